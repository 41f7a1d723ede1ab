"""A law of friction of one's own, by two formulas; checked for what the solvers rely on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from colloc.mechanics.friction import regularised_speed
from colloc.mechanics.law import Matrix
from colloc.numerics.arrays import Array
from colloc.numerics.expression import Formula, formula
from colloc.system.arguments import check_positive, named_arguments
from colloc.system.errors import ProblemError

VARIABLES = ("vs", "vn", "speed", "delta")
_DIRECTIONS, _SPEEDS, _DELTAS = 48, np.geomspace(1e-4, 1e2, 13), (1e-6, 1e-2)
_STEP, _JUMP = 1e-9, 1e-6
"""Distance in delta, and change of the force over the largest, that tell a jump from a slope of
1/delta."""
_NEARLY, _STEEP = 1e-3, 0.5
"""A small part of the speed, and more than that of the force it has alone."""
_RTOL, _LEAST = 1e-10, 1e-12
_ANGLE = np.linspace(0, 2 * np.pi, 721)[None]
_CIRCLE, _DRY = (np.cos(_ANGLE), np.sin(_ANGLE)), np.array([[1e-9]])  # unit speed, and its delta


def _samples() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Velocities in all directions, over many speeds and two deltas, ``(1, n)`` each."""
    angle = 2 * np.pi * (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    speed, angle, delta = (a.reshape(1, -1) for a in np.meshgrid(_SPEEDS, angle, _DELTAS))
    return speed * np.cos(angle), speed * np.sin(angle), delta


def _same(a: Array, b: Array) -> bool:
    return bool(np.allclose(a, b, rtol=_RTOL, atol=0.0))


@named_arguments
@dataclass(frozen=True)
class OwnLaw:
    """Friction per length by formulas of the sliding velocity; a law of friction.

    Parameters
    ----------
    tangential, normal : str
        Force along the body and across it, in terms of ``vs`` and ``vn``, the velocity along
        (positive towards the head) and across; ``speed``, which is ``sqrt(vs**2 + vn**2 +
        delta**2)``; numbers, ``+ - * / **``, ``sqrt``, ``exp``, ``log``, ``tanh``, ``abs`` and
        ``where(condition, a, b)``. Where a dry law divides by the speed, let it be ``speed``: it is
        never zero.
    unit, speed_unit : float
        Divisor of forces; factor of velocities and delta before the formulas see them.

    Raises
    ------
    ProblemError
        If a formula cannot be read, or the law gives energy to the body somewhere, does not vanish
        at rest, or differs between left and right (the mirror image of a gait would be another
        gait).

    Examples
    --------
    Friction that weakens when the body slides fast:

    >>> from colloc import OwnLaw
    >>> law = OwnLaw("-vs/speed * (1 + 0.5*exp(-speed))", "-2*vn/speed * (1 + 0.5*exp(-speed))")
    >>> law.reversible, law.degree
    (True, None)
    """

    tangential: str = "-vs/speed"
    normal: str = "-vn/speed"
    unit: float = 1.0
    speed_unit: float = 1.0

    kernel_numbers = ()
    associated = False  # samples cannot tell: several motions are reckoned with

    def __post_init__(self) -> None:
        check_positive(self, "unit", "speed_unit", of="friction.")
        vs, vn, delta = _samples()
        zero = np.zeros((1, 1))
        with np.errstate(all="ignore"):  # what is not finite is refused
            fs, fn = (np.broadcast_to(f, vs.shape) for f in self.density(vs, vn, delta))
            rest = np.abs(self.density(zero, zero, zero + _DELTAS[0])).max()
        if not np.isfinite([*fs, *fn]).all() or np.isnan(rest):
            where = "at rest (vs = vn = 0)" if np.isnan(rest) else "somewhere"
            raise ProblemError(
                f"friction: a formula has no finite value {where}; divide by speed, which is never "
                f"zero."
            )
        gain = fs * vs + fn * vn
        if (gain >= 0).any():
            worst = 0, np.argmax(gain / np.hypot(vs, vn))
            raise ProblemError(
                f"friction: at (vs, vn) = ({vs[worst]:.3g}, {vn[worst]:.3g}) the force "
                f"({fs[worst]:.3g}, {fn[worst]:.3g}) does not oppose the motion, so friction would "
                f"give energy to the body; look at the signs."
            )
        if rest > 0:
            raise ProblemError("friction: a formula does not vanish at rest (vs = vn = 0).")
        left = self.density(vs, -vn, delta)
        if not (_same(left[0], fs) and _same(left[1], -fn)):
            raise ProblemError(
                "friction: the law differs between left and right (vn and -vn), which the "
                "symmetries exclude."
            )
        if self.smallest <= 0:
            raise ProblemError("friction: nothing resists sliding along the body, or across it.")
        # a force that jumps has no balance where it does
        step = _STEP * delta
        for name, *sides in (
            ("vs", self.density(step, vn, delta), self.density(-step, vn, delta)),
            ("vn", self.density(vs, step, delta), self.density(vs, -step, delta)),
        ):
            jump = np.hypot(*(a - b for a, b in zip(*sides, strict=True)))
            if (jump / np.hypot(*sides[0]).max()).max() > _JUMP:
                raise ProblemError(
                    f"friction: the force jumps where {name} changes its sign; let it vanish or "
                    f"agree there."
                )
        # flat but for a step in one velocity: Newton's steps run off to 1e154
        one, nearly = np.ones((1, 1)), np.array([[_NEARLY]])
        for name, k, alone, beside in (
            ("vs", 0, self.density(one, nearly, _DRY), self.density(nearly, one, _DRY)),
            ("vn", 1, self.density(nearly, one, _DRY), self.density(one, nearly, _DRY)),
        ):
            if abs(beside[k]) > _STEEP * abs(alone[k]):
                raise ProblemError(
                    f"friction: the force by {name} is dry regardless of the other velocity, which "
                    f"no formula is solved for; divide by speed, or state a wheel's friction as "
                    f"Axle(rolling=..., sideways=...)."
                )

    @property
    def formulas(self) -> tuple[str, ...]:
        return self.tangential, self.normal

    @property
    def _read(self) -> tuple[Formula, ...]:
        return tuple(formula(text, VARIABLES) for text in self.formulas)

    @property
    def label(self) -> str:
        return "own law of friction"

    def describe(self) -> str:
        scale = "" if self.unit == 1 else f", over {self.unit:g}"
        if self.speed_unit != 1:
            scale += f"; a body length per period is a speed of {self.speed_unit:g} (speed_unit)"
        return f"{self.tangential} along, {self.normal} across the body{scale}"

    @cached_property
    def degree(self) -> float | None:
        vs, vn, delta = _samples()
        before, after = (np.hypot(*self.density(t * vs, t * vn, t * delta)) for t in (1.0, 2.0))
        degrees = np.log2(after / before)
        mean = float(np.round(degrees.mean(), 9)) + 0.0
        return mean if np.abs(degrees - mean).max() < _RTOL else None

    @cached_property
    def reversible(self) -> bool:
        vs, vn, delta = _samples()
        forward, backward = self.density(vs, vn, delta), self.density(-vs, -vn, delta)
        return all(_same(-b, f) for f, b in zip(forward, backward, strict=True))

    @cached_property
    def regularised(self) -> bool:
        return any(name in each.names for each in self._read for name in ("speed", "delta"))

    @cached_property
    def smallest(self) -> float:
        fs, fn = self.density(*_CIRCLE, _DRY)
        return float(-(fs * _CIRCLE[0] + fn * _CIRCLE[1]).max())

    @cached_property
    def largest(self) -> float:
        return float(np.hypot(*self.density(*_CIRCLE, _DRY)).max())

    def in_units_of(self, unit: float) -> OwnLaw:
        return replace(self, unit=self.unit * unit)

    def in_speeds_of(self, unit: float) -> OwnLaw:
        return replace(self, speed_unit=self.speed_unit * unit)

    def density(self, vs: Array, vn: Array, delta: Array) -> tuple[Array, Array]:
        vs, vn, delta = (self.speed_unit * a for a in (vs, vn, delta + 0.0 * vs))
        at = {"vs": vs, "vn": vn, "speed": regularised_speed(vs, vn, delta), "delta": delta}
        fs, fn = (each(at) / self.unit + 0.0 * vs for each in self._read)
        return fs, fn

    def density_jacobian(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        vs, vn, delta = (self.speed_unit * a for a in (vs, vn, delta))
        zero, r = 0.0 * (vs + vn), regularised_speed(vs, vn, delta)
        at, scale = {"vs": vs, "vn": vn, "speed": r, "delta": delta}, self.speed_unit / self.unit
        rows = []
        for each in self._read:
            by = dict.fromkeys(at, 0.0) | each.partials(at)
            slopes = by["vs"] + by["speed"] * vs / r, by["vn"] + by["speed"] * vn / r
            rows.append(tuple(zero - scale * slope for slope in slopes))
        return tuple(rows)

    def density_secant(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        # beside the trace, which is nearly 0 where each component is dry by itself
        (ss, _), (_, nn) = self.density_jacobian(vs, vn, delta)
        along, across = (
            regularised_speed(ss + nn, f * v / (v * v + delta * delta + _LEAST**2), _LEAST)
            for f, v in zip(self.density(vs, vn, delta), (vs, vn), strict=True)
        )
        return (along, 0.0 * ss), (0.0 * ss, across)

    def density_potential(self, vs: Array, vn: Array, delta: Array) -> Array:
        raise NotImplementedError("formulas need not be the gradient of a function.")
