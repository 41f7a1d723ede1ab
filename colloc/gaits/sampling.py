"""Seeded starts for a search over gaits: start number k is the same whatever the number of starts.

Admissible shapes form a region that is star-shaped about the straight body (joint limits and non-crossing keep holding
when all angles shrink together). So a gait is sampled as a direction in the space of Fourier parameters, from a Latin
hypercube over the harmonics, times a fraction of the largest amplitude that is admissible in that direction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.guesses import largest_factor
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.path_samples import fourier_through
from colloc.gaits.problem import Problem
from colloc.system.errors import ProblemError

LATIN_HYPERCUBE, PERTURBED = "latin-hypercube", "perturbed"
SAMPLERS = (LATIN_HYPERCUBE, PERTURBED)
BLOCK = 25
"""Starts per Latin hypercube: start k belongs to hypercube k // BLOCK, seeded by that number and the run's seed."""
PATH_SEED_HARMONICS = 2
_FRACTIONS = (0.2, 0.95)
_PHASES = 200
_ATTEMPTS = 200
_CLEARLY_MOVING = 1.5
_ON_FLOOR = 1e-4


def largest_amplitude(problem: Problem, gait: Fourier) -> float:
    """The largest factor by which a gait's angles can be multiplied and stay admissible; inf for the straight body."""
    return largest_factor(problem.body, problem.joint_limit, gait.angles(np.arange(_PHASES) / _PHASES))


def seed_class(problem: Problem) -> Harmonic:
    """The harmonics that starts are drawn from: the problem's own, or a few where its class bounds the path."""
    return problem.gait.series(PATH_SEED_HARMONICS)


def on_speed_floor(problem: Problem, gait: AnyGait) -> bool:
    """Whether a gait is as slow as ``smallest_shape_speed`` allows: then that bound, and no mechanics, decided its size."""
    return gait.shape_speed < problem.smallest_shape_speed * (1 + _ON_FLOOR)


def latin_hypercube(n: int, dimension: int, rng: np.random.Generator) -> np.ndarray:
    """Points ``(n, dimension)`` of the unit cube, one in every n-th of each coordinate (McKay, Beckman and Conover, 1979).

    Those of `scipy.stats.qmc`, which takes half a second to load: a tenth of a whole search.
    """
    within, order = rng.uniform(size=(n, dimension)), np.tile(np.arange(1, n + 1), (dimension, 1))
    for coordinate in order:
        rng.shuffle(coordinate)
    return (order.T - within) / n


def latin_hypercube_gait(problem: Problem, seed: int, start: int) -> Fourier:
    """Start number `start` of a Latin hypercube over the mean and the harmonics of the problem's class of gaits.

    Harmonic k is sampled with an amplitude that falls like 1/k, so that no harmonic dominates the rates.

    Raises
    ------
    ProblemError
        If no admissible gait moves as fast as the problem's ``smallest_shape_speed``.
    """
    block, row = divmod(start, BLOCK)
    n_joint, harmonics = problem.body.n_joint, seed_class(problem).harmonics
    dimension = n_joint * (2 * harmonics + 1) + 1
    rng = np.random.default_rng([seed, block]).spawn(1)[0]  # as newer releases of SciPy do
    unit = latin_hypercube(BLOCK, dimension, rng)[row]
    again = np.random.default_rng([seed, block, row + 1])
    for _ in range(_ATTEMPTS):
        gait = _scaled(problem, unit)
        if gait.shape_speed > _CLEARLY_MOVING * problem.smallest_shape_speed:
            return gait
        unit = again.random(dimension)
    raise ProblemError(
        f"found no admissible start as fast as smallest_shape_speed {problem.smallest_shape_speed:g}; make it smaller."
    )


def _scaled(problem: Problem, unit: np.ndarray) -> Fourier:
    """The member of the class that a point of the unit cube stands for."""
    n_joint, harmonics = problem.body.n_joint, seed_class(problem).harmonics
    table = (2 * unit[:-1] - 1).reshape(n_joint, -1)
    falling = 1.0 / np.arange(1, harmonics + 1)
    drawn = Fourier(table[:, 0], table[:, 1 : harmonics + 1] * falling, table[:, harmonics + 1 :] * falling)
    return _multiplied(problem, drawn, _FRACTIONS[0] + unit[-1] * (_FRACTIONS[1] - _FRACTIONS[0]))


def _multiplied(problem: Problem, drawn: Fourier, fraction: float) -> Fourier:
    """The class member nearest to `drawn`, at a fraction of the largest admissible amplitude."""
    gait = seed_class(problem).fourier(seed_class(problem).parameters(drawn), problem.body.n_joint)
    largest = largest_amplitude(problem, gait)
    if not np.isfinite(largest):
        return gait
    factor = fraction * largest
    return Fourier(factor * gait.mean, factor * gait.cos, factor * gait.sin)


def perturbed_gait(problem: Problem, optima: Sequence[AnyGait], seed: int, start: int, spread: float = 0.3) -> Fourier:
    """Start number `start` near a known optimum: optima take turns, coefficients move by normals of `spread` [rad].

    Where that leaves the admissible region, the whole gait is shrunk back into it.
    """
    if not optima:
        raise ProblemError("perturbed starts need at least one known optimum.")
    rng = np.random.default_rng([seed, start])
    near = fourier_through(optima[start % len(optima)], seed_class(problem)).resized(seed_class(problem).harmonics)
    for _ in range(_ATTEMPTS):
        mean, cos, sin = (a + spread * rng.standard_normal(a.shape) for a in (near.mean, near.cos, near.sin))
        drawn = Fourier(mean, cos, sin)
        member = seed_class(problem).fourier(seed_class(problem).parameters(drawn), problem.body.n_joint)
        gait = _multiplied(problem, member, min(1.0, 1.0 / largest_amplitude(problem, member)))
        if gait.shape_speed > _CLEARLY_MOVING * problem.smallest_shape_speed:
            return gait
    raise ProblemError(f"found no admissible start within {spread:g} rad of the known optimum; change the spread.")


def start_gait(problem: Problem, sampler: str, seed: int, start: int) -> Fourier:
    """The gait of start number `start` of a sampler by name; "perturbed" ones lie near the problem's own guess."""
    if sampler not in SAMPLERS:
        raise ProblemError(f"sampler must be one of {', '.join(SAMPLERS)}, not {sampler!r}.")
    if sampler == PERTURBED:
        return perturbed_gait(problem, [problem.guess], seed, start)
    return latin_hypercube_gait(problem, seed, start)
