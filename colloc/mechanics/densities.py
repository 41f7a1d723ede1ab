"""Formulas of a time point: what a cycle integrates besides distance and work, and what limits
bound.

A formula is text, so that files can hold it, and is evaluated with NumPy where a motion is replayed
and with CasADi where derivatives are needed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from keyword import iskeyword
from typing import Any

import numpy as np

from colloc.mechanics.balance import joint_moments
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.numerics.expression import FUNCTIONS, Formula, formula
from colloc.system.arguments import is_number, named_arguments
from colloc.system.errors import ProblemError

VARIABLES = {
    "angle": "of every joint [rad]",
    "rate": "of every joint [rad per period]",
    "speed": "of every joint at a free pace [rad per sqrt(length / gravity)]",
    "moment": "that the actuator of every joint exerts [weight x body length]",
    "power": "that it delivers, moment times rate",
    "idle": "power below which regularised friction does not tell who drives whom: "
    "friction at the speed delta",
}
SUMMED = (*FUNCTIONS, "sum")
"""Functions of a formula; ``sum`` is over the joints."""
_WITH_PACE, _WITH_FRICTION = ("rate", "speed", "power", "idle"), ("moment", "power", "idle")
_DOUBLINGS = -20, 1, 4, 20
"""Powers of two by which a formula's degree is found, beyond whatever scale it has of its own."""
_TAKEN = ("distance", "work", "rotation", "across", "period", "efficiency", "value", "instants")


@dataclass(frozen=True)
class JointMap:
    """Joints that share motors, or are stuck: ``q = gears @ m + rest``.

    gears: turn of each joint per motor, ``(n_joint, n_motor)``. rest: joint angles with all motors
    at 0, ``(n_joint,)``; no motor turns a joint that is not at 0 there.
    """

    gears: tuple[tuple[float, ...], ...]
    rest: tuple[float, ...]

    @cached_property
    def matrix(self) -> np.ndarray:
        return np.array(self.gears)

    @cached_property
    def inverse(self) -> np.ndarray:
        """Nearest motor angles to joint angles, ``(n_motor, n_joint)``."""
        return np.linalg.pinv(self.matrix)

    @cached_property
    def offset(self) -> np.ndarray:
        return np.array(self.rest)[:, None]

    @property
    def n_motor(self) -> int:
        return len(self.gears[0])

    def joint_angles(self, motors: Array) -> Array:
        return self.joint_rates(motors) + self.offset

    def joint_rates(self, motors: Array) -> Array:
        return namespace(motors).matmul(self.matrix, motors)

    def motor_rates(self, joints: Array) -> Array:
        return namespace(joints).matmul(self.inverse, joints)

    def motor_moments(self, joints: Array) -> Array:
        """Moments of the motors: each does the work of all joints that hang on it."""
        return namespace(joints).matmul(self.matrix.T, joints)


@dataclass(frozen=True, eq=False)
class Instants:
    """Time points of a body, as formulas see them.

    angles and rates ``(n_joint, n_time)``; rates and delta per period divided by `unit`. z: tail
    velocities that balance the body ``(3, n_time)``; or `moments` at its joints ``(n_joint,
    n_time)``; neither where no formula speaks of moments. load: an outside force on the centre of
    mass, in the body's axes ``(2, n_time)``. joint_map: where formulas speak of motors.
    """

    body: Body
    friction: Law
    angles: Array
    rates: Array
    delta: Array
    z: Array = None
    moments: Array = None
    unit: float = 1.0
    load: Array = None
    joint_map: JointMap | None = None
    froude: Array = None  # in the unit of time of the rates

    def take(self, which: np.ndarray) -> Instants:
        names = ("angles", "rates", "z", "moments", "load")
        rows = {name: getattr(self, name) for name in names}
        some = {name: row[:, which] for name, row in rows.items() if row is not None}
        return replace(self, **some)

    @cached_property
    def moment(self) -> Array:
        body: Any = self.body
        moments = self.moments
        if moments is None:
            forces = body.forces(self.friction, self.angles, self.rates, self.z, self.delta)
            moments = joint_moments(body, self.angles, forces, self.load)
        return self.joint_map.motor_moments(moments) if self.joint_map else moments

    @property
    def power(self) -> Array:
        return self.moment * self.rate

    @property
    def angle(self) -> Array:
        joints = self.joint_map
        return joints.motor_rates(self.angles - joints.offset) if joints else self.angles

    @property
    def rate(self) -> Array:
        rates = self.joint_map.motor_rates(self.rates) if self.joint_map else self.rates
        return self.unit * rates

    @property
    def speed(self) -> Array:
        return self.rates * self.froude**0.5

    @property
    def idle(self) -> Array:
        degree = self.friction.degree or 0.0
        return self.unit * self.friction.largest * self.delta ** (1.0 + degree)


def sample() -> dict[str, Any]:
    rng = np.random.default_rng(0)
    angle, rate, moment = rng.uniform(0.2, 1.0, (3, 3, 5)) * rng.choice([-1.0, 1.0], (3, 3, 5))
    more = {"power": moment * rate, "idle": 1e-3}
    return {"angle": angle, "rate": rate, "speed": rate, "moment": moment} | more


class _OfInstants:
    _text: str

    @property
    def _formula(self) -> Formula:
        return formula(getattr(self, self._text), tuple(VARIABLES), SUMMED)

    @property
    def needs_pace(self) -> bool:
        return "speed" in self._formula.names

    @cached_property
    def needs_forces(self) -> bool:
        """True if it depends on more than shapes and their rates."""
        return bool({"speed", "moment", "power", "idle"} & self._formula.names)

    @cached_property
    def depends_on_delta(self) -> bool:
        """True if it depends on delta by itself."""
        return "idle" in self._formula.names

    def _value(self, now: Instants) -> Array:
        names = [name for name in VARIABLES if name in self._formula.names]
        return self._formula({name: getattr(now, name) for name in names})

    @cached_property
    def friction_degree(self) -> float | None:
        """Power of the friction coefficients to which it is proportional; None if to none."""
        return self._degree(_WITH_FRICTION)

    @cached_property
    def pace_degree(self) -> float | None:
        """Power of the pace to which it is proportional under dry friction; None if to none. An
        integral of degree 1 belongs to a path at any pace, and so does a largest value of degree
        0."""
        return self._degree(_WITH_PACE)

    def _degree(self, scaled: tuple[str, ...]) -> float | None:
        at = sample()
        before, powers = self._formula(at), []
        with np.errstate(all="ignore"):
            for p in _DOUBLINGS:
                after = {k: v * 2.0**p if k in scaled else v for k, v in at.items()}
                powers.append(np.log2(self._formula(after) / before) / p)
        degree = float(np.round(powers[0].flat[0], 6)) + 0.0
        return degree if np.allclose(np.concatenate(powers), degree, rtol=0, atol=1e-9) else None

    def _check(self, what: str, rows: tuple[int, ...], instead: str) -> None:
        """Normalise the formula; a `ProblemError` if it has other rows, or no finite value."""
        text = self._formula.text
        object.__setattr__(self, self._text, text)
        with np.errstate(all="ignore"):
            value = self._formula(sample())
        if np.shape(value) not in [(n, 5) for n in rows]:
            raise ProblemError(f"{what}: '{text}' {instead}.")
        if not np.isfinite(value).all():
            raise ProblemError(f"{what}: '{text}' is not finite for typical values.")

    def fields(self) -> dict[str, Any]:
        """As plain numbers and text (JSON)."""
        values: dict[str, Any] = asdict(self)  # type: ignore[call-overload]
        return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}


@named_arguments
@dataclass(frozen=True)
class Quantity(_OfInstants):
    """An integral over a cycle, for objectives to speak of.

    Parameters
    ----------
    name : str
        The word that objectives use for it.
    density : str
        Formula of ``angle``, ``rate``, ``moment``, ``power`` of every joint, and ``idle`` (friction
        at the speed delta): numbers, ``+ - * / **``, the functions of
        `colloc.numerics.expression`, and ``sum``, over the joints.
    meaning : str, optional
        A description.

    Raises
    ------
    ProblemError
        If it is no formula, has no finite value somewhere, or one for each joint.

    Examples
    --------
    >>> heat = Quantity("heat", "sum(moment**2)", "loss in the windings")
    >>> heat.friction_degree, heat.pace_degree
    (2.0, 0.0)
    """

    name: str
    density: str
    meaning: str = ""

    _text = "density"

    def __post_init__(self) -> None:
        name = self.name
        if (
            not (isinstance(name, str) and name.isidentifier())
            or iskeyword(name)
            or name.endswith(("_error", "_delta"))
            or name in (*_TAKEN, *SUMMED)
        ):
            raise ProblemError(f"a quantity needs a name of its own that is a word, not {name!r}.")
        instead = "is no sum over the joints; put sum(...) around it"
        self._check(f"the quantity {name}", (1,), instead)

    def at(self, now: Instants) -> Array:
        """Density per unit of time of the instants, ``(1, n_time)``."""
        return self._value(now) / now.unit


# the small number is for a derivative where a joint turns back
LENGTH = Quantity("length", "sqrt(sum(rate**2) + 1e-24)", "length of the path in shape space [rad]")
# A motor that is driven backwards brakes: it gives nothing back. The positive part of a power has a
# corner at 0, smoothed at the scale of regularised friction, and vanishes with delta like it.
DRIVEN_WORK = Quantity(
    "driven_work",
    "sum(power + sqrt(power**2 + idle**2)) / 2",
    "work of the actuators where none takes energy back",
)
INTEGRALS = {each.name: each for each in (LENGTH, DRIVEN_WORK)}
"""Quantities that every objective may speak of."""


def quantities_of(quantities: Any) -> tuple[Quantity, ...]:
    """Quantities by their names, or as they are. `ProblemError` for an unknown name."""
    each = list(quantities) if isinstance(quantities, Iterable) else [quantities]
    for one in each:
        if not isinstance(one, Quantity) and one not in INTEGRALS:
            raise ProblemError(
                f"{one!r} is no quantity: name one of {', '.join(INTEGRALS)}, or state a Quantity."
            )
    return tuple(one if isinstance(one, Quantity) else INTEGRALS[one] for one in each)


@named_arguments
@dataclass(frozen=True)
class PathLimit(_OfInstants):
    """An upper bound on a function of a time point, throughout a cycle.

    Parameters
    ----------
    name : str
    function : str
        Formula as of a `Quantity`; with a value for each joint, or one for all.
    most : float or sequence of float
        The bound, for all joints or each.
    both_ways : bool
        Bound the magnitude.

    Raises
    ------
    ProblemError
        If it is no formula, or the bound is not positive.

    Examples
    --------
    >>> PathLimit("torque", "moment", (0.1, 0.2)).names
    ('torque of joint 1', 'torque of joint 2')
    >>> PathLimit("all power", "sum(power)", 0.5, both_ways=False).names
    ('all power',)
    """

    name: str
    function: str
    most: float | tuple[float, ...]
    both_ways: bool = True

    _text = "function"

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.strip():
            raise ProblemError(f"a path limit needs a name, not {self.name!r}.")
        instead = "is not defined at a time point: use quantities of joints"
        self._check(f"the limit {self.name}", (1, 3), instead)
        each = tuple(np.ravel(np.asarray(self.most, dtype=object)).tolist())
        if not each or not all(is_number(a) and a > 0 for a in each):
            raise ProblemError(
                f"the limit {self.name}: the most must be positive and finite, not {self.most!r}."
            )
        most = tuple(map(float, each)) if np.ndim(self.most) else float(each[0])
        object.__setattr__(self, "most", most)

    @cached_property
    def of_each(self) -> bool:
        return self._formula(sample()).shape[0] == 3

    def on(self, n_joint: int) -> PathLimit:
        """Return it with a bound for each of its values."""
        rows = n_joint if self.of_each else 1
        if np.size(self.most) not in (1, rows):
            raise ProblemError(
                f"the limit {self.name} has {np.size(self.most)} values; give one, or {rows}."
            )
        return replace(self, most=tuple(np.broadcast_to(self.most, rows).tolist()))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its values, once there is a bound for each."""
        if not self.of_each:
            return (self.name,)
        return tuple(f"{self.name} of joint {j + 1}" for j in range(np.size(self.most)))

    def at(self, now: Instants) -> Array:
        """Values over their bounds."""
        return self._value(now) / np.array(self.most)[:, None]


@dataclass(frozen=True)
class PathLimits:
    """Limits of a body, each with a bound for each of its values (`PathLimit.on`)."""

    each: tuple[PathLimit, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(name for limit in self.each for name in limit.names)

    @property
    def least(self) -> np.ndarray:
        """Lower bounds of the shares ``(n_share,)``; the upper one is 1."""
        return np.array(
            [-1.0 if limit.both_ways else -np.inf for limit in self.each for _ in limit.names]
        )

    @property
    def needs_forces(self) -> bool:
        return any(limit.needs_forces for limit in self.each)

    def at(self, now: Instants) -> Array:
        """Values over their bounds, ``(n_share, n_time)``."""
        return namespace(now.rates).stack([limit.at(now) for limit in self.each])

    def sizes(self, shares: np.ndarray) -> np.ndarray:
        """Shares, or their magnitudes where both ways are bounded: at most 1."""
        return np.where(np.isfinite(self.least)[:, None], np.abs(shares), shares)

    def in_units_of(self, unit: float) -> PathLimits:
        sizes = (unit ** (limit.friction_degree or 0.0) for limit in self.each)
        limits = zip(self.each, sizes, strict=True)
        return PathLimits(
            tuple(replace(limit, most=tuple(np.array(limit.most) / size)) for limit, size in limits)
        )


def stated_limit(statement: Any) -> PathLimit:
    if not isinstance(statement, (PathLimit, dict)):
        raise ProblemError(
            f"limits are of the kind PathLimit(name, function, most), not {statement!r}."
        )
    return statement if isinstance(statement, PathLimit) else PathLimit(**statement)


Limits = Iterable[PathLimit] | PathLimits


def limits_of(limits: Limits, n_joint: int) -> PathLimits:
    if isinstance(limits, PathLimits):
        return limits
    return PathLimits(tuple(each.on(n_joint) for each in limits))


def torque_and_power(torque: tuple[float, ...], power: tuple[float, ...]) -> tuple[PathLimit, ...]:
    """Limits of motors, joint by joint: moments either way, and powers that they deliver."""
    rows = ("torque", "moment", torque, True), ("power", "power", power, False)
    return tuple(PathLimit(*each) for each in rows if each[2])
