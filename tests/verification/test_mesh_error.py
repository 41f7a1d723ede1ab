"""The error estimate of a mesh against other references, and meshes planned from it."""

from functools import cache

import numpy as np
import pytest

import colloc
from benchmarks.error_control import CASES, case_problem, held, outcome
from colloc import Chain, Fourier, Friction, Harmonic, Problem, ellipse, replay, solve
from colloc.dynamics.control_problem import control_problem
from colloc.mechanics.balance import instant
from colloc.mechanics.contact import crossing_depth
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.search import optimise as refine
from colloc.verification import mesh_error as refinement
from colloc.verification.adaptive_motion import fine_motion, rates_at
from colloc.verification.mesh_error import kink_phases, mesh_error, plan_mesh
from tests.shared.stages import answer_near

GAIT = ellipse(0, 2.8, 1.25)
DELTA = 1e-3
UNEQUAL = Friction(mu_t=1.7, mu_f=1, mu_b=1.3)
each_friction = pytest.mark.parametrize("friction", [Friction(), UNEQUAL], ids=str)
NONE = np.zeros((2, 1))
FOLDED = Fourier([2.0, 2.0], [[0.3], [0.3]], NONE), Fourier([-2.0, 0.0], [[1.4], [0.0]], NONE)


def problem(name="gauss-3", friction=None, **changes):
    fields = {"delta": DELTA, "delta_start": DELTA, "gait": Harmonic(1, "bilateral")}
    fields |= {"intervals": 20, "scheme": name}
    return Problem("p", GAIT, friction=friction or Friction(), **(fields | changes))


@cache
def replayed(friction):
    how = {"tolerance": 1e-9, "instants": 6400, "most_instants": 25600}
    return replay(Chain(), friction, GAIT, DELTA, **how)


def error_of(stated, mesh=None, gait=GAIT, tolerance=1e-6, delta=DELTA):
    control = control_problem(stated)
    return mesh_error(control, mesh or control.mesh(), gait, delta, tolerance)


def planned(stated, mesh=None, tolerance=1e-6, **how):
    control = control_problem(stated)
    return plan_mesh(control, mesh or control.mesh(), GAIT, DELTA, tolerance, **how)


def fine_of(stated, mesh=None, gait=GAIT, tolerance=1e-6):
    control = control_problem(stated)
    return refinement.gait_motion(control, gait, DELTA, mesh or control.mesh(), tolerance)


@each_friction
def test_adaptive_panels_agree_with_a_uniform_replay(friction):
    fine = fine_motion(problem().body, friction, GAIT, DELTA, np.linspace(0, 1, 21), 1e-8)
    known = replayed(friction)
    assert fine.unresolved.sum() <= 1e-8
    twice = fine_motion(
        problem().body, friction, GAIT, DELTA, np.linspace(0, 1, 21), 1e-8, periods=2
    )
    np.testing.assert_array_equal(twice.edges, fine.edges)  # of the efficiency of all periods
    assert abs(fine.path[-1]) == pytest.approx(known.distance, rel=1e-7)
    assert fine.totals[0, -1] == pytest.approx(known.work, rel=1e-7)
    # dense output: the same motion from panels that end elsewhere
    other = fine_motion(problem().body, friction, GAIT, DELTA, np.linspace(0, 1, 24), 1e-8)
    t = np.random.default_rng(5).uniform(0, 1, 200)
    for mine, theirs in zip(fine.at(t), other.at(t), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-7)


@each_friction
@pytest.mark.parametrize("name", ["trapezoid", "hermite-simpson", "gauss-2", "gauss-5", "radau-3"])
def test_total_error_is_that_of_collocation_and_the_estimate_bounds_it(name, friction):
    # collocating a given gait, by the scheme's own quadrature written out here
    stated = problem(name, friction)
    mesh = control_problem(stated).mesh()
    error = error_of(stated, tolerance=1e-7)
    t = mesh.edges[:-1, None] + mesh.h[:, None] * mesh.scheme.c
    rates = rates_at(stated.body, friction, GAIT, DELTA, t)
    theta, x, work = 0.0, 0.0, 0.0
    for k in range(mesh.n):
        stage = theta + mesh.h[k] * mesh.scheme.A @ rates.z[2, k]
        x += mesh.h[k] * mesh.scheme.b @ (np.exp(1j * stage) * rates.centre[k])
        work += mesh.h[k] * mesh.scheme.b @ rates.densities[0, k]
        theta += mesh.h[k] * mesh.scheme.b @ rates.z[2, k]
    true = abs(x) / work / replayed(friction).efficiency - 1
    assert error.total == pytest.approx(true, rel=2e-3, abs=3e-8)
    assert abs(true) <= 1.02 * error.estimate
    assert error.value.sum() == pytest.approx(true, rel=0.1, abs=1e-6)


@pytest.mark.parametrize(
    "objective", ["distance / driven_work", "distance / length", "distance / (work + driven_work)"]
)
def test_shares_of_intervals_add_up_to_the_error_of_other_objectives(objective):
    """The total is known from the scheme's own increments and the fine motion alone."""
    error = error_of(problem("trapezoid", objective=objective))
    assert abs(error.total) > 1e-4
    assert error.value.sum() == pytest.approx(error.total, rel=0.1)


def test_shares_of_intervals_add_up_where_the_body_turns_in_half_a_period():
    """What counts is the displacement half way between the headings of both halves."""
    gait = Fourier(np.zeros(2), np.array([[1.5], [-1.0]]), np.array([[0.3], [1.0]]))
    stated = problem("trapezoid", gait=Harmonic(1, "antipodal"), intervals=40)
    assert abs(fine_of(stated, gait=gait).theta[-1]) > 0.1
    error = error_of(stated, gait=gait)
    assert error.value.sum() == pytest.approx(error.total, rel=0.02)


def test_a_rotation_that_a_mesh_misses_turns_half_of_the_body_and_asks_for_another_mesh():
    """However much the efficiency may err."""
    gait = Fourier([0.6, 0.3], [[1.2], [-0.3]], [[0.3], [1.0]])
    stated = problem("gauss-2", gait=Harmonic(1))
    control, fine = control_problem(stated), fine_of(stated, gait=gait)
    mesh = control.mesh()
    nodes = mesh.edges[:-1, None] + mesh.h[:, None] * mesh.scheme.c
    spin = rates_at(stated.body, stated.friction, gait, DELTA, nodes).z[2]
    turned = 0.5 * abs(mesh.h @ spin @ mesh.scheme.b - fine.theta[-1]) / abs(fine.path[-1])
    assert error_of(stated, gait=gait).turning == pytest.approx(turned, rel=1e-3)
    assert turned > refinement.TURNING
    assert plan_mesh(control, mesh, gait, DELTA, 1.0) is not None


@each_friction
def test_kinks_are_instants_at_which_a_point_of_a_link_is_at_rest(friction):
    stated = problem(friction=friction)
    fine = fine_of(stated, Mesh(scheme("gauss-3"), np.linspace(0.0, 0.5, 21)))
    kinks = kink_phases(stated.body, friction, GAIT, DELTA, fine)
    assert 4 <= kinks.size <= 24
    # reversing the motion about the middle of the half period maps kinks to kinks (A0 = 0)
    np.testing.assert_allclose(np.sort(0.5 - kinks), kinks, atol=2e-4)
    angles, rates = GAIT(kinks)
    z = colloc.solve_balance(stated.body, friction, angles, rates, DELTA).z
    slow = np.abs(instant(stated.body, friction, angles, rates, z, DELTA).velocity.vs).min(axis=0)
    assert (slow < 30 * DELTA).all()
    # where forwards and backwards differ, every link that changes its way
    t = np.linspace(0.0, 0.5, 2002)[1:-1]
    z = fine.velocity(t[:, None]).reshape(3, -1)
    vs = instant(stated.body, friction, *GAIT(t), z, DELTA).velocity.vs
    turns = t[np.nonzero(vs[:, 1:] * vs[:, :-1] < 0)[1]]
    assert friction.reversible or np.abs(turns[:, None] - kinks).min(axis=1).max() < 1e-3


def test_a_kink_is_found_where_the_body_comes_to_rest():
    """One joint that swings to and fro: everything rests where it turns back."""
    body, friction = Chain((0.4, 0.6)), Friction(mu_t=1, mu_f=1, mu_b=3)
    turns = np.array([0.1234, 0.6234])

    def swinging(t):
        phase = 2 * np.pi * (t - turns[0])
        return 1.2 + 0.8 * np.cos(phase)[None], -1.6 * np.pi * np.sin(phase)[None]

    fine = fine_motion(body, friction, swinging, 1e-4, np.linspace(0, 1, 41), 1e-6)
    np.testing.assert_allclose(kink_phases(body, friction, swinging, 1e-4, fine), turns, atol=1e-6)


@pytest.mark.parametrize(("least", "counts"), [(2.0, True), (5.0, False)])
def test_a_point_that_nearly_rests_makes_a_kink_up_to_thirty_delta(least, counts):
    """One joint slows down until some point of the links moves at 17 delta, or at 43."""
    body, friction, delta = Chain((0.4, 0.6)), Friction(), 1e-3

    def slowing(t):
        late = t - 0.25
        return (0.3 + least * late + 2000 * late**3 / 3)[None], (least + 2000 * late**2)[None]

    at = slowing(np.array([0.25]))
    velocity = body.velocity(body.posture(at[0]), at[1], body.solve(friction, *at, delta).z)
    slow = body.contact.sticking_speeds(friction, velocity).min() / delta
    assert slow == pytest.approx(8.55 * least, rel=0.01)
    fine = fine_motion(body, friction, slowing, delta, np.linspace(0, 0.5, 21), 1e-6)
    assert (np.abs(kink_phases(body, friction, slowing, delta, fine) - 0.25) < 0.01).any() == counts


@pytest.mark.parametrize(
    ("rule", "friction", "held"),
    [("radau-3", UNEQUAL, False), ("radau-3", Friction(), True), ("gauss-3", UNEQUAL, True)],
)
def test_no_node_lies_where_friction_changes_its_sense(rule, friction, held, monkeypatch):
    """Schemes with nodes at ends of intervals would give the efficiency a kink there."""
    stated, kink = problem(friction=friction, scheme=rule, intervals=8), 0.1234
    monkeypatch.setattr(refinement, "kink_phases", lambda *arguments: np.array([kink]))
    assert (kink in planned(stated, tolerance=1e-4).edges) == held


def test_knots_on_kinks_save_points(monkeypatch):
    stated = problem("gauss-7", intervals=16)
    with_knots = planned(stated)
    monkeypatch.setattr(refinement, "kink_phases", lambda *arguments: np.empty(0))
    without = planned(stated)
    points = [(plan.edges.size - 1) * scheme(plan.scheme).s for plan in (with_knots, without)]
    assert points[0] < 0.9 * points[1]
    fine = fine_of(stated, tolerance=1e-7)
    knots = kink_phases(stated.body, stated.friction, GAIT, DELTA, fine, 0.02 / 32)
    assert np.abs(with_knots.edges[:, None] - knots).min(axis=0).max() < 1e-4


@pytest.mark.parametrize("name", ["gauss-2", "gauss-3", "radau-3", "hermite-simpson"])
def test_planned_meshes_are_as_accurate_as_they_say(name):
    stated = problem(name)
    for tolerance in (1e-4, 1e-6):
        plan = planned(stated, tolerance=tolerance)
        assert plan.reached
        mesh = Mesh(scheme(plan.scheme), plan.edges)
        error = error_of(stated, mesh, tolerance=0.1 * tolerance)
        assert abs(error.total) <= error.estimate <= 1.1 * tolerance
        assert planned(stated, mesh, 1.1 * tolerance) is None


def test_a_nested_mesh_has_every_knot_of_the_one_before():
    stated = problem("gauss-3")
    edges = control_problem(stated).mesh().edges
    plan, free = (
        planned(stated, nested=nested, knots=np.array([0.123])) for nested in (True, False)
    )
    assert np.isin(edges, plan.edges).all()
    assert not np.isin(edges, free.edges).all()
    assert 0.123 in free.edges  # as it has to be
    assert plan.reached
    mesh = Mesh(scheme(plan.scheme), plan.edges)
    assert error_of(stated, mesh, tolerance=1e-7).estimate <= 1.1e-6


def test_an_exhausted_budget_is_said_and_no_success(monkeypatch):
    stated = problem("gauss-2", mesh_tolerance=1e-7, intervals=20)
    plan = planned(stated, tolerance=1e-7, most_points=60)
    assert not plan.reached
    assert plan.estimate > 1e-7
    small = plan_mesh
    monkeypatch.setattr(refine, "plan_mesh", lambda *a, **k: small(*a, **{**k, "most_points": 60}))
    solution = solve(stated, 1)
    assert solution.status == "certificate failed"
    assert "mesh error" in solution.message
    assert "mesh error" in [check.name for check in solution.certificate.failures]


def test_a_refined_solution_knows_its_scheme_and_its_error():
    stated = problem("gauss-2", mesh_tolerance=1e-5)
    answer = answer_near(stated)
    assert answer.optimal
    assert answer.scheme == answer.mesh.scheme.name != "gauss-2"
    known = replay(stated.body, stated.friction, answer.gait, DELTA, tolerance=1e-8)
    assert abs(answer.efficiency / known.efficiency - 1) < 1e-5


@pytest.mark.parametrize("wide", [GAIT.scaled(1.2), *FOLDED])
def test_violations_are_reported_in_the_interval_where_they_are(wide):
    """Of a joint that bends too far, to either side, or links that cross."""
    stated, t = problem(), np.linspace(0, 0.5, 2001)
    control = control_problem(stated)
    mesh = control.mesh()
    clear, violation = (
        refinement.constraint_violation(control.admissible, mesh, gait) for gait in (GAIT, wide)
    )
    assert clear.max() == 0
    angles = wide.angles(t)
    excess = np.maximum(np.abs(angles).max(axis=0) - np.pi, crossing_depth(stated.body, angles))
    cells = np.unique(np.clip(np.searchsorted(mesh.edges, t[excess > 1e-3]) - 1, 0, mesh.n - 1))
    assert cells.size
    assert (violation[cells] > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES, ids=[name.replace(" ", "-") for name in CASES])
def test_estimate_is_never_optimistic_by_more_than_a_factor_two(name):
    result = outcome(case_problem(name))
    if not result["optimal"]:
        pytest.skip(result["message"])
    assert held(result, "against replay"), result
    assert result["against optimum"] is None or held(result, "against optimum"), result
