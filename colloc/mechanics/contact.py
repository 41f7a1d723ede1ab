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
_ROUNDING = 1e-12
_BLOCK = 40_000  # distances at once
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


def held_minimum(first: Array, second: Array, share: Array, width: float) -> Array:
    """`smooth_minimum`, or its tangent plane of a given share where that is not negative."""
    xp = namespace(share, first)
    plane = tangent_of_minimum(first, second, 0.5 * (share + xp.abs(share)), width)
    return xp.where(share < 0, smooth_minimum(first, second, width), plane)


@dataclass(frozen=True, eq=False)
class Contact:
    """Two parts that must not cross: the smaller of two values of one function of the joint angles
    between them must not be positive; it is smoothed over `width`. NumPy and CasADi.

    joints: those between the parts. order: the joints among these as each of the two values takes
    them, ``(2, k)``. numbers: what else it takes, ``(2, m)``. function: angles ``(k, n_time)`` and
    numbers ``(m, n_time)`` to values ``(1, n_time)``. slopes: to derivatives ``(k, n_time)``.
    """

    name: str
    joints: range
    order: np.ndarray
    numbers: np.ndarray
    function: Callable[[Array, Array], Array]
    slopes: Callable[[np.ndarray, np.ndarray], np.ndarray]
    width: float

    @property
    def kernel_numbers(self) -> np.ndarray:
        """For the compiled kernel (native/contacts.h)."""
        kind = 1 + (_crossing_sum, _straddling, _lacking).index(self.function)
        sides = zip(np.array(self.joints)[self.order], self.numbers, strict=True)
        head = kind, len(self.joints), self.numbers.shape[1], self.width
        return np.concatenate([head, *(side for pair in sides for side in pair)])

    def pair(self, angles: Array) -> tuple[Array, Array]:
        """Both values ``(1, n_time)``, at all angles of a body."""
        return self._values(angles[list(self.joints), :])

    def _values(self, angles: Array) -> tuple[Array, Array]:
        first, second = (
            self.function(angles[order.tolist(), :], namespace(angles).constant(numbers[:, None]))
            for order, numbers in zip(self.order, self.numbers, strict=True)
        )
        return first, second

    def held(self, angles: Array, share: Array) -> Array:
        """The minimum, or its tangent plane, at the angles between the parts."""
        return held_minimum(*self._values(angles), share, self.width)

    def excess(self, angles: Array) -> Array:
        """The smoothed minimum ``(1, n_time)``."""
        return smooth_minimum(*self.pair(angles), self.width)


# smooth functions of joint angles, for programs, and their derivatives


def near_contacts(body: Any) -> list[Contact]:
    """Links two apart, bending to either side."""
    contacts, there_and_back = [], np.array([[0, 1], [1, 0]])
    for i in range(body.n_link - 2):
        before, middle, after = body.lengths[i : i + 3]
        for side, sign in (("left", 1.0), ("right", -1.0)):
            name = f"links {i + 1} and {i + 3} ({side})"
            numbers = np.array([[sign, before, middle], [sign, after, middle]])
            at = range(i, i + 2), there_and_back, numbers
            contacts.append(Contact(name, *at, _crossing_sum, _slopes_of_sum, SMOOTHING))
    return contacts


def link_contacts(body: Any, far: Sequence[Pair] = ()) -> list[Contact]:
    """Links two apart, the pairs `far` of links farther apart, and all ends and links if the links
    are wide."""
    wide = [lacking_width(body, *pair) for pair in ends_and_links(body)] if body.width else []
    return near_contacts(body) + [far_contact(body, *pair) for pair in far] + wide


def _crossing_sum(angles: Array, numbers: Array) -> Array:
    """A sum of the angles a, b between links two apart that exceeds pi, as that of the angles the
    other way round does, where the links cross; over pi, and to either side."""
    xp, a, b = namespace(angles), angles[:1, :], angles[1:, :]
    side, link, middle = (numbers[k : k + 1, :] for k in range(3))
    chi = xp.arctan2(link * xp.sin(a), middle + link * xp.cos(a))
    return side * (b + xp.where(_are_equal(link, middle), 0.5 * a, chi)) - np.pi


def _are_equal(link: Array, middle: Array) -> Array:
    """True if lengths are equal but for rounding, which decides about chi where they fold up."""
    return (link - middle) ** 2 <= (_ROUNDING * middle) ** 2


def _slopes_of_sum(angles: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    side, link, middle = numbers
    along = link * np.cos(angles[0])
    bend = link * link + middle * along
    equal = _are_equal(link, middle)
    square = np.where(equal, 1.0, bend + middle * (middle + along))
    return side * np.stack([np.where(equal, 0.5, bend / square), np.ones_like(bend)])


def far_contact(body: Any, first: int, second: int) -> Contact:
    """Both values are > 0 where links `first` < `second`, more than one apart, cross [body
    lengths]."""
    joints, name = range(first, second), f"links {first + 1} and {second + 1}"
    order = np.array([joints, joints[::-1]]) - first
    lengths = np.array([body.lengths[first + 1 : second + 1], body.lengths[first:second][::-1]])
    return Contact(
        name, joints, order, lengths, _straddling, _slopes_of_straddling, CLEARANCE_SMOOTHING
    )


def _straddling(angles: Array, lengths: Array) -> Array:
    """What is > 0 where a link has its ends on both sides of another's line, from the angles and
    lengths on the way from there to its farther end.

    With m and d the mean and half the difference of the distances of its ends from the line, it
    lies on one side iff ``|d| - |m| <= 0``. Smoothing also closes the gap through which parallel
    links would slip through each other when both ends pass at once.
    """
    xp, smoothing = namespace(angles), CLEARANCE_SMOOTHING**2
    heights = lengths * xp.sin(xp.cumsum(angles))
    half = 0.5 * heights[-1:, :]
    square = (xp.sum_rows(heights) - half) ** 2
    # never above |m|, and below it by at most 0.3 of the smoothing
    return xp.sqrt(half**2 + smoothing) - square / xp.sqrt(square + smoothing)


def _slopes_of_straddling(angles: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    turn, smoothing = np.cumsum(angles, axis=0), CLEARANCE_SMOOTHING**2
    heights, along = lengths * np.sin(turn), lengths * np.cos(turn)
    half = 0.5 * heights[-1]
    mean = heights.sum(axis=0) - half
    square = mean * mean + smoothing
    on_mean = -mean * (square + smoothing) / (square * np.sqrt(square))
    on_half = half / np.sqrt(half * half + smoothing) - on_mean
    return on_mean * _ahead(along) + on_half * 0.5 * along[-1]


def _ahead(rows: np.ndarray) -> np.ndarray:
    """Sums of each row and those after it: a joint carries all links beyond it."""
    return np.cumsum(rows[::-1], axis=0)[::-1]


def lacking_width(body: Any, end: int, link: int) -> Contact:
    """The width w that an end and a link at the distance d lack to first order, ``(w^2 - d^2)/2w``
    [body lengths]: unlike the distance it has a derivative on the link."""
    between = range(link + 1, end) if end > link else range(link - 1, end - 1, -1)
    joints = range(link, end - 1) if end > link else range(end, link)
    order = np.arange(len(joints))[:: 1 if end > link else -1]
    numbers = np.array([body.width, body.lengths[link], *(body.lengths[k] for k in between)])
    both = np.tile(order, (2, 1)), np.tile(numbers, (2, 1))  # one condition alone
    name = f"end {end} and link {link + 1}"
    return Contact(name, joints, *both, _lacking, _slopes_of_lacking, CLEARANCE_SMOOTHING)


def _outside(xp: Any, along: Array, length: Array) -> Array:
    return 0.5 * (along - xp.abs(along)) + 0.5 * (along - length + xp.abs(along - length))


def _lacking(angles: Array, numbers: Array) -> Array:
    xp, w, length, lengths = namespace(angles), numbers[:1, :], numbers[1:2, :], numbers[2:, :]
    turn = xp.cumsum(angles)
    # from the end of the link that is nearer along the chain, into the link and across
    along, across = -xp.sum_rows(lengths * xp.cos(turn)), xp.sum_rows(lengths * xp.sin(turn))
    return (w * w - (_outside(xp, along, length) ** 2 + across**2)) / (2 * w)


def _slopes_of_lacking(angles: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    (w, length), lengths, turn = numbers[:2], numbers[2:], np.cumsum(angles, axis=0)
    x, y = lengths * np.cos(turn), lengths * np.sin(turn)
    outside = _outside(np, -x.sum(axis=0), length)  # where it is none its slope does not count
    return -(outside * _ahead(y) + y.sum(axis=0) * _ahead(x)) / w


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
    if not is_chain(body) or pairs == ():
        return np.zeros(angles.shape[1])
    ends = np.stack(body.joints(angles))
    close = _within_reach(ends, _pairs_apart(body.n_link, 2)) if pairs is None else list(pairs)
    depth = _in_blocks(_crossing, ends, close).max(axis=0, initial=0.0)
    if body.width == 0:
        return depth
    beside = ends_and_links(body) if pairs is None else _ends_beside(close).reshape(-1, 2)
    return _with_width(depth, _gaps(ends, beside).min(axis=0, initial=np.inf), body.width)


def passing_depth(body: Any, angles: np.ndarray) -> float:
    """Depth to which links pass through each other between successive points of a path [body
    lengths].

    A link cannot cross another without an end of one passing through the other, also where no
    sample holds a crossing: an end beside the other link changes its side. The depth is the smaller
    of its distances before and after.
    """
    if not is_chain(body):
        return 0.0
    ends = np.stack(body.joints(angles))
    close = _within_reach(ends, _pairs_apart(body.n_link, 2))
    return float(_in_blocks(_passing, ends, close).max(initial=0.0))


def overlapping_pairs(ends: np.ndarray, pairs: Sequence[Pair], width: float, least: float) -> Pairs:
    """Pairs of links that overlap, or pass through each other along a path, by more than `least`
    [body lengths]; from the coordinates ``(2, n_link + 1, n_time)`` of joints and tips."""
    close = _within_reach(ends, pairs, width)
    depth = _in_blocks(_crossing, ends, close)
    if width > 0:
        gaps = [_gaps(ends, beside) for beside in _ends_beside(close)]
        depth = _with_width(depth, np.min(gaps, axis=0), width)
    deepest = np.maximum(depth.max(axis=1), _in_blocks(_passing, ends, close))
    return tuple(pair for pair, deep in zip(close, deepest, strict=True) if deep > least)


def _in_blocks(
    of_pairs: Callable[[np.ndarray, Sequence[Pair]], np.ndarray],
    ends: np.ndarray,
    pairs: Sequence[Pair],
) -> np.ndarray:
    size = max(1, _BLOCK // ends.shape[2])
    blocks = (pairs[k : k + size] for k in range(0, max(1, len(pairs)), size))
    return np.concatenate([of_pairs(ends, block) for block in blocks])


def _columns(pairs: Sequence[Pair] | np.ndarray) -> np.ndarray:
    return np.array(pairs, dtype=int).reshape(-1, 2).T


def _ends_beside(pairs: Sequence[Pair]) -> np.ndarray:
    """Each end of either link, and the other link, ``(4, n_pair, 2)``."""
    i, j = _columns(pairs)
    return np.stack([(j, i), (j + 1, i), (i, j), (i + 1, j)]).transpose(0, 2, 1)


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt(vectors[0] * vectors[0] + vectors[1] * vectors[1])


def _crossing(ends: np.ndarray, pairs: Sequence[Pair]) -> np.ndarray:
    heights, _ = _seen_ends(ends, pairs)
    crossing = (heights[0] * heights[1] < 0) & (heights[2] * heights[3] < 0)
    return np.where(crossing, np.abs(heights).min(axis=0), 0.0)


def _gaps(ends: np.ndarray, ends_links: Sequence[Pair] | np.ndarray) -> np.ndarray:
    end, link = _columns(ends_links)
    along, to = ends[:, link + 1] - ends[:, link], ends[:, end] - ends[:, link]
    part = np.clip((along * to).sum(axis=0) / (along * along).sum(axis=0), 0.0, 1.0)
    return _length(to - part * along)


def _with_width(depth: np.ndarray, gap: np.ndarray, width: float) -> np.ndarray:
    return depth + np.maximum(width - np.where(depth > 0, 0.0, gap), 0.0)


def _passing(ends: np.ndarray, pairs: Sequence[Pair]) -> np.ndarray:
    """Depths ``(n_pair,)`` to which links of pairs pass through each other between times."""
    heights, beside = _seen_ends(ends, pairs)
    through = (heights[..., 1:] * heights[..., :-1] < 0) & beside[..., 1:] & beside[..., :-1]
    depth = np.minimum(np.abs(heights[..., 1:]), np.abs(heights[..., :-1]))
    return np.where(through, depth, 0.0).max(axis=(0, 2), initial=0.0)


def _seen_ends(ends: np.ndarray, pairs: Sequence[Pair]) -> tuple[np.ndarray, np.ndarray]:
    """Of pairs (i, j) of links, signed distances of the ends of link j from the line of link i,
    then the other way round, and whether they lie beside the link, ``(4, n_pair, n_time)``."""
    heights, beside = [], []
    i, j = _columns(pairs)
    for line, link in ((i, j), (j, i)):
        along = ends[:, line + 1] - ends[:, line]
        length = _length(along)
        for to in (ends[:, link] - ends[:, line], ends[:, link + 1] - ends[:, line]):
            heights.append((along[0] * to[1] - along[1] * to[0]) / length)
            beside.append(np.abs((along * to).sum(axis=0) / length - 0.5 * length) < 0.5 * length)
    return np.array(heights), np.array(beside)


def _within_reach(ends: np.ndarray, pairs: Sequence[Pair], width: float = 0.0) -> list[Pair]:
    """Pairs whose links can come nearer than their width, at a time point or on the straight way to
    the next: their middles say that most never do."""
    middles = 0.5 * (ends[:, 1:] + ends[:, :-1])
    lengths = _length(ends[:, 1:] - ends[:, :-1]).max(axis=1, initial=0.0)

    def within(middles, pairs):
        i, j = _columns(pairs)
        apart = middles[:, j] - middles[:, i]
        step = _length(np.diff(apart)).max(axis=1, initial=0.0)
        reach = 0.5 * (lengths[i] + lengths[j] + step) + width
        return _length(apart).min(axis=1, initial=np.inf) <= reach

    here = _in_blocks(within, middles, pairs)
    return [pair for pair, is_close in zip(pairs, here, strict=True) if is_close]
