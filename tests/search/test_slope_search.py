"""Problems on a slope: motion by the differential equation, solved, certified, kept; none is better."""

import numpy as np
import pytest

import colloc
from colloc import BSpline, Chain, Friction, Harmonic, Pad, Polygon, Problem, ellipse, load, save
from colloc.commands.results import verify
from colloc.commands.solve import summary_lines
from colloc.dynamics.control_problem import control_problem
from colloc.dynamics.dynamics import PeriodTotals
from colloc.gaits.gait import delta_per_period
from colloc.gaits.gait_fields import fields, gait_from
from colloc.mechanics.bodies import FULL
from colloc.reduced.program import ReducedProgram
from colloc.search.certify import gait_certificate
from colloc.search.confirm import Solver
from colloc.search.iterate import space_near
from colloc.search.solve import solve
from colloc.transcription.full_program import FullProgram
from colloc.verification.differential_motion import slope_motion
from colloc.verification.mesh_error import mesh_error

AT = {"gait": Harmonic(1, "bilateral"), "delta": 1e-2, "grade": 0.1}
PROBLEM = Problem("climber", ellipse(0, 2.8, 1.3), **AT)
SIDES = PROBLEM.with_(name="sides", gait=Polygon(4), delta=6e-4, delta_start=None, intervals=None)
"""About as dry: the path is 17 rad long."""
LEVEL = Problem("bilateral", gait=Harmonic(1, "bilateral"), grade=0.4, intervals=60)
SKEW = Problem(
    "skew", body=Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3)),
    friction=colloc.Friction(mu_t=1.7, mu_b=1.3), gait=Harmonic(2), grade=0.4,
    intervals=60,
)  # fmt: skip
PARTS = {
    "feet": (colloc.Foot(0), Pad(1, 0.1, 0.6), colloc.Wheel(2, rolling=0.5)),
    "masses": (0.4, 0.3, 0.3),
}
FEET = SKEW.with_(name="feet", body=Chain((0.2, 0.5, 0.3), **PARTS), grade=0.2, towards=0.5)
SPLINE = SKEW.with_(name="spline", gait=BSpline(7, degree=3), guess=None)
PATHS = SKEW.with_(name="sides", gait=Polygon(5), guess=None)
FLAT = {"grade": 0.0}


@pytest.fixture(scope="module")
def uphill(once):
    return once("climber", lambda: solve(PROBLEM, 1))


def run(body, gait, grade=0.1, **settings):
    ran = slope_motion(body, Friction(), gait, 1e-2, grade, tolerance=1e-4, **settings)
    return ran.climb[0] / ran.joint_work[0]


@pytest.mark.parametrize(
    "free",
    [
        {"grade": 0.1},
        {"froude": colloc.Free(0.01, 1), "objective": "distance / (work + 0.1 * period)"},
    ],
)
def test_the_trust_region_of_ipopt_holds_heading_and_pace(free):
    gait = Harmonic(1) if "froude" in free else Harmonic(1, "bilateral")
    stated = Problem("free", ellipse(0, 2.8, 1.3), gait=gait, delta=1e-2, intervals=12, **free)
    space, v = space_near(stated, stated.guess)
    parameters = space.full_parameters(v)
    program = FullProgram(space.control, parameters, space.mesh.edges, space.mesh.scheme.name)
    x, static = program.feasible(parameters, 0.1), program.layout.static[:, 0]
    result = Solver(program, {"max_iter": 10}).solve_within(x, 0.1, None, 1e-3)
    assert 0 < np.abs(result.x[static] - x[static]).max() <= 1.01e-3


@pytest.mark.slow
def test_ipopt_alone_finds_the_same_heading(uphill):
    alone = solve(PROBLEM, search="full")
    assert alone.status == "solved", alone.message
    assert alone.certificate.value == pytest.approx(uphill.certificate.value, rel=1e-5)
    assert alone.gait.theta == pytest.approx(uphill.gait.theta, abs=1e-2)


def test_the_answer_is_a_certified_solution_of_the_full_program(uphill):
    assert uphill.status == "solved", uphill.message
    assert uphill.answer.program == FULL
    theta = uphill.answer.x[uphill.answer.layout.theta[0]]
    assert uphill.gait.theta == pytest.approx(theta[0], abs=1e-9)
    ran = slope_motion(Chain(), Friction(), uphill.gait, 1e-2, 0.1)
    assert uphill.certificate.distance == pytest.approx(ran.climb[0], abs=1e-5)
    for work in (ran.joint_work[0], ran.friction_work[0] + 0.1 * ran.climb[0]):
        assert uphill.certificate.work == pytest.approx(work, abs=1e-5)


@pytest.mark.slow
def test_a_polygon_climbs_better_and_is_certified_and_kept(uphill, tmp_path, capsys):
    found = solve(SIDES, 1)
    assert (found.status, found.answer.program) == ("solved", FULL), found.message
    gait, delta = found.gait, found.answer.delta_per_period
    way = {"theta": gait.theta, "breaks": gait.corner_phases}
    ran = slope_motion(Chain(), Friction(), gait, delta, 0.1, **way)
    assert found.certificate.value == pytest.approx(ran.climb[0] / ran.joint_work[0], rel=1e-5)
    assert abs(ran.turn) < 1e-5
    assert found.certificate.value > 1.4 * uphill.certificate.value
    path = save(found, tmp_path / "sides.h5")
    assert load(path).gait.theta == gait.theta
    assert verify([str(path)]) == 0
    assert "verified" in capsys.readouterr().out


@pytest.mark.slow
def test_a_body_on_feet_climbs_a_slope_that_is_too_steep_for_one_that_lies():
    found = solve(Problem("feet", body=Chain(feet=1), gait=PROBLEM.gait, grade=0.2))
    assert found.status == "solved", found.message
    assert found.certificate.value > 0.4


def test_no_gait_and_no_heading_beside_it_climbs_better(uphill):
    own, gait, rng = control_problem(PROBLEM).admissible, uphill.gait, np.random.default_rng(2)
    v = own.parameters(gait)
    for size in (0.03, 0.1):
        for _ in range(2):
            # folded links may not cross
            step = np.append(-np.abs(rng.normal(size=v.size - 1)) * np.sign(v[:-1]), rng.normal())
            assert run(Chain(), own.member(v + size * step)) < uphill.certificate.value
    assert uphill.certificate.value > 1.05 * run(Chain(), ellipse(0, 2.8, 1.3))


def test_whole_periods_add_up_along_the_fall_line(uphill):
    motion = uphill.sample([0.0, 1.0, 2.5])
    np.testing.assert_allclose(motion.centre[0, 1], uphill.certificate.distance, rtol=1e-4)
    np.testing.assert_allclose(motion.theta[1], motion.theta[0], atol=1e-5)
    # turned by what is left of a rotation
    centres = uphill.sample([0.5]).centre[:, 0], *motion.centre[:, 1:].T
    half, end, last = (complex(*centre) for centre in centres)
    turn = np.exp(1j * (motion.theta[1] - motion.theta[0]))
    assert last == pytest.approx(end * (1 + turn) + turn**2 * half, abs=1e-9)


@pytest.mark.slow
def test_it_is_kept_verified_and_summarised_like_any_other(uphill, tmp_path, capsys):
    path = save(uphill, tmp_path / "climber.h5")
    again = load(path)
    assert again.certificate == uphill.certificate
    assert again.problem.hash == PROBLEM.hash
    assert again.gait.theta == uphill.gait.theta
    assert verify([str(path)]) == 0
    assert "verified" in capsys.readouterr().out
    assert any("slope of grade 0.1" in line for line in summary_lines(again, None, verbose=True))


def test_a_gait_that_turns_and_points_elsewhere_fails_its_certificate(uphill):
    gait = uphill.gait
    # no gait of the class
    mean, theta = gait.mean + np.array([0.1, 0.2]), gait.theta + 0.02
    turns = colloc.Fourier(mean, gait.cos, gait.sin, theta=theta)
    at = PROBLEM.with_(towards=0.05), turns, 1e-2, np.empty(0)
    found = gait_certificate(*at, tolerance=1e-4, claimed=uphill.value)
    holds = {check.name for check in found.checks if check.passed}
    assert {"replay gap", "net rotation", "direction"} <= {check.name for check in found.failures}
    assert {"work = dissipation", "balance in replay", "replay error"} <= holds


def test_the_error_of_a_mesh_is_known_interval_by_interval(uphill):
    space, v = space_near(PROBLEM, uphill.gait, np.linspace(0.0, 1.0, 21))
    control, meshes = control_problem(PROBLEM), (uphill.mesh, space.mesh)
    fine, coarse = (mesh_error(control, mesh, uphill.gait, 1e-2) for mesh in meshes)
    assert fine.estimate < PROBLEM.mesh_tolerance < 0.1 * coarse.estimate
    assert coarse.total == pytest.approx(coarse.value.sum(), rel=0.05)
    own = -ReducedProgram(space, 1e-2).objective(v)
    assert coarse.total == pytest.approx(own / uphill.certificate.value - 1, rel=1e-2)


@pytest.mark.slow
def test_what_joints_give_back_and_can_do_counts_on_slopes(uphill):
    """Uphill joints brake at times: driven work is work and what they do not get back."""
    problem = PROBLEM.with_(objective="driven efficiency", torque_limit=0.05, power_limit=1.0)
    space, v = space_near(problem, uphill.gait, np.linspace(0.0, 1.0, 21))
    program = ReducedProgram(space, 1e-2)
    found = gait_certificate(problem, uphill.gait, 1e-2, np.empty(0), tolerance=1e-5)
    assert found.distance / found.value > 1.0001 * found.work
    excess = program.place_rows(v)
    assert excess > 0.1
    (demand,) = (check for check in found.checks if check.name == "actuators")
    assert demand.value == pytest.approx(excess, rel=1e-3)
    error = mesh_error(control_problem(problem), space.mesh, uphill.gait, 1e-2)
    assert error.total == pytest.approx(-program.objective(v) / found.value - 1, rel=1e-2)


def test_a_slope_that_is_not_climbed_is_said_so():
    found = solve(PROBLEM.with_(grade=0.9, delta=0.1), 1)
    assert found.status == "not converged"
    assert "no gait was found that climbs a grade of 0.9" in found.message
    # down it joints may brake more than they drive, which is no efficiency
    down = control_problem(PROBLEM).dynamics.totals(PeriodTotals(-11.0, 0.0, 1.0))
    assert np.isnan(PROBLEM.objective(down))


def bump(t):
    return np.exp(np.cos(2 * np.pi * t))


def program_at(problem, delta):
    """A program, and a point of it with nothing special; of paths one that is closed."""
    space, v = space_near(problem, ellipse(0, 2.6, 1.3))
    size = 0.0 if problem.gait.relative_delta else 0.1
    v = np.append(v[:-1] + size * np.random.default_rng(0).normal(size=v.size - 1), 0.7)
    program = ReducedProgram(space, delta)
    program.place_rows(v)
    return program, v


@pytest.mark.parametrize("problem", [LEVEL, SKEW, FEET, SPLINE, PATHS], ids=lambda p: p.name)
def test_the_mesh_has_the_motion_of_the_differential_equation(problem):
    program, v = program_at(problem.with_(intervals=120), 0.1)
    gait = program.space.member(v)
    delta = delta_per_period(problem.gait, gait, 0.1)
    at = problem.body, problem.friction, gait, delta, problem.grade
    ran = slope_motion(*at, breaks=gait.corner_phases)
    found = program.motion.values(v, 0.1)
    way = (ran.climb + 1j * ran.aside) * np.exp(-1j * (problem.towards or 0.0))
    exact = {"distance": way.real, "across": way.imag, "work": ran.joint_work, "rotation": ran.turn}
    for name, value in exact.items():
        assert found[name] == pytest.approx(float(np.squeeze(value)), abs=1e-5), name


@pytest.mark.parametrize("problem", [SKEW, SPLINE, PATHS], ids=lambda p: p.name)
def test_where_the_ground_is_nearly_level_a_gait_goes_as_far_as_on_the_level_where_it_is_asked_to(
    problem,
):
    aside = {"grade": 1e-9, "towards": 2.0}
    (up, v), (level, w) = (space_near(problem.with_(**on), problem.guess) for on in (aside, FLAT))
    found, known = (
        ReducedProgram(space, 0.01).motion.values(at, 0.01) for space, at in ((up, v), (level, w))
    )
    turned = up.member(np.append(v[:-1], v[-1] + 0.3))
    assert up.parameters(turned)[-1] == pytest.approx(v[-1] + 0.3)
    assert found["work"] == pytest.approx(known["work"], abs=1e-7)
    way = np.hypot(found["distance"], found["across"])
    assert way == pytest.approx(known["distance"], abs=1e-7)
    # where it points is found at a larger delta
    assert found["distance"] > 0.98 * known["distance"]


@pytest.mark.parametrize(
    "gait",
    [Harmonic(2), BSpline(8, symmetry="bilateral"), colloc.Basis([bump, lambda t: bump(t - 0.3)])],
)
def test_a_member_that_points_somewhere_is_known_by_its_parameters_and_kept_in_files(gait):
    problem = LEVEL.with_(gait=gait, guess=None)
    v = np.append(np.random.default_rng(1).normal(size=gait.size(2)), 0.7)
    gaits = control_problem(problem).admissible
    member = gaits.member(v)
    assert member.theta == 0.7
    assert "points +40.11°" in str(member)
    np.testing.assert_allclose(gaits.parameters(gait_from(fields(member))), v, atol=1e-12)
    free = gaits.parameters(gait.member(v[:-1], 2))
    np.testing.assert_allclose(free[:-1], v[:-1], atol=1e-12)
    assert np.isnan(free[-1])
    # begun at another phase it would point elsewhere
    later = colloc.Fourier([0.0, 0.0], [[1.0], [0.2]], [[0.7], [1.0]], theta=0.7)
    assert (gaits.parameters(later)[-1] == 0.7) != (gait == Harmonic(2))
    assert problem.gait == problem.with_(grade=0.0).gait == gait
