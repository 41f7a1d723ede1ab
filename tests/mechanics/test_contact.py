"""Admissible shapes of lines and strips: smooth bounds against segments and points; self-contact of all
pairs in chains of 2 to 8 links, and the two-link body."""

from contextlib import nullcontext
from dataclasses import replace
from itertools import product

import casadi as ca
import numpy as np
import pytest

from colloc import Chain, Fourier, Harmonic, Problem, ellipse, replay, solve
from colloc.bounds.motions import admissible
from colloc.dynamics.control_problem import control_problem
from colloc.mechanics import contact as touching
from colloc.mechanics.contact import crossing_depth, far_pairs, overlapping_pairs, passing_depth
from colloc.search.optimise import crossing_pairs, last_free
from colloc.transcription.full_program import FullProgram
from colloc.transcription.shape_constraints import near_peaks, shape_checks
from tests.shared.mechanics import numpy_instead
from tests.shared.stages import program_of

AROUND_THE_CORNER = Fourier(np.zeros(2), np.array([[2.877], [0.172]]), np.array([[0.0], [-2.872]]))
"""A gait that rounds the shape (2 pi/3, 2 pi/3), where the first end passes the third link, within
2e-3 rad."""


@pytest.mark.parametrize(
    "lengths",
    [(1 / 3, 1 / 3, 1 / 3), (0.5, 0.3, 0.2), (0.2, 0.3, 0.5), (0.25, 0.5, 0.25), (0.3, 0.4, 0.3)],
)
def test_bounds_never_allow_a_crossing_and_forbid_little_else(lengths):
    body = Chain(lengths)
    rng = np.random.default_rng(1)
    angles = rng.uniform(-np.pi, np.pi, (2, 40000))
    excess = np.max([each.excess(angles)[0] for each in body.contacts()], axis=0)
    allowed = excess <= 0
    crossing = crossing_depth(body, angles) > 0
    assert not np.any(allowed & crossing)
    exact = excess <= 0.5 * touching.SMOOTHING + 1e-9
    assert np.array_equal(exact[~allowed] | crossing[~allowed], np.ones((~allowed).sum(), bool))
    assert (crossing.mean() > 0.02) == (lengths[0] + lengths[2] > lengths[1])


def test_the_gap_between_links_is_that_of_their_points():
    body = Chain((0.2, 0.35, 0.15, 0.3))
    rng = np.random.default_rng(3)
    angles = rng.uniform(-np.pi, np.pi, (3, 200))
    part = np.linspace(0.0, 1.0, 201)
    ends = np.stack(body.joints(angles))
    points = [ends[:, k, :, None] * (1 - part) + ends[:, k + 1, :, None] * part for k in range(4)]
    # of link j, the end away from link i
    tips = {(i, j): 200 if j > i else 0 for i in range(4) for j in range(4)}

    def distance(i, j):
        other = points[j] if abs(i - j) > 1 else points[j][:, :, [tips[i, j]]]
        return np.hypot(*(points[i][:, :, :, None] - other[:, :, None, :])).min(axis=(1, 2))

    naive = np.min([distance(i, j) for i in range(4) for j in range(4) if i != j], axis=0)
    crossing = crossing_depth(body, angles) > 0
    wide = replace(body, width=0.149)
    lacks = crossing_depth(wide, angles) - crossing_depth(body, angles)
    assert crossing.any()
    np.testing.assert_allclose(lacks[crossing], wide.width, rtol=1e-14)
    known = np.maximum(wide.width - naive, 0.0)
    assert np.abs(lacks - known)[~crossing].max() < 0.35 / 200
    # what a search bounds, of every end and every link but its own
    assert len(touching.ends_and_links(wide)) == 4 * 3
    for end, link in touching.ends_and_links(wide):
        lacking, w = touching.lacking_width(wide, end, link).pair(angles)[0][0], wide.width
        naive = np.hypot(*(points[link] - ends[:, end, :, None])).min(axis=1)
        np.testing.assert_allclose(np.sqrt(w**2 - 2 * w * lacking), naive, atol=0.35 / 200)


def test_the_tangent_planes_of_the_minimum_lie_above_it_and_touch():
    rng = np.random.default_rng(2)
    first, second = rng.normal(size=(2, 500)) * 3 * touching.SMOOTHING
    share, step = touching.share_of_first(first, second), 1e-8
    least = touching.smooth_minimum(first, second)
    np.testing.assert_allclose(touching.tangent_of_minimum(first, second, share), least, atol=1e-15)
    other = touching.tangent_of_minimum(first, second, rng.permutation(share))
    assert np.all(other >= least - 1e-15)
    ahead, behind = (touching.smooth_minimum(first + side * step, second) for side in (1, -1))
    slope = (ahead - behind) / (2 * step)
    np.testing.assert_allclose(share, slope, atol=1e-6)


def corner_peak(gait):
    """The checks, the one at the corner, and instant and height of its peak, on 40 intervals."""
    problem = Problem(name="corner", guess=AROUND_THE_CORNER)
    checks = shape_checks(problem.body)
    mesh = control_problem(problem).mesh()
    which, _, times = near_peaks(Harmonic(1), gait.table, mesh, checks, np.pi, 0.0)
    mine = which == checks.names.index("links 1 and 3 (left)")
    values = checks.values(which[mine], gait.angles(times[mine]))
    return checks, which[mine][:1], times[mine][[np.argmax(values)]], values.max()


def test_the_peak_at_a_corner_is_that_of_dense_samples_and_a_held_share_follows_it_to_second_order():
    checks, corner, time, peak = corner_peak(AROUND_THE_CORNER)
    dense = AROUND_THE_CORNER.angles(time + np.linspace(-0.01, 0.01, 200_001))
    every = np.repeat(corner, dense.shape[1])
    assert checks.values(every, dense).max() == pytest.approx(peak, abs=1e-8)
    share = checks.shares(corner, AROUND_THE_CORNER.angles(time))
    assert 0.1 < share[0] < 0.9
    errors, blind = [], []
    for size in (1e-2, 5e-3, 2.5e-3):
        cos = AROUND_THE_CORNER.cos + size * np.array([[0.3], [-0.8]])
        moved = Fourier(np.zeros(2), cos, AROUND_THE_CORNER.sin)
        height, shape = corner_peak(moved)[3], moved.angles(time)
        errors.append(abs(checks.values(corner, shape, share)[0] - height))
        blind.append(height - checks.values(corner, shape)[0])
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((orders > 1.7) & (orders < 2.3))
    assert errors[-1] < 1e-5
    # without it the constraint at that instant falls behind the peak in proportion to the move
    assert min(blind) > 1e-4
    assert blind[0] > 3 * blind[-1]


@pytest.mark.parametrize("lengths", [(0.3, 0.2, 0.15, 0.35), (0.2, 0.2, 0.3, 0.1, 0.1, 0.1)])
@pytest.mark.parametrize("solver", [nullcontext, numpy_instead])
def test_all_contacts_at_once_have_the_values_and_slopes_of_each_by_itself(lengths, solver):
    body = Chain(lengths, width=0.02)
    checks, q = shape_checks(body, far_pairs(body), (2.0,)), ca.SX.sym("q", body.n_joint)
    which = np.repeat(np.arange(len(checks.names)), 5)
    shapes = np.random.default_rng(4).uniform(-2.0, 2.0, (body.n_joint, which.size))
    shares = np.resize([-1.0, 0.3], which.size)
    with solver():
        values = checks.values(which, shapes, shares)
        slopes = checks.slopes(which, shapes, shares)
    for k, contact in enumerate(body.contacts(far_pairs(body)), checks.n_angle):
        assert checks.names[k] == contact.name
        for t in np.flatnonzero(which == k):
            value = contact.held(q[list(contact.joints), :], shares[t])
            exact = ca.Function("f", [q], [value, ca.jacobian(value, q)])(shapes[:, t])
            assert values[t] == pytest.approx(float(exact[0]), abs=1e-13)
            np.testing.assert_allclose(slopes[:, t], exact[1].full()[0], atol=1e-10)
    angle, rate = which == 1, which == which[-1]
    assert np.array_equal(values[angle], shapes[1, angle])
    assert np.array_equal(values[rate], shapes[0, rate] / 2.0)


def test_links_of_equal_lengths_but_for_rounding_fold_up_like_equal_ones():
    folded = np.pi * np.array([[1.0, -1.0, 0.2], [0.3, 0.1, -1.0]])[:, np.repeat([0, 1, 2], 4)]
    which, alike = np.resize([2, 3], 12), []
    for middle in (1 / 3, np.nextafter(1 / 3, 1)):
        checks = shape_checks(Chain((1 / 3, middle, 1 / 3)))
        values = checks.values(which, folded)
        alike.append([values, *checks.slopes(which, folded, np.full(which.size, -1.0))])
    np.testing.assert_allclose(*alike, atol=1e-12)


def test_links_pass_each_other_where_any_end_changes_its_side_beside_another_link():
    body, rng, depths = Chain((0.2, 0.1, 0.3, 0.15, 0.25)), np.random.default_rng(9), []
    for shape in rng.uniform(-2.5, 2.5, (400, 4, 1)):
        angles = shape + rng.choice([0.2, 1.0]) * rng.normal(size=(4, 2))
        at, depth = np.array([1, 1j]) @ np.stack(body.joints(angles)).swapaxes(0, 1), 0.0
        for k, end in product(range(5), range(6)):
            if end not in (k, k + 1):
                seen = (at[end] - at[k]) / (at[k + 1] - at[k])
                beside = (seen.real > 0) & (seen.real < 1)
                if beside.all() and np.prod(seen.imag) < 0:
                    depth = max(depth, body.lengths[k] * np.abs(seen.imag).min())
        depths.append(depth)
        assert passing_depth(body, angles) == pytest.approx(depth, abs=1e-12)
    assert np.count_nonzero(depths) > 20


@pytest.mark.parametrize("width", [0.0, 0.02])
def test_pairs_cross_whose_ends_lie_on_both_sides_of_each_other(width):
    body = Chain((0.05, 0.2, 0.1, 0.15, 0.2, 0.1, 0.2), width=width)
    rng, found = np.random.default_rng(5), 0
    for angles in rng.uniform(-2.8, 2.8, (300, 6, 1)):
        at = (np.array([1, 1j]) @ np.stack(body.joints(angles))[..., 0]).ravel()

        def side(a, b, p, at=at):
            return np.sign(((at[b] - at[a]).conjugate() * (at[p] - at[a])).imag)

        crossed = {
            (i, j)
            for i, j in far_pairs(body)
            if side(i, i + 1, j) != side(i, i + 1, j + 1)
            and side(j, j + 1, i) != side(j, j + 1, i + 1)
        }
        pairs = overlapping_pairs(np.stack(body.joints(angles)), far_pairs(body), width, 0.0)
        assert crossed <= set(pairs) if width else crossed == set(pairs)
        assert all(crossing_depth(body, angles, [pair])[0] > 0 for pair in crossed)
        found += len(crossed)
    assert found > 50


@pytest.mark.parametrize("lengths", [(1 / 3,) * 3, (0.3, 0.2, 0.15, 0.35)], ids=len)
def test_a_body_in_a_mirror_meets_itself_on_the_other_side_as_deep(lengths):
    """And a contact is positive where, and only where, the links two apart cross."""
    body, rng = Chain(lengths), np.random.default_rng(8)
    angles = rng.uniform(-2.9, 2.9, (body.n_joint, 400))
    here, mirrored = (
        {near.name: near.pair(sign * angles) for near in body.contacts()} for sign in (1, -1)
    )
    for name, near in here.items():
        side, other = ("left", "right") if "left" in name else ("right", "left")
        np.testing.assert_allclose(near, mirrored[name.replace(side, other)], rtol=0, atol=1e-13)
    pairs = [(i, i + 2) for i in range(len(lengths) - 2)]
    crossed = np.max([np.minimum(*near) for near in here.values()], axis=0)[0] > 0
    deep = crossing_depth(body, angles, pairs)
    assert crossed[deep > 1e-9].all()
    assert deep[~crossed].max() == 0.0
    assert 0.05 < crossed.mean() < 0.95


@pytest.mark.parametrize("width", [0.01, 0.03, 0.2])
def test_a_joint_folds_until_the_free_end_lies_beside_its_neighbour(width):
    body, last = Chain(width=width), np.pi - np.arcsin(3 * width)
    folded = np.array([[last - 1e-6, last + 1e-6], [0.0, 0.0]])
    for shapes in (folded, -folded, folded[::-1]):
        assert np.array_equal(admissible(body, shapes), [True, False])
        assert np.array_equal(crossing_depth(body, shapes) > 0, [False, True])
    uneven = Chain((0.5, 0.3, 0.2), width=width * 0.9)  # of unequal neighbours the shorter decides
    last = np.pi - np.arcsin(uneven.width / 0.3)
    beside = np.array([[last - 1e-6, last + 1e-6], [0.0, 0.0]])
    assert np.array_equal(crossing_depth(uneven, beside) > 0, [False, True])


def test_without_a_width_nothing_is_different_and_two_links_never_cross():
    assert not Chain((0.5, 0.5)).contacts()
    assert np.array_equal(crossing_depth(Chain((0.5, 0.5)), np.array([[3.0, 0.0]])), [0.0, 0.0])
    assert Problem("lines", body=Chain(width=0.0)).hash == Problem("lines").hash
    assert "width" not in Problem("lines").to_dict()["body"]
    assert len(Chain().contacts()) == 2
    wide = Problem("strips", body=Chain(width=0.02))
    assert wide.hash != Problem("strips").hash
    assert Problem.from_dict(wide.to_dict()).body == Chain(width=0.02)


def test_the_best_folded_gait_keeps_its_width_and_pays_for_it():
    guess, width = ellipse(A0=2.4, A1=0.3, B1=0.5), 0.03
    at = {"gait": Harmonic(1, "bilateral"), "delta_start": 1e-3, "intervals": 12}
    problem = Problem("folded", guess, Chain(width=width), **at)
    wide = solve(problem, 1)
    assert wide.status == "solved"
    # as lines the links lie on each other, at 0.1030 (problems/three_link_folded.py)
    assert 0.09 < wide.certificate.efficiency < 0.098
    angles = wide.gait.angles(np.linspace(0.0, 1.0, 4001))
    assert np.max(np.abs(angles)) < np.pi - np.arcsin(width * 3) + 1e-6
    wider = Chain(width=width + 1e-4)
    assert crossing_depth(wider, angles).max() == pytest.approx(1e-4, abs=1e-6)


BODIES = [Chain((0.25,) * 4), Chain((0.1, 0.4, 0.2, 0.3)), Chain((0.2,) * 5), Chain((1 / 8,) * 8)]


def crossing(body, angles, i, j):
    """Plain intersection of two links, by solving for the point on both lines."""
    x, y = body.joints(angles)
    p, q = x[i] + 1j * y[i], x[j] + 1j * y[j]
    r, s = x[i + 1] + 1j * y[i + 1] - p, x[j + 1] + 1j * y[j + 1] - q
    area = (r.conj() * s).imag
    on_first, on_second = (((q - p).conj() * s).imag / area, ((q - p).conj() * r).imag / area)
    return (on_first > 0) & (on_first < 1) & (on_second > 0) & (on_second < 1)


def clearance(body, angles, i, j):
    """The smooth function that is not negative only where the links do not cross."""
    return -touching.far_contact(body, i, j).excess(angles)


@pytest.mark.parametrize("body", BODIES, ids=lambda b: f"{b.n_link} links")
def test_clearance_never_allows_a_crossing_and_forbids_little_else(body):
    rng = np.random.default_rng(2)
    angles = rng.uniform(-1, 1, (body.n_joint, 20000)) * rng.uniform(0.5, np.pi, 20000)
    seen = 0
    for i, j in far_pairs(body):
        value = clearance(body, angles, i, j)[0]
        cross = crossing(body, angles, i, j)
        seen += cross.sum()
        assert not (cross & (value >= 0)).any()
        assert (cross | (value >= -2 * touching.CLEARANCE_SMOOTHING)).all()
    assert seen > 20
    assert len(far_pairs(body)) == (body.n_link - 2) * (body.n_link - 3) // 2


def test_parallel_links_that_slip_through_each_other_are_caught():
    # links 1 and 4 are always parallel; their distance passes through zero between two samples
    body = Chain((0.3, 0.2, 0.2, 0.3))
    tilt = np.array([-0.03, -0.01, 0.01, 0.03])
    angles = np.stack([tilt - 1.0, np.full(4, 2.0), np.pi - 1.0 - tilt])
    height = body.joints(angles)[1]
    np.testing.assert_allclose(height[3], height[4], atol=1e-12)
    assert height[3, 1] < 0 < height[3, 2]
    assert crossing_depth(body, angles, [(0, 3)]).max() < 1e-9
    assert passing_depth(body, angles) > 1e-3
    ends = np.stack(body.joints(angles))
    assert overlapping_pairs(ends, [(0, 3)], 0.0, 1e-3) == ((0, 3),)
    assert not overlapping_pairs(ends[..., :2], [(0, 3)], 0.0, 0.0)
    assert clearance(body, angles[:, 1:3].mean(axis=1, keepdims=True), 0, 3)[0, 0] < 0


def curl(amplitude, **changes):
    """Five links that curl up as a whole; they close a ring at 2 pi / 5 a joint."""
    guess = Fourier(np.zeros(4), np.full((4, 1), amplitude), np.zeros((4, 1)))
    fields = {"body": Chain((0.2,) * 5), "gait": Harmonic(1, "antipodal"), "intervals": 12}
    return Problem("curl", guess, **(fields | changes))


def test_last_free_gait_stops_before_links_cross():
    problem = curl(1.0)
    free = problem.gait.parameters(problem.guess)
    bad = 1.6 * free
    program = program_of(problem)
    assert (0, 4) in crossing_pairs(program, bad)
    between = last_free(program, free, bad)
    assert not crossing_pairs(program, between)
    assert 1.0 < between.max() / free.max() < 1.6


def test_constraint_rows_hold_the_clearance_at_the_worst_instant_of_every_cell():
    problem = curl(1.1, body=Chain((0.15, 0.25, 0.2, 0.1, 0.3)))
    far = tuple(far_pairs(problem.body))
    p = problem.gait.parameters(problem.guess)
    p = p + 0.1 * np.random.default_rng(4).standard_normal(p.size)
    control = control_problem(problem)
    program = FullProgram(control, p, far=far)
    x = program.feasible(p, 0.1)
    value = np.array(program.nlp.functions["jac_g"](x, 0.1)[0]).ravel()
    fine = np.linspace(program.mesh.edges[:-1], program.mesh.edges[1:], 2001)
    angles = program.member(x).angles(fine.T.ravel())
    placed = 0
    for i, j in far:
        name = f"links {i + 1} and {j + 1}"
        rows, cells = program.groups[name], program.cells[name]
        nearest = clearance(problem.body, angles, i, j).reshape(program.mesh.n, -1).min(axis=1)
        np.testing.assert_allclose(-value[rows], nearest[cells], atol=1e-3)
        left_out = np.delete(nearest, cells)
        assert left_out.min(initial=np.inf) > 0.1
        assert (program.row_upper[rows] == 0).all()
        placed += cells.size
    assert placed > 5


def test_two_links_cannot_gain_by_any_delta_or_harmonics_what_directional_friction_gives(solved):
    solution, _ = solved("two_link")
    assert solution.status == "solved"

    def efficiency(amplitude):
        at = solution.problem.body, solution.problem.friction
        return replay(*at, Fourier([0.0], [[amplitude]], [[0.0]]), 1e-4, tolerance=1e-5).efficiency

    sweep = np.linspace(0.8, 2.4, 9)
    values = [efficiency(a) for a in sweep]
    assert abs(sweep[np.argmax(values)] - abs(solution.gait.cos[0, 0])) < 0.15
    assert solution.certificate.efficiency == pytest.approx(max(values), rel=5e-3)
    assert solution.certificate.efficiency >= max(values) * (1 - 1e-6)


def test_wide_links_that_lie_end_to_end_overlap_by_what_they_lack():
    """Links 2 and 3 fold up, so that link 4 begins 0.02 beyond the end of link 1."""
    body = Chain((0.4, 0.11, 0.09, 0.4))
    ends = np.stack(body.joints(np.array([[0.0], [np.pi], [np.pi]])))
    assert overlapping_pairs(ends, ((0, 3),), 0.03, 0.0) == ((0, 3),)
    assert overlapping_pairs(ends, ((0, 3),), 0.01, 0.0) == ()
