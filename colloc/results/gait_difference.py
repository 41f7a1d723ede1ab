"""By what two gaits of a body differ: the mean of the angles, their amplitudes, their phases, or higher harmonics.

With ``a`` and ``b`` the complex first harmonics of a joint, ``|a - b|^2 = (|a| - |b|)^2 + 2 (|a| |b| - Re a b*)``: so the mean
square over a period is a sum of what means, amplitudes, phases and higher harmonics do to it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.results.solution import Solution
from colloc.system.errors import ProblemError

_PHASES, _STEPS = 512, 4


class GaitDifference(NamedTuple):
    """Root mean squares over a period, joints added up [rad]."""

    offset: float
    amplitude: float
    phase: float
    harmonics: float

    @property
    def total(self) -> float:
        """Of the gaits as functions of time."""
        return float(np.linalg.norm(self))

    @property
    def largest(self) -> str:
        """Which is, in words."""
        names = ("the offset of the joints", "the amplitude", "the phase between the joints", "the higher harmonics")
        return names[int(np.argmax(self))]


def gait_difference(mine: Solution, best: Solution) -> GaitDifference:
    """By what a gait differs from another one, at the start phase, and in the mirror image, at which they are nearest; of a
    symmetric body also named from the other end, under friction that is the same both ways also run backwards.

    Raises
    ------
    ProblemError
        If their bodies differ.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("small", delta=1e-2)
    >>> mine, best = (colloc.evaluate(problem, colloc.ellipse(A0=0, A1=A1, B1=0.5)) for A1 in (1.0, 1.2))
    >>> gait_difference(mine, best).largest
    'the amplitude'
    """
    body, law = best.problem.body, best.problem.law
    if mine.problem.body != body:
        raise ProblemError(f"{best.problem.name} is a gait of another body: there is nothing to compare joint by joint.")
    t = np.arange(_PHASES) / _PHASES
    ours, theirs = mine.gait.angles(t), best.gait.angles(t)
    images = [theirs, -theirs]
    images += [body.swapped(image) for image in images] if body.symmetric else []
    images += [image[:, (-np.arange(_PHASES)) % _PHASES] for image in images] if law.reversible else []
    a = _harmonics(ours)
    starts = np.exp(2j * np.pi * np.arange(a.shape[1]) * t[:, None])
    return min((_nearest(a, _harmonics(image), starts) for image in images), key=lambda found: found.total)


def _nearest(a: np.ndarray, b: np.ndarray, starts: np.ndarray) -> GaitDifference:
    """With the second gait, of harmonics b, begun at the phase at which it is nearest, by Newton's method."""
    alike, rates = (a.conj() * b).sum(axis=0), 2j * np.pi * np.arange(b.shape[1])
    begun = starts[np.argmax((starts @ alike).real)]
    for _ in range(_STEPS):
        slope, bend = ((begun * rates**order @ alike).real for order in (1, 2))
        begun = begun * np.exp(-rates * slope / bend) if bend < 0 else begun
    b = b * begun
    first = np.abs(a[:, 1]), np.abs(b[:, 1])
    apart = np.maximum(np.abs(a[:, 1] - b[:, 1]) ** 2 - (first[0] - first[1]) ** 2, 0.0)
    return GaitDifference(
        float(np.linalg.norm(a[:, 0] - b[:, 0])),
        float(np.linalg.norm(first[0] - first[1])),
        float(np.sqrt(apart.sum())),
        float(np.linalg.norm(a[:, 2:] - b[:, 2:])),
    )


def _harmonics(angles: np.ndarray) -> np.ndarray:
    """Complex amplitudes ``(n_joint, n_harmonic + 1)`` whose squares add up to the mean square over a period."""
    found = np.fft.rfft(angles, axis=1) / angles.shape[1]
    found[:, 1:-1] *= np.sqrt(2.0)
    return found
