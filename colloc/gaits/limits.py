"""Limits on joints as a problem states them: one for all, or one for each."""

from __future__ import annotations

from typing import Any

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.system.arguments import is_number
from colloc.system.errors import ProblemError

Limit = float | tuple[float, ...]
"""On the magnitude of all angles of a body, or of each joint angle of a chain."""


def checked_limit(body: Body, limit: Any) -> Limit:
    """A limit as it is, or as a tuple of one for each joint. `ProblemError` if it cannot be used for the body."""
    each, largest = _each(limit), body.usual.largest_limit
    if not each or not all(0 < a <= largest + 1e-12 for a in each):
        most = f"pi/{np.pi / largest:g}".removesuffix("/1")
        shown = f"{limit:g}" if each and np.ndim(limit) == 0 else repr(limit)
        raise ProblemError(f"joint_limit must lie in (0, {most}], not {shown}.")
    if np.ndim(limit) == 0:
        return limit
    if len(each) != body.n_joint or len(body.limit_names) != body.n_joint:
        raise ProblemError(f"joint_limit has {len(each)} values; give one for all joints, or one for each joint of a chain.")
    return each


def widest(limit: Limit) -> float:
    """The largest of the limits."""
    return float(np.max(limit))


def of_each(limit: Limit | None, n_joint: int) -> tuple[float, ...]:
    """The limits joint by joint; empty where there is none."""
    return () if limit is None else tuple(np.broadcast_to(np.asarray(limit, dtype=float), n_joint).tolist())


def under_one_limit(angles: np.ndarray, limit: Limit) -> tuple[np.ndarray, float]:
    """Shapes ``(n_joint, n)``, each joint stretched by what its limit is below the widest, and that: to be held against it."""
    if np.ndim(limit) == 0:
        return angles, limit  # type: ignore[return-value]
    return angles * (widest(limit) / np.array(limit))[:, None], widest(limit)


def checked_actuator_limit(name: str, limit: Any, n_joint: int) -> Limit | None:
    """A limit as it is, or as a tuple of one for each joint; None is none. `ProblemError` if it cannot be used."""
    if limit is None:
        return None
    each = _each(limit)
    if not each or not all(0 < a < np.inf for a in each):
        raise ProblemError(f"{name} must be positive and finite, not {limit!r}.")
    if np.ndim(limit) and len(each) != n_joint:
        raise ProblemError(f"{name} has {len(each)} values; give one for all joints, or one for each of the {n_joint}.")
    return each if np.ndim(limit) else each[0]


def _each(limit: Any) -> tuple[float, ...]:
    """The limits one by one; none if they are no numbers."""
    each = np.ravel(np.asarray(limit, dtype=object))
    return tuple(float(a) for a in each) if all(map(is_number, each)) else ()
