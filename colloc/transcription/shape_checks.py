"""Path constraints of shapes and their rates: joint limits, joint speeds, links that must not
cross."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from colloc.gaits.limits import Limit, range_of
from colloc.mechanics.bodies import Body, Stretch
from colloc.mechanics.contact import Contact, Pairs, smooth_minimum, tangent_of_minimum
from colloc.mechanics.joint_map import JointMap
from colloc.numerics.arrays import Array, namespace
from colloc.numerics.peaks import vertex

_PLACES, _FLAT = 9, 1e-12
"""On a stretch of a smooth body; a bend of its angle below which it has no peak."""


@dataclass(frozen=True, eq=False)
class ShapeCheck:
    """A scalar function of the shape that admissibility bounds from above (angles also from below),
    or of the shape's rates.

    along: its values ``(n_time,)`` at shapes ``(n_joint, n_time)``. share: there, the weight of the
    first of two functions of which this is the minimum, or -1; of the largest angle on a stretch of
    a smooth body, where on the body it is. cut: of shapes and shares ``(n_time,)``, or CasADi's for
    one, the tangent planes of these weights, the function itself where they are negative, or the
    angles at these places, ``(1, n_time)``. slope: its derivative with respect to the shape. row:
    it per shape coordinate, if it is linear. place: which of the body's angles it is, -1 if it is
    none. fixed: its bounds, if these are not the limits of such an angle. derivative: 1 if "shapes"
    are their rates per period.
    """

    name: str
    along: Callable[[np.ndarray], np.ndarray]
    share: Callable[[np.ndarray], np.ndarray]
    cut: Callable[[Array, Array], Array]
    slope: ca.Function
    row: np.ndarray | None = None
    place: int = -1
    fixed: tuple[float, float] | None = None
    derivative: int = 0

    @property
    def linear(self) -> bool:
        return self.row is not None or self.place >= 0

    @property
    def n_joint(self) -> int:
        return int(self.slope.size1_in(0))

    @property
    def joints(self) -> np.ndarray:
        """Shape coordinates it depends on, ``(n,)`` int."""
        pattern = self.slope.sparsity_out(0)
        return np.array(pattern.row(), dtype=int)

    def slopes(self, shares: np.ndarray) -> np.ndarray:
        """Derivatives ``(n_time, n_joint)`` of a linear one."""
        still = np.zeros((self.n_joint, shares.size))
        return np.array(ca.densify(self.slope(still, shares[None]))).T.reshape(shares.size, -1)

    @property
    def both_ways(self) -> bool:
        return self.fixed is None or np.isfinite(self.fixed[0])

    def bounds(self, limit: Limit) -> tuple[float, float]:
        return self.fixed or range_of(limit[self.place] if isinstance(limit, tuple) else limit)

    def of(self, gait: Any, times: np.ndarray) -> np.ndarray:
        """Shapes of a gait, or their rates, ``(n_joint, n_time)``."""
        return np.asarray(gait.rates(times) if self.derivative else gait.angles(times))

    def matrix(self, gait_class: Any, times: np.ndarray, n_joint: int) -> np.ndarray:
        matrix = gait_class.rate_matrix if self.derivative else gait_class.angle_matrix
        return np.asarray(matrix(times, n_joint))

    def offset(self, gait_class: Any, n_joint: int) -> np.ndarray:
        return np.zeros((n_joint, 1)) if self.derivative else np.asarray(gait_class.offset(n_joint))

    def magnitudes(self, shapes: np.ndarray, limit: Limit) -> np.ndarray:
        """Distance of values from the middle of their bounds."""
        values = self.along(shapes)
        return np.abs(values - self.middle(limit)) if self.both_ways else values

    def middle(self, limit: Limit) -> float:
        return 0.5 * sum(self.bounds(limit)) if self.both_ways else 0.0

    def itself(self, shapes: np.ndarray) -> np.ndarray:
        """Shares at which the cuts are the function itself."""
        return self.share(shapes) if self.both_ways else np.full(shapes.shape[1], -1.0)

    def nearer_bounds(self, values: np.ndarray, limit: Limit) -> tuple[np.ndarray, np.ndarray]:
        """The nearer bound of values ``(n,)``; infinite in place of the other."""
        lower, upper = self.bounds(limit)
        below = values - lower < upper - values
        return np.where(below, lower, -np.inf), np.where(below, np.inf, upper)

    def excess(self, values: np.ndarray, limit: Limit) -> np.ndarray:
        lower, upper = self.bounds(limit)
        return np.maximum(values - upper, lower - values)


@lru_cache(maxsize=64)
def shape_checks(
    body: Body,
    far: Pairs = (),
    speeds: tuple[float, ...] = (),
    joint_map: JointMap | None = None,
) -> list[ShapeCheck]:
    """Angles within the limit, then contacts of near pairs and of pairs `far`, then rates over the
    largest allowed, `speeds` [rad per period]."""
    angles = ca.SX.sym("q", body.n_joint)
    bounded = body.bounded_angles
    names, stretches = enumerate(bounded.names), bounded.stretches
    if stretches:
        checks = [
            _stretch_check(name, angles, stretch, k)
            for (k, name), stretch in zip(names, stretches, strict=True)
        ]
    else:
        checks = [
            _angle_check(name, angles, row, k)
            for (k, name), row in zip(names, bounded.rows, strict=True)
        ]
    known = _contact_checks(body)
    checks += [
        known.get(each.name) or known.setdefault(each.name, _minimum_check(each, angles))
        for each in body.contacts(far)
    ]
    each, name = (
        (joint_map.inverse, "motor")
        if joint_map
        else (np.eye(body.n_joint), body.defaults.coordinate)
    )
    rates = (
        _angle_check(f"speed of {name} {j + 1}", angles, each[j] / most, -1)
        for j, most in enumerate(speeds)
    )
    return checks + [replace(rate, fixed=(-1.0, 1.0), derivative=1) for rate in rates]


@lru_cache(maxsize=64)
def _contact_checks(body: Body) -> dict[str, ShapeCheck]:
    return {}


def _angle_check(name: str, angles: ca.SX, row: np.ndarray, place: int) -> ShapeCheck:

    def cut(shapes: Array, shares: Array) -> Array:
        return namespace(shapes).matmul(row[None], shapes)

    return ShapeCheck(
        name,
        lambda shapes: row @ shapes,
        lambda shapes: np.full(shapes.shape[1], -1.0),
        cut,
        _slope(cut, angles),
        row,
        place,
    )


def _stretch_check(name: str, angles: ca.SX, stretch: Stretch, place: int) -> ShapeCheck:
    """The largest angle on a stretch of a smooth body."""
    fine = np.linspace(stretch.first, stretch.last, _PLACES)
    rows = stretch.angles_at(fine)

    def largest(shapes: np.ndarray) -> np.ndarray:
        """Place of the maximum, ``(n_time,)``, by a parabola."""
        heights = np.abs(rows @ shapes)
        inner = np.clip(np.argmax(heights, axis=0), 1, _PLACES - 2)
        every = np.arange(heights.shape[1])
        low, mid, high = (heights[inner + k, every] for k in (-1, 0, 1))
        offset = np.where(
            low - 2 * mid + high < -_FLAT, vertex(low, mid, high), np.sign(high - low)
        )
        return fine[inner] + np.clip(offset, -1, 1) * (fine[1] - fine[0])

    def along(shapes: np.ndarray) -> np.ndarray:
        return cut(shapes, largest(shapes))[0]

    def cut(shapes: Array, places: Array) -> Array:
        return namespace(shapes).sum_rows(stretch.angles_at(places).T * shapes)

    return ShapeCheck(name, along, largest, cut, _slope(cut, angles), place=place)


def _slope(cut: Callable[[Array, Array], Array], angles: ca.SX) -> ca.Function:
    share = ca.SX.sym("share")
    return ca.Function(
        "slope", [angles, share], [ca.sparsify(ca.jacobian(cut(angles, share), angles).T)]
    )


def _minimum_check(contact: Contact, angles: ca.SX) -> ShapeCheck:
    def cut(shapes: Array, shares: Array) -> Array:
        xp, (first, second) = namespace(shapes), contact.pair(shapes)
        tangent = tangent_of_minimum(first, second, 0.5 * (shares + xp.abs(shares)), contact.width)
        return xp.where(shares < 0, smooth_minimum(first, second, contact.width), tangent)

    return ShapeCheck(
        contact.name,
        lambda shapes: contact.excess(shapes)[0],
        lambda shapes: contact.share(shapes)[0],
        cut,
        _slope(cut, angles),
        fixed=(-np.inf, 0.0),
    )
