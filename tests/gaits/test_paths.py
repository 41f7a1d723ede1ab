"""Gaits given by their path: arcs, polygons, symmetries, prolongation from class to class, and what
is refused."""

import numpy as np
import pytest

from colloc import (
    ArcPath,
    BSpline,
    Chain,
    Corners,
    Fourier,
    FreePath,
    Friction,
    Harmonic,
    Polygon,
    Problem,
    ellipse,
)
from colloc.gaits.harmonic import shifted
from colloc.gaits.path_samples import (
    corners_through,
    graded_edges,
    path_length,
)
from colloc.gaits.starts import prolonged
from colloc.gaits.symmetry import SYMMETRIES, symmetric_samples
from colloc.mechanics.contact import crossing_depth, passing_depth
from colloc.numerics.arcs import advance, direction
from colloc.search.spaces import nearest_parameters, transcribed
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.verification.replay import replay

TRIANGLE = Corners(np.array([[2.0, 2.9, 2.0], [-2.0, -2.0, -2.9]]))


def unit_vectors(rng, n, spread):
    a = rng.normal(size=(n, 6))
    a /= np.linalg.norm(a, axis=0)
    b = a + spread * rng.normal(size=a.shape)
    return a, b / np.linalg.norm(b, axis=0)


@pytest.mark.parametrize("n_joint", [2, 3, 5])
@pytest.mark.parametrize("spread", [1e-7, 1e-3, 0.02, 0.05, 0.5])
def test_an_arc_is_the_integral_of_its_unit_tangent_and_turns_evenly(n_joint, spread):
    rng = np.random.default_rng(0)
    if n_joint == 2:
        t0 = rng.normal(size=(1, 6))
        t1 = t0 + spread * rng.normal(size=(1, 6))
    else:
        t0, t1 = unit_vectors(rng, n_joint, spread)
    tau = rng.uniform(size=(1, 6))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    integral = sum(
        0.5 * w * tau * direction(t0, t1, 0.5 * (x + 1) * tau)
        for x, w in zip(nodes, weights, strict=True)
    )
    np.testing.assert_allclose(advance(t0, t1, tau), integral, rtol=0, atol=1e-14)
    np.testing.assert_allclose(
        np.linalg.norm(direction(t0, t1, tau), axis=0), 1, rtol=0, atol=1e-14
    )
    # the angle from the start is tau times the whole
    start, here, end = (
        direction(t0, t1, np.full((1, 6), x)) if np.isscalar(x) else direction(t0, t1, x)
        for x in (0.0, tau, 1.0)
    )
    angle = [2 * np.arcsin(0.5 * np.linalg.norm(b - start, axis=0)) for b in (here, end)]
    np.testing.assert_allclose(angle[0], tau[0] * angle[1], rtol=0, atol=1e-14)


def member(symmetry, curvature=4.0, n=16, body=None):
    """A path of the class near an ellipse."""
    guess = (
        ellipse(0, 2.0, 1.2)
        if body is None
        else Fourier(np.zeros(3), [[1.2], [0.2], [-1.2]], [[0.7], [1.0], [0.7]])
    )
    problem = Problem(
        "p", guess, body=body or Chain(), gait=FreePath(curvature, symmetry), intervals=n
    )
    program = transcribed(problem)
    return program.member(nearest_parameters(program, guess))


@pytest.mark.parametrize("symmetry", SYMMETRIES)
@pytest.mark.parametrize("body", [None, Chain((0.25,) * 4)])
def test_a_free_path_closes_smoothly_at_unit_shape_speed_with_its_symmetry(symmetry, body):
    path = member(symmetry, body=body)
    assert path.edges[-1] == (1.0 if symmetry == "none" else 0.5)
    t = np.linspace(-0.7, 1.9, 5000)
    rates = path.rates(t)
    np.testing.assert_allclose(np.linalg.norm(rates, axis=0), path.length, rtol=1e-7)
    h = 1e-6
    np.testing.assert_allclose(
        (path.angles(t + h) - path.angles(t - h)) / (2 * h), rates, atol=2e-3 * path.length
    )
    # no jump of angles or tangents anywhere, at the ends and in the middle of the period least of
    # all
    assert np.abs(np.diff(path.angles(t))).max() < 1.01 * path.length * (t[1] - t[0])
    assert np.linalg.norm(np.diff(rates), axis=0).max() < 4.0 * (1 + 1e-6) * path.length**2 * (
        t[1] - t[0]
    )
    if symmetry == "bilateral":
        np.testing.assert_allclose(path.angles(-t), -path.angles(t)[::-1], atol=1e-8)
    if symmetry == "antipodal":
        np.testing.assert_allclose(path.angles(t + 0.5), -path.angles(t), atol=1e-8)


@pytest.mark.parametrize("body", [None, Chain((0.25,) * 4)])
def test_a_path_is_the_member_of_its_parameters_the_first_of_which_is_its_shape_speed(body):
    path, kind = member("antipodal", body=body), FreePath(4.0, "antipodal")
    v = kind.parameters(path)
    assert v.size == kind.size(path.n_joint, path.edges.size - 1)
    assert v[0] == pytest.approx(path.shape_speed)
    again, t = kind.member(v, path.n_joint, path.edges), np.arange(100) / 100
    np.testing.assert_allclose(again.angles(t), path.angles(t), rtol=0, atol=1e-14)
    np.testing.assert_allclose(again.rates(t), path.rates(t), rtol=0, atol=1e-12)


def test_part_of_a_period_has_that_part_of_the_intervals_and_a_dense_search_some_250_numbers():
    for kind in (lambda s: FreePath(symmetry=s), lambda s: Harmonic(3, s)):
        whole, half = kind("none"), kind("antipodal")
        assert whole.intervals(2) == 2 * half.intervals(2)
    path, half = FreePath(), FreePath(symmetry="antipodal")
    assert 0 < 2 * half.coarse_intervals(2) == path.coarse_intervals(2) < 0.5 * path.intervals(2)
    assert [each * path.most_arcs(n) for n, each in ((2, 1), (5, 5), (10, 10))] == [250] * 3


def test_finer_arcs_are_the_same_path():
    path = member("bilateral")
    edges = np.sort(np.concatenate([path.edges, 0.3 * path.edges[1:] + 0.7 * path.edges[:-1]]))
    t = np.random.default_rng(0).uniform(size=200)
    np.testing.assert_allclose(path.resampled(edges).angles(t), path.angles(t), atol=1e-9)


@pytest.mark.parametrize(
    "gait",
    [
        TRIANGLE,
        member("none"),
        member("antipodal", body=Chain((0.25,) * 4)),
        ellipse(0.1, 2.0, 1.2),
        BSpline(6).member(np.linspace(-1, 1, 12), 2),
    ],
)
def test_the_mirror_image_of_a_gait_is_one_of_its_class(gait):
    t = np.linspace(0, 1, 97)
    assert type(gait.mirrored) is type(gait)
    np.testing.assert_allclose(gait.mirrored.angles(t), -gait.angles(t), atol=1e-12)
    np.testing.assert_allclose(gait.mirrored.rates(t), -gait.rates(t), atol=1e-10)


def test_a_sharp_guess_is_bent_back_to_the_curvature_allowed():
    problem = Problem("p", TRIANGLE, gait=FreePath(3.0, "bilateral"), intervals=24)
    program = transcribed(problem)
    path = program.member(nearest_parameters(program, TRIANGLE))
    assert np.abs(path.curvatures()).max() < 3.0 * (1 + 1e-7)
    assert path.length > 2 * np.pi / 3.0
    assert abs(path.winding) == 1
    with pytest.raises(NotConvergedError, match="curvature"):
        # a circle of curvature 0.3 does not fit between the joint limits
        nearest_parameters(transcribed(problem.with_(gait=FreePath(0.2, "bilateral"))), TRIANGLE)


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_harmonics_survive_the_way_through_points(symmetry):
    rng = np.random.default_rng(2)
    drawn = Fourier(
        0.3 * rng.normal(size=2), 0.3 * rng.normal(size=(2, 3)), 0.3 * rng.normal(size=(2, 3))
    )
    target = Harmonic(3, symmetry)
    gait = target.fourier(target.parameters(drawn), 2)

    class Opaque:
        n_joint, delta_unit = 2, 1.0
        angles, rates = staticmethod(gait.angles), staticmethod(gait.rates)

    back = target.through(Opaque())
    t = np.linspace(0, 1, 50)
    np.testing.assert_allclose(back.angles(t), gait.angles(t), rtol=0, atol=1e-10)


def test_a_symmetric_gait_is_recognised_whatever_phase_it_starts_at():
    turned = ellipse(0.2, 1.3, 0.8)
    for phase in (0.0, 0.13, 0.5, 0.61):
        points = symmetric_samples(shifted(turned, phase), "bilateral")
        np.testing.assert_allclose(points[:, 0], -points[::-1, 0], atol=1e-6)
        half = path_length(turned) / 2
        assert np.linalg.norm(np.diff(points), axis=0).sum() == pytest.approx(half, rel=1e-5)


def test_a_polygon_is_found_again_through_its_points():
    square = Corners(np.array([[1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]]))
    found = corners_through(square, Polygon(4))
    np.testing.assert_allclose(np.sort(found.corners), np.sort(square.corners), atol=0.02)
    np.testing.assert_allclose(
        corners_through(TRIANGLE, Polygon(3, "bilateral")).length, TRIANGLE.length, rtol=0.02
    )


@pytest.mark.parametrize(
    ("corners", "axis"), [(3, "corner"), (4, "corner"), (4, "side"), (5, "corner"), (6, "side")]
)
def test_polygons_have_the_corners_and_the_symmetry_they_promise(corners, axis):
    problem = Problem(
        "p", ellipse(0, 2.0, 1.2), gait=Polygon(corners, "bilateral", axis), intervals=40
    )
    program = transcribed(problem)
    gait = program.member(nearest_parameters(program, problem.guess))
    t = np.linspace(0, 1, 20001)[:-1] + 1e-6
    heading = np.unwrap(np.arctan2(*gait.rates(t)[::-1]))
    turns = np.abs(
        np.diff(np.append(heading, heading[0] + 2 * np.pi * np.sign(heading[-1] - heading[0])))
    )
    assert np.sum(turns > 1e-6) == corners
    np.testing.assert_allclose(gait.angles(-t), -gait.angles(t)[::-1], atol=1e-8)


def test_replay_of_the_small_triangle_reaches_two_fifths():
    """Joints moved one after the other and undone together: d = e/12, W = 5 e/24 (design notes,
    section 5)."""
    for c, e in ((2.2, 1e-3), (2.5, 1e-3)):
        gait = Corners(np.array([[c + e, c, c], [-c, -c, -c - e]]))
        assert gait.length == pytest.approx((2 + np.sqrt(2)) * e)
        result = replay(
            Chain(),
            Friction(),
            lambda t, g=gait: (g.angles(t), g.rates(t)),
            1e-9 * gait.length,
            breaks=gait.corner_phases,
        )
        assert result.efficiency == pytest.approx(0.4, rel=2e-3)
        assert result.distance == pytest.approx(e / 12, rel=2e-3)
        assert result.work == pytest.approx(5 * e / 24, rel=2e-3)


def test_replay_does_not_depend_on_the_pace_of_a_polygon():
    gait = Corners(np.array([[1.2, -0.8, -1.0], [1.0, 1.1, -1.3]]))

    def slow_at_corners(t):
        # phase s(t) with s' = 0 at the corners
        breaks = gait.phases
        k = np.clip(np.searchsorted(breaks, t, side="right") - 1, 0, 2)
        h = np.diff(breaks)[k]
        x = (t - breaks[k]) / h
        inside = np.clip(
            breaks[k] + h * (x - np.sin(2 * np.pi * x) / (2 * np.pi)), 1e-12, 1 - 1e-12
        )
        return gait.angles(inside), gait.rates(inside) * (1 - np.cos(2 * np.pi * x))

    sharp = replay(
        Chain(),
        Friction(),
        lambda t: (gait.angles(t), gait.rates(t)),
        1e-8,
        breaks=gait.corner_phases,
    )
    smooth = replay(Chain(), Friction(), slow_at_corners, 1e-8, instants=3200)
    assert sharp.distance == pytest.approx(smooth.distance, rel=1e-5)
    assert sharp.work == pytest.approx(smooth.work, rel=1e-5)
    assert sharp.rotation == pytest.approx(smooth.rotation, abs=1e-5)


def test_a_graded_mesh_puts_intervals_where_the_path_turns():
    edges = graded_edges(TRIANGLE, FreePath(16.0, "bilateral"), 40)
    assert (edges[0], edges[-1]) == (0.0, 0.5)
    assert (np.diff(edges) > 0).all()
    corner = TRIANGLE.phases[1]
    near = np.abs(edges - corner) < 0.05
    assert near.sum() > 3 * np.sum(np.abs(edges - 0.5 * corner) < 0.05)
    circle = graded_edges(ellipse(0, np.sqrt(2), np.sqrt(2)), FreePath(4.0), 40)
    np.testing.assert_allclose(np.diff(circle), 1 / 40, rtol=0.01)


def test_delta_keeps_its_meaning_from_class_to_class():
    stated = Problem("p", ellipse(0, 1.5, 1.0), gait=Harmonic(1, "bilateral"), delta=1e-3)
    path = prolonged(stated, stated.guess, FreePath(4.0, "bilateral"))
    assert path.delta * path_length(stated.guess) == pytest.approx(1e-3)
    back = prolonged(path, stated.guess, Harmonic(2, "bilateral"))
    assert back.delta == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("gait", "changes", "words"),
    [
        (FreePath(4.0), {"scheme": "trapezoid"}, "gauss-N or radau-N"),
        (FreePath(4.0), {"intervals": 2}, "mesh is too small"),
        (Polygon(6), {"intervals": 8}, "mesh is too small"),
        (
            FreePath(4.0),
            {"body": Chain((0.5, 0.5)), "guess": Fourier([0.0], [[1.0]], [[0.0]])},
            "three links",
        ),
        (FreePath(4.0), {"guess": Corners(np.array([[0.1, -0.1], [0.0, 0.0]]))}, "hardly moves"),
        (FreePath(4.0, "bilateral"), {"body": Chain((0.2, 0.3, 0.5))}, "both ends"),
    ],
)
def test_unusable_problems_are_refused_in_words(gait, changes, words):
    with pytest.raises(ProblemError, match=words):
        Problem("p", **({"guess": ellipse(0, 1.5, 1.0), "gait": gait} | changes))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: FreePath(0.0), "curvature"),
        (lambda: FreePath(4.0, "threefold"), "symmetry"),
        (lambda: FreePath(4.0, "antipodal", 2), "odd"),
        (lambda: FreePath(4.0, winding=0.5), "whole number"),
        (lambda: Polygon(1), "corners"),
        (lambda: Polygon(5, "antipodal"), "even"),
        (lambda: Polygon(4, "bilateral", "edge"), "axis"),
        (lambda: Corners(np.array([[1.0, 1.0], [0.0, 0.0]])), "equal neighbours"),
        (lambda: Corners("triangle"), "numbers"),
        (lambda: ArcPath([0, 0.5], np.zeros((2, 2)), np.zeros((1, 2)), 1.0), "ascend"),
        (lambda: ArcPath([0, 1.0], np.zeros((2, 2)), np.zeros((2, 2)), 1.0), "disagree"),
    ],
)
def test_unusable_classes_and_gaits_are_refused_in_words(make, words):
    with pytest.raises(ProblemError, match=words):
        make()


def test_problems_of_every_class_survive_their_description():
    for gait, guess in (
        (FreePath(4.0, "bilateral", 1), TRIANGLE),
        (Polygon(4, "bilateral", "side"), member("bilateral")),
    ):
        problem = Problem("p", guess, gait=gait, intervals=40)
        again = Problem.from_dict(problem.to_dict())
        assert again.hash == problem.hash
        assert again.gait == gait
        assert again.delta_start == 0.01


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_the_certificate_sees_a_path_that_does_not_join(symmetry):
    path = member(symmetry)
    assert path.largest_jump() < 1e-9
    shapes = path.shapes.copy()
    shapes[:, 5] += [3e-6, 4e-6]
    assert ArcPath(
        path.edges, shapes, path.tangents, path.length, symmetry
    ).largest_jump() == pytest.approx(5e-6, rel=1e-3)
    if (
        symmetry == "bilateral"
    ):  # arcs are drawn from their starts: the last shape is drawn by nobody, so its arc is bent
        tangents = path.tangents + 1e-5 * (np.arange(path.edges.size) == path.edges.size - 1)
        assert (
            ArcPath(path.edges, path.shapes, tangents, path.length, symmetry).largest_jump() > 1e-7
        )


@pytest.mark.parametrize("way", [1, -1])
def test_a_circle_of_arcs_has_one_curvature_and_winds_once_its_way(way):
    turn = np.linspace(0, 1, 8) ** 2 * 2 * np.pi * way
    circle = ArcPath(
        turn / turn[-1],
        0.5 * np.array([np.cos(turn), np.sin(turn)]),
        turn[None] + way * np.pi / 2,
        np.pi,
    )
    assert circle.largest_jump() < 1e-14
    np.testing.assert_allclose(circle.curvatures(), 2 * way)
    assert circle.largest_curvature() == pytest.approx(2)
    assert circle.winding == way
    for allowed, beyond in ((1.6, 0.25), (2.5, 0.0)):
        checks = {name: value for name, value, *_ in FreePath(allowed).own_checks(circle)}
        assert checks == {"joins": circle.largest_jump(), "curvature": pytest.approx(beyond)}


def test_a_pair_of_closed_joints_that_travels_along_a_folded_chain_wastes_nothing_in_the_limit():
    """All joints are open by e but two neighbours, which are folded: W = e/5, d = W (1 - e^2/24).
    No gait exceeds 1."""
    links = 5
    body, sign = (
        Chain((1 / links,) * links),
        np.array([[(-1.0) ** (j + 1)] for j in range(links - 1)]),
    )
    closed = [(), *((j, j + 1) for j in range(links - 2))]
    open_by = np.array([[0.0 if j in pair else 1.0 for pair in closed] for j in range(links - 1)])
    for e in (0.2, 0.1):
        gait = Corners(sign * (np.pi - e * open_by))
        fine = replay(body, Friction(), lambda t, g=gait: (g.angles(t), g.rates(t)),
        1e-7 * gait.length, instants=800,
                      tolerance=1e-4, breaks=gait.phases[1:-1])  # fmt: skip
        assert fine.rotation == pytest.approx(0, abs=1e-12)
        assert fine.work == pytest.approx(e / links, rel=1e-8)
        assert 1 - fine.efficiency == pytest.approx(e**2 / 24, rel=0.02)
        angles = gait.angles(np.linspace(0, 1, 4001))
        assert crossing_depth(body, angles).max() < 1e-12
        assert passing_depth(body, angles) < 1e-12
