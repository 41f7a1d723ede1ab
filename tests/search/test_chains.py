"""Chains of 2 to 8 links: self-contact of all pairs, and the two-link body."""

import numpy as np
import pytest

from colloc import Chain, Fourier, Friction, Harmonic, Problem, replay
from colloc.dynamics.control_problem import control_problem
from colloc.mechanics.contact import (
    CLEARANCE_SMOOTHING,
    crossing_depth,
    far_contact,
    far_pairs,
    overlapping_pairs,
    passing_depth,
)
from colloc.search.optimise import crossing_pairs, last_free
from colloc.transcription.full_program import FullProgram
from tests.shared.stages import program_of

BODIES = [Chain((0.25,) * 4), Chain((0.1, 0.4, 0.2, 0.3)), Chain((0.2,) * 5), Chain((1 / 8,) * 8)]


def crossing(body, angles, i, j):
    """Plain intersection of two links, by solving for the point on both lines."""
    x, y = body.joints(angles)
    p, q = x[i] + 1j * y[i], x[j] + 1j * y[j]
    r, s = x[i + 1] + 1j * y[i + 1] - p, x[j + 1] + 1j * y[j + 1] - q
    area = (r.conj() * s).imag
    on_first, on_second = (((q - p).conj() * s).imag / area, ((q - p).conj() * r).imag / area)
    return (on_first > 0) & (on_first < 1) & (on_second > 0) & (on_second < 1)


def clearance(body, angles, i, j):
    """The smooth function that is not negative only where the links do not cross."""
    return -far_contact(body, i, j).excess(angles)


@pytest.mark.parametrize("body", BODIES, ids=lambda b: f"{b.n_link} links")
def test_clearance_never_allows_a_crossing_and_forbids_little_else(body):
    rng = np.random.default_rng(2)
    angles = rng.uniform(-1, 1, (body.n_joint, 20000)) * rng.uniform(0.5, np.pi, 20000)
    seen = 0
    for i, j in far_pairs(body):
        value = clearance(body, angles, i, j)[0]
        cross = crossing(body, angles, i, j)
        seen += cross.sum()
        assert not (cross & (value >= 0)).any()
        assert (cross | (value >= -2 * CLEARANCE_SMOOTHING)).all()
    assert seen > 20
    assert len(far_pairs(body)) == (body.n_link - 2) * (body.n_link - 3) // 2


def test_parallel_links_that_slip_through_each_other_are_caught():
    # links 1 and 4 are parallel at every instant, and their distance passes through zero between
    # two samples
    body = Chain((0.3, 0.2, 0.2, 0.3))
    tilt = np.array([-0.03, -0.01, 0.01, 0.03])
    angles = np.stack([tilt - 1.0, np.full(4, 2.0), np.pi - 1.0 - tilt])
    height = body.joints(angles)[1]
    np.testing.assert_allclose(height[3], height[4], atol=1e-12)
    assert height[3, 1] < 0 < height[3, 2]
    assert crossing_depth(body, angles, [(0, 3)]).max() < 1e-9
    assert passing_depth(body, angles) > 1e-3
    ends = np.stack(body.joints(angles))
    assert overlapping_pairs(ends, [(0, 3)], 0.0, 1e-3) == ((0, 3),)
    assert not overlapping_pairs(ends[..., :2], [(0, 3)], 0.0, 0.0)
    assert clearance(body, angles[:, 1:3].mean(axis=1, keepdims=True), 0, 3)[0, 0] < 0


def curl(amplitude, **changes):
    """Five links that curl up as a whole; they close a ring at 2 pi / 5 a joint."""
    guess = Fourier(np.zeros(4), np.full((4, 1), amplitude), np.zeros((4, 1)))
    fields = {"body": Chain((0.2,) * 5), "gait": Harmonic(1, "antipodal"), "intervals": 12}
    return Problem("curl", guess, **(fields | changes))


def test_last_free_gait_stops_before_links_cross():
    problem = curl(1.0)
    free = problem.gait.parameters(problem.guess)
    bad = 1.6 * free
    program = program_of(problem)
    assert (0, 4) in crossing_pairs(program, bad)
    between = last_free(program, free, bad)
    assert not crossing_pairs(program, between)
    assert 1.0 < between.max() / free.max() < 1.6


def test_constraint_rows_hold_the_clearance_at_the_worst_instant_of_every_cell():
    problem = curl(1.1, body=Chain((0.15, 0.25, 0.2, 0.1, 0.3)))
    far = tuple(far_pairs(problem.body))
    p = problem.gait.parameters(problem.guess)
    p = p + 0.1 * np.random.default_rng(4).standard_normal(p.size)
    control = control_problem(problem)
    program = FullProgram(control, p, far=far)
    x = program.feasible(p, 0.1)
    value = np.array(program.nlp.functions["jac_g"](x, 0.1)[0]).ravel()
    fine = np.linspace(program.mesh.edges[:-1], program.mesh.edges[1:], 2001)
    angles = program.member(x).angles(fine.T.ravel())
    placed = 0
    for i, j in far:
        name = f"links {i + 1} and {j + 1}"
        rows, cells = program.groups[name], program.cells[name]
        nearest = clearance(problem.body, angles, i, j).reshape(program.mesh.n, -1).min(axis=1)
        np.testing.assert_allclose(-value[rows], nearest[cells], atol=1e-3)
        left_out = np.delete(nearest, cells)
        assert left_out.min(initial=np.inf) > 0.1
        assert (program.row_upper[rows] == 0).all()
        placed += cells.size
    assert placed > 5


@pytest.mark.parametrize("lengths", [(0.5, 0.5), (0.3, 0.7)])
@pytest.mark.parametrize(
    "friction", [Friction(), Friction(mu_t=3, mu_f=1, mu_b=1), Friction(mu_t=0.5, mu_f=2, mu_b=2)]
)
def test_scallop_theorem(lengths, friction):
    # one joint retraces its path; with equal speeds both ways nothing is left, whatever the delta
    body = Chain(lengths)

    def even(t):
        return 0.3 + 1.5 * np.sin(2 * np.pi * t)[None], 3 * np.pi * np.cos(2 * np.pi * t)[None]

    def uneven(t):
        phase = 2 * np.pi * t + 0.6 * np.sin(2 * np.pi * t)
        rate = 2 * np.pi * (1 + 0.6 * np.cos(2 * np.pi * t))
        return 0.3 + 1.5 * np.sin(phase)[None], 1.5 * (np.cos(phase) * rate)[None]

    for delta in (1e-1, 1e-4):
        fine = replay(body, friction, even, delta, instants=100, most_instants=100)
        assert fine.distance < 1e-10
        assert fine.work > 0.1
    # regularised friction depends on speed a little: different speeds there and back leave a
    # distance of order delta
    viscous, dry = (
        replay(body, friction, uneven, delta, instants=400, most_instants=400).distance
        for delta in (3e-1, 3e-3)
    )
    assert dry < 3e-3
    assert dry < viscous / 3


def test_two_links_cannot_gain_by_any_delta_or_harmonics_what_directional_friction_gives(solved):
    solution, _ = solved("two_link")
    assert solution.status == "solved"

    def efficiency(amplitude):
        at = solution.problem.body, solution.problem.friction
        return replay(*at, Fourier([0.0], [[amplitude]], [[0.0]]), 1e-4, tolerance=1e-5).efficiency

    sweep = np.linspace(0.8, 2.4, 9)
    values = [efficiency(a) for a in sweep]
    assert abs(sweep[np.argmax(values)] - abs(solution.gait.cos[0, 0])) < 0.15
    assert solution.certificate.efficiency == pytest.approx(max(values), rel=5e-3)
    assert solution.certificate.efficiency >= max(values) * (1 - 1e-6)
