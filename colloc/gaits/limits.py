"""Limits on joints as a problem states them: one for all, or one for each."""

from __future__ import annotations

from typing import Any

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.system.arguments import is_number
from colloc.system.errors import ProblemError

Limit = float | tuple[Any, ...]
"""Largest magnitude of all angles, or of each joint angle, or (least, largest) of each."""


def checked_limit(body: Body, limit: Any) -> Limit:
    """A joint limit as a number, or a tuple of a number or (least, largest) for each joint."""
    if isinstance(limit, np.ndarray) and limit.ndim == 0:
        limit = limit.item()
    if not isinstance(limit, (tuple, list, np.ndarray)):
        return _checked_joint(body, limit)
    each = tuple(_checked_joint(body, joint) for joint in limit)
    if len(each) != body.n_joint or len(body.bounded_angles.names) != body.n_joint:
        raise ProblemError(
            f"joint_limit has {len(each)} values; give one for all joints, or one for each joint "
            f"of a chain."
        )
    return each


def _checked_joint(body: Body, limit: Any) -> Any:
    largest = body.defaults.largest_limit
    if np.ndim(limit):
        pair = _numbers(limit)
        if len(pair) != 2:
            raise ProblemError(
                f"joint_limit of a joint is a number, or its least and its largest angle, not "
                f"{limit!r}."
            )
        if pair[0] != -pair[1]:
            if -largest - 1e-12 <= pair[0] < 0 < pair[1] <= largest + 1e-12:
                return pair
            raise ProblemError(
                f"joint_limit {pair!r} must go from a negative to a positive angle in radians, "
                f"neither beyond {largest:.4g}: the straight body has to lie between."
            )
        limit = pair[1]
    if not is_number(limit) or not 0 < limit <= largest + 1e-12:
        most = f"pi/{np.pi / largest:g}".removesuffix("/1")
        shown = f"{limit:g}" if is_number(limit) else repr(limit)
        raise ProblemError(f"joint_limit must lie in (0, {most}], not {shown}.")
    return float(limit)


def checked_actuator_limit(name: str, limit: Any, n_joint: int) -> Limit | None:
    """A limit as a number or a tuple of one for each joint; None is none."""
    if limit is None:
        return None
    each = _numbers(limit)
    if not each or not all(0 < a < np.inf for a in each):
        raise ProblemError(f"{name} must be positive and finite, not {limit!r}.")
    if np.ndim(limit) and len(each) != n_joint:
        raise ProblemError(
            f"{name} has {len(each)} values; give one for all joints, or one for each of the "
            f"{n_joint}."
        )
    return each if np.ndim(limit) else each[0]


def _numbers(limit: Any) -> tuple[float, ...]:
    each = np.ravel(np.asarray(limit, dtype=object))
    return tuple(float(a) for a in each) if all(map(is_number, each)) else ()


def joint_ranges(limit: Limit, n_joint: int) -> np.ndarray:
    """Least and largest angle of each joint, ``(n_joint, 2)``."""
    each = limit if isinstance(limit, tuple) else (limit,) * n_joint
    return np.array([joint if isinstance(joint, tuple) else (-joint, joint) for joint in each])


def one_sided(limit: Limit) -> bool:
    """True if a joint may bend farther to one side than to the other."""
    return bool(joint_ranges(limit, 1).sum(axis=1).any())


def widest(limit: Limit) -> float:
    return float(np.abs(joint_ranges(limit, 1)).max())


def of_each(limit: Limit | None, n_joint: int) -> tuple[float, ...]:
    """The limits joint by joint; empty without one."""
    if limit is None:
        return ()
    return tuple(np.broadcast_to(np.asarray(limit, dtype=float), n_joint).tolist())


def under_one_limit(angles: np.ndarray, limit: Limit) -> tuple[np.ndarray, float]:
    """Scale each joint angle ``(n_joint, n)`` by its limit so that one limit, returned too, holds
    for all."""
    if not isinstance(limit, tuple):
        return angles, limit
    low, high = joint_ranges(limit, len(angles)).T[:, :, None]
    return angles * (widest(limit) / np.where(angles < 0, -low, high)), widest(limit)
