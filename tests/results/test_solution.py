"""The solved problem: where it goes and turns, by its interpolant and as the chord of an arc."""

from dataclasses import replace

import numpy as np
import pytest

import colloc
from colloc import Chain, Fourier, Harmonic, Problem, ellipse, evaluate, load, replay, save
from colloc.commands.solve import summary_lines
from colloc.dynamics.control_problem import control_problem
from colloc.gaits.gait import delta_per_period
from colloc.reduced.program import ReducedProgram
from colloc.results.motion import arc, lab_feet, part_speeds
from colloc.results.solution import direction_of_travel
from colloc.search.iterate import space_near
from colloc.transcription.full_program import FullProgram
from colloc.verification.mesh_error import mesh_error
from tests.shared.cases import cases

SKEW = Fourier([0.3, -0.5], [[0.4], [0.9]], [[1.1], [-0.2]])
DELTA = 0.3
BODY, FRICTION = Chain(), colloc.Friction()
GAIT = Fourier(np.array([0.4, 0.3]), np.array([[1.0], [0.2]]), np.array([[0.1], [1.0]]))
FINE = {"delta": DELTA, "tolerance": 1e-8, "instants": 400}
CASES = """
series: gait=Harmonic(1)
with inertia: gait=Harmonic(1), froude=0.05
polygon of unequal friction: gait=Polygon(4), friction=Friction(mu_t=1.7, mu_f=1, mu_b=1.3)
"""
CASES = cases(CASES, globals())


def test_a_turn_is_said_to_the_side_to_which_the_tail_link_turns_and_how_far_joints_swing():
    at = {"gait": Harmonic(1), "rotation": None, "delta": 1e-1, "mesh_tolerance": 1e-2}
    for gait in (SKEW, SKEW.mirrored):
        found = evaluate(Problem("t", **at), gait)
        before, after = found.sample(np.array([0.0, 1.0])).theta
        side = "counter-clockwise" if after > before else "clockwise"
        assert f"° {side}," in found.turning
        np.testing.assert_allclose(found.swings, 2 * np.hypot(gait.cos, gait.sin)[:, 0], rtol=1e-4)


def test_a_pad_is_as_fast_as_the_faster_of_its_ends(unsolved):
    """So it sticks only where it does not turn either."""
    body, gait = Chain(feet=tuple(colloc.Pad(k, 0.4, 0.6) for k in range(3))), {"gait": Harmonic(1)}
    solution = unsolved(Problem("pads", ellipse(0.2, 1.2, 0.8), body, delta=1e-1, **gait))
    t, step = np.linspace(0.06, 0.94, 12), 1e-5
    before, after = (lab_feet(body, solution.sample(t + by)) for by in (-step, step))
    ends = np.hypot(*(after - before)) / (2 * step)
    name, speeds = part_speeds(body, solution.sample(t))
    assert name == "foot"
    assert (ends.max(axis=0) > 1.3 * ends.mean(axis=0)).mean() > 0.2  # they turn
    np.testing.assert_allclose(speeds, ends.max(axis=0), atol=0.02 * speeds.max())


@pytest.mark.parametrize(
    ("mu_f", "mu_b", "first"), [(1.0, 5.0, "head first"), (5.0, 1.0, "tail first")]
)
def test_a_body_travels_to_the_side_to_which_it_slides_easily(mu_f, mu_b, first):
    body, friction = Chain((0.5, 0.5)), colloc.Friction(mu_t=1.0, mu_f=mu_f, mu_b=mu_b)
    stated = Problem("eased", None, body, friction, Harmonic(1), delta=1e-2)
    solution = evaluate(stated, Fourier([0.0], [[1.0]], [[0.0]]))
    assert solution.travels == first
    # which is told if it is not
    assert any(first in line for line in summary_lines(solution, None)) == (first != "head first")


@pytest.mark.parametrize("symmetry", ["none", "bilateral", "antipodal"])
def test_sampled_motion_is_consistent(symmetry, three_link):
    # at a large delta all is smooth
    smooth = {"delta": 0.3, "mesh_tolerance": 1e-4, "gait": Harmonic(1, symmetry)}
    solution = three_link
    if symmetry != "bilateral":
        solution = evaluate(Problem("smooth", **smooth), ellipse(0.0, 1.4, 0.8))
    body, law, t = solution.problem.body, solution.problem.friction, np.linspace(0, 1, 4001)
    motion, dt = solution.sample(t), t[1]
    exact = body.solve(law, motion.angles, motion.rates, solution.answer.delta)
    assert np.median(np.abs(motion.z - exact.z)) < 2e-3
    centre = body.motion(law, motion.angles, motion.rates, solution.answer.delta, exact).centre
    turn, plane = np.exp(1j * motion.theta), np.array([1, 1j])
    # theta' = omega; centre and tail move with their own velocities, in the second half too
    assert np.abs(np.diff(motion.theta)).max() < 20 * dt
    for pose, rate in (
        (motion.theta, motion.z[2]),
        (plane @ motion.centre, turn * (plane @ centre)),
        (plane @ motion.tail, turn * (plane @ motion.z[:2])),
    ):
        assert np.median(np.abs(np.gradient(pose, dt) - rate)[1:-1]) < 2e-3
    # a period advances by d along x and does not turn, as exactly as its mesh is asked to be
    off = solution.problem.mesh_tolerance * solution.distance
    way = motion.centre[:, -1] - motion.centre[:, 0]
    np.testing.assert_allclose(way, [solution.distance, 0.0], atol=off)
    assert abs(motion.theta[-1] - motion.theta[0]) < 1e-9
    later = solution.sample(t[:5] + 3)
    expected = motion.centre[:, :5] + np.array([[3 * solution.distance], [0.0]])
    np.testing.assert_allclose(later.centre, expected, atol=3 * off)


@pytest.fixture(scope="module")
def turning(unsolved):
    """A gait that turns the body, in balance; not an optimum."""
    guess = Fourier(mean=[0.5, 0.9], cos=[[1.0], [0.2]], sin=[[0.0], [1.1]])
    how = {"gait": Harmonic(1), "rotation": None, "delta": 0.3, "intervals": 80}
    return unsolved(Problem("circle", guess, delta_start=0.3, **how))


def test_a_gait_that_turns_moves_on_from_where_a_period_left_it(turning):
    assert abs(turning.rotation) > 0.1
    # the tail velocity adds up to the pose across ends of periods, also before the first
    t, plane = np.linspace(-1.3, 2.4, 3701), np.array([1, 1j])
    motion, dt = turning.sample(t), t[1] - t[0]
    velocity = np.exp(1j * motion.theta) * (plane @ motion.z[:2])
    for pose, rate in ((motion.theta, motion.z[2]), (plane @ motion.tail, velocity)):
        travelled = np.concatenate([[0.0], np.cumsum(0.5 * dt * (rate[1:] + rate[:-1]))])
        np.testing.assert_allclose(pose - pose[0], travelled, atol=3e-5)
    assert motion.theta[2300] - motion.theta[1300] == pytest.approx(turning.rotation, abs=1e-12)


def test_the_centre_of_mass_goes_round_a_circle_of_the_radius_that_is_stated(turning):
    ends = turning.sample(np.arange(60.0)).centre
    rows = 2 * (ends[:, 1:3] - ends[:, [0]]).T  # a point as far from the first as from these
    middle = np.linalg.solve(rows, (ends[:, 1:3] ** 2 - ends[:, [0]] ** 2).sum(axis=0))
    radii = np.hypot(*(ends - middle[:, None]))
    np.testing.assert_allclose(radii, radii[0], rtol=1e-7)
    np.testing.assert_allclose(np.hypot(*np.diff(ends)), turning.distance, rtol=1e-6)
    # from any phase the arc is the same, though the way is not
    t = np.linspace(0.0, 1.0, 2001)
    for begin in (0.0, 0.1, 0.45, 0.83):
        found = arc(turning.rotation, turning.sample(begin + t).centre)
        np.testing.assert_allclose(found, turning.arc, rtol=1e-6)
    assert turning.turning_radius == turning.arc.radius
    chord = 2 * turning.arc.radius * np.sin(abs(turning.rotation) / 2)
    assert turning.arc.chord == pytest.approx(chord, rel=1e-12)
    ways = [np.hypot(*np.diff(turning.sample([t, t + 1.0]).centre)) for t in (0.0, 0.45)]
    assert np.ptp(ways) > 1e-3
    assert f"turns {abs(np.degrees(turning.rotation)):.4g}°" in turning.turning


def test_the_tour_of_the_readme_works_on_a_failed_solution_uncertified(three_link, tmp_path):
    failed = colloc.Solution(three_link.problem, replace(three_link.answer, optimal=False))
    again = load(save(failed, tmp_path / "failed.h5"))
    for solution in (failed, again):
        known = solution.certificate
        assert solution.status == "not converged"
        assert not known.passed
        assert np.isnan([known.efficiency, known.efficiency_error]).all()
        assert "nothing was checked" in known.failures[0].line()
        assert solution.efficiency == solution.answer.efficiency
    # nor is an answer at another delta than was asked for
    other = replace(three_link.answer, delta=1.5 * three_link.answer.delta)
    assert replace(three_link, answer=other).status == "not converged"


def replayed(path=GAIT, turn=0.0):
    return replay(BODY, FRICTION, path, turn=turn, **FINE)


def on_a_dense_grid(path, n=4000):
    """Rotation and places by the trapezoidal rule, exact for smooth periodic motion."""
    t = np.arange(n) / n
    angles, rates = path(t)
    solved = BODY.solve(FRICTION, angles, rates, DELTA)
    moved = BODY.motion(FRICTION, angles, rates, DELTA, solved)
    omega, centre = solved.z[2], np.array([1, 1j]) @ np.array(moved.centre)

    def integral(rate):
        """From 0 up to every t and 1, by the spectrum; the mean grows."""
        k = np.fft.fftfreq(n, 1 / n)
        parts = np.fft.fft(rate) / n
        wave = np.where(k == 0, 0, parts / np.where(k == 0, 1, 2j * np.pi * k))
        found = np.fft.ifft(wave * n) + parts[0] * t
        return np.append(found, found[0] + parts[0]) - found[0]

    theta = integral(omega).real
    alpha, later = theta[-1], np.append(t, 1.0)
    # periodic from axes that turn evenly; its primitive times e^(i alpha t) is the place
    seen = np.exp(1j * (theta[:-1] - alpha * t)) * centre
    loop = np.fft.ifft(np.fft.fft(seen) / (1j * (2 * np.pi * np.fft.fftfreq(n, 1 / n) + alpha)))
    return alpha, np.append(loop, loop[0]) * np.exp(1j * alpha * later)


def test_a_period_turns_about_a_point_and_the_chord_is_that_of_the_mean_circle():
    alpha, place = on_a_dense_grid(GAIT)
    assert abs(alpha) > 0.05
    # the point that a period leaves where it is: place(1) - c = e^(i alpha) (place(0) - c)
    centre = (place[-1] - np.exp(1j * alpha) * place[0]) / (1 - np.exp(1j * alpha))
    t = np.linspace(0, 1, place.size)[:-1]
    radius = abs(((place - centre)[:-1] * np.exp(-1j * alpha * t)).mean())
    assert np.ptp(abs(place - centre)) > 0.01 * radius  # it does wriggle
    found = replayed(turn=alpha)
    assert found.rotation == pytest.approx(alpha, abs=found.errors["rotation"])
    assert found.distance == pytest.approx(2 * radius * abs(np.sin(alpha / 2)), rel=1e-8)
    assert arc(alpha, np.array([place.real, place.imag])).radius == pytest.approx(radius, rel=1e-8)


def test_the_chord_does_not_depend_on_the_phase_that_a_period_is_begun_at():
    turn = replayed().rotation
    begun = [lambda t, p=phase: GAIT(t + p) for phase in (0, 0.13, 0.37, 0.71)]
    chords, displacements = ([replayed(path, at).distance for path in begun] for at in (turn, 0.0))
    assert np.ptp(displacements) > 0.01 * max(displacements)
    np.testing.assert_allclose(chords, chords[0], rtol=1e-9)


def stated(case, turn, intervals=24):
    given = {"friction": FRICTION, "delta": DELTA, "delta_start": DELTA} | CASES[case]
    return Problem(case.replace(" ", "_"), GAIT, rotation=turn, intervals=intervals, **given)


@pytest.mark.parametrize("case", CASES)
def test_reduced_and_full_program_and_replay_agree_on_the_chord(case):
    space, v = space_near(stated(case, None), GAIT)
    turn = ReducedProgram(space, DELTA).motion.values(v, DELTA)["rotation"]
    problem = stated(case, turn)
    space, v = space_near(problem, GAIT)
    delta, program = DELTA, ReducedProgram(space, DELTA)
    values = program.motion.values(v, delta)
    assert values["rotation"] == pytest.approx(turn, abs=1e-12)

    full = FullProgram(space.control, space.full_parameters(v), space.mesh.edges)
    x, functions = full.feasible(space.full_parameters(v), delta), full.nlp.functions
    at = x, delta / full.delta_unit
    g = np.array(functions["jac_g"](*at)[0]).ravel()
    value = float(functions["grad_f"](*at)[0])
    assert value == pytest.approx(-values["distance"] / values["work"], rel=1e-9)
    for group in ("orientation", "rotation", "distance", "work"):
        rows = full.groups[group]
        np.testing.assert_allclose(g[rows], full.row_lower[rows], atol=1e-10)

    gait = space.member(v)
    per_period = delta_per_period(problem.gait, gait, delta)
    how = {"breaks": gait.corner_phases, "tolerance": 1e-6, "turn": turn}
    how |= {"regime": problem.regime} if problem.froude else {}
    fine = replay(BODY, problem.law, gait, per_period, **how)
    control = control_problem(problem)
    error = mesh_error(control, control.in_phases(full.mesh, gait), gait, per_period, 1e-7)
    off = values["distance"] / values["work"] / fine.efficiency - 1
    assert off == pytest.approx(error.total, abs=3e-6)
    assert abs(error.total) < error.estimate + 1e-7


@pytest.mark.parametrize(
    ("way", "word"), [((1, 1), "head first"), ((-1, -1), "tail first"), ((1, -1), "sideways")]
)
def test_a_body_that_lies_askew_travels_the_way_it_points_in_the_mean_or_another(way, word):
    tail = np.outer(way, [0.0, 1.0, 2.0])
    assert direction_of_travel(tail + 0.2 * np.array([-1.0, 2.0, 2.0]), tail) == word
