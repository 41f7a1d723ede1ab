"""The objective for delta -> 0 with an error bar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Limit:
    """An extrapolated value and its estimated error."""

    value: float
    error: float


PARTS_OF_DELTA = (1.0, 0.1, 0.01)
"""At which a gait's value is to be known."""
_DECADE = PARTS_OF_DELTA[1]
_SLOWEST = 0.9


def extrapolated_limit(values: Sequence[float], errors: Sequence[float]) -> Limit:
    """Limit for delta -> 0 of one gait's value, from its values at delta, delta/10 and delta/100.

    Regularisation acts like c delta at leading order, so a ninth of the last change remains; sticking links act like
    delta log delta, and gaits of the size of delta like delta squared, with any signs. So the error is that ninth again; or
    more where the two changes fall off more slowly; and no less than what is left of a linear part of the first change that
    other parts hide in the second.

    Parameters
    ----------
    values, errors : (3,)
        Values of the objective and their own errors.
    """
    first, second = values[1] - values[0], values[2] - values[1]
    linear = _DECADE / (1 - _DECADE)
    falloff = min(abs(second) / max(abs(first), 1e-300), _SLOWEST)
    left = max(max(linear, falloff / (1 - falloff)) * abs(second), linear * _DECADE * abs(first))
    own = (1 + linear) * errors[2] + linear * errors[1]
    return Limit(float(values[2] + linear * second), float(left + own))
