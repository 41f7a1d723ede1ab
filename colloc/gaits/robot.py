"""What a problem states of joints and motors: their limits, one for all or one for each; and a
robot in SI units, with the numbers of a problem that follow from it.

Problems have no dimensions: with body length L, weight m g and period T the pace is the Froude
number Fr = L / (g T^2), a torque is in m g L, a joint speed in radians per T.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.gaits.objective import DRIVEN, Objective
from colloc.gaits.regime import Free
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import PathLimit
from colloc.mechanics.inertia import GRAVITY
from colloc.system.arguments import check_range, is_number, named_arguments, shown
from colloc.system.errors import ProblemError

LARGEST = 1e9  # of metres, kilograms and seconds; the smallest is its inverse
_LONGEST = 20.0  # metres; a longer body is rather one in centimetres
INERTIA_COUNTS = 1e-3
"""Froude number over the smallest friction coefficient from which inertia counts: it changes the
efficiency by about its square times 1e3, a thousandth there."""
DERIVED = ("froude", "speed_limit", "torque_limit")
"""Fields of a problem that follow from a robot; the objective does unless one is stated."""


@named_arguments
@dataclass(frozen=True, kw_only=True)
class Robot:
    """A robot in SI units, for `Problem(robot=...)`: its pace, limits and objective follow from it.

    Parameters
    ----------
    length : float
        Of the stretched body [m].
    mass : float
        [kg].
    period : float or (float, float)
        Time that a cycle takes [s]; or the shortest and the longest, between which it is sought.
    max_speed, max_torque : float or sequence of float, optional
        Of all motors or of each [rad/s], [N m].
    idle_power : float
        What electronics draw, whatever the motors do [W].
    backlash : float
        Play of a joint [rad]; a gait whose joints all move by less is none.
    gravity : float
        [m/s^2].

    Raises
    ------
    ProblemError
        If a number is unusable, or looks as if it were in centimetres.

    Examples
    --------
    >>> import colloc
    >>> snake = colloc.Robot(length=0.62, mass=0.9, period=2.5, max_torque=1.2, idle_power=2)
    >>> problem = colloc.Problem("snake", robot=snake)
    >>> problem.objective.short, round(problem.froude, 4), round(problem.torque_limit, 3)
    ('d/E', 0.0101, 0.219)
    """

    length: float
    mass: float
    period: float | tuple[float, float]
    max_speed: float | tuple[float, ...] | None = None
    max_torque: float | tuple[float, ...] | None = None
    idle_power: float = 0.0
    backlash: float = 0.0
    gravity: float = GRAVITY

    def __post_init__(self) -> None:
        for name in ("period", "max_speed", "max_torque"):
            value = getattr(self, name)
            if isinstance(value, (Sequence, np.ndarray)) and not isinstance(value, str):
                object.__setattr__(self, name, tuple(np.ravel(np.array(value, object)).tolist()))
        paces = self.period if isinstance(self.period, tuple) else (self.period,)
        if len(paces) > 2 or (len(paces) == 2 and not paces[0] < paces[1]):
            raise ProblemError(
                f"period must be a number of seconds, or the shortest and the longest, not "
                f"{shown(self.period)}."
            )
        sizes = {"length": self.length, "mass": self.mass, "gravity": self.gravity}
        for each in (sizes, *({"period": pace} for pace in paces)):
            check_range(1 / LARGEST, LARGEST, **each)
        check_range(0.0, LARGEST, idle_power=self.idle_power, backlash=self.backlash)
        if self.length > _LONGEST:
            raise ProblemError(
                f"length={self.length:g} is {self.length:g} metres, and at most {_LONGEST:g} are "
                f"taken. If these are centimetres, write length={self.length / 100:g}."
            )

    def pressing(self, grade: float) -> float:
        """Component of gravity normal to the ground [m/s^2]."""
        return self.gravity * math.cos(math.atan(grade))

    def torque_unit(self, grade: float) -> float:
        """m g L [N m]."""
        return self.mass * self.pressing(grade) * self.length

    def speed_limits(self, grade: float, n_joint: int) -> tuple[PathLimit, ...]:
        """Limits of the joints' speeds where the period is sought with the gait."""
        if not isinstance(self.period, tuple) or self.max_speed is None:
            return ()
        root = math.sqrt(self.length / self.pressing(grade))
        return (PathLimit(SPEED_OF_ROBOT, "speed", _scaled(self.max_speed, root)).on(n_joint),)

    def dimensionless(self, grade: float, smallest_friction: float) -> dict[str, Any]:
        """The objective and the fields `DERIVED` of a problem on such a grade; without inertia if
        it does not count beside the smallest coefficient of friction."""
        pressing = self.pressing(grade)
        unit = self.torque_unit(grade)
        times = self.period if isinstance(self.period, tuple) else (self.period,)
        low, high = (self.length / (pressing * t**2) for t in (times[-1], times[0]))
        froude: Any = Free(low, high) if len(times) == 2 else low
        if high < INERTIA_COUNTS * smallest_friction and len(times) == 1:
            froude = 0.0
        seconds, period = times[0], ""
        if len(times) == 2:
            seconds, period = math.sqrt(self.length / pressing), " * period"
        idle = self.idle_power * seconds / unit
        battery = f"distance / (driven_work + {idle:.17g}{period})"
        return {
            "objective": Objective(battery, name=BATTERY) if idle else DRIVEN,
            "froude": froude,
            "speed_limit": None if len(times) == 2 else _scaled(self.max_speed, times[0]),
            "torque_limit": _scaled(self.max_torque, 1.0 / unit),
        }


SPEED_OF_ROBOT = "joint speed of the robot"
BATTERY = "battery efficiency"
"""Distance over the energy that a battery gives: work of motors that brake without regeneration,
and idle power; in weights times length."""


def _scaled(limit: Any, by: float) -> Any:
    if isinstance(limit, tuple):
        return tuple(by * each for each in limit)
    return limit if limit is None else by * limit


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
