"""Functions of an instant, each one formula: what a period sums up besides its way and work, and
what is limited all along.

A formula speaks of every joint, or other shape coordinate, at an instant. It is text, so that files
can hold it, and is evaluated with NumPy where a motion is replayed and with CasADi where
derivatives are needed: there is no second statement.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from keyword import iskeyword
from typing import Any

import numpy as np

from colloc.mechanics.actuators import joint_moments
from colloc.mechanics.bodies import Body
from colloc.mechanics.joint_map import JointMap
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.numerics.expression import FUNCTIONS, Formula, formula
from colloc.system.arguments import is_number, named_arguments
from colloc.system.errors import ProblemError

VARIABLES = {
    "angle": "of every joint [rad]",
    "rate": "of every joint [rad per period]",
    "moment": "that the actuator of every joint exerts [weight x body length]",
    "power": "that it delivers, moment times rate",
    "idle": "power at an instant below which regularised friction does not tell who drives whom: "
    "friction at the speed delta",
}
"""What a formula may speak of."""
SUMMED = (*FUNCTIONS, "sum")
"""What it may use; ``sum`` is over the joints."""
_OF_FORCES = {"moment", "power", "idle"}
_WITH_PACE, _WITH_FRICTION = ("rate", "power", "idle"), ("moment", "power", "idle")
_DOUBLINGS = -20, 1, 4, 20
"""By which powers of two a formula's degree is found: far enough to meet whatever scale it has of
its own."""
_TAKEN = ("distance", "work", "rotation", "across", "period", "efficiency", "value", "instants")


@dataclass(frozen=True, eq=False)
class Instants:
    """A body at instants, as formulas see it.

    Parameters
    ----------
    body, friction
    angles, rates : (n_joint, n_time)
        Rates and delta are those per period divided by `unit`; friction takes them.
    delta
    z : (3, n_time), optional
        Tail velocities that balance the body; or
    moments : (n_joint, n_time), optional
        Moments at its joints. Neither is needed where nobody asks for moments.
    unit : float
    load : (2, n_time), optional
        An outside force on its centre of mass, in its axes.
    joint_map : JointMap, optional
        Where joints hang on fewer motors: formulas then speak of these.
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

    def chosen(self, which: np.ndarray) -> Instants:
        """Some of them."""
        some = (
            None if row is None else row[:, which]
            for row in (self.angles, self.rates, self.z, self.moments, self.load)
        )
        angles, rates, z, moments, load = some
        return replace(self, angles=angles, rates=rates, z=z, moments=moments, load=load)

    @property
    def angle(self) -> Array:
        return self.joint_map.motor_angles(self.angles) if self.joint_map else self.angles

    @property
    def rate(self) -> Array:
        rates = self.joint_map.motor_rates(self.rates) if self.joint_map else self.rates
        return self.unit * rates

    @cached_property
    def moment(self) -> Array:
        body, friction, moments = self.body, self.friction, self.moments
        if moments is None:
            forces = body.forces(friction, self.angles, self.rates, self.z, self.delta)
            moments = joint_moments(body, self.angles, forces, self.load)  # type: ignore[arg-type]
        return self.joint_map.motor_moments(moments) if self.joint_map else moments

    @property
    def power(self) -> Array:
        return self.moment * self.rate

    @property
    def idle(self) -> Array:
        return (
            self.unit * self.friction.largest * self.delta ** (1.0 + (self.friction.degree or 0.0))
        )


def read(text: str) -> Formula:
    """A formula of `VARIABLES`. `ProblemError` if it is none."""
    return formula(text, tuple(VARIABLES), SUMMED)


def sample() -> dict[str, Any]:
    """Instants of three joints at which formulas are tried."""
    rng = np.random.default_rng(0)
    angle, rate, moment = rng.uniform(0.2, 1.0, (3, 3, 5)) * rng.choice([-1.0, 1.0], (3, 3, 5))
    return {"angle": angle, "rate": rate, "moment": moment, "power": moment * rate, "idle": 1e-3}


class OfInstants:
    """A function of an instant by the formula `text`: what follows from the formula alone."""

    text: str

    @property
    def _formula(self) -> Formula:
        return read(self.text)

    @cached_property
    def needs_forces(self) -> bool:
        """Whether it depends on more than shapes and their rates."""
        return bool(_OF_FORCES & self._formula.names)

    @cached_property
    def smoothed(self) -> bool:
        """Whether it depends on delta by itself."""
        return "idle" in self._formula.names

    def _value(self, now: Instants) -> Array:
        return self._formula(
            {name: getattr(now, name) for name in VARIABLES if name in self._formula.names}
        )

    @cached_property
    def friction_degree(self) -> float | None:
        """The power of the friction coefficients that it is proportional to; None if to none."""
        return self._degree(_WITH_FRICTION)

    @cached_property
    def pace_degree(self) -> float | None:
        """The same of the pace, under dry friction. An integral of what grows like the pace itself
        belongs to a path, however fast it is followed; so does the largest value of what does not
        grow."""
        return self._degree(_WITH_PACE)

    def _degree(self, scaled: tuple[str, ...]) -> float | None:
        at = sample()
        before = self._formula(at)
        with np.errstate(all="ignore"):
            after = [
                self._formula({k: v * 2.0**p if k in scaled else v for k, v in at.items()})
                for p in _DOUBLINGS
            ]
            powers = np.concatenate(
                [np.log2(a / before) / p for a, p in zip(after, _DOUBLINGS, strict=True)]
            )
        near = float(np.round(powers.flat[0], 6)) + 0.0
        return near if np.allclose(powers, near, rtol=0, atol=1e-9) else None

    def _checked(self, what: str, rows: tuple[int, ...], instead: str) -> None:
        """A `ProblemError` for a formula without as many rows, or without a finite value
        somewhere."""
        with np.errstate(all="ignore"):
            value = self._formula(sample())
        if np.shape(value) not in [(n, 5) for n in rows]:
            raise ProblemError(f"{what}: '{self.text}' {instead}.")
        if not np.isfinite(value).all():
            raise ProblemError(f"{what}: '{self.text}' has no finite value at a usual instant.")


@named_arguments
@dataclass(frozen=True)
class Quantity(OfInstants):
    """An integral over a period of a function of an instant, for objectives to speak of.

    Parameters
    ----------
    name : str
        By which objectives call it.
    density : str
        Formula of ``angle``, ``rate``, ``moment``, ``power`` of every joint, and ``idle``
        (`VARIABLES`): numbers, ``+ - * / **``, `colloc.numerics.expression.FUNCTIONS`, and ``sum``,
        over the joints.
    meaning : str, optional
        In words.

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

    def __post_init__(self) -> None:
        name = self.name
        known = (
            isinstance(name, str)
            and name.isidentifier()
            and not iskeyword(name)
            and not name.endswith(("_error", "_delta"))
        )
        if not known or name in (*_TAKEN, *SUMMED):
            raise ProblemError(f"a quantity needs a name of its own that is a word, not {name!r}.")
        object.__setattr__(self, "density", read(self.density).text)
        self._checked(
            f"the quantity {name}", (1,), "is no sum over the joints; put sum(...) around it"
        )

    @property
    def text(self) -> str:  # type: ignore[override]
        return self.density

    def at(self, now: Instants) -> Array:
        """Its density ``(1, n_time)``, per unit of time of the instants."""
        return self._value(now) / now.unit

    def of_shapes(self, angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """The same of shapes and their rates ``(n_joint, n_time)``, where it needs no forces."""
        return np.asarray(self._formula({"angle": angles, "rate": rates}))

    def fields(self) -> dict[str, str]:
        """As plain text (JSON)."""
        return {"name": self.name, "density": self.density, "meaning": self.meaning}


LENGTH = Quantity("length", "sqrt(sum(rate**2) + 1e-24)", "length of the path in shape space [rad]")
"""The small number is for a derivative where a joint turns back."""
DRIVEN_WORK = Quantity(
    "driven_work",
    "sum(power + sqrt(power**2 + idle**2)) / 2",
    "work of the actuators where none takes energy back",
)
"""Work against friction is the sum of what all actuators do, and one that is driven backwards
counts as a gain there. A real one brakes: it gives nothing back. The positive part of a power P has
a corner at 0, which is smoothed at the scale of the regularised friction: below the speed delta
friction is viscous, and so a power of delta times friction at that speed tells nothing about who
drives whom. It vanishes with delta like friction's own regularisation, and the certificate's limit
for delta -> 0 covers both."""
INTEGRALS = {each.name: each for each in (LENGTH, DRIVEN_WORK)}
"""Quantities that every objective may speak of."""


def quantities_of(asked: Any) -> tuple[Quantity, ...]:
    """Quantities by their names, or as they are. `ProblemError` for a name that is none."""
    for each in asked if isinstance(asked, Iterable) else (asked,):
        if not isinstance(each, Quantity) and each not in INTEGRALS:
            raise ProblemError(
                f"{each!r} is no quantity: name one of {', '.join(INTEGRALS)}, or state a Quantity."
            )
    return tuple(each if isinstance(each, Quantity) else INTEGRALS[each] for each in asked)


@named_arguments
@dataclass(frozen=True)
class PathLimit(OfInstants):
    """The most that a function of an instant may be, at every instant of a period.

    Parameters
    ----------
    name : str
    function : str
        Formula as of a `Quantity`; with a value for each joint, or one for all.
    most : float or sequence of float
        For all joints, or each.
    both_ways : bool
        Whether the magnitude is limited.

    Raises
    ------
    ProblemError
        If it is no formula, or the most is not positive.

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

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.strip():
            raise ProblemError(f"a path limit needs a name, not {self.name!r}.")
        object.__setattr__(self, "function", read(self.function).text)
        self._checked(
            f"the limit {self.name}", (1, 3), "has no value at an instant: let it speak of joints"
        )
        each = tuple(np.ravel(np.asarray(self.most, dtype=object)).tolist())
        if not each or not all(is_number(a) and a > 0 for a in each):
            raise ProblemError(
                f"the limit {self.name}: the most must be positive and finite, not {self.most!r}."
            )
        object.__setattr__(
            self, "most", tuple(map(float, each)) if np.ndim(self.most) else float(each[0])
        )

    @property
    def text(self) -> str:  # type: ignore[override]
        return self.function

    @cached_property
    def of_each(self) -> bool:
        """Whether it is on every joint."""
        return self._formula(sample()).shape[0] == 3

    def on(self, n_joint: int) -> PathLimit:
        """The same with a most for each of its values. `ProblemError` if there are others."""
        rows = n_joint if self.of_each else 1
        if np.size(self.most) not in (1, rows):
            raise ProblemError(
                f"the limit {self.name} has {np.size(self.most)} values; give one, or {rows}."
            )
        return replace(self, most=tuple(np.broadcast_to(self.most, rows).tolist()))

    @property
    def names(self) -> tuple[str, ...]:
        """What the rows of `at` are, once there is a most for each."""
        rows = range(np.size(self.most))
        return (
            tuple(f"{self.name} of joint {j + 1}" for j in rows) if self.of_each else (self.name,)
        )

    def at(self, now: Instants) -> Array:
        """Shares of what is allowed ``(n_row, n_time)``."""
        return self._value(now) / np.array(self.most)[:, None]

    def fields(self) -> dict[str, Any]:
        """As plain numbers and text (JSON)."""
        most = list(self.most) if isinstance(self.most, tuple) else self.most
        return {
            "name": self.name,
            "function": self.function,
            "most": most,
            "both_ways": self.both_ways,
        }


@dataclass(frozen=True)
class PathLimits:
    """Limits of a body, each with a most for each of its values (`PathLimit.on`)."""

    each: tuple[PathLimit, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """What the rows of `at` are."""
        return tuple(name for limit in self.each for name in limit.names)

    @property
    def least(self) -> np.ndarray:
        """Of the shares, that are allowed ``(n_share,)``; the most is 1."""
        return np.array(
            [-1.0 if limit.both_ways else -np.inf for limit in self.each for _ in limit.names]
        )

    @property
    def needs_forces(self) -> bool:
        return any(limit.needs_forces for limit in self.each)

    def at(self, now: Instants) -> Array:
        """Shares of what is allowed ``(n_share, n_time)``."""
        return namespace(now.rates).stack([limit.at(now) for limit in self.each])

    def sizes(self, shares: np.ndarray) -> np.ndarray:
        """What must not exceed 1, of shares: magnitudes where both ways are limited."""
        return np.where(np.isfinite(self.least)[:, None], np.abs(shares), shares)

    def in_units_of(self, unit: float) -> PathLimits:
        """The same for friction that is divided by a unit."""
        scaled = [
            np.array(limit.most) / unit ** (limit.friction_degree or 0.0) for limit in self.each
        ]
        return PathLimits(
            tuple(
                replace(limit, most=tuple(most))
                for limit, most in zip(self.each, scaled, strict=True)
            )
        )


def stated_limit(stated: Any) -> PathLimit:
    """A limit, as it is or as `PathLimit.fields` wrote it. `ProblemError` if it is none."""
    if not isinstance(stated, (PathLimit, dict)):
        raise ProblemError(
            f"limits are of the kind PathLimit(name, function, most), not {stated!r}."
        )
    return stated if isinstance(stated, PathLimit) else PathLimit(**stated)


def limits_of(asked: Iterable[PathLimit] | PathLimits, n_joint: int) -> PathLimits:
    """Limits of a body with so many joints, as they are stated or ready."""
    return (
        asked
        if isinstance(asked, PathLimits)
        else PathLimits(tuple(each.on(n_joint) for each in asked))
    )


def torque_and_power(torque: tuple[float, ...], power: tuple[float, ...]) -> tuple[PathLimit, ...]:
    """What motors can do, joint by joint, where it is limited: moments either way, and powers that
    they deliver, not brake."""
    stated = ("torque", "moment", torque, True), ("power", "power", power, False)
    return tuple(PathLimit(*each) for each in stated if each[2])
