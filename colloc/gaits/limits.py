"""Limits on joints as a problem states them: one for all, or one for each."""

from __future__ import annotations

from typing import Any

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.system.arguments import is_number
from colloc.system.errors import ProblemError

Limit = float | tuple[Any, ...]
"""On the magnitude of all angles of a body, or of each joint angle of a chain, or its least and its
largest value."""


def checked_limit(body: Body, limit: Any) -> Limit:
    """A limit as it is, or as a tuple of one for each joint. `ProblemError` if it cannot be used
    for the body."""
    if isinstance(limit, np.ndarray) and limit.ndim == 0:
        limit = limit.item()
    if not isinstance(limit, (tuple, list, np.ndarray)):
        return _checked_number(body, limit)
    each = tuple(_range_or_number(own) for own in limit)
    for own in each:
        if isinstance(own, tuple):
            _check_range(own, body.usual.largest_limit)
    each = tuple(own if isinstance(own, tuple) else _checked_number(body, own) for own in each)
    if len(each) != body.n_joint or len(body.limit_names) != body.n_joint:
        raise ProblemError(
            f"joint_limit has {len(each)} values; give one for all joints, or one for each joint "
            f"of a chain."
        )
    return each


def _range_or_number(own: Any) -> Any:
    if np.ndim(own) == 0:
        return own
    pair = _each(own)
    if len(pair) != 2:
        raise ProblemError(
            f"joint_limit of a joint is a number, or its least and its largest angle, not {own!r}."
        )
    return pair if pair[0] != -pair[1] else pair[1]


def _check_range(own: tuple[float, float], largest: float) -> None:
    if not -largest - 1e-12 <= own[0] < 0 < own[1] <= largest + 1e-12:
        raise ProblemError(
            f"joint_limit {own!r} must go from a negative to a positive angle in radians, neither "
            f"beyond {largest:.4g}: the "
            "straight body has to lie between."
        )


def _checked_number(body: Body, limit: Any) -> Any:
    largest = body.usual.largest_limit
    if not is_number(limit) or not 0 < limit <= largest + 1e-12:
        most = f"pi/{np.pi / largest:g}".removesuffix("/1")
        shown = f"{limit:g}" if is_number(limit) else repr(limit)
        raise ProblemError(f"joint_limit must lie in (0, {most}], not {shown}.")
    return float(limit)


def range_of(own: Any) -> tuple[float, float]:
    """The least and the largest angle that a limit of one joint allows."""
    return own if isinstance(own, tuple) else (-own, own)


def one_sided(limit: Limit) -> bool:
    """Whether a joint may bend farther to one side than to the other."""
    return isinstance(limit, tuple) and any(isinstance(own, tuple) for own in limit)


def widest(limit: Limit) -> float:
    """The largest magnitude that the limits allow."""
    return max(of_each_angle(limit, 1))


def of_each_angle(limit: Limit, n_joint: int) -> tuple[float, ...]:
    """The largest magnitude of each joint angle; all alike of so many where there is one limit."""
    each = limit if isinstance(limit, tuple) else (limit,) * n_joint
    return tuple(float(np.abs(own).max()) for own in each)


def of_each(limit: Limit | None, n_joint: int) -> tuple[float, ...]:
    """The limits joint by joint; empty where there is none."""
    return (
        ()
        if limit is None
        else tuple(np.broadcast_to(np.asarray(limit, dtype=float), n_joint).tolist())
    )


def under_one_limit(angles: np.ndarray, limit: Limit) -> tuple[np.ndarray, float]:
    """Shapes ``(n_joint, n)``, each joint stretched by what its limit is below the widest, and
    that: to be held against it."""
    if not isinstance(limit, tuple):
        return angles, limit
    low, high = np.array([range_of(own) for own in limit]).T[:, :, None]
    return angles * (widest(limit) / np.where(angles < 0, -low, high)), widest(limit)


def checked_actuator_limit(name: str, limit: Any, n_joint: int) -> Limit | None:
    """A limit as it is, or as a tuple of one for each joint; None is none. `ProblemError` if it
    cannot be used."""
    if limit is None:
        return None
    each = _each(limit)
    if not each or not all(0 < a < np.inf for a in each):
        raise ProblemError(f"{name} must be positive and finite, not {limit!r}.")
    if np.ndim(limit) and len(each) != n_joint:
        raise ProblemError(
            f"{name} has {len(each)} values; give one for all joints, or one for each of the "
            f"{n_joint}."
        )
    return each if np.ndim(limit) else each[0]


def _each(limit: Any) -> tuple[float, ...]:
    """The limits one by one; none if they are no numbers."""
    each = np.ravel(np.asarray(limit, dtype=object))
    return tuple(float(a) for a in each) if all(map(is_number, each)) else ()
