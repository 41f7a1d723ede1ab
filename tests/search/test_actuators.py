"""What joints have to do, with inertia and without; gaits of joints that are weak, slow or one-sided;
and optima against maxima of grid sweeps that this file does itself."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

import colloc
from colloc import Chain, Fourier, Friction, Harmonic, Problem, Viscous, evaluate, replay, save
from colloc.dynamics.chain import joint_torques, torque_function
from colloc.mechanics.balance import instant, joint_moments, largest_moments, total_power
from colloc.mechanics.contact import crossing_depth
from colloc.mechanics.densities import DRIVEN_WORK, Instants, PathLimits, torque_and_power
from colloc.mechanics.friction import LinkVelocity
from colloc.mechanics.inertia import inertial_moments
from colloc.reduced.program import ReducedProgram
from colloc.results.robot import joint_torques as sheet_torques
from colloc.results.robot import limit_lines as lines
from colloc.search.confirm import explanation
from colloc.search.iterate import space_near
from colloc.search.options import OPTIONS
from colloc.search.solve import solve
from colloc.transcription.full_program import ACTUATORS
from tests.shared.cases import cases, slow_but
from tests.shared.mechanics import random_instants
from tests.shared.stages import program_of

ONE = PathLimits(torque_and_power((1.0, 1.0), (1.0, 1.0)))
BODY, LAW = Chain((0.2, 0.5, 0.3), weights=(0.3, 0.3, 0.4)), Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
USUAL = Problem("limited", colloc.ellipse(0.0, 2.8, 1.3), gait=Harmonic(1, "bilateral"))
EASY = Friction(mu_t=3, mu_f=1, mu_b=1)
ONE_SIDED = ((-0.6, 1.5), (-1.5, 0.6))
HOPELESS = {
    "power": (
        {"power_limit": 0.005},
        r"power of joint \d is 0\.005 weight x body length per period",
    ),
    "torque": (
        {"torque_limit": 0.01},
        r"torque of joint \d is 0\.01 weight x body length, and .* 5",
    ),
    "far": ({"power_limit": 0.1, "at_least": {"distance": 0.3}}, r"power of joint \d is 0\.1 "),
}
CHAIN = Chain((0.3, 0.25, 0.45))
FLOOR = Friction(mu_t=1.3, mu_f=0.7, mu_b=1.1)
GAIT = Fourier([0.3, -0.2], cos=[[0.6, 0.1], [0.3, 0.2]], sin=[[0.2, 0.3], [0.7, -0.1]])
DELTA, FROUDE = 0.05, 0.3
T = np.linspace(0, 1, 20001)
FAR = {"objective": "distance", "friction": Friction(mu_t=2, mu_f=1, mu_b=1.5)}


CASES = """
harmonics: gait=Harmonic(2, "bilateral"), speed_limit=(8.0, 8.0), delta=1e-2, **FAR
splines: gait=BSpline(8, symmetry="bilateral"), speed_limit=8.0, **FAR
serpenoid: gait=Serpenoid(1), speed_limit=3.0, body=Chain((0.2,) * 5), friction=ROUGH, delta=1e-2
inertia: gait=Harmonic(1, "antipodal"), speed_limit=10.0, froude=0.05
slope: gait=Harmonic(1), speed_limit=6.0, grade=0.05, friction=UNEVEN, objective="distance"
"""
ROUGH, UNEVEN = Friction(mu_t=3), Friction(mu_t=3, mu_f=1, mu_b=1.5)
CASES = cases(CASES, globals())
DRY = 1e-4
LYING, FRICTION = Chain(), Friction()


def moments(body, law, angles, rates, delta):
    z = body.solve(law, angles, rates, delta).require().z
    return joint_moments(body, angles, body.forces(law, angles, rates, z, delta)), z


@pytest.mark.parametrize(
    ("law", "degree"),
    [(LAW, 0), (colloc.PowerLaw(0.5, mu_t=2.0), 0.5), (Viscous(normal=2, tangential=1), 1)],
    ids=str,
)
def test_driven_power_scales_with_the_pace_as_friction_does(law, degree):
    angles, rates = random_instants(50)
    z = Chain().solve(law, angles, rates, 0.1).z
    at = (Instants(Chain(), law, angles, pace * rates, pace * 0.1, z=pace * z) for pace in (1, 3))
    slow, fast = map(DRIVEN_WORK.at, at)
    np.testing.assert_allclose(fast, 3.0 ** (1 + degree) * slow, rtol=1e-9)


@pytest.mark.parametrize(
    "law",
    [LAW, colloc.PowerLaw(0.5, mu_t=2.0, mu_f=1.0, mu_b=1.0), Viscous(normal=2, tangential=1)],
    ids=str,
)
def test_a_joint_that_idles_counts_as_driven_by_half_of_what_delta_hides(law):
    """So the driven power is smooth there: half of any power is gained, whichever way."""
    (angles, rates), delta = random_instants(20), 1e-2
    idle = law.largest * delta ** (1 + law.degree)
    held = joint_moments(BODY, angles, BODY.forces(law, angles, rates, np.zeros((3, 20)), delta))

    def driven(share):
        return DRIVEN_WORK.at(Instants(BODY, law, angles, share * rates, delta, moments=held))[0]

    np.testing.assert_allclose(driven(0.0), 2 * 0.5 * idle, rtol=1e-12)
    h = 1e-5 * idle
    slope = (driven(h) - driven(-h)) / (2 * h)
    power = Instants(BODY, law, angles, rates, delta, moments=held).power.sum(axis=0)
    np.testing.assert_allclose(slope, 0.5 * power, rtol=1e-6)


def test_a_joint_holds_no_more_than_friction_and_a_slope_pull_on_its_lighter_side():
    """Both across a straight body: at the middles of its links, or at its feet."""
    bound = largest_moments(Chain(masses=(0.2, 0.3, 0.5)), Friction(mu_t=2.0), 0.3)
    assert bound == pytest.approx([(2.0 / 3 + 0.3 * mass) / 6 for mass in (0.2, 0.5)])
    aside = [colloc.Foot(0, 0.8, offset=side * 0.2) for side in (1, -1)]
    bound = largest_moments(Chain((0.5, 0.5), feet=[*aside, colloc.Foot(1, 0.9)]), Friction(), 0.3)
    assert bound == pytest.approx([0.5 * (0.1 + 0.2) + 0.3 * 0.5 * 0.25])


def test_torques_are_limited_both_ways_and_powers_one_way():
    """In the program's bounds and in a replay: a gait in a mirror needs the same torques."""
    np.testing.assert_array_equal(ONE.least, [-1.0, -1.0, -np.inf, -np.inf])
    limits = {"torque_limit": 0.1, "power_limit": 0.5}
    program = program_of(Problem("limited", gait=Harmonic(1), intervals=6, **limits))
    rows = program.groups[ACTUATORS]
    assert set(program.row_upper[rows]) == {1.0}
    assert sorted(set(program.row_lower[rows])) == [-np.inf, -1.0]
    assert np.mean(program.row_lower[rows] == -1.0) == 0.5
    gait = Fourier([0.5, 0.2], [[1.2], [0.3]], [[0.2], [1.0]])
    mirrored = Fourier(-gait.mean, -gait.cos, -gait.sin)
    t = np.arange(400) / 400
    signed, _ = moments(BODY, LAW, *gait(t), 1e-2)
    # which is what makes a difference here
    assert np.abs(signed.max(axis=1) + signed.min(axis=1)).max() > 0.01
    found, other = (
        replay(BODY, LAW, each, 1e-2, instants=400, limits=ONE, tolerance=1e-4).shares
        for each in (gait, mirrored)
    )
    np.testing.assert_allclose(found, other, rtol=1e-9)
    np.testing.assert_allclose(found[:2], np.abs(signed).max(axis=1), rtol=1e-2)


@pytest.fixture(scope="module")
def free():
    return solve(USUAL, 1)


@pytest.fixture(scope="module")
def weak():
    return solve(USUAL.with_(power_limit=0.6), 1)


def test_the_replay_tells_the_largest_torques_and_powers(free):
    # every ellipse of three equal links swings an end link broadside
    torques, powers = np.split(replay(Chain(), Friction(), free.gait, 1e-4, limits=ONE).shares, 2)
    np.testing.assert_allclose(torques, 1 / 18, rtol=1e-4)
    assert powers[0] == pytest.approx(powers[1], rel=1e-4)
    assert replay(Chain(), Friction(), free.gait, 1e-4).shares.size == 0


def test_limits_that_nothing_reaches_change_nothing(free):
    same = solve(USUAL.with_(torque_limit=0.06, power_limit=(0.9, 0.9)), 1)
    assert same.status == "solved"
    assert same.efficiency == pytest.approx(free.efficiency, rel=1e-8)


def test_motors_may_brake_harder_than_they_may_drive_but_turn_no_harder_either_way():
    angles, rates = random_instants(200)
    now = Instants(BODY, LAW, angles, rates, 1e-3, z=BODY.solve(LAW, angles, rates, 1e-3).z)
    joint, instant = np.unravel_index(now.power.argmin(), now.power.shape)
    brakes = now.take(np.array([instant]))
    power, torque = np.full(2, 100.0), np.full(2, 100.0)
    power[joint], torque[joint] = -0.5 * brakes.power[joint, 0], 0.5 * abs(brakes.moment[joint, 0])
    for limit, share in (({"power_limit": (*power,)}, 1.0), ({"torque_limit": (*torque,)}, 2.0)):
        limits = Problem("brakes", body=BODY, gait=Harmonic(1), **limit).path_limits
        most = limits.sizes(limits.at(brakes)).max()
        assert most == pytest.approx(share) if share > 1 else most < share, limit


def test_weak_motors_cost_efficiency_and_keep_their_limit_between_the_nodes(free, weak):
    assert weak.status == "solved"
    assert weak.answer.program == "full"
    assert weak.efficiency < 0.95 * free.efficiency
    shares = replay(Chain(), Friction(), weak.gait, 1e-4, instants=6400, limits=ONE).shares
    assert shares[2:].max() == pytest.approx(0.6, rel=1e-4)
    assert next(c for c in weak.certificate.checks if c.name == "actuators").passed


def test_a_certificate_fails_a_gait_whose_joints_do_more_than_they_can(weak):
    from colloc.search.certify import gait_certificate

    weaker = weak.problem.with_(power_limit=0.55)
    checks = gait_certificate(weaker, weak.gait, 1e-4, np.empty(0)).failures
    assert [c.name for c in checks] == ["actuators"]
    assert checks[0].value == pytest.approx(0.6 / 0.55 - 1, rel=1e-3)


@pytest.mark.slow
def test_a_middle_joint_may_be_weaker_than_the_best_gait_wants_and_multipliers_price_it():
    body, limit = Chain((0.25,) * 4), {"torque_limit": (0.1, 0.047, 0.1)}
    problem = Problem("four", None, body, gait=Harmonic(1, "bilateral"), **limit)
    found = solve(problem.with_(guess=solve(problem.with_(torque_limit=None), 1).gait), 1)
    assert found.status == "solved"
    # the price of a limit is the sum of the multipliers of its rows: shares are moments over it
    price = np.abs(found.answer.lam_g[-3 * found.mesh.n_point :]).sum() / 0.047
    limits = ((0.1, middle, 0.1) for middle in (0.0465, 0.0475))
    less, more = (found.problem.with_(torque_limit=at, guess=found.gait) for at in limits)
    gained = solve(more, 1).efficiency - solve(less, 1).efficiency
    assert gained / 1e-3 == pytest.approx(price, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("case", HOPELESS)
def test_where_no_start_keeps_the_limits_the_search_ends_soon_and_says_what_is_missed(case):
    (changes, words), tried = HOPELESS[case], []
    stated = USUAL.with_(guess=None, delta=1e-2, **changes)
    found = solve(stated, progress=lambda news: tried.append(news.done))
    assert max(tried) == OPTIONS.patience
    assert found.status == "not converged"
    assert re.search(f"the limit on the {words}.* relax the limits", found.message)
    assert "None of 8 starts led to a gait of the class that keeps the limits" in found.message


def test_a_limit_that_is_not_kept_is_named_with_its_joint_its_size_and_its_unit():
    limits = {"torque_limit": (0.1, 0.2), "power_limit": (0.3, 0.4)}
    program = program_of(Problem("limited", gait=Harmonic(1), intervals=6, **limits))
    for which, most in enumerate((0.1, 0.2, 0.3, 0.4)):
        limit = (
            f"{('torque', 'power')[which // 2]} of joint {which % 2 + 1} is {most} weight x body"
        )
        limit += " length" + " per period" * (which > 1)
        excess = np.zeros(program.row_lower.size)
        excess[program.groups[ACTUATORS].start + 4 * 5 + which] = 0.5
        ended = SimpleNamespace(excess=excess, iterations=7, status="Ended")
        when = f"at phase {program.mesh.times[5]:.3f}"
        said = f"the limit on the {limit}, and the gait needs 1.5 times as much {when} (Ended)"
        assert said in explanation(program, ended, 0.1)


def states(n):
    return np.random.default_rng(0).normal(size=(3, n))


def test_torques_by_derivatives_agree_with_those_by_differences_in_time():
    t, h = np.linspace(0.03, 0.9, 7), 1e-4
    (angles, rates), accelerations = GAIT(t), (GAIT(t + h)[1] - GAIT(t - h)[1]) / (2 * h)
    momenta = states(t.size)
    function = torque_function(CHAIN, FLOOR)
    found = function(angles, rates, accelerations, momenta, DELTA, FROUDE).full()
    wanted = joint_torques(CHAIN, FLOOR, GAIT, t, momenta, delta=DELTA, froude=FROUDE)
    np.testing.assert_allclose(found, wanted, atol=1e-6)


def test_a_uniform_pull_takes_no_torque():
    """What it does to the joints of a body at rest, less what its acceleration of all links does."""
    angles, pull = GAIT(np.linspace(0.03, 0.9, 7))[0], np.random.default_rng(1).normal(size=(2, 7))
    none = np.zeros((len(CHAIN.contact.force_names), 7))
    falls = (pull[0] * c + pull[1] * s for c, s in zip(*directions(angles), strict=True))
    aside = (pull[1] * c - pull[0] * s for c, s in zip(*directions(angles), strict=True))
    growth = LinkVelocity(np.array([*falls]), np.array([*aside]), np.zeros((3, 7)))
    still = LinkVelocity(*np.zeros((3, 3, 7)))
    against = joint_moments(CHAIN, angles, none, pull)
    falling = inertial_moments(CHAIN, angles, still, growth)
    np.testing.assert_allclose(against + falling, 0.0, atol=1e-14)


def directions(angles):
    """Cosines and sines of the links' directions from that of the tail link."""
    turns = np.cumsum(np.vstack([np.zeros(angles.shape[1]), angles]), axis=0)
    return np.cos(turns), np.sin(turns)


@pytest.mark.slow
def test_a_gait_whose_motors_limit_it_is_certified_and_uses_all_that_it_may():
    stated = {"friction": Friction(mu_t=2, mu_f=1, mu_b=1), "gait": Harmonic(1, "antipodal")}
    problem = Problem("weak", delta=1e-2, froude=0.2, torque_limit=0.2, **stated)
    strong = solve(problem.with_(torque_limit=None), starts=1)
    weak = solve(problem, starts=1)
    assert weak.status == "solved", weak.message
    assert weak.answer.program == "full"
    assert weak.value < strong.value - 1e-4
    (check,) = (check for check in weak.certificate.checks if check.name == "actuators")
    assert check.passed
    most = [np.abs(sheet_torques(each, np.arange(2000) / 2000)).max() for each in (strong, weak)]
    assert most[0] > 0.21
    assert most[1] == pytest.approx(0.2, rel=1e-3)
    (used,) = lines(weak)  # statics say nothing of what accelerates links
    assert "torque 100 % of 0.2" in used
    again = evaluate(problem, weak.gait)
    assert again.status == "solved", again.message
    assert again.value == pytest.approx(weak.value, rel=1e-5)
    beyond = evaluate(problem, strong.gait)
    assert [check.name for check in beyond.certificate.failures] == ["actuators"]


@pytest.mark.parametrize("case", slow_but(["harmonics", "serpenoid"], CASES))
def test_the_fastest_instants_are_as_fast_as_allowed(case):
    """Between mesh points too, for any class paced by time, and for motions with states."""
    found = colloc.solve(Problem("limited", **CASES[case]), starts=1)
    assert found.status == "solved"
    fastest = np.abs(found.gait.rates(T)).max(axis=1)
    assert (fastest / found.problem.speed_limit).max() == pytest.approx(1.0, abs=1e-5)


@pytest.mark.slow
def test_a_flat_top_that_the_second_round_comes_back_to_is_no_end():
    """Instants that move far make the first round overshoot; the rounds that follow them settle."""
    asked = {"speed_limit": (7, 11), "objective": "distance"}
    stated = Problem("flat", gait=Harmonic(2), delta=1e-2, mesh_tolerance=1e-3, **asked)
    assert colloc.solve(stated, starts=1).status == "solved"


def problem(joint_limit, gait=None, **changes):
    stated = {"friction": EASY, "gait": gait or Harmonic(1), "delta": 1e-3, "mesh_tolerance": 1e-4}
    return Problem("ranges", joint_limit=joint_limit, **(stated | changes))


@pytest.fixture(scope="module")
def one_sided():
    return colloc.solve(problem(ONE_SIDED, Harmonic(1, "bilateral")), starts=4)


def test_the_answer_keeps_both_sides_and_uses_one(one_sided, tmp_path):
    assert one_sided.success
    first, second = one_sided.gait.angles(np.linspace(0, 1, 4001))
    low, high = first.min(), first.max()
    assert low == pytest.approx(-0.6, abs=1e-5)
    assert high == pytest.approx(1.5, abs=1e-5)
    assert second.max() < 0.6 + 1e-5
    read = colloc.load(save(one_sided, tmp_path / "r.h5"))
    assert read.problem.joint_limit == ONE_SIDED
    assert read.problem.hash == one_sided.problem.hash


def test_mirrored_ranges_give_the_mirrored_gait(one_sided):
    limits = tuple((-high, -low) for low, high in ONE_SIDED)
    mirrored = colloc.solve(problem(limits, Harmonic(1, "bilateral")), starts=4)
    assert mirrored.efficiency == pytest.approx(one_sided.efficiency, rel=1e-6)


@pytest.mark.slow
def test_polygons_keep_both_sides_use_them_and_mirror():
    gait = colloc.Polygon(3, "bilateral")
    aside = Fourier([0.5, -0.5], [[0.9], [-0.9]], [[0.5], [0.5]])
    stated = Problem("paths", gait=gait, delta=1e-2, mesh_tolerance=1e-2, smallest_shape_speed=0.4)
    here = colloc.solve(stated.with_(joint_limit=((-1, 2), (-2, 1)), guess=aside), starts=1)
    other_way = stated.with_(joint_limit=((-2, 1), (-1, 2)), guess=aside.scaled(-1))
    there = colloc.solve(other_way, starts=1)
    assert here.success
    assert there.efficiency == pytest.approx(here.efficiency, rel=1e-9)
    first, second = here.gait.angles(np.linspace(0, 1, 4001))
    assert first.max() == pytest.approx(2.0, abs=1e-5)
    assert first.min() > -1.0 - 1e-5
    assert second.max() < 1.0 + 1e-5


def test_a_range_that_is_even_is_a_limit():
    assert problem(((-1, 1), 2.0)).joint_limit == problem((1.0, 2.0)).joint_limit


def efficiencies(A, n):
    """d/W of ellipses in rows (A0, A1, B1), by the midpoint rule; 0 where inadmissible."""
    t = (np.arange(n) + 0.5) / n
    c, s = np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)
    A0, A1, B1 = (A[:, k, None] for k in range(3))
    q = np.stack([A0 + A1 * c + B1 * s, -A0 - A1 * c + B1 * s])
    r = 2 * np.pi * np.stack([-A1 * s + B1 * c, A1 * s + B1 * c])
    shape = q.shape[1:]
    q, r = q.reshape(2, -1), r.reshape(2, -1)
    z = colloc.solve_balance(LYING, FRICTION, q, r, DRY).require().z
    now = instant(LYING, FRICTION, q, r, z, DRY)
    omega, power = z[2].reshape(shape), total_power(now.velocity, now.force)[0].reshape(shape)
    theta = (np.cumsum(omega, axis=1) - 0.5 * omega) / n
    cx, cy = (a[0].reshape(shape) for a in LYING.centre_velocity(now.posture, now.velocity))
    move = (np.exp(1j * theta) * (cx + 1j * cy)).sum(axis=1)
    value = np.abs(move) / power.sum(axis=1)
    outside = np.abs(A[:, 0]) + np.hypot(A[:, 1], A[:, 2]) > np.pi + 1e-12
    crossing = crossing_depth(LYING, q).reshape(shape).max(axis=1) > 0
    return np.where(outside | crossing, 0.0, value)


def swept_maximum(centre, width, n=120):
    """Value and point, over grids that shrink around their best point to a width of 1e-3."""
    centre = np.array(centre)
    while width > 2e-3:
        axis = np.linspace(-width, width, 7)
        grid = centre + np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
        # the joint limit is a curved edge of the admissible set: add points on it
        direction = grid[:, 1:] / np.hypot(grid[:, 1], grid[:, 2])[:, None]
        on_edge = np.column_stack([grid[:, 0], direction * (np.pi - np.abs(grid[:, 0]))[:, None]])
        near = np.abs(on_edge - centre).max(axis=1) <= width
        grid = np.concatenate([grid, on_edge[near]])
        centre = grid[np.argmax(efficiencies(grid, n))]
        width *= 0.35
    return efficiencies(centre[None], 960)[0], centre


@pytest.mark.parametrize(
    ("name", "around", "width"),
    [
        ("three_link", (0.05, 2.8, 1.35), 0.15),
        pytest.param("three_link_offset", (1.05, 0.7, 1.1), 0.15, marks=pytest.mark.slow),
        pytest.param("three_link_folded", (2.55, 0.38, 0.45), 0.06, marks=pytest.mark.slow),
    ],
)
def test_collocation_finds_the_maximum_of_a_grid_sweep(name, around, width, solved):
    solution, reference = solved(name)
    assert solution.status == "solved"
    value, point = swept_maximum(around, width)
    assert abs(solution.certificate.efficiency / value - 1) < 1e-4
    found = abs(solution.gait.mean[0]), solution.gait.cos[0, 0], solution.gait.sin[0, 0]
    np.testing.assert_allclose(found, np.abs(point), atol=0.02)
    assert abs(solution.certificate.efficiency - reference.efficiency) < reference.tolerance


def test_between_points_of_a_mesh_less_is_allowed_to_both_sides():
    limits = {"torque_limit": 0.05, "power_limit": 1.0}  # joints brake with any power
    stated = USUAL.with_(guess=colloc.ellipse(0.0, 2.0, 1.3), intervals=8, delta=1e-3, **limits)
    space, v = space_near(stated, stated.guess)
    program = ReducedProgram(space, stated.delta)
    excess, placed = program.place_rows(v), program.actuators
    at = stated.body, stated.friction, stated.guess, stated.delta
    largest = replay(*at, limits=stated.path_limits).shares.max()
    assert excess == pytest.approx(largest - 1, abs=1e-4)
    assert placed.upper.min() < 0.95
    np.testing.assert_array_equal(placed.lower[:2], -placed.upper[:2])
    assert np.isinf(placed.lower[2:]).all()
