"""The solved problem: its interpolant, where it goes and turns, and what it is if it failed."""

from dataclasses import replace

import numpy as np
import pytest

import colloc
from colloc import Chain, Fourier, Harmonic, Pad, Problem, Solution, ellipse, evaluate, load, save
from colloc.commands.solve import summary_lines
from colloc.results.motion import arc, lab_feet, part_speeds

SKEW = Fourier([0.3, -0.5], [[0.4], [0.9]], [[1.1], [-0.2]])


def test_a_turn_is_said_to_the_side_to_which_the_tail_link_turns():
    at = {"gait": Harmonic(1), "rotation": None, "delta": 1e-1, "mesh_tolerance": 1e-2}
    for gait in (SKEW, SKEW.mirrored):
        found = evaluate(Problem("t", **at), gait)
        before, after = found.sample(np.array([0.0, 1.0])).theta
        side = "counter-clockwise" if after > before else "clockwise"
        assert f"° {side}," in found.turning


def test_a_pad_is_as_fast_as_the_faster_of_its_ends(unsolved):
    """So it sticks only where it does not turn either."""
    body, gait = Chain(feet=tuple(Pad(k, 0.4, 0.6) for k in range(3))), {"gait": Harmonic(1)}
    solution = unsolved(Problem("pads", ellipse(0.2, 1.2, 0.8), body, delta=1e-1, **gait))
    t, step = np.linspace(0.06, 0.94, 12), 1e-5
    before, after = (lab_feet(body, solution.sample(t + by)) for by in (-step, step))
    ends = np.hypot(*(after - before)) / (2 * step)
    name, speeds = part_speeds(body, solution.sample(t))
    assert name == "foot"
    assert (ends.max(axis=0) > 1.3 * ends.mean(axis=0)).mean() > 0.2  # they turn
    np.testing.assert_allclose(speeds, ends.max(axis=0), atol=0.02 * speeds.max())


def test_a_gait_that_is_named_from_the_other_end_travels_the_other_end_first():
    """Each joint takes the part of its mirror image, with the opposite angle."""
    gait = Fourier([0.0, 0.2], [[1.4], [0.9]], [[0.2], [1.1]])
    turned = Fourier(-gait.mean[::-1], -gait.cos[::-1], -gait.sin[::-1])
    back = Fourier(gait.mean, gait.cos, -gait.sin)
    problem = Problem("named", gait=Harmonic(1), delta=1e-2, rotation=None)
    one, other, reversed_ = (evaluate(problem, each).travels for each in (gait, turned, back))
    assert {one, other} == {"head first", "tail first"}
    assert reversed_ == other


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
    # theta' = omega; centre and tail move with their own velocities, through the symmetry's second
    # half
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
    # what the tail velocity says adds up to the pose across the ends of periods, also of those
    # before the first
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
    # from any phase the arc is the same, and of all phases together the centre of mass is where the
    # arc says
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


def test_the_tour_of_the_readme_works_on_a_failed_solution_and_certifies_nothing(
    three_link, tmp_path
):
    failed = Solution(three_link.problem, replace(three_link.answer, optimal=False))
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
