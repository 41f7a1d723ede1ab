"""Purcell's swimmer, whose pace matters: against another integration, and certified."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.peers import drag
from colloc import Chain, Harmonic, Viscous, ellipse, load, load_problem, replay, save
from colloc.bounds.optimality_gap import gap_line
from colloc.commands.solve import summary_lines
from colloc.pictures.report_page import report_page
from colloc.search.solve import solve

ROOT = Path(__file__).resolve().parents[2]
LAW, CORNERS = Viscous(normal=drag.NORMAL, tangential=drag.TANGENTIAL), (0.25, 0.5, 0.75)


def square(amplitude):
    """Purcell's stroke: the joints take turns, so that the angles run round a square."""

    def path(t):
        side = np.minimum((np.asarray(t) * 4).astype(int), 3)
        s = np.asarray(t) * 4 - side
        start = amplitude * np.array([[-1, 1, 1, -1], [1, 1, -1, -1]])[:, side]
        step = 2 * amplitude * np.array([[1, 0, -1, 0], [0, -1, 0, 1]])[:, side]
        return start + step * s, 4 * step

    return path


@pytest.mark.parametrize("amplitude", [0.3, 0.9])
def test_purcells_square_stroke_goes_as_far_as_an_independent_integration_says(amplitude):
    path = square(amplitude)
    measured = replay(Chain(), LAW, path, 1e-4, breaks=CORNERS, instants=160, tolerance=1e-9)

    def rates(t, state):
        angles, turning = (a[:, 0] for a in path(np.array([t])))
        R = drag.resistance(state[2], angles)
        rigid = -np.linalg.solve(R[:3, :3], R[:3, 3:] @ turning)
        whole = np.concatenate([rigid, turning])
        return [*rigid, whole @ R @ whole]

    def centre(state, t):
        angles, theta = path(np.array([t]))[0][:, 0], state[2]
        ahead = np.exp(1j * (theta + angles[1])) - np.exp(1j * (theta - angles[0]))
        return complex(*state[:2]) + ahead / 18

    state = np.zeros(4)
    begin = centre(state, 0.0)
    for a, b in zip((0.0, *CORNERS), (*CORNERS, 1.0), strict=True):
        inside = lambda t, y, a=a, b=b: rates(min(max(t, a), b - 1e-12), y)  # noqa: E731
        state = solve_ivp(inside, (a, b), state, rtol=1e-10, atol=1e-12).y[:, -1]
    assert abs(centre(state, 0.0) - begin) == pytest.approx(measured.distance, rel=1e-7)
    assert state[3] == pytest.approx(measured.work, rel=1e-7)
    assert state[2] == pytest.approx(measured.rotation, abs=1e-8)


def test_the_path_decides_how_far_a_viscous_body_goes_and_the_pace_what_it_costs():
    gait = ellipse(0.2, 0.9, 0.7)

    def at_pace(wobble):
        def path(t):
            phase = t + wobble * np.sin(2 * np.pi * t) / (2 * np.pi)
            return gait.angles(phase), gait.rates(phase) * (1 + wobble * np.cos(2 * np.pi * t))

        return replay(Chain(), LAW, path, 1e-4, instants=160, tolerance=1e-9)

    even, uneven = at_pace(0.0), at_pace(0.6)
    assert uneven.distance == pytest.approx(even.distance, rel=1e-8)
    assert uneven.work > 1.1 * even.work


@pytest.fixture(scope="module")
def purcell():
    return solve(load_problem(ROOT / "problems/purcell.py"), 1)


def test_purcells_swimmer_is_solved_certified_kept_and_read(purcell, tmp_path):
    solution = purcell
    assert solution.status == "solved"
    assert solution.measured.value == pytest.approx(0.0115705, abs=1e-7)
    read = load(save(solution, tmp_path / "purcell.h5"))
    assert read.problem.hash == solution.problem.hash
    assert read.problem.friction == LAW
    assert "as work depends on the pace under drag (2, 1)" in "\n".join(
        summary_lines(solution, None, verbose=True)
    )
    assert "the work depends on the pace" in report_page(solution)
    assert "no upper bound" in gap_line(solution.problem.with_(objective="efficiency"), 0.1, None)


def test_with_more_harmonics_the_pace_comes_closer_to_the_best_one_constant_power(purcell):
    more = solve(purcell.problem.with_(gait=Harmonic(3, "antipodal")), 1)
    assert more.status == "solved"
    assert more.measured.value == pytest.approx(0.0123108, abs=1e-7)
    spread = []
    for solution in (purcell, more):
        power = solution.power(solution.sample(np.arange(64) / 64))
        spread.append(power.std() / power.mean())
    assert spread[1] < 0.5 * spread[0]
