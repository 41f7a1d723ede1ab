"""The solved problem: its interpolant, its certificate, its budgets, and the schemes against each
other."""

from dataclasses import replace

import numpy as np
import pytest

from colloc.commands.solve import summary_lines
from colloc.gaits.harmonic import Fourier, Harmonic, ellipse
from colloc.gaits.problem import Problem
from colloc.mechanics.balance import instant
from colloc.mechanics.chain import Chain
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from colloc.results.motion import arc
from colloc.results.solution import Solution
from colloc.results.store import load, save
from colloc.search.certify import certify
from colloc.search.evaluate import evaluate
from colloc.search.solve import solve
from colloc.verification.replay import replay

SKEW = Fourier([0.3, -0.5], [[0.4], [0.9]], [[1.1], [-0.2]])


def test_a_turn_is_said_to_the_side_to_which_the_tail_link_turns():
    for gait in (SKEW, SKEW.mirrored):
        found = evaluate(
            Problem("t", gait=Harmonic(1), rotation=None, delta=1e-1, mesh_tolerance=1e-2), gait
        )
        before, after = found.sample(np.array([0.0, 1.0])).theta
        side = "counter-clockwise" if after > before else "clockwise"
        assert f"° {side}," in found.turning


def test_a_deliberately_poor_guess_reaches_the_paper_s_optimum(three_link):
    assert three_link.status == "solved"
    gait = three_link.gait
    assert abs(three_link.certificate.efficiency - 0.2600) < 1e-4
    np.testing.assert_allclose(
        [gait.mean[0], gait.cos[0, 0], gait.sin[0, 0]], [0.0, 2.859, 1.302], atol=2e-3
    )
    guess = three_link.problem.guess
    start = replay(
        three_link.problem.body,
        Friction(),
        lambda t: (guess.angles(t), guess.rates(t)),
        1e-4,
        instants=400,
        most_instants=800,
    )
    assert start.efficiency < 0.5 * three_link.efficiency


def test_a_gait_that_is_named_from_the_other_end_travels_the_other_end_first():
    """Each joint takes the part of its mirror image, and the angles their opposite: the same motion
    of equal links."""
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
    problem = Problem(
        "eased",
        body=Chain((0.5, 0.5)),
        friction=Friction(mu_t=1.0, mu_f=mu_f, mu_b=mu_b),
        gait=Harmonic(1),
        delta=1e-2,
    )
    solution = evaluate(problem, Fourier([0.0], [[1.0]], [[0.0]]))
    assert solution.travels == first
    # which is told if it is not
    assert any(first in line for line in summary_lines(solution, None)) == (first != "head first")


@pytest.mark.parametrize("symmetry", ["none", "bilateral", "antipodal"])
def test_sampled_motion_is_consistent(symmetry, solved):
    solution = solved("three_link")[0] if symmetry == "bilateral" else _smooth(symmetry)
    t = np.linspace(0, 1, 4001)
    motion = solution.sample(t)
    dt = t[1] - t[0]
    # theta' = omega and centre' = its velocity, through the symmetry's second half
    middle = slice(1, -1)
    jump = np.abs(np.diff(motion.theta)).max()
    assert jump < 20 * dt
    error = np.gradient(motion.theta, dt)[middle] - motion.z[2][middle]
    assert np.median(np.abs(error)) < 1e-3
    body = solution.problem.body
    now = instant(
        body,
        solution.problem.friction,
        motion.angles,
        motion.rates,
        motion.z,
        solution.answer.delta,
    )
    cx, cy = body.centre_velocity(now.posture, now.velocity)
    c, s = np.cos(motion.theta), np.sin(motion.theta)
    speed = np.stack([c * cx[0] - s * cy[0], s * cx[0] + c * cy[0]])
    assert np.median(np.abs(np.gradient(motion.centre, dt, axis=1) - speed)) < 1e-3
    # the tail moves with its own velocity, which is measured along and across the first link
    along, across = motion.z[:2]
    velocity = np.stack([c * along - s * across, s * along + c * across])
    assert np.median(np.abs(np.gradient(motion.tail, dt, axis=1) - velocity)) < 2e-3
    # tail velocities are those of the balance
    exact = solve_balance(
        body, solution.problem.friction, motion.angles, motion.rates, solution.answer.delta
    ).z
    assert np.median(np.abs(motion.z - exact)) < 2e-3
    # a period advances by d along x and does not turn, as exactly as its mesh is asked to be
    off = solution.problem.mesh_tolerance * solution.distance
    np.testing.assert_allclose(
        motion.centre[:, -1] - motion.centre[:, 0], [solution.distance, 0.0], atol=off
    )
    assert abs(motion.theta[-1] - motion.theta[0]) < 1e-9
    later = solution.sample(t[:5] + 3)
    expected = motion.centre[:, :5] + np.array([[3 * solution.distance], [0.0]])
    np.testing.assert_allclose(later.centre, expected, atol=3 * off)


@pytest.fixture
def turning(unsolved):
    """A gait that turns the body, in balance; not an optimum."""
    guess = Fourier(mean=[0.5, 0.9], cos=[[1.0], [0.2]], sin=[[0.0], [1.1]])
    return unsolved(
        Problem(
            "circle",
            guess,
            gait=Harmonic(1),
            rotation=None,
            delta=0.3,
            delta_start=0.3,
            intervals=80,
        )
    )


def test_a_gait_that_turns_moves_on_from_where_a_period_left_it(turning):
    assert abs(turning.rotation) > 0.1
    # what the tail velocity says adds up to the pose across the ends of periods, also of those
    # before the first
    t = np.linspace(-1.3, 2.4, 3701)
    motion, dt = turning.sample(t), t[1] - t[0]
    along, across, omega = motion.z
    c, s = np.cos(motion.theta), np.sin(motion.theta)
    for pose, rate in (
        (motion.theta, omega),
        (motion.tail[0], c * along - s * across),
        (motion.tail[1], s * along + c * across),
    ):
        travelled = np.concatenate([[0.0], np.cumsum(0.5 * dt * (rate[1:] + rate[:-1]))])
        np.testing.assert_allclose(pose - pose[0], travelled, atol=3e-5)
    assert motion.theta[2300] - motion.theta[1300] == pytest.approx(turning.rotation, abs=1e-12)


def test_the_centre_of_mass_goes_round_a_circle_of_the_radius_that_is_stated(turning):
    ends = turning.sample(np.arange(60.0)).centre
    middle = _centre_of_circle(*ends[:, :3].T)
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
    assert turning.arc.chord == pytest.approx(
        2 * turning.arc.radius * np.sin(abs(turning.rotation) / 2), rel=1e-12
    )
    assert (
        np.ptp(
            [
                np.hypot(*np.diff(turning.sample([begin, begin + 1.0]).centre))
                for begin in (0.0, 0.45)
            ]
        )
        > 1e-3
    )
    assert f"turns {abs(np.degrees(turning.rotation)):.4g}°" in turning.turning


def _centre_of_circle(a, b, c):
    """The point as far from a as from b and c."""
    rows = 2 * np.array([b - a, c - a])
    return np.linalg.solve(rows, [b @ b - a @ a, c @ c - a @ a])


def _smooth(symmetry):
    """A quick solve at large delta, where everything is smooth."""
    problem = Problem(
        "smooth",
        ellipse(0.0, 1.4, 0.8),
        gait=Harmonic(1, symmetry),
        delta=0.3,
        delta_start=0.3,
        mesh_tolerance=1e-4,
    )
    return solve(problem, 1)


def test_distance_and_work_equal_those_of_the_replay_on_a_grid_ten_times_finer(three_link):
    certificate = certify(three_link.answer, instants=2 * 10 * three_link.mesh.n_point)
    assert abs(three_link.efficiency / certificate.efficiency - 1) < 1e-4
    assert certificate.efficiency_error < 1e-6
    assert certificate.passed


def test_a_solution_that_lies_fails_its_certificate(three_link):
    from colloc.results.solution import Solution

    def with_answer(**changes):
        return Solution(three_link.problem, replace(three_link.answer, **changes))

    names = {c.name for c in certify(with_answer(value=three_link.value * 1.001).answer).failures}
    assert names == {"replay gap"}
    other = three_link.gait
    bent = Fourier(other.mean + np.array([0.3, 0.0]), other.cos, other.sin)
    names = {c.name for c in certify(with_answer(gait=bent).answer).failures}
    assert {"joint limits", "replay gap"} <= names
    for changes in (
        {"optimal": False},
        {"delta": 1.5 * three_link.answer.delta},
    ):  # the answer, and the delta asked for
        failed = with_answer(**changes)
        failed.certificate = three_link.certificate
        assert failed.status == "not converged"


def test_the_tour_of_the_readme_works_on_a_failed_solution_and_certifies_nothing(
    three_link, tmp_path
):
    failed = Solution(three_link.problem, replace(three_link.answer, optimal=False))
    again = load(save(failed, tmp_path / "failed.h5"))
    for solution in (failed, again):
        assert solution.status == "not converged"
        assert not solution.certificate.passed
        assert np.isnan(
            [solution.certificate.efficiency, solution.certificate.efficiency_error]
        ).all()
        assert "nothing was checked" in solution.certificate.failures[0].line()
        assert solution.efficiency == solution.answer.efficiency
