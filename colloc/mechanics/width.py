"""How near the links of a chain come to each other, and what a width asks of a shape.

A link of width w is a strip with round ends, w/2 to either side of its middle line. The rule: *no joint and no free end comes
nearer than w to the middle line of a link that it is not an end of*. Where no middle lines cross this says, since the distance
of two segments is that of an end of one from the other:

- links that are not neighbours do not overlap: their middle lines are at least w apart;
- neighbours, which overlap about their joint whatever they do (a hinge is cut away there), close until the free end of the
  shorter one, of length l, lies beside the other: the joint turns up to ``pi - asin(w / l)``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from colloc.mechanics.contact import crossing_depth
from colloc.mechanics.links import Links
from colloc.numerics.arrays import Array, namespace

Pair = tuple[int, int]


def ends_and_links(body: Links, pairs: Sequence[Pair] | None = None) -> list[Pair]:
    """All (end, link) where the joint or tip number `end`, from 0 at the tail, is no end of the link; or of pairs of links."""
    if pairs is None:
        return [(end, link) for link in range(body.n_link) for end in range(body.n_link + 1) if end not in (link, link + 1)]
    return [(end, link) for i, j in pairs for link, ends in ((i, (j, j + 1)), (j, (i, i + 1))) for end in ends]


def square_distance(body: Links, angles: Array, end: int, link: int) -> Array:
    """Of a joint or tip from a link, ``(1, n_time)``, from joint angles ``(n_joint, n_time)``; NumPy and CasADi."""
    xp = namespace(angles)
    step = 1 if end > link else -1
    length, along, across, turn = body.lengths[link], 0.0, 0.0, 0.0
    # walk along the chain in the frame of the link, from its near end; away from the tail or towards it
    for k in range(link + 1, end) if step > 0 else range(link - 1, end - 1, -1):
        joint = k - 1 if step > 0 else k
        turn = turn + angles[joint : joint + 1, :]
        along = along - body.lengths[k] * xp.cos(turn)
        across = across + body.lengths[k] * xp.sin(turn)
    # `along` is counted from the near end into the link: what lies outside of [0, length]
    outside = 0.5 * (along - xp.abs(along)) + 0.5 * (along - length + xp.abs(along - length))
    return outside * outside + across * across


def excesses(body: Links, angles: Array) -> list[tuple[Pair, Array]]:
    """For every end and link a smooth function that is <= 0 where they keep the width, to first order the width that they lack
    [body lengths], ``(1, n_time)``; it has a derivative on the link too, where the distance has none."""
    w = body.width
    return [(p, (w * w - square_distance(body, angles, *p)) / (2 * w)) for p in ends_and_links(body)]


def gap(body: Links, angles: np.ndarray, pairs: Sequence[Pair] | None = None) -> np.ndarray:
    """The smallest distance of an end from a link that it is not an end of [body lengths], ``(n_time,)``; 0 where links cross.

    Of all, or of pairs of links. Neighbours of equal lengths l folded by an angle beyond pi/2 have the gap l sin(pi - |angle|).
    """
    found = [_from_segment(np.stack(body.joints(angles)), end, link) for end, link in ends_and_links(body, pairs)]
    return np.where(crossing_depth(body, angles, pairs) > 0, 0.0, np.min(found, axis=0, initial=np.inf))


def overlap(body: Links, angles: np.ndarray, pairs: Sequence[Pair] | None = None) -> np.ndarray:
    """What links lack of their width, and how far they cross besides [body lengths], ``(n_time,)``; 0 where they keep it."""
    depth = crossing_depth(body, angles, pairs)
    return depth if body.width == 0 else depth + np.maximum(body.width - gap(body, angles, pairs), 0.0)


def _from_segment(ends: np.ndarray, end: int, link: int) -> np.ndarray:
    """Distance of a joint or tip from a link, by the coordinates ``(2, n_link + 1, n_time)`` of all, ``(n_time,)``."""
    along, to = ends[:, link + 1] - ends[:, link], ends[:, end] - ends[:, link]
    part = np.clip((along * to).sum(axis=0) / (along * along).sum(axis=0), 0.0, 1.0)
    return np.hypot(*(to - part * along))
