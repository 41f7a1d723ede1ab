"""Which shapes of a chain are admissible: links must not cross, nor come nearer to each other than
their width.

Neighbours can only fold onto each other (|angle| <= pi). Links i and i + 2 with a joint at both
ends of link i + 1 cross iff, with a and b the two joint angles, ``min(b + chi(a; l_i), a + chi(b;
l_i+2)) > pi`` or the mirror image, where ``chi(a; l) = atan2(l sin a, m + l cos a)`` and m is the
length between; for equal lengths chi = a/2 and the condition is ``min(2 a + b, a + 2 b) > 2 pi``.
(Base m, base angles pi - a and pi - b: the tip of one link lies beyond the line of the other on
both sides.)

Links farther apart cross iff each has its ends on both sides of the other's line (`clearance`).

A link of width w is a strip with round ends, w/2 to either side of its middle line. The rule: *no
joint and no free end comes nearer than w to the middle line of a link that it is not an end of*.
Where no middle lines cross this says, since the distance of two segments is that of an end of one
from the other:

- links that are not neighbours do not overlap: their middle lines are at least w apart;
- neighbours, which overlap about their joint whatever they do (a hinge is cut away there), close
  until the free end of the shorter one, of length l, lies beside the other: the joint turns up to
  ``pi - asin(w / l)``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from colloc.mechanics.links import Links
from colloc.numerics.arrays import Array, namespace

SMOOTHING = 1e-3
"""Width [rad] of the smoothed minimum; it errs to the safe side, by at most half of this."""
CLEARANCE_SMOOTHING = 2e-4
"""Width [body lengths] of smoothed absolute values and minima; they err to the safe side, by at
most twice this."""
Pair = tuple[int, int]


def _subtended(angle: Array, link: float, middle: float) -> Array:
    if link == middle:
        return 0.5 * angle
    xp = namespace(angle)
    return xp.arctan2(link * xp.sin(angle), middle + link * xp.cos(angle))


def crossing_sums(body: Links, angles: Array, i: int) -> tuple[Array, Array]:
    """For links i and i + 2, the two sums that both exceed pi, or both fall below -pi, where they
    cross; ``(1, n_time)`` each.

    Joint angles ``(n_joint, n_time)``.
    """
    before, middle, after = body.lengths[i : i + 3]
    a, b = angles[i : i + 1, :], angles[i + 1 : i + 2, :]
    return b + _subtended(a, before, middle), a + _subtended(b, after, middle)


def smooth_minimum(first: Array, second: Array, width: float = SMOOTHING) -> Array:
    """The smaller of two values, or up to half of `width` more where they are equal."""
    gap = first - second
    spread = namespace(gap).sqrt(gap * gap + width * width) - width
    return 0.5 * (first + second) - 0.5 * spread


def share_of_first(first: Array, second: Array, width: float = SMOOTHING) -> Array:
    """Derivative of `smooth_minimum` in its first argument; that in the second makes up 1."""
    gap = first - second
    return 0.5 - 0.5 * gap / namespace(gap).sqrt(gap * gap + width * width)


def tangent_of_minimum(
    first: Array, second: Array, share: Array, width: float = SMOOTHING
) -> Array:
    """The tangent plane of `smooth_minimum` that has the slope `share` in the first argument; never
    below the minimum.

    Where a path rounds the corner at which both sums are pi, the smaller sum has a peak with a
    kink, and the instant of the peak moves with the path. By the envelope theorem the peak's height
    changes like the tangent plane at the peak, its slope held; the minimum itself, at a fixed
    instant, falls whichever way the peak moves along the path.
    """
    share_of_second = 1.0 - share
    bulge = 0.5 - namespace(share).sqrt(share * share_of_second)
    return share * first + share_of_second * second + width * bulge


@dataclass(frozen=True, eq=False)
class Contact:
    """Two parts of a body that must not cross: the smaller of two functions of the shape must not
    be positive."""

    name: str
    pair: Callable[[Array], tuple[Array, Array]]
    """Of shapes ``(n_joint, n_time)``, the two functions, ``(1, n_time)`` each; NumPy and
    CasADi."""
    width: float
    """Over which the minimum is smoothed."""

    def excess(self, angles: Array) -> Array:
        """The smoothed minimum ``(1, n_time)``."""
        return smooth_minimum(*self.pair(angles), self.width)

    def after(self, joints_at: Callable[[Array], Array]) -> Contact:
        """The same parts as a function of other coordinates, of which the joint angles are a
        function."""
        return replace(self, pair=lambda shape: self.pair(joints_at(shape)))

    def share(self, angles: Array) -> Array:
        """What the first function has of its derivative, ``(1, n_time)``."""
        return share_of_first(*self.pair(angles), self.width)


def crossing_bounds(body: Links, angles: Array) -> Array | None:
    """Smooth functions that are <= pi only at shapes where no links i and i + 2 cross, ``(2 (n_link
    - 2), n_time)``.

    None for a body of two links. Joint angles ``(n_joint, n_time)``.
    """
    if body.n_link < 3:
        return None
    rows = []
    for i in range(body.n_link - 2):
        first, second = crossing_sums(body, angles, i)
        rows += [smooth_minimum(first, second), smooth_minimum(-first, -second)]
    return namespace(angles).stack(rows)


def far_pairs(body: Links) -> list[tuple[int, int]]:
    """All pairs of links that are more than two apart; `crossing_bounds` has those that are two
    apart."""
    return [(i, j) for i in range(body.n_link) for j in range(i + 3, body.n_link)]


def intrusions(body: Links, angles: Array, first: int, second: int) -> tuple[Array, Array]:
    """Two smooth functions that are both > 0 where links `first` < `second` cross [body lengths];
    ``(1, n_time)`` each.

    With m and d the mean and half the difference of the distances of one link's ends from the
    other's line, that link lies on one side iff ``|d| - |m| <= 0``; this for one link, and for the
    other.
    """
    return -_side(body, angles, first, second), -_side(body, angles, second, first)


def clearance(body: Links, angles: Array, first: int, second: int) -> Array:
    """A smooth function that is >= 0 only where links `first` < `second` do not cross [body
    lengths], ``(1, n_time)``.

    Two segments cross iff neither lies on one side of the other: the smaller of the two
    `intrusions` decides. Smoothing also closes the gap through which parallel links would slip
    through each other at one instant, when both ends pass at once.
    """
    return -smooth_minimum(*intrusions(body, angles, first, second), CLEARANCE_SMOOTHING)


def _smooth_abs(xp, value: Array) -> Array:
    """Never above the absolute value, and below it by at most 0.3 `CLEARANCE_SMOOTHING`."""
    square = value * value
    return square / xp.sqrt(square + CLEARANCE_SMOOTHING**2)


def _side(body: Links, angles: Array, line: int, link: int) -> Array:
    """How far `link` stays on one side of the line through the link `line`; negative if its ends
    are on both sides."""
    xp, (turns, rises) = namespace(angles), _walk(tuple(body.lengths), line, link)
    heights = xp.matmul(rises, xp.sin(xp.matmul(turns, angles)))
    mean, spread = heights[0:1, :], heights[1:2, :]
    return _smooth_abs(xp, mean) - xp.sqrt(spread * spread + CLEARANCE_SMOOTHING**2)


@lru_cache(maxsize=4096)
def _walk(lengths: tuple[float, ...], line: int, link: int) -> tuple[np.ndarray, np.ndarray]:
    """Along the chain, in the frame of `line`, to the end of `link`: the turns of the links passed,
    of joint angles ``(n, n_joint)``, and of their sines the mean height of that link's ends, and
    half their difference, ``(2, n)``."""
    step = 1 if link > line else -1
    passed = list(range(line + step, link + step, step))
    turns = np.cumsum(np.eye(len(lengths))[[k - 1 if step > 0 else k for k in passed], :-1], axis=0)
    rises = np.tile(np.take(lengths, passed), (2, 1))
    rises[:, -1] *= 0.5
    rises[1, :-1] = 0.0
    return turns, rises


def separate_pairs(body: Links) -> list[tuple[int, int]]:
    """All pairs of links that are not neighbours."""
    return [(i, j) for i in range(body.n_link) for j in range(i + 2, body.n_link)]


def crossing_depth(
    body: Links, angles: np.ndarray, pairs: Sequence[Pair] | None = None
) -> np.ndarray:
    """How far links penetrate each other, ``(n_time,)``; 0 where no two of them cross.

    Plain segment intersection of the given pairs, by default of all that are not neighbours,
    independent of `crossing_bounds` and `clearance`: the depth is the smallest distance from an end
    of one of two crossing segments to the other segment.
    """
    ends = np.stack(body.joints(angles))
    return _crossing(ends, _within_reach(ends, separate_pairs(body) if pairs is None else pairs))


def passing_depth(body: Links, angles: np.ndarray) -> float:
    """How far links pass through each other between successive instants of a path [body lengths]; 0
    if none does.

    A link cannot cross another without an end of one passing through the other. That shows even
    where no sample holds a crossing (parallel links that slip through each other): an end that is
    beside the other link changes its side. The value is the smaller of the end's distances before
    and after.
    """
    ends = np.stack(body.joints(angles))
    return _passing(ends, _within_reach(ends, separate_pairs(body)))


def overlapping_pairs(
    ends: np.ndarray, pairs: Sequence[Pair], width: float, least: float
) -> tuple[Pair, ...]:
    """Those of pairs of links that overlap, or pass through each other between successive instants
    of a path, by more than `least` [body lengths]; from the coordinates ``(2, n_link + 1, n_time)``
    of joints and tips."""

    def depth(one: list[Pair]) -> float:
        return max(float(_overlap(ends, one, width, _their_ends(one)).max()), _passing(ends, one))

    return tuple(pair for pair in _within_reach(ends, pairs, width) if depth([pair]) > least)


def _within_reach(ends: np.ndarray, pairs: Sequence[Pair], width: float = 0.0) -> list[Pair]:
    """Those of pairs whose links can come nearer than their width, at an instant or on the straight
    way to the next: most of a long body never do, and their middles say so."""
    middles, near = 0.5 * (ends[:, 1:] + ends[:, :-1]), []
    lengths = np.hypot(*(ends[:, 1:] - ends[:, :-1])).max(axis=1, initial=0.0)
    for i, j in pairs:
        apart = middles[:, j] - middles[:, i]
        reach = 0.5 * (lengths[i] + lengths[j] + np.hypot(*np.diff(apart)).max(initial=0.0)) + width
        if np.hypot(*apart).min(initial=np.inf) <= reach:
            near.append((i, j))
    return near


def _crossing(ends: np.ndarray, pairs: Sequence[Pair]) -> np.ndarray:
    depth = np.zeros(ends.shape[2])
    for i, j in pairs:
        (d1, d2), (d3, d4), _ = _end_distances(ends, i, j)
        crossing = (d1 * d2 < 0) & (d3 * d4 < 0)
        distance = np.min(np.abs([d1, d2, d3, d4]), axis=0)
        depth = np.maximum(depth, np.where(crossing, distance, 0.0))
    return depth


def _passing(ends: np.ndarray, pairs: Sequence[Pair]) -> float:
    deepest = 0.0
    for i, j in pairs:
        first, second, beside = _end_distances(ends, i, j)
        for distance, along in zip((*first, *second), beside, strict=True):
            through = (distance[1:] * distance[:-1] < 0) & along[1:] & along[:-1]
            passed = np.minimum(np.abs(distance[1:]), np.abs(distance[:-1]))[through]
            deepest = max(deepest, float(passed.max(initial=0.0)))
    return deepest


def _end_distances(
    ends: np.ndarray, i: int, j: int
) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
    """Signed distances of the ends of link j from the line of link i, the other way round, and
    which ends lie beside."""
    result: list[list[np.ndarray]] = []
    beside = []
    for line, link in ((i, j), (j, i)):
        along = ends[:, line + 1] - ends[:, line]
        length = np.hypot(*along)
        seen = [ends[:, link] - ends[:, line], ends[:, link + 1] - ends[:, line]]
        result.append([_cross(along, p) / length for p in seen])
        beside += [
            np.abs((along * p).sum(axis=0) / length - 0.5 * length) < 0.5 * length for p in seen
        ]
    return result[0], result[1], beside


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[1] - a[1] * b[0]


def ends_and_links(body: Links) -> list[Pair]:
    """All (end, link) where the joint or tip number `end`, from 0 at the tail, is no end of the
    link."""
    return [
        (end, link)
        for link in range(body.n_link)
        for end in range(body.n_link + 1)
        if end not in (link, link + 1)
    ]


def _their_ends(pairs: Sequence[Pair]) -> list[Pair]:
    """The same of pairs of links."""
    return [
        (end, link)
        for i, j in pairs
        for link, ends in ((i, (j, j + 1)), (j, (i, i + 1)))
        for end in ends
    ]


def square_distance(body: Links, angles: Array, end: int, link: int) -> Array:
    """Of a joint or tip from a link, ``(1, n_time)``, from joint angles ``(n_joint, n_time)``;
    NumPy and CasADi."""
    xp = namespace(angles)
    step = 1 if end > link else -1
    length, along, across, turn = body.lengths[link], 0.0, 0.0, 0.0
    # walk along the chain in the frame of the link, from its near end; away from the tail or
    # towards it
    for k in range(link + 1, end) if step > 0 else range(link - 1, end - 1, -1):
        joint = k - 1 if step > 0 else k
        turn = turn + angles[joint : joint + 1, :]
        along = along - body.lengths[k] * xp.cos(turn)
        across = across + body.lengths[k] * xp.sin(turn)
    # `along` is counted from the near end into the link: what lies outside of [0, length]
    outside = 0.5 * (along - xp.abs(along)) + 0.5 * (along - length + xp.abs(along - length))
    return outside * outside + across * across


def excess(body: Links, angles: Array, end: int, link: int) -> Array:
    """A smooth function that is <= 0 where an end and a link keep the width, to first order the
    width that they lack [body lengths], ``(1, n_time)``; it has a derivative on the link too, where
    the distance has none."""
    w = body.width
    return (w * w - square_distance(body, angles, end, link)) / (2 * w)


def gap(body: Links, angles: np.ndarray) -> np.ndarray:
    """The smallest distance of an end from a link that it is not an end of [body lengths],
    ``(n_time,)``; 0 where links cross.

    Neighbours of equal lengths l folded by an angle beyond pi/2 have the gap l sin(pi - |angle|).
    """
    ends = np.stack(body.joints(angles))
    return np.where(
        _crossing(ends, separate_pairs(body)) > 0, 0.0, _gap(ends, ends_and_links(body))
    )


def overlap(body: Links, angles: np.ndarray, pairs: Sequence[Pair] | None = None) -> np.ndarray:
    """What links lack of their width, and how far they cross besides [body lengths], ``(n_time,)``;
    0 where they keep it.

    Of all, or of pairs of links.
    """
    ends = np.stack(body.joints(angles))
    every, apart = (
        (separate_pairs(body), ends_and_links(body))
        if pairs is None
        else (pairs, _their_ends(pairs))
    )
    return _overlap(ends, _within_reach(ends, every), body.width, apart)


def _overlap(
    ends: np.ndarray, pairs: Sequence[Pair], width: float, apart: Sequence[Pair]
) -> np.ndarray:
    depth = _crossing(ends, pairs)
    return (
        depth
        if width == 0
        else depth + np.maximum(width - np.where(depth > 0, 0.0, _gap(ends, apart)), 0.0)
    )


def _gap(ends: np.ndarray, apart: Sequence[Pair]) -> np.ndarray:
    return np.min([_from_segment(ends, end, link) for end, link in apart], axis=0, initial=np.inf)


def _from_segment(ends: np.ndarray, end: int, link: int) -> np.ndarray:
    """Distance of a joint or tip from a link, by the coordinates ``(2, n_link + 1, n_time)`` of
    all, ``(n_time,)``."""
    along, to = ends[:, link + 1] - ends[:, link], ends[:, end] - ends[:, link]
    part = np.clip((along * to).sum(axis=0) / (along * along).sum(axis=0), 0.0, 1.0)
    return np.hypot(*(to - part * along))
