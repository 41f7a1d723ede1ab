"""Laws of friction that are stated as formulas: forces, derivatives and traits follow from the
text."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from colloc.mechanics.friction import regularised_speed
from colloc.mechanics.law import Matrix
from colloc.numerics.arrays import Array
from colloc.numerics.expression import Dual, Formula, formula

VARIABLES = ("vs", "vn", "speed", "delta")
_DIRECTIONS, _SPEEDS, DELTAS = 48, np.geomspace(1e-4, 1e2, 13), (1e-6, 1e-2)
_SAME, _LEAST = 1e-10, 1e-12


class FormulaLaw:
    """A law by its `formulas`, its name and its units; what it knows better than samples tell, it
    may say itself."""

    kernel_numbers = ()

    @property
    def associated(self) -> bool:
        """Samples cannot tell whether a formula is the gradient of a convex function: several
        motions are reckoned with."""
        return False

    @property
    def unit(self) -> float:
        """Forces are divided by it."""
        return 1.0

    @property
    def speed_unit(self) -> float:
        """Velocities and delta are multiplied by it before the formulas see them."""
        return 1.0

    @property
    def formulas(self) -> tuple[str, ...]:
        """Force along and across in terms of `VARIABLES`, and, of an associated law, the potential
        whose gradient is minus the force."""
        raise NotImplementedError

    @property
    def _read(self) -> tuple[Formula, ...]:
        return tuple(formula(text, VARIABLES) for text in self.formulas)

    @cached_property
    def degree(self) -> float | None:
        vs, vn, delta = samples()
        before, after = (np.hypot(*self.density(t * vs, t * vn, t * delta)) for t in (1.0, 2.0))
        degrees = np.log2(after / before)
        found = float(np.round(degrees.mean(), 9)) + 0.0
        return found if np.abs(degrees - found).max() < _SAME else None

    @cached_property
    def reversible(self) -> bool:
        vs, vn, delta = samples()
        forward, backward = self.density(vs, vn, delta), self.density(-vs, -vn, delta)
        return all(same(-b, f) for f, b in zip(forward, backward, strict=True))

    @cached_property
    def regularised(self) -> bool:
        return any(name in each.names for each in self._read for name in ("speed", "delta"))

    @cached_property
    def _at_unit_speed(self) -> tuple[np.ndarray, np.ndarray]:
        angle = np.linspace(0, 2 * np.pi, 721)[None]
        fs, fn = self.density(np.cos(angle), np.sin(angle), np.array([[1e-9]]))
        return -(fs * np.cos(angle) + fn * np.sin(angle)), np.hypot(fs, fn)

    @property
    def smallest(self) -> float:
        return float(self._at_unit_speed[0].min())

    @property
    def largest(self) -> float:
        return float(self._at_unit_speed[1].max())

    def density(self, vs: Array, vn: Array, delta: Array) -> tuple[Array, Array]:
        fs, fn = (each(self._at(vs, vn, delta)) / self.unit for each in self._read[:2])
        return fs, fn

    def _at(self, vs: Array, vn: Array, delta: Array) -> dict[str, Array]:
        """The variables in the units of the formulas."""
        vs, vn, delta = (self.speed_unit * a for a in (vs, vn, delta + 0.0 * vs))
        return {"vs": vs, "vn": vn, "speed": regularised_speed(vs, vn, delta), "delta": delta}

    def density_jacobian(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        vs, vn, delta = (self.speed_unit * a for a in (vs, vn, delta))
        zero = 0.0 * (vs + vn)
        r = regularised_speed(vs, vn, delta)
        at = {
            "vs": Dual(vs, (1.0 + zero, zero)),
            "vn": Dual(vn, (zero, 1.0 + zero)),
            "speed": Dual(r, (vs / r, vn / r)),
            "delta": Dual(delta + zero, (zero, zero)),
        }
        rows = [each.differentiated(at).slopes for each in self._read[:2]]
        return tuple(
            tuple(zero - self.speed_unit / self.unit * slope for slope in row) for row in rows
        )

    def density_secant(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        """The trace of the Jacobian in every direction: no less than the secant of a law that grows
        with the speed."""
        (ss, _), (_, nn) = self.density_jacobian(vs, vn, delta)
        zero = 0.0 * ss
        trace = regularised_speed(ss + nn, zero, _LEAST + zero)  # positive for any law
        return (trace, zero), (zero, trace)

    def density_potential(self, vs: Array, vn: Array, delta: Array) -> Array:
        """Of the formula's units: a force times a speed."""
        return self._read[2](self._at(vs, vn, delta)) / (self.unit * self.speed_unit)


def samples() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Velocities in all directions, over many speeds and two deltas, ``(1, n)`` each."""
    angle = 2 * np.pi * (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    speed, angle, delta = (a.reshape(1, -1) for a in np.meshgrid(_SPEEDS, angle, DELTAS))
    return speed * np.cos(angle), speed * np.sin(angle), delta


def same(a: Array, b: Array) -> bool:
    return bool(np.allclose(a, b, rtol=_SAME, atol=0.0))
