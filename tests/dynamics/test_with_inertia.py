"""Gaits with inertia as a search sees them: against shooting, differences and the slow motion; and work
of single joints: against Newton's law for links in the plane and the balance of power."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import colloc
from colloc.commands.solve import summary_lines
from colloc.dynamics import dynamics
from colloc.dynamics.chain import momenta_at, torques_at
from colloc.dynamics.control_problem import control_problem
from colloc.dynamics.dynamics import Shapes
from colloc.gaits.objective import objective_from
from colloc.gaits.regime import Regime
from colloc.mechanics.inertia import momentum_rates
from colloc.pictures.movie import pictures
from colloc.reduced.program import ReducedProgram
from colloc.search.iterate import space_near
from colloc.verification.mesh_error import mesh_error
from tests.shared.cases import slow, slow_but
from tests.shared.mechanics import numpy_instead, with_inertia

LEANING = colloc.Fourier(mean=[0.3, -0.5], cos=[[0.4], [0.9]], sin=[[1.1], [-0.2]])
ROUND = colloc.ellipse(A0=0, A1=2.5, B1=1.3)
UNEVEN, UNEQUAL = colloc.Chain((0.3, 0.45, 0.25)), colloc.Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
STANDING = colloc.Chain((0.3, 0.45, 0.25), feet=1)
MASSES = colloc.Chain((0.2, 0.3, 0.5), masses=(0.5, 0.1, 0.4), inertias=(0.01, 0.02, 0.03))


def problem(**fields):
    usual = {"gait": colloc.Harmonic(1), "guess": LEANING, "rotation": None, "delta": 1e-2}
    usual |= {"body": UNEVEN, "friction": UNEQUAL, "froude": 0.1}
    return colloc.Problem("paced", **(usual | fields))


def program(stated):
    space, v = space_near(stated, stated.guess)
    return ReducedProgram(space, stated.delta), v


@pytest.mark.parametrize(
    ("body", "friction"),
    [
        (UNEVEN, UNEQUAL),
        (MASSES, colloc.Friction(mu_t=0.4)),
        (STANDING, colloc.Friction(mu_t=3.0, mu_f=0.5, mu_b=1.0)),
        (colloc.Chain((0.5, 0.5)), colloc.Viscous(normal=2.0)),
    ],
)
def test_the_kernel_and_the_symbolic_statement_have_the_derivatives_of_differences(body, friction):
    rng, law, step = np.random.default_rng(4), body.law(friction), 1e-4
    given, n_joint = rng.normal(size=(2 * body.n_joint + 3, 50)), body.n_joint

    def stated(given):
        angles, rates, states = np.split(given, [n_joint, 2 * n_joint])
        now = momentum_rates(body, law, angles, rates, states, delta=0.3, froude=0.1)
        return np.concatenate([now.z, states[:2], now.power, now.rates])

    def compiled():
        angles, rates, states = np.split(given, [n_joint, 2 * n_joint])
        return momenta_at(body, law, (angles, rates, 0.3), states, 0.1)

    value, found = compiled()
    accelerations, froude = rng.normal(size=(n_joint, 50)), np.full((1, 50), 0.1)
    y = np.vstack([given[: 2 * n_joint], accelerations, given[2 * n_joint :], froude])
    torques = torques_at(body, law, y, 0.3, differentiated=True)
    with numpy_instead():
        symbolic = compiled()
        symbolic_torques = torques_at(body, law, y, 0.3)
    for each, wanted in zip(torques, symbolic_torques, strict=True):
        np.testing.assert_allclose(each, wanted, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(value, stated(given), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(symbolic[0], value, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(symbolic[1], found, rtol=1e-9, atol=1e-9)
    for k, unit in enumerate(np.eye(len(given))[:, :, None]):
        by = step * unit
        near, far = ((stated(given + n * by) - stated(given - n * by)) / (2 * n) for n in (1, 2))
        np.testing.assert_allclose(found[:, k], (4 * near - far) / (3 * step), rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("froude", [0.1, 0.5, slow(0.003)])
def test_shooting_and_collocation_find_the_same_motion(froude):
    reduced, v = program(problem(froude=froude, intervals=200))
    stated = reduced.space.control.problem
    shot = with_inertia(stated.body, stated.law, reduced.space.member(v), 1e-2, froude)
    found = reduced.period(v)
    assert shot.stable
    assert found["distance"] == pytest.approx(shot.distance, rel=2e-4)
    assert found["work"] == pytest.approx(shot.work, rel=2e-4)
    assert found["rotation"] == pytest.approx(shot.rotation, abs=2e-4)
    kind, mesh, gait = reduced.motion.kind, reduced.space.mesh, reduced.space.member(v)
    along = kind.simulate(mesh, Shapes(*gait(mesh.times), 1e-2), np.empty(0))
    at = stated.body, stated.law, *gait(mesh.times), along.states
    gained = kind.equations(mesh).integrals(momentum_rates(*at, delta=1e-2, froude=froude).rates)[0]
    np.testing.assert_allclose(along.states, along.edges[:, :1] + gained, rtol=0, atol=1e-13)
    shot_there = [np.interp(mesh.edges, shot.tail[0], each) for each in shot.states[:3]]
    np.testing.assert_allclose(along.edges, shot_there, atol=1e-3 * np.abs(shot.states[:3]).max())


def test_half_of_an_antipodal_gait_says_what_all_of_it_does():
    antipodal = {"gait": colloc.Harmonic(1, "antipodal"), "rotation": 0.0}
    half, v = program(problem(guess=ROUND, intervals=60, **antipodal))
    whole, w = program(problem(guess=ROUND, intervals=120))
    for name in ("distance", "work"):
        assert half.period(v)[name] == pytest.approx(whole.period(w)[name], rel=1e-5)
    assert whole.period(w)["rotation"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"gait": colloc.Harmonic(1, "antipodal"), "guess": ROUND, "rotation": 0.0},
        {"froude": colloc.Free(0.05, 0.2), "objective": "distance"},
    ],
    ids=["whole", "half", "free pace"],
)
def test_momenta_of_a_gait_beside_another_are_predicted_to_first_order(fields):
    """Half as far away, a quarter of the error. The search starts Newton's method there."""
    reduced, v = program(problem(intervals=40, **fields))
    kind, (space, mesh) = reduced.motion.kind, (reduced.space, reduced.space.mesh)
    direction = np.random.default_rng(7).normal(size=v.size)

    def simulated(v):
        static = v[v.size - len(kind.static_parameters) :]
        shapes = Shapes(*space.at(v)[:2], 1e-2)
        return shapes, static, kind.simulate(mesh, shapes, static)

    begin, static, here = simulated(v)
    errors = []
    for size in (2e-3, 1e-3):
        end, other, there = simulated(v + size * direction)
        change = kind.first_order_change(mesh, begin, here.slopes(), end, other - static)
        errors.append(np.abs(there.states - here.states - change).max())
    assert errors[0] < 0.1 * np.abs(there.states - here.states).max()
    assert errors[1] == pytest.approx(errors[0] / 4, rel=0.2)


@pytest.mark.parametrize("seed", [0, slow(1)])
def test_on_feet_that_hold_the_motion_is_found_soon_from_far_away(seed, monkeypatch):
    """From momenta of a body length a period. The kernel goes NumPy's way."""
    stated = problem(body=STANDING, delta=1e-4, froude=0.02, intervals=60)
    space, _ = space_near(stated, LEANING)
    angles, rates = LEANING(space.mesh.times)
    kind, asked = control_problem(stated).dynamics, []
    at = space.mesh, Shapes(angles, rates, 1e-4), np.empty(0)
    expected = kind.simulate(*at)
    far = np.random.default_rng(seed).normal(size=(3, space.mesh.n_point))

    def counted(*given, **how):
        asked.append(1)
        return momenta_at(*given, **how)

    monkeypatch.setattr(dynamics, "momenta_at", counted)
    compiled = kind.simulate(*at, far)
    with numpy_instead():
        found = kind.simulate(*at, far)
    assert found.exist.all()
    assert compiled.exist.all()
    np.testing.assert_allclose(compiled.states, found.states, atol=1e-11)
    np.testing.assert_allclose(found.states, expected.states, atol=1e-9)
    assert len(asked) < 300


@pytest.mark.slow
def test_the_best_gait_for_the_pace_is_certified_and_beats_the_slow_one_played_fast():
    stated = colloc.Problem(
        "paced", gait=colloc.Harmonic(1, "antipodal"), froude=0.1, delta=1e-2, guess=ROUND
    )
    found = colloc.solve(stated, starts=1)
    assert found.status == "solved", found.message
    assert found.answer.program == stated.formulation, "IPOPT confirms it on the full program"
    slow = colloc.solve(stated.with_(froude=0.0), starts=1)
    played = with_inertia(stated.body, stated.law, slow.gait, 1e-2, 0.1)
    assert found.efficiency > 1.2 * played.efficiency
    checks = {check.name: check.value for check in found.certificate.checks}
    assert 0 < checks["stability"] < 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "gait", "froude"),
    [
        (colloc.Chain((0.5, 0.5)), colloc.Harmonic(2), 0.2),
        (colloc.Chain(feet=1), colloc.Harmonic(1, "antipodal"), 0.05),
    ],
    ids=["two links, which crawl with inertia alone", "feet"],
)
def test_bodies_of_other_kinds_find_a_certified_gait(body, gait, froude):
    found = colloc.solve(colloc.Problem("paced", body=body, gait=gait, froude=froude), starts=8)
    assert found.status == "solved", found.message
    assert found.efficiency > 0.03


def test_how_slow_is_slow_enough_follows_the_friction_of_the_feet():
    feet = tuple(colloc.Foot(k, friction=UNEQUAL) for k in range(3))
    own, oily = colloc.Chain(UNEVEN.lengths, feet=feet), colloc.Friction(mu_f=0.1)
    known, found = (
        colloc.slow_enough(*at, LEANING, 0.1) for at in ((STANDING, UNEQUAL), (own, oily))
    )
    assert found == pytest.approx(known, rel=1e-6)


@pytest.fixture(scope="module")
def paced():
    return colloc.evaluate(colloc.Problem("paced", froude=0.1, delta=1e-2), ROUND)


@pytest.mark.slow
def test_cycles_from_rest_are_those_after_which_the_motion_goes_as_far(paced):
    at = paced.problem.body, paced.problem.law, ROUND, 1e-2, 0.1
    off = np.abs(colloc.motion_from_rest(*at, periods=4).periods[:, 0] / paced.distance - 1)
    cycles, way = paced.cycles_from_rest
    assert cycles == np.argmax(off < 0.02) + 1
    assert way == pytest.approx(paced.distance, rel=0.02)


def test_a_gait_that_is_given_is_evaluated_at_its_pace(paced):
    stated, found = paced.problem, paced
    played = with_inertia(stated.body, stated.law, ROUND, 1e-2, 0.1)
    assert found.success
    assert found.efficiency == pytest.approx(played.efficiency, rel=1e-4)
    again = colloc.replay(stated.body, stated.law, ROUND, 1e-2, froude=0.1, tolerance=1e-5)
    assert again.efficiency == pytest.approx(played.efficiency, rel=2e-5)
    told = "\n".join(summary_lines(found, None, verbose=True))
    assert "played at the Froude number 0.1" in told
    assert f"quasi-static    {found.played_slowly:.4f}" in told


@pytest.mark.slow
def test_what_a_gait_that_turns_is_worth_slowly_is_the_limit_of_slow_paces():
    """The chord of its arc, as at any pace, whatever phase it begins at and was asked to turn."""
    bent = colloc.Fourier([0.1, 0.2], [[0.0, 0.0], [0.5, 0.0]], [[1.0, 0.25], [0.4, 0.0]])
    how = {"froude": 1e-4, "delta": 0.1, "mesh_tolerance": 1e-3}
    found = colloc.evaluate(stated := colloc.Problem("bent", gait=colloc.Harmonic(2), **how), bent)
    assert abs(found.rotation) > 0.05
    straight = colloc.Solution(stated, found.answer, found.certificate)
    assert straight.played_slowly == pytest.approx(found.value, rel=1e-3)


def test_a_body_with_inertia_that_begins_at_rest_comes_to_move_as_certified(paced, three_link):
    found, moved = paced, paced.from_rest(np.arange(0.0, 6.501, 0.01))
    ways = np.hypot(*np.diff(moved.centre[:, ::100], axis=1))
    assert np.hypot(*(moved.centre[:, 1] - moved.centre[:, 0])) < 1e-3
    assert ways[0] < 0.9 * ways[-1]
    assert ways[-1] == pytest.approx(found.distance, rel=1e-3)
    settled, alike = moved.z[:, 550:], found.sample(moved.t[550:]).z
    np.testing.assert_allclose(settled, alike, atol=2e-2)
    assert len(list(pictures(found, 2, 2, width=200, from_rest=True))) == 4
    with pytest.raises(colloc.ProblemError, match="has no inertia"):
        three_link.from_rest(np.zeros(1))


@pytest.mark.parametrize("objective", ["efficiency", "distance / driven_work"])
def test_what_the_intervals_miss_adds_up_to_what_all_of_them_do(objective):
    """Each has an error of its own, though the body turns, and what comes later with it."""

    def errors(intervals):
        stated = problem(intervals=intervals, delta=0.1, objective=objective)
        space, v = space_near(stated, LEANING)
        return mesh_error(control_problem(stated), space.mesh, space.member(v), 0.1, 1e-7)

    error = errors(12)
    assert error.value.sum() == pytest.approx(error.total, rel=0.05)
    assert error.estimate > abs(error.total) > 1e-4
    assert np.abs(error.value).sum() > 2 * abs(error.total), "of either sign"
    assert np.median(np.abs(errors(48).value)) < 1e-7, "kinks are few"
    on = (program(problem(intervals=n, delta=0.1, objective=objective)) for n in (12, 96))
    collocated, true = (reduced.period(v) for reduced, v in on)
    missed = abs(collocated["rotation"] - true["rotation"])
    assert error.turning == pytest.approx(0.5 * missed / true["distance"], rel=0.01)


def test_two_equal_links_go_nowhere_by_an_antipodal_gait():
    """As far back while bent to the other side; links that differ do not."""
    gait = colloc.Fourier(mean=[0.0], cos=[[1.1, 0.0, 0.3]], sin=[[0.0, 0.0, 0.4]])

    def distance(body):
        how = {"tolerance": 1e-4, "objective": objective_from("distance + work")}
        return colloc.replay(body, colloc.Friction(mu_t=2), gait, 1e-2, froude=0.1, **how).distance

    assert distance(colloc.Chain((0.5, 0.5))) < 1e-6 < 1e-4 < distance(colloc.Chain((0.4, 0.6)))


GAIT = colloc.Fourier([0.3, -0.2], cos=[[0.6, 0.1], [0.3, 0.2]], sin=[[0.2, 0.3], [0.7, -0.1]])
CHAIN = colloc.Chain((0.3, 0.25, 0.45), masses=(0.2, 0.2, 0.6), inertias=(0.002, 0.01, 0.004))
FLOOR, DELTA, FROUDE = colloc.Friction(mu_t=1.3, mu_f=0.7, mu_b=1.1), 0.05, 0.3
DRIVEN = colloc.Objective("driven efficiency")
ALL = colloc.Quantity("all_power", "sum(power)")


def driven_problem(**fields):
    usual = {"body": CHAIN, "friction": FLOOR, "gait": colloc.Harmonic(2), "guess": GAIT}
    usual |= {"froude": FROUDE, "objective": "driven efficiency", "delta": DELTA, "rotation": None}
    return colloc.Problem("driven", **usual | fields)


def newtons_joint_powers(froude, points=60, n=4000):
    """Power of each joint in a period, from the followed place and orientation of the body by
    Newton's law for each link in the plane: a program that shares no line with the torques."""
    ran = with_inertia(CHAIN, FLOOR, GAIT, DELTA, froude, tolerance=1e-8)
    spline = CubicSpline(ran.tail[0], ran.states[3:6].T)
    t, h, lengths = (np.arange(n) + 0.5) / n, 1e-4, np.array(CHAIN.lengths)
    masses = np.array(CHAIN.masses)

    def links(t):
        theta, x, y = spline(t).T
        turned = theta + np.vstack([0 * t, np.cumsum(GAIT.angles(t), axis=0)])
        along = lengths[:, None] * np.exp(1j * turned)
        middle = np.cumsum(along, axis=0) - 0.5 * along
        return turned, middle - masses @ middle + x + 1j * y

    before, now, after = links(t - h), links(t), links(t + h)
    spin, velocity = ((b - a) / (2 * h) for a, b in zip(before, after, strict=True))
    turning, growth = ((b - 2 * c + a) / h**2 for a, c, b in zip(before, now, after, strict=True))
    direction, arm = np.exp(1j * now[0]), (np.arange(points) + 0.5) / points - 0.5
    force, moment = 0.0, 0.0
    for share in arm:
        at = share * lengths[:, None] * direction
        moving = np.conj(direction) * (velocity + 1j * spin * at)
        mu = np.where(moving.real > 0, FLOOR.mu_f, FLOOR.mu_b)
        size = np.sqrt(np.abs(moving) ** 2 + DELTA**2)
        push = -(mu * moving.real + 1j * FLOOR.mu_t * moving.imag) / size
        push = lengths[:, None] / points * direction * push
        force, moment = force + push, moment + (np.conj(at) * push).imag
    # what the links behind a joint lack of force and moment goes through it
    lacks = froude * masses[:, None] * growth - force
    spun = froude * np.array(CHAIN.inertias)[:, None] * turning - moment
    powers, (_, rates) = [], GAIT(t)
    for joint in range(2):
        hinge = now[1][joint] + 0.5 * lengths[joint] * direction[joint]
        behind = slice(0, joint + 1)
        about = (np.conj(now[1][behind] - hinge) * lacks[behind]).imag + spun[behind]
        powers.append(-about.sum(axis=0) * rates[joint])
    return np.array(powers)


def test_newtons_law_for_every_link_says_the_same():
    """Up to its 60 points on a link."""
    powers, idle = newtons_joint_powers(FROUDE), 1.3 * DELTA
    positive = 0.5 * (powers + np.sqrt(powers**2 + idle**2)).sum(axis=0).mean()
    asked = {"quantities": ["driven_work"], "limits": [colloc.PathLimit("power", "power", 2.0)]}
    played = with_inertia(CHAIN, FLOOR, GAIT, DELTA, FROUDE, **asked)
    assert played.shares == pytest.approx(np.abs(powers).max(axis=1) / 2, rel=5e-3)
    assert played.values["driven_work"] == pytest.approx(positive, rel=1e-3)
    assert played.values["driven_work"] > 1.1 * played.work, "joints brake links, too"


@pytest.mark.parametrize("grade", [0.0, 0.2])
def test_joints_do_the_work_of_friction_and_climb(grade):
    gait = colloc.Fourier(GAIT.mean, GAIT.cos, GAIT.sin, theta=0.7)
    how = {"regime": Regime(grade=grade, towards=0.5 if grade else None), "quantities": [ALL]}
    played = with_inertia(CHAIN, FLOOR, gait, DELTA, FROUDE, tolerance=1e-7, **how)
    assert played.values["all_power"] == pytest.approx(played.work, rel=3e-7)
    way = complex(*(played.states[4:6, -1] - played.states[4:6, 0]))
    seen = way * np.exp(-0.5j) if grade else abs(way)
    assert complex(played.distance, played.across) == pytest.approx(seen)


@pytest.mark.parametrize("seed", slow_but([0], range(4)))
def test_stated_errors_cover_the_true_ones(seed):
    rng = np.random.default_rng(seed)
    mean, series = 0.4 * rng.normal(size=2), rng.normal(size=(2, 2, 2)) * [0.9, 0.3]
    mu_t, mu_f, mu_b = rng.uniform(0.3, 2, 3)
    law = colloc.Friction(mu_t=mu_t, mu_f=mu_f, mu_b=mu_b)
    delta, froude = 10 ** rng.uniform([-4, -2.5], [-1.5, 0])
    at = CHAIN, law, colloc.Fourier(mean, *series), delta, froude
    true = with_inertia(*at, tolerance=1e-7, objective=DRIVEN)
    for tolerance in (1e-3, 1e-5):
        played = with_inertia(*at, tolerance=tolerance, objective=DRIVEN)
        off = abs(played.values["driven_work"] - true.values["driven_work"])
        assert off <= played.errors["driven_work"]
        assert abs(DRIVEN(played.values) / DRIVEN(true.values) - 1) <= played.error_of(DRIVEN)
        assert played.error_of(DRIVEN) <= tolerance


def test_shooting_and_collocation_find_the_same_work():
    stated = driven_problem(intervals=200)
    space, v = space_near(stated, GAIT)
    found = ReducedProgram(space, DELTA).period(v)
    replayed = colloc.replay(CHAIN, FLOOR, GAIT, DELTA, froude=FROUDE, objective=DRIVEN)
    assert found["driven_work"] == pytest.approx(replayed.values["driven_work"], rel=2e-5)
    assert replayed.actuator_work == pytest.approx(replayed.work, rel=1e-6)


@pytest.mark.slow
def test_a_gait_of_least_driven_work_is_certified_and_beats_that_of_least_work():
    stated = {"body": colloc.Chain(), "friction": colloc.Friction(), "guess": None}
    stated |= {"gait": colloc.Harmonic(1, "antipodal"), "rotation": 0.0, "delta": 1e-2}
    stated = driven_problem(froude=0.2, mesh_tolerance=1e-4, **stated)
    found = colloc.solve(stated, starts=1)
    assert found.status == "solved", found.message
    assert found.answer.program == "full"
    other = colloc.solve(stated.with_(objective="efficiency"), starts=1)
    again = colloc.evaluate(stated, other.gait)
    assert again.status == "solved", again.message
    assert found.value > 1.001 * again.value
