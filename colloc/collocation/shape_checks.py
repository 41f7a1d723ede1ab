"""CasADi expressions of the bounds on shapes: joint limits, and links that must not cross."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from colloc.mechanics.body import Chain
from colloc.mechanics.contact import (
    CLEARANCE_SMOOTHING,
    SMOOTHING,
    Pairs,
    crossing_sums,
    intrusions,
    share_of_first,
    smooth_minimum,
    tangent_of_minimum,
)


@dataclass(frozen=True, eq=False)
class ShapeCheck:
    """A scalar function of the joint angles that admissibility bounds from above (joint angles also from below).

    value: of the angles. share: of the angles, the weight of the first of two sums of which the function is the minimum,
    or -1. cut: of the angles and a share, the tangent plane of that weight, or the function itself where it is negative.
    slope: its derivative with respect to the angles. joint: which joint's angle it is itself; -1 if none's.
    """

    name: str
    value: ca.Function
    share: ca.Function
    cut: ca.Function
    slope: ca.Function
    joint: int = -1

    @property
    def on_joint(self) -> bool:
        """Whether it is a joint angle itself, bounded from below too."""
        return self.joint >= 0


@lru_cache(maxsize=64)
def shape_checks(body: Chain, far: Pairs = ()) -> list[ShapeCheck]:
    """Functions of the joint angles that admissibility bounds.

    Each joint angle, to be kept within its limits; then functions that must not be positive: for all links two apart, and
    for the pairs `far` of links farther apart.
    """
    angles = ca.SX.sym("q", body.n_joint)
    checks = [_joint_check(f"joint {j + 1}", angles, j) for j in range(body.n_joint)]
    for i, (first, second) in enumerate(crossing_sums(body, angles)):
        name = f"links {i + 1} and {i + 3}"
        checks.append(_minimum_check(f"{name} (left)", angles, first - np.pi, second - np.pi))
        checks.append(_minimum_check(f"{name} (right)", angles, -first - np.pi, -second - np.pi))
    for i, j in far:
        checks.append(
            _minimum_check(f"links {i + 1} and {j + 1}", angles, *intrusions(body, angles, i, j), CLEARANCE_SMOOTHING)
        )
    return checks


def _joint_check(name: str, angles: ca.SX, joint: int) -> ShapeCheck:
    share, value = ca.SX.sym("share"), angles[joint]
    none = ca.Function("share", [angles], [ca.SX(-1)])
    return ShapeCheck(name, ca.Function("check", [angles], [value]), none, *_cut(angles, share, value), joint)


def _cut(angles: ca.SX, share: ca.SX, cut: ca.SX) -> tuple[ca.Function, ca.Function]:
    slope = ca.densify(ca.gradient(cut, angles))
    return ca.Function("cut", [angles, share], [cut]), ca.Function("slope", [angles, share], [slope])


def _minimum_check(name: str, angles: ca.SX, first: ca.SX, second: ca.SX, width: float = SMOOTHING) -> ShapeCheck:
    value, share = smooth_minimum(first, second, width), ca.SX.sym("share")
    cut = ca.if_else(share < 0, value, tangent_of_minimum(first, second, ca.fmax(share, 0), width))
    return ShapeCheck(
        name,
        ca.Function("check", [angles], [value]),
        ca.Function("share", [angles], [share_of_first(first, second, width)]),
        *_cut(angles, share, cut),
    )
