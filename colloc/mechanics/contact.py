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
from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.mechanics.balance import is_chain
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


# smooth functions of joint angles, for programs


def near_contacts(body: Any) -> list[Contact]:
    """Links two apart, bending to either side."""

    def contact(i: int, side: str, sign: int) -> Contact:
        def pair(angles: Array) -> tuple[Array, Array]:
            first, second = crossing_sums(body, angles, i)
            return sign * first - np.pi, sign * second - np.pi

        return Contact(f"links {i + 1} and {i + 3} ({side})", pair, SMOOTHING)

    sides = ("left", 1), ("right", -1)
    return [contact(i, *side) for i in range(body.n_link - 2) for side in sides]


def link_contacts(body: Any, far: Sequence[Pair] = ()) -> list[Contact]:
    """Links two apart, the pairs `far` of links farther apart, and all ends and links if the links
    are wide."""

    def crossing(i: int, j: int) -> Contact:
        name = f"links {i + 1} and {j + 1}"
        return Contact(name, lambda angles: intrusions(body, angles, i, j), CLEARANCE_SMOOTHING)

    def nearing(end: int, link: int) -> Contact:
        # one condition alone is the smaller of two that are the same
        name = f"end {end} and link {link + 1}"
        return Contact(
            name, lambda angles: (lacking_width(body, angles, end, link),) * 2, CLEARANCE_SMOOTHING
        )

    wide = [nearing(*pair) for pair in ends_and_links(body)] if body.width else []
    return near_contacts(body) + [crossing(*pair) for pair in far] + wide


def crossing_sums(body: Any, angles: Array, i: int) -> tuple[Array, Array]:
    """Two sums ``(1, n_time)`` that both exceed pi, or both fall below -pi, where links i and i + 2
    cross."""
    before, middle, after = body.lengths[i : i + 3]
    xp, a, b = namespace(angles), angles[i : i + 1, :], angles[i + 1 : i + 2, :]

    def chi(angle: Array, link: float) -> Array:
        if link == middle:
            return 0.5 * angle
        return xp.arctan2(link * xp.sin(angle), middle + link * xp.cos(angle))

    return b + chi(a, before), a + chi(b, after)


def intrusions(body: Any, angles: Array, first: int, second: int) -> tuple[Array, Array]:
    """Two smooth functions ``(1, n_time)`` that are both > 0 where links `first` < `second` cross
    [body lengths].

    With m and d the mean and half the difference of the distances of one link's ends from the
    other's line, that link lies on one side iff ``|d| - |m| <= 0``. Smoothing also closes the gap
    through which parallel links would slip through each other when both ends pass at once.
    """

    def straddling(line: int, link: int) -> Array:
        a, b = (_seen_from(body, angles, line, end)[1] for end in (link, link + 1))
        square, spread = (0.5 * (a + b)) ** 2, (0.5 * (a - b)) ** 2
        xp, smoothing = namespace(angles), CLEARANCE_SMOOTHING**2
        # never above |m|, and below it by at most 0.3 of the smoothing
        return xp.sqrt(spread + smoothing) - square / xp.sqrt(square + smoothing)

    return straddling(first, second), straddling(second, first)


def lacking_width(body: Any, angles: Array, end: int, link: int) -> Array:
    """The width w that an end and a link at the distance d lack to first order, ``(w^2 - d^2)/2w``
    [body lengths], ``(1, n_time)``: unlike the distance it has a derivative on the link."""
    xp, w, length = namespace(angles), body.width, body.lengths[link]
    along, across = _seen_from(body, angles, link, end)
    # `along` is counted from the near end into the link: what lies outside of [0, length]
    outside = 0.5 * (along - xp.abs(along)) + 0.5 * (along - length + xp.abs(along - length))
    return (w * w - (outside * outside + across * across)) / (2 * w)


def _seen_from(body: Any, angles: Array, link: int, end: int) -> tuple[Array, Array]:
    """The joint or tip number `end` in the frame of a link: from its end that is nearer along the
    chain, into the link and across, ``(1, n_time)`` each."""
    xp, forwards = namespace(angles), end > link
    along, across, turn = 0.0, 0.0, 0.0
    for k in range(link + 1, end) if forwards else range(link - 1, end - 1, -1):
        joint = k - 1 if forwards else k
        turn = turn + angles[joint : joint + 1, :]
        along = along - body.lengths[k] * xp.cos(turn)
        across = across + body.lengths[k] * xp.sin(turn)
    return along, across


def ends_and_links(body: Any) -> list[Pair]:
    """All (end, link) where the joint or tip number `end`, from 0 at the tail, is no end of the
    link."""
    links, ends = range(body.n_link), range(body.n_link + 1)
    return [(end, link) for link in links for end in ends if end not in (link, link + 1)]


# exact intersection, independent of the smooth functions; bodies that are no chains never cross


def link_width(body: Any) -> float:
    return body.width if is_chain(body) else 0.0


def far_pairs(body: Any) -> Pairs:
    """All pairs of links more than two apart."""
    return _pairs_apart(body.n_link, 3) if is_chain(body) else ()


def _pairs_apart(n_link: int, distance: int) -> Pairs:
    return tuple((i, j) for i in range(n_link) for j in range(i + distance, n_link))


def crossing_depth(
    body: Any, angles: np.ndarray, pairs: Sequence[Pair] | None = None
) -> np.ndarray:
    """Depth to which links cross each other, the smallest distance from an end of one of two
    crossing segments to the other, and the width that they lack [body lengths], ``(n_time,)``; of
    the given pairs, by default of all."""
    if not is_chain(body):
        return np.zeros(angles.shape[1])
    ends = np.stack(body.joints(angles))
    if pairs is None:
        return _overlap(ends, _pairs_apart(body.n_link, 2), body.width, ends_and_links(body))
    return _overlap(ends, pairs, body.width)


def passing_depth(body: Any, angles: np.ndarray) -> float:
    """Depth to which links pass through each other between successive points of a path [body
    lengths].

    A link cannot cross another without an end of one passing through the other, also where no
    sample holds a crossing: an end beside the other link changes its side. The depth is the smaller
    of its distances before and after.
    """
    if not is_chain(body):
        return 0.0
    return _passing(np.stack(body.joints(angles)), _pairs_apart(body.n_link, 2))


def overlapping_pairs(ends: np.ndarray, pairs: Sequence[Pair], width: float, least: float) -> Pairs:
    """Pairs of links that overlap, or pass through each other along a path, by more than `least`
    [body lengths]; from the coordinates ``(2, n_link + 1, n_time)`` of joints and tips."""
    return tuple(
        pair
        for pair in _within_reach(ends, pairs, width)
        if max(_overlap(ends, [pair], width).max(), _passing(ends, [pair])) > least
    )


def _overlap(
    ends: np.ndarray, pairs: Sequence[Pair], width: float, ends_links: Sequence[Pair] | None = None
) -> np.ndarray:
    """`crossing_depth` of pairs, and of ends from links, by default those of the pairs."""
    depth = np.zeros(ends.shape[2])
    for i, j in _within_reach(ends, pairs):
        heights, _ = _seen_ends(ends, i, j)
        crossing = (heights[0] * heights[1] < 0) & (heights[2] * heights[3] < 0)
        depth = np.maximum(depth, np.where(crossing, np.abs(heights).min(axis=0), 0.0))
    if width == 0:
        return depth
    if ends_links is None:
        ends_links = [(a + k, b) for i, j in pairs for a, b in ((j, i), (i, j)) for k in (0, 1)]
    gap = np.full(depth.shape, np.inf)
    for end, link in ends_links:
        along, to = ends[:, link + 1] - ends[:, link], ends[:, end] - ends[:, link]
        part = np.clip((along * to).sum(axis=0) / (along * along).sum(axis=0), 0.0, 1.0)
        gap = np.minimum(gap, np.hypot(*(to - part * along)))
    return depth + np.maximum(width - np.where(depth > 0, 0.0, gap), 0.0)


def _passing(ends: np.ndarray, pairs: Sequence[Pair]) -> float:
    deepest = 0.0
    for i, j in _within_reach(ends, pairs):
        heights, beside = _seen_ends(ends, i, j)
        through = (heights[:, 1:] * heights[:, :-1] < 0) & beside[:, 1:] & beside[:, :-1]
        passed = np.minimum(np.abs(heights[:, 1:]), np.abs(heights[:, :-1]))[through]
        deepest = max(deepest, float(passed.max(initial=0.0)))
    return deepest


def _seen_ends(ends: np.ndarray, i: int, j: int) -> tuple[np.ndarray, np.ndarray]:
    """Signed distances of the ends of link j from the line of link i, then the other way round, and
    whether they lie beside the link, ``(4, n_time)``."""
    heights, beside = [], []
    for line, link in ((i, j), (j, i)):
        along = ends[:, line + 1] - ends[:, line]
        length = np.hypot(*along)
        for to in (ends[:, link] - ends[:, line], ends[:, link + 1] - ends[:, line]):
            heights.append((along[0] * to[1] - along[1] * to[0]) / length)
            beside.append(np.abs((along * to).sum(axis=0) / length - 0.5 * length) < 0.5 * length)
    return np.array(heights), np.array(beside)


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
