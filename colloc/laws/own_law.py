"""A law of friction of one's own, stated as two formulas; checked for what the solvers rely on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from colloc.laws.formula_law import DELTAS, FormulaLaw, same, samples
from colloc.system.arguments import check_positive, named_arguments
from colloc.system.errors import ProblemError

_BESIDE, _JUMP = 1e-9, 1e-6
"""Distance in delta, and change of the force over the largest, by which a jump is told from a slope
of 1/delta."""


@named_arguments
@dataclass(frozen=True)
class OwnLaw(FormulaLaw):
    """Friction per length as formulas of the velocity of sliding; a `colloc.mechanics.law.Law`.

    Parameters
    ----------
    tangential, normal : str
        Force along the body and across it, in terms of ``vs`` and ``vn``, the velocity along
        (positive towards the head) and across; ``speed``, which is ``sqrt(vs**2 + vn**2 +
        delta**2)``; numbers, ``+ - * / **``, ``sqrt``, ``exp``, ``log``, ``tanh``, ``abs`` and
        ``where(condition, a, b)``. Where a dry law divides by the speed, let it be ``speed``: it is
        never zero.
    unit, speed_unit : float
        Forces are divided by the first; velocities and delta multiplied by the second before the
        formulas see them.

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

    def __post_init__(self) -> None:
        check_positive(self, "unit", "speed_unit", of="friction.")
        vs, vn, delta = samples()
        with np.errstate(all="ignore"):  # what is not finite is refused
            fs, fn = (np.broadcast_to(f, vs.shape) for f in self.density(vs, vn, delta))
        if not (np.isfinite(fs).all() and np.isfinite(fn).all()):
            raise ProblemError(
                "friction: a formula has no finite value somewhere; divide by speed, which is "
                "never zero."
            )
        gain = fs * vs + fn * vn
        if (gain >= 0).any():
            worst = np.unravel_index(np.argmax(gain / np.hypot(vs, vn)), gain.shape)
            raise ProblemError(
                f"friction: at (vs, vn) = ({vs[worst]:.3g}, {vn[worst]:.3g}) the force "
                f"({fs[worst]:.3g}, {fn[worst]:.3g}) does "
                "not oppose the motion, so friction would give energy to the body; look at the "
                "signs."
            )
        zero = np.zeros((1, 1))
        with np.errstate(all="ignore"):
            rest = np.abs(self.density(zero, zero, zero + DELTAS[0])).max()
        if np.isnan(rest):
            raise ProblemError(
                "friction: a formula has no value at rest (vs = vn = 0); divide by speed, which is "
                "never zero."
            )
        if rest > 0:
            raise ProblemError("friction: a formula does not vanish at rest (vs = vn = 0).")
        left = self.density(vs, -vn, delta)
        if not (same(left[0], fs) and same(left[1], -fn)):
            raise ProblemError(
                "friction: the law differs between left and right (vn and -vn), which the "
                "symmetries exclude."
            )

        self._check_continuity()

    def _check_continuity(self) -> None:
        """A force that jumps has no balance where it does."""
        vs, vn, delta = samples()
        for what, across in (("vs", (1.0, 0.0)), ("vn", (0.0, 1.0))):
            at, step = (vs * across[1], vn * across[0]), _BESIDE * delta
            sides = [
                self.density(
                    at[0] + sign * across[0] * step, at[1] + sign * across[1] * step, delta
                )
                for sign in (1, -1)
            ]
            jump = (
                np.hypot(*(a - b for a, b in zip(*sides, strict=True))) / np.hypot(*sides[0]).max()
            )
            if jump.max() > _JUMP:
                raise ProblemError(
                    f"friction: the force jumps where {what} changes its sign; let it vanish or "
                    f"agree there."
                )

    @property
    def formulas(self) -> tuple[str, ...]:
        return self.tangential, self.normal

    @property
    def label(self) -> str:
        return "own law of friction"

    def describe(self) -> str:
        scale = "" if self.unit == 1 else f", over {self.unit:g}"
        scale += (
            ""
            if self.speed_unit == 1
            else f"; a body length per period is a speed of {self.speed_unit:g} (speed_unit)"
        )
        return f"{self.tangential} along, {self.normal} across the body{scale}"

    def in_units_of(self, unit: float) -> OwnLaw:
        return replace(self, unit=self.unit * unit)

    def in_speeds_of(self, unit: float) -> OwnLaw:
        return replace(self, speed_unit=self.speed_unit * unit)
