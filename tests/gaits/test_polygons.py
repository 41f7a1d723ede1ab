"""Polygons: symmetries, the way into their class, what does not depend on the pace; and optima at corners
of the contact region, at kinks and at the fold: certified."""

import numpy as np
import pytest

import colloc
from colloc import BSpline, Chain, Corners, Fourier, Friction, Harmonic, Polygon, Problem, ellipse
from colloc.gaits.gait import SYMMETRIES, GaitFunction, symmetric_samples
from colloc.gaits.harmonic import shift_phase
from colloc.gaits.starts import latin_hypercube_gait, warm_start
from colloc.mechanics.contact import crossing_depth, passing_depth
from colloc.results.solution import SOLVED
from colloc.search.iterate import evaluate_at, space_near
from colloc.search.optimise import refine
from colloc.search.solve import solve
from colloc.verification.replay import replay
from research.small_gaits import small_gait

TRIANGLE = Corners(np.array([[2.0, 2.9, 2.0], [-2.0, -2.0, -2.9]]))


@pytest.mark.parametrize(
    "gait", [TRIANGLE, ellipse(0.1, 2.0, 1.2), BSpline(6).member(np.linspace(-1, 1, 12), 2)]
)
def test_the_mirror_image_of_a_gait_is_one_of_its_class(gait):
    t = np.linspace(0, 1, 97)
    assert type(gait.mirrored) is type(gait)
    np.testing.assert_allclose(gait.mirrored.angles(t), -gait.angles(t), atol=1e-12)
    np.testing.assert_allclose(gait.mirrored.rates(t), -gait.rates(t), atol=1e-10)


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_harmonics_survive_the_way_through_points(symmetry):
    target = Harmonic(3, symmetry)
    gait = target.member(0.3 * np.random.default_rng(2).normal(size=target.size(2)), 2)

    class Opaque(GaitFunction):
        n_joint = 2
        angles, rates = staticmethod(gait.angles), staticmethod(gait.rates)

    back, t = target.through(Opaque()), np.linspace(0, 1, 50)
    np.testing.assert_allclose(back.angles(t), gait.angles(t), rtol=0, atol=1e-10)


def test_a_symmetric_gait_is_recognised_whatever_phase_it_starts_at():
    turned = ellipse(0.2, 1.3, 0.8)
    for phase in (0.0, 0.13, 0.5, 0.61):
        points = symmetric_samples(shift_phase(turned, phase), "bilateral")
        np.testing.assert_allclose(points[:, 0], -points[::-1, 0], atol=1e-6)
        half = turned.length / 2
        assert np.linalg.norm(np.diff(points), axis=0).sum() == pytest.approx(half, rel=1e-5)


def test_a_polygon_is_found_again_through_its_points_and_exactly_from_its_corners():
    square = Corners(np.array([[1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]]))
    for gait, kind in ((square, Polygon(4)), (TRIANGLE, Polygon(3, "bilateral"))):
        found = kind.member(kind.parameters(gait), 2)
        assert found.length == pytest.approx(gait.length, rel=0.02)
        again = kind.member(kind.parameters(found), 2)
        np.testing.assert_allclose(again.corners, found.corners, atol=1e-13)
    same = Polygon(4).member(Polygon(4).parameters(square), 2)
    np.testing.assert_allclose(same.corners, square.corners, atol=1e-13)


def test_a_polygon_is_a_spline_of_degree_1_whose_pace_does_not_matter():
    for symmetry in SYMMETRIES:
        kind = Polygon(6, symmetry)
        v, t = np.linspace(-1.0, 1.0, kind.size(2)) ** 3, np.linspace(0.0, 1.0, 101)
        gait, timed = kind.member(v, 2), kind.trajectory(v, 2)
        np.testing.assert_allclose(kind.project(timed), v, atol=1e-12)
        assert kind.relative_delta
        assert not BSpline(6, 2).relative_delta
        # angles linear in the parameters at a program's times are those of the gait at its phases
        part = t * kind.fraction
        angles = gait.angles(kind.phases(gait, part))
        np.testing.assert_allclose(angles, timed.angles(part), atol=1e-12)
        edges = kind.edges(24)
        np.testing.assert_allclose(kind.times(gait, kind.phases(gait, edges)), edges, atol=1e-12)
        assert np.ptp(np.linalg.norm(gait.rates(t), axis=0)) < 1e-9
        assert np.abs(edges[:, None] - kind.pieces).min(axis=0).max() < 1e-12


@pytest.mark.parametrize(
    ("corners", "axis"), [(3, "corner"), (4, "corner"), (4, "side"), (5, "corner"), (6, "side")]
)
def test_polygons_have_the_corners_and_the_symmetry_they_promise(corners, axis):
    kind, t = Polygon(corners, "bilateral", axis), np.linspace(0, 1, 20001)[:-1] + 1e-6
    gait = kind.member(kind.parameters(ellipse(0, 2.0, 1.2)), 2)
    heading = np.arctan2(*gait.rates(t)[::-1])
    turns = (heading - np.roll(heading, 1) + 1) % (2 * np.pi) - 1
    assert np.sum(np.abs(turns) > 1e-6) == corners
    assert (abs(turns[0]) > 1e-6) == (axis == "corner")  # where the axis first meets it
    np.testing.assert_allclose(gait.angles(-t), -gait.angles(t)[::-1], atol=1e-8)


def test_replay_of_the_small_triangle_reaches_two_fifths():
    """Joints moved one after the other and undone together: d = e/12, W = 5 e/24."""
    for c, e in ((2.2, 1e-3), (2.5, 1e-3)):
        gait = Corners(np.array([[c + e, c, c], [-c, -c, -c - e]]))
        assert gait.length == pytest.approx((2 + np.sqrt(2)) * e)
        delta = 1e-9 * gait.length
        result = replay(Chain(), Friction(), gait, delta, breaks=gait.corner_phases)
        assert result.efficiency == pytest.approx(0.4, rel=2e-3)
        assert result.distance == pytest.approx(e / 12, rel=2e-3)
        assert result.work == pytest.approx(5 * e / 24, rel=2e-3)


def test_replay_does_not_depend_on_the_pace_of_a_polygon():
    gait = Corners(np.array([[1.2, -0.8, -1.0], [1.0, 1.1, -1.3]]))

    def slow_at_corners(t):
        # phase s(t) with s' = 0 at the corners
        k = np.clip(np.searchsorted(gait.phases, t, side="right") - 1, 0, 2)
        begin, h = gait.phases[k], np.diff(gait.phases)[k]
        turn = 2 * np.pi * (t - begin) / h
        inside = np.clip(begin + h * (turn - np.sin(turn)) / (2 * np.pi), 1e-12, 1 - 1e-12)
        return gait.angles(inside), gait.rates(inside) * (1 - np.cos(turn))

    sharp = replay(Chain(), Friction(), gait, 1e-8, breaks=gait.corner_phases)
    smooth = replay(Chain(), Friction(), slow_at_corners, 1e-8, instants=3200)
    assert sharp.distance == pytest.approx(smooth.distance, rel=1e-5)
    assert sharp.work == pytest.approx(smooth.work, rel=1e-5)
    assert sharp.rotation == pytest.approx(smooth.rotation, abs=1e-5)


def test_delta_keeps_its_meaning_from_class_to_class():
    stated = Problem("p", ellipse(0, 1.5, 1.0), gait=Harmonic(1, "bilateral"), delta=1e-3)
    path = warm_start(stated, stated.guess, Polygon(4, "bilateral"))
    assert path.delta * stated.guess.length == pytest.approx(1e-3)
    back = warm_start(path, stated.guess, Harmonic(2, "bilateral"))
    assert back.delta == pytest.approx(1e-3)


def test_a_pair_of_closed_joints_that_travels_along_a_folded_chain_wastes_nothing_in_the_limit():
    """All are open by e but two neighbours: W = e/5, d = W (1 - e^2/24); none exceeds 1."""
    links = 5
    body, sign = Chain((1 / links,) * links), -((-1.0) ** np.arange(links - 1)[:, None])
    closed = [(), *((j, j + 1) for j in range(links - 2))]
    open_by = np.array([[0.0 if j in pair else 1.0 for pair in closed] for j in range(links - 1)])
    for e in (0.2, 0.1):
        gait = Corners(sign * (np.pi - e * open_by))
        how = {"instants": 800, "tolerance": 1e-4, "breaks": gait.corner_phases}
        fine = replay(body, Friction(), gait, 1e-7 * gait.length, **how)
        assert fine.rotation == pytest.approx(0, abs=1e-12)
        assert fine.work == pytest.approx(e / links, rel=1e-8)
        assert 1 - fine.efficiency == pytest.approx(e**2 / 24, rel=0.02)
        angles = gait.angles(np.linspace(0, 1, 4001))
        assert crossing_depth(body, angles).max() < 1e-12
        assert passing_depth(body, angles) < 1e-12


def from_start(start, friction, symmetry, **fields):
    stated = {"gait": Harmonic(1, symmetry), "delta": 1e-4, "delta_start": 0.1} | fields
    problem = Problem("case", ellipse(0.0, 1.0, 0.5), friction=friction, **stated)
    return problem.with_(guess=latin_hypercube_gait(problem, 0, start))


def test_an_optimum_that_rounds_the_corner_of_the_contact_region_is_certified():
    """The fourth maximum of the paper's sweep, 0.1240; fixed instants ended 6e-3 rad inside."""
    solution = solve(from_start(2, Friction(), "antipodal", intervals=20), 1)
    assert solution.status == "solved", solution.message
    assert solution.certificate.efficiency == pytest.approx(0.1240, abs=1e-4)
    # it does round the corner: both sums of the angles are near pi at once
    a, b = solution.gait.angles(np.linspace(0, 1, 20001))
    assert np.min(np.maximum(np.abs(b + a / 2 - np.pi), np.abs(a + b / 2 - np.pi))) < 5e-3


@pytest.mark.slow
def test_refinement_encloses_a_kink_instead_of_following_it():
    """Five meshes, each with its knot moved after the kink, had ended at an error of 3.1e-5."""
    first = solve(from_start(6, Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3), "none", intervals=40), 1)
    problem = first.problem.with_(guess=first.gait, delta=1e-6, delta_start=4e-3)
    solution = solve(problem, 1)
    assert solution.status == "solved", solution.message
    checks = {check.name: check for check in solution.certificate.checks}
    assert checks["mesh error"].value < 2e-5
    assert len({step.intervals for step in solution.history}) <= 4


@pytest.mark.slow
def test_a_gait_that_rests_on_a_kink_is_certified_and_said_to():
    """Nearest to it, no gradient is below 1e-3; those of both sides cancel. Rounding
    decides which starts settle there: two of thirty did not, and there is one of 0.4469."""
    body, friction = Chain((0.2, 0.5, 0.3)), Friction(mu_t=0.5, mu_f=1.0, mu_b=5.0)
    gait_at_kink = Fourier(
        mean=[0.296, -0.3171],
        cos=[[0.4153, -0.0582, -0.0081], [-0.0938, -0.1365, -0.0073]],
        sin=[[0.0, -0.0786, 0.0409], [0.3417, 0.0153, -0.0484]],
    )
    problem = Problem("kink", None, body, friction, Harmonic(3), delta=1e-4)
    factors = (1.0, 1.000001, 1.000003, 1.000005)
    solutions = [solve(problem.with_(guess=gait_at_kink.grown(each)), 1) for each in factors]
    certified = [each for each in solutions if each.status == "solved"]
    assert len(certified) >= 2, [each.message for each in solutions]
    ends = [(each.certificate.efficiency, "kink" in each.message) for each in certified]
    assert any(is_kink and abs(value - 0.4162) < 2e-4 for value, is_kink in ends)
    assert min(ends)[0] > 0.416


def test_a_gait_whose_finer_mesh_has_no_balance_is_kept_and_says_so(monkeypatch):
    def fails(*_):
        raise colloc.NotConvergedError("the balance did not converge.")

    gait = ellipse(A0=0, A1=2.8, B1=1.3)
    problem = Problem("coarse", gait, gait=Harmonic(1, "bilateral"), intervals=8)
    found = evaluate_at(*space_near(problem, gait), problem.delta)
    monkeypatch.setattr("colloc.search.optimise.optimise", fails)
    kept = refine(found)
    np.testing.assert_array_equal(kept.v, found.v)
    assert kept.message == "Refinement ended, as on a finer mesh: the balance did not converge."


def test_a_quadrilateral_at_the_fold_beats_every_symmetric_one_known():
    corners = np.array([[3.1416, 3.13, 3.13, 3.05], [-0.15, 0.0, 0.12, 0.12]])
    corners[0] = np.minimum(corners[0], np.pi)
    problem = Problem("fold", Corners(corners), gait=Polygon(4), intervals=24, delta_start=1e-3)
    solution = solve(problem, 1)
    assert solution.status == "solved"
    assert solution.certificate.efficiency > 0.44
    assert np.abs(solution.gait.corners).max() == pytest.approx(np.pi, abs=1e-6)
    assert solution.gait.length == pytest.approx(2 * np.pi * problem.smallest_shape_speed, rel=1e-6)


def test_ipopt_alone_refines_the_mesh_of_a_polygon_just_until_the_replay_is_as_near_as_asked():
    """Delta is relative to the shape speed: with another one a mesh that will do is refined."""
    coarsely = {"delta": 0.02, "intervals": 8, "scheme": "gauss-1"}
    stated = Problem("path", ellipse(1.0, 0.7, 1.1), gait=Polygon(4, "bilateral"), **coarsely)
    for tolerance, meshes in ((1e-3, 1), (1e-4, 2)):
        found = solve(stated.with_(mesh_tolerance=tolerance), search="full")
        (error,) = [check for check in found.certificate.checks if check.name == "mesh error"]
        assert error.passed
        assert len(found.history) == meshes


@pytest.mark.slow
def test_triangles_at_the_fold_approach_the_best_infinitesimal_gait_in_proportion_to_their_length():
    limit = small_gait(Chain(), Friction(), np.array([np.pi, 0.0])).efficiency
    shortfalls = []
    for speed in (0.1, 0.04):
        shape, length = np.array([3.0, -0.03]), 2 * np.pi * speed
        guess = Corners(small_gait(Chain(), Friction(), shape).path(shape, 1.1 * length))
        small = {"smallest_shape_speed": speed, "delta": 1e-3 * speed, "delta_start": 0.1 * speed}
        solution = solve(Problem("small", guess, gait=Polygon(3), intervals=30, **small), 1)
        assert solution.status == SOLVED
        assert solution.gait.length == pytest.approx(length, rel=1e-3)
        shortfalls.append((limit - solution.certificate.efficiency) / length)
    assert 0.4560 < limit < 0.4563
    assert shortfalls[1] == pytest.approx(shortfalls[0], rel=0.15)
