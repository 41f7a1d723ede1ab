"""Self-contact of chains: links must not cross, nor come nearer to each other than their width.

Neighbours can only fold onto each other (|angle| <= pi). Links i and i + 2 cross iff, with a and b
the joint angles between them, ``min(b + chi(a; l_i), a + chi(b; l_i+2)) > pi`` or the mirror image,
where ``chi(a; l) = atan2(l sin a, m + l cos a)`` and m is the length between; for equal lengths chi
= a/2. Links farther apart cross iff each has its ends on both sides of the other's line.

A link of width w is a strip with round ends: *no joint and no free end comes nearer than w to the
middle line of a link that it is not an end of*. So neighbours, which overlap about their joint (a
hinge is cut away there), close until the free end of the shorter one, of length l, lies beside the
other: the joint turns up to ``pi - asin(w / l)``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from colloc.mechanics.links import Links
from colloc.numerics.arrays import Array, namespace

SMOOTHING = 1e-3
"""Width [rad] of the smoothed minimum; it errs to the safe side, by at most half of this."""
CLEARANCE_SMOOTHING = 2e-4
"""Width [body lengths] of smoothed absolute values and minima; they err to the safe side, by at
most twice this."""
Pair = tuple[int, int]
Pairs = tuple[Pair, ...]


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
    """Tangent plane of `smooth_minimum` with the slope `share` in the first argument; never below
    the minimum.

    Where a path rounds the corner at which both sums are pi, the smaller one peaks at a kink, whose
    time moves with the path. By the envelope theorem its height changes like this plane; the
    minimum itself, at a fixed time, falls whichever way the peak moves.
    """
    share_of_second = 1.0 - share
    bulge = 0.5 - namespace(share).sqrt(share * share_of_second)
    return share * first + share_of_second * second + width * bulge


@dataclass(frozen=True, eq=False)
class Contact:
    """Two parts that must not cross: the smaller of two functions of shapes ``(n_joint, n_time)``,
    ``(1, n_time)`` each, must not be positive; it is smoothed over `width`. NumPy and CasADi."""

    name: str
    pair: Callable[[Array], tuple[Array, Array]]
    width: float

    def excess(self, angles: Array) -> Array:
        """The smoothed minimum ``(1, n_time)``."""
        return smooth_minimum(*self.pair(angles), self.width)

    def share(self, angles: Array) -> Array:
        """Derivative of the minimum in the first function, ``(1, n_time)``."""
        return share_of_first(*self.pair(angles), self.width)

    def after(self, joints_at: Callable[[Array], Array]) -> Contact:
        """The contact as a function of other coordinates."""
        return replace(self, pair=lambda shape: self.pair(joints_at(shape)))


def link_contacts(body: Links, far: Sequence[Pair] = ()) -> list[Contact]:
    """Links two apart, bending to either side, the pairs `far` of links farther apart, and all ends
    and links if the links are wide."""
    contacts = []
    for i in range(body.n_link - 2):
        for side, sign in (("left", 1), ("right", -1)):
            name = f"links {i + 1} and {i + 3} ({side})"
            contacts.append(Contact(name, partial(_crossing_excess, body, i, sign), SMOOTHING))
    for i, j in far:
        pair = partial(intrusions, body, first=i, second=j)
        contacts.append(Contact(f"links {i + 1} and {j + 1}", pair, CLEARANCE_SMOOTHING))
    for end, link in ends_and_links(body) if body.width else ():
        pair = partial(_width_excess, body, end, link)
        contacts.append(Contact(f"end {end} and link {link + 1}", pair, CLEARANCE_SMOOTHING))
    return contacts


def _crossing_excess(body: Links, i: int, sign: int, angles: Array) -> tuple[Array, Array]:
    first, second = crossing_sums(body, angles, i)
    return sign * first - np.pi, sign * second - np.pi


def _width_excess(body: Links, end: int, link: int, angles: Array) -> tuple[Array, Array]:
    both = excess(body, angles, end, link)
    return both, both  # one condition alone is the smaller of two that are the same


def _subtended_angle(angle: Array, link: float, middle: float) -> Array:
    if link == middle:
        return 0.5 * angle
    xp = namespace(angle)
    return xp.arctan2(link * xp.sin(angle), middle + link * xp.cos(angle))


def crossing_sums(body: Links, angles: Array, i: int) -> tuple[Array, Array]:
    """Two sums ``(1, n_time)`` that both exceed pi, or both fall below -pi, where links i and i + 2
    cross."""
    before, middle, after = body.lengths[i : i + 3]
    a, b = angles[i : i + 1, :], angles[i + 1 : i + 2, :]
    return b + _subtended_angle(a, before, middle), a + _subtended_angle(b, after, middle)


def crossing_bounds(body: Links, angles: Array) -> Array | None:
    """Smooth functions that are <= pi only where no links i and i + 2 cross, ``(2 (n_link - 2),
    n_time)``; None for two links."""
    rows = []
    for i in range(body.n_link - 2):
        first, second = crossing_sums(body, angles, i)
        rows += [smooth_minimum(first, second), smooth_minimum(-first, -second)]
    return namespace(angles).stack(rows) if rows else None


def intrusions(body: Links, angles: Array, first: int, second: int) -> tuple[Array, Array]:
    """Two smooth functions ``(1, n_time)`` that are both > 0 where links `first` < `second` cross
    [body lengths].

    With m and d the mean and half the difference of the distances of one link's ends from the
    other's line, that link lies on one side iff ``|d| - |m| <= 0``. Smoothing also closes the gap
    through which parallel links would slip through each other when both ends pass at once.
    """
    return -_side(body, angles, first, second), -_side(body, angles, second, first)


def _side(body: Links, angles: Array, line: int, link: int) -> Array:
    """Distance by which `link` stays on one side of the line through the link `line`; negative if
    its ends are on both sides."""
    xp, (turns, rises) = namespace(angles), _walk(tuple(body.lengths), line, link)
    heights = xp.matmul(rises, xp.sin(xp.matmul(turns, angles)))
    mean, spread = heights[0:1, :] ** 2, heights[1:2, :] ** 2
    # never above |mean|, and below it by at most 0.3 of the smoothing
    smooth = mean / xp.sqrt(mean + CLEARANCE_SMOOTHING**2)
    return smooth - xp.sqrt(spread + CLEARANCE_SMOOTHING**2)


@lru_cache(maxsize=4096)
def _walk(lengths: tuple[float, ...], line: int, link: int) -> tuple[np.ndarray, np.ndarray]:
    """From `line` along the chain to `link`, in the frame of `line`: turns of the links passed, of
    joint angles ``(n, n_joint)``; and of their sines the mean height of the link's ends, and half
    their difference, ``(2, n)``."""
    step = 1 if link > line else -1
    passed = list(range(line + step, link + step, step))
    turns = np.cumsum(np.eye(len(lengths))[[k - 1 if step > 0 else k for k in passed], :-1], axis=0)
    rises = np.tile(np.take(lengths, passed), (2, 1))
    rises[:, -1] *= 0.5
    rises[1, :-1] = 0.0
    return turns, rises


def square_distance(body: Links, angles: Array, end: int, link: int) -> Array:
    """Square distance of the joint or tip number `end` from a link, ``(1, n_time)``."""
    xp = namespace(angles)
    step = 1 if end > link else -1
    length, along, across, turn = body.lengths[link], 0.0, 0.0, 0.0
    # along the chain in the frame of the link, from its near end
    for k in range(link + 1, end) if step > 0 else range(link - 1, end - 1, -1):
        joint = k - 1 if step > 0 else k
        turn = turn + angles[joint : joint + 1, :]
        along = along - body.lengths[k] * xp.cos(turn)
        across = across + body.lengths[k] * xp.sin(turn)
    # `along` is counted from the near end into the link: what lies outside of [0, length]
    outside = 0.5 * (along - xp.abs(along)) + 0.5 * (along - length + xp.abs(along - length))
    return outside * outside + across * across


def excess(body: Links, angles: Array, end: int, link: int) -> Array:
    """The width that an end and a link lack, to first order, negative where they keep it [body
    lengths], ``(1, n_time)``; unlike the distance it has a derivative on the link."""
    w = body.width
    return (w * w - square_distance(body, angles, end, link)) / (2 * w)


def ends_and_links(body: Links) -> list[Pair]:
    """All (end, link) where the joint or tip number `end`, from 0 at the tail, is no end of the
    link."""
    return [
        (end, link)
        for link in range(body.n_link)
        for end in range(body.n_link + 1)
        if end not in (link, link + 1)
    ]


# exact intersection, independent of the smooth functions; bodies that are no chains never cross


def _separate(body: Links, distance: int) -> Pairs:
    return tuple((i, j) for i in range(body.n_link) for j in range(i + distance, body.n_link))


def link_width(body: Any) -> float:
    return body.width if isinstance(body, Links) else 0.0


def far_pairs(body: Any) -> Pairs:
    """All pairs of links more than two apart."""
    return _separate(body, 3) if isinstance(body, Links) else ()


def crossing_depth(
    body: Any, angles: np.ndarray, pairs: Sequence[Pair] | None = None
) -> np.ndarray:
    """Depth to which links cross each other, the smallest distance from an end of one of two
    crossing segments to the other, and the width that they lack [body lengths], ``(n_time,)``; of
    the given pairs, by default of all."""
    if not isinstance(body, Links):
        return np.zeros(angles.shape[1])
    ends = np.stack(body.joints(angles))
    if pairs is None:
        every, distances = _separate(body, 2), ends_and_links(body)
    else:
        every, distances = tuple(pairs), _their_ends(pairs)
    return _overlap(ends, _within_reach(ends, every), body.width, distances)


def passing_depth(body: Any, angles: np.ndarray) -> float:
    """Depth to which links pass through each other between successive points of a path [body
    lengths].

    A link cannot cross another without an end of one passing through the other, also where no
    sample holds a crossing: an end beside the other link changes its side. The depth is the smaller
    of its distances before and after.
    """
    if not isinstance(body, Links):
        return 0.0
    ends = np.stack(body.joints(angles))
    return _passing(ends, _within_reach(ends, _separate(body, 2)))


def overlapping_pairs(
    ends: np.ndarray, pairs: Sequence[Pair], width: float, least: float
) -> tuple[Pair, ...]:
    """Pairs of links that overlap, or pass through each other along a path, by more than `least`
    [body lengths]; from the coordinates ``(2, n_link + 1, n_time)`` of joints and tips."""

    def depth(one: list[Pair]) -> float:
        return max(float(_overlap(ends, one, width, _their_ends(one)).max()), _passing(ends, one))

    return tuple(pair for pair in _within_reach(ends, pairs, width) if depth([pair]) > least)


def gap(body: Links, angles: np.ndarray) -> np.ndarray:
    """Smallest distance of an end from a link that it is not an end of [body lengths],
    ``(n_time,)``; 0 where links cross."""
    ends = np.stack(body.joints(angles))
    crosses = _crossing(ends, _separate(body, 2)) > 0
    return np.where(crosses, 0.0, _gap(ends, ends_and_links(body)))


def _their_ends(pairs: Sequence[Pair]) -> list[Pair]:
    return [(end, b) for i, j in pairs for a, b in ((j, i), (i, j)) for end in (a, a + 1)]


def _within_reach(ends: np.ndarray, pairs: Sequence[Pair], width: float = 0.0) -> list[Pair]:
    """Pairs whose links can come nearer than their width, at a time point or on the straight way to
    the next: their middles say that most never do."""
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
        result.append([(along[0] * p[1] - along[1] * p[0]) / length for p in seen])
        beside += [
            np.abs((along * p).sum(axis=0) / length - 0.5 * length) < 0.5 * length for p in seen
        ]
    return result[0], result[1], beside


def _overlap(
    ends: np.ndarray, pairs: Sequence[Pair], width: float, distances: Sequence[Pair]
) -> np.ndarray:
    depth = _crossing(ends, pairs)
    if width == 0:
        return depth
    lack = width - np.where(depth > 0, 0.0, _gap(ends, distances))
    return depth + np.maximum(lack, 0.0)


def _gap(ends: np.ndarray, pairs: Sequence[Pair]) -> np.ndarray:
    """Smallest distance of joints or tips from links, pairs of (end, link), ``(n_time,)``."""

    def distance(end: int, link: int) -> np.ndarray:
        along, to = ends[:, link + 1] - ends[:, link], ends[:, end] - ends[:, link]
        part = np.clip((along * to).sum(axis=0) / (along * along).sum(axis=0), 0.0, 1.0)
        return np.hypot(*(to - part * along))

    return np.min([distance(*pair) for pair in pairs], axis=0, initial=np.inf)
