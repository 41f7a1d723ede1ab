"""Joints that are no faster, at any instant, than their motors, and joints that bend farther to one
side than to the other; and optima against maxima of grid sweeps that this file does itself."""

import numpy as np
import pytest

import colloc
from colloc import Chain, Fourier, Friction, Harmonic, Polygon, Problem, load, save, solve
from colloc.mechanics.balance import instant, total_power
from colloc.mechanics.contact import crossing_depth
from tests.shared.cases import cases, slow_but

T = np.linspace(0, 1, 20001)
FAR = {"objective": "distance", "friction": Friction(mu_t=2, mu_f=1, mu_b=1.5)}


def fastest(solution):
    """Of every joint [rad per period]."""
    return np.abs(solution.gait.rates(T)).max(axis=1)


@pytest.fixture(scope="module")
def slow():
    return solve(Problem("slow", gait=Harmonic(1, "bilateral"), speed_limit=12), starts=4)


CASES = """
harmonics: gait=Harmonic(2, "bilateral"), speed_limit=(8.0, 8.0), delta=1e-2, **FAR
splines: gait=BSpline(8, symmetry="bilateral"), speed_limit=8.0, **FAR
serpenoid: gait=Serpenoid(1), speed_limit=3.0, body=Chain((0.2,) * 5), friction=ROUGH, delta=1e-2
inertia: gait=Harmonic(1, "antipodal"), speed_limit=10.0, froude=0.05
slope: gait=Harmonic(1), speed_limit=6.0, grade=0.05, friction=UNEVEN, objective="distance"
"""
ROUGH, UNEVEN = Friction(mu_t=3), Friction(mu_t=3, mu_f=1, mu_b=1.5)
CASES = cases(CASES, globals())


@pytest.mark.parametrize("case", slow_but(["harmonics", "serpenoid"], CASES))
def test_the_fastest_instants_are_as_fast_as_allowed(case):
    """Also between the points of the mesh, of any class paced by time, and of motions with
    states."""
    found = solve(Problem("limited", **CASES[case]), starts=1)
    assert found.status == "solved"
    share = fastest(found) / np.broadcast_to(found.problem.speed_limit, found.problem.body.n_joint)
    assert share.max() == pytest.approx(1.0, abs=1e-5)


@pytest.mark.slow
def test_a_flat_top_that_the_second_round_comes_back_to_is_no_end():
    """Instants that move far make the first round overshoot; the rounds that follow them settle."""
    asked = {"speed_limit": (7, 11), "objective": "distance"}
    stated = Problem("flat", gait=Harmonic(2), delta=1e-2, mesh_tolerance=1e-3, **asked)
    assert solve(stated, starts=1).status == "solved"


def test_a_certificate_fails_a_gait_that_is_too_fast(slow):
    checked = {c.name: c for c in slow.certificate.checks}
    assert checked["joint speed"].passed
    tighter = colloc.evaluate(slow.problem.with_(speed_limit=11.9, guess=None), slow.gait)
    check = next(c for c in tighter.certificate.checks if c.name == "joint speed")
    assert check.value == pytest.approx(12 / 11.9 - 1, rel=1e-3)
    assert not check.passed


LAW = Friction(mu_t=3, mu_f=1, mu_b=1)
ONE_SIDED = ((-0.6, 1.5), (-1.5, 0.6))


def problem(joint_limit, gait=None, **changes):
    stated = {"friction": LAW, "gait": gait or Harmonic(1), "delta": 1e-3, "mesh_tolerance": 1e-4}
    return Problem("ranges", joint_limit=joint_limit, **(stated | changes))


@pytest.fixture(scope="module")
def one_sided():
    return solve(problem(ONE_SIDED, Harmonic(1, "bilateral")), starts=4)


def test_the_answer_keeps_both_sides_and_uses_one(one_sided, tmp_path):
    assert one_sided.success
    first, second = one_sided.gait.angles(np.linspace(0, 1, 4001))
    low, high = first.min(), first.max()
    assert low == pytest.approx(-0.6, abs=1e-5)
    assert high == pytest.approx(1.5, abs=1e-5)
    assert second.max() < 0.6 + 1e-5
    read = load(save(one_sided, tmp_path / "r.h5"))
    assert read.problem.joint_limit == ONE_SIDED
    assert read.problem.hash == one_sided.problem.hash


def test_mirrored_ranges_give_the_mirrored_gait(one_sided):
    mirrored = solve(
        problem(tuple((-high, -low) for low, high in ONE_SIDED), Harmonic(1, "bilateral")), starts=4
    )
    assert mirrored.efficiency == pytest.approx(one_sided.efficiency, rel=1e-6)


@pytest.mark.slow
def test_polygons_keep_both_sides_use_them_and_mirror():
    gait = Polygon(3, "bilateral")
    aside = Fourier([0.5, -0.5], [[0.9], [-0.9]], [[0.5], [0.5]])
    stated = Problem("paths", gait=gait, delta=1e-2, mesh_tolerance=1e-2, smallest_shape_speed=0.4)
    here = solve(stated.with_(joint_limit=((-1, 2), (-2, 1)), guess=aside), starts=1)
    there = solve(stated.with_(joint_limit=((-2, 1), (-1, 2)), guess=aside.scaled(-1.0)), starts=1)
    assert here.success
    assert there.efficiency == pytest.approx(here.efficiency, rel=1e-9)
    first, second = here.gait.angles(np.linspace(0, 1, 4001))
    assert first.max() == pytest.approx(2.0, abs=1e-5)
    assert first.min() > -1.0 - 1e-5
    assert second.max() < 1.0 + 1e-5


def test_a_range_that_is_even_is_a_limit():
    assert problem(((-1, 1), 2.0)).joint_limit == problem((1.0, 2.0)).joint_limit


DELTA = 1e-4
BODY, FRICTION = Chain(), Friction()


def efficiencies(A, n):
    """d/W of ellipses, one per row (A0, A1, B1), by the midpoint rule on the whole period; 0 where
    inadmissible."""
    t = (np.arange(n) + 0.5) / n
    c, s = np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)
    A0, A1, B1 = (A[:, k, None] for k in range(3))
    q = np.stack([A0 + A1 * c + B1 * s, -A0 - A1 * c + B1 * s])
    r = 2 * np.pi * np.stack([-A1 * s + B1 * c, A1 * s + B1 * c])
    shape = q.shape[1:]
    q, r = q.reshape(2, -1), r.reshape(2, -1)
    z = colloc.solve_balance(BODY, FRICTION, q, r, DELTA).require().z
    now = instant(BODY, FRICTION, q, r, z, DELTA)
    omega, power = z[2].reshape(shape), total_power(now.velocity, now.force)[0].reshape(shape)
    theta = (np.cumsum(omega, axis=1) - 0.5 * omega) / n
    cx, cy = (a[0].reshape(shape) for a in BODY.centre_velocity(now.posture, now.velocity))
    move = (np.exp(1j * theta) * (cx + 1j * cy)).sum(axis=1)
    value = np.abs(move) / power.sum(axis=1)
    outside = np.abs(A[:, 0]) + np.hypot(A[:, 1], A[:, 2]) > np.pi + 1e-12
    crossing = crossing_depth(BODY, q).reshape(shape).max(axis=1) > 0
    return np.where(outside | crossing, 0.0, value)


def swept_maximum(centre, width, n=240):
    """Maximum over grids that shrink around their best point until they are 1e-3 wide; (value,
    point)."""
    centre = np.array(centre)
    while width > 2e-3:
        axis = np.linspace(-width, width, 7)
        grid = centre + np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
        # the joint limit is a curved edge of the admissible set: add points on it
        direction = grid[:, 1:] / np.hypot(grid[:, 1], grid[:, 2])[:, None]
        on_edge = np.column_stack([grid[:, 0], direction * (np.pi - np.abs(grid[:, 0]))[:, None]])
        near = np.abs(on_edge - centre).max(axis=1) <= width
        grid = np.concatenate([grid, on_edge[near]])
        value = efficiencies(grid, n)
        centre = grid[np.argmax(value)]
        width *= 0.35
    return efficiencies(centre[None], 4 * n)[0], centre


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


@pytest.mark.slow
def test_with_slow_joints_it_is_the_maximum_over_ellipses_that_are_small_enough():
    """Joints of one harmonic of amplitude a are at most 2 pi a fast: all that is swept is (A0, a,
    B1 / A1)."""
    speed = 12.0
    solution = solve(Problem("slow", gait=Harmonic(1, "bilateral"), speed_limit=speed), 4)
    centre, width = np.array([0.0, 0.8, 0.8]), np.array([1.5, 0.2, 0.7])
    while width[0] > 0.01:
        steps = np.linspace(-1, 1, 7)
        grid = centre + width * np.stack(np.meshgrid(*[steps] * 3), axis=-1).reshape(-1, 3)
        grid[:, 1] = np.minimum(grid[:, 1], 1.0)
        a, turn = grid[:, 1] * speed / (2 * np.pi), grid[:, 2]
        ellipses = np.column_stack([grid[:, 0], a * np.cos(turn), a * np.sin(turn)])
        value = efficiencies(ellipses, 240)
        best = int(np.argmax(value))
        centre, width = grid[best], 0.5 * width
    assert centre[1] == 1.0
    value = efficiencies(ellipses[[best]], 960)[0]
    assert solution.certificate.efficiency == pytest.approx(value, rel=1e-4)
