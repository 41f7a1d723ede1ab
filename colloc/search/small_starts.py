"""Small loops at the shapes where they travel farthest for their work: starts that samples of a
class hardly ever meet.

Dry friction lets a loop of any size move a body, and at a few shapes, such as folded ones, small
loops beat most large gaits. A linear program gives the best small loop at a shape
(`colloc.bounds.motions`); it is solved at shapes drawn from a coarse lattice.
"""

from __future__ import annotations

import numpy as np

from colloc.bounds.motions import (
    CoulombMotion,
    SmallGait,
    best_mixture,
    heading_of,
    one_joint,
    unit_directions,
)
from colloc.gaits.bspline import Corners
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.harmonic import Fourier
from colloc.gaits.limits import widest
from colloc.gaits.problem import Problem
from colloc.gaits.starts import largest_factor, to_class
from colloc.mechanics.law import rate_independent
from colloc.search.checkpoint import checkpointed
from colloc.system.errors import NotConvergedError

_SHAPES, _LEVELS = 60, np.linspace(-1.0, 1.0, 5)
"""Shapes that are drawn, and their angles over the limit."""
_HEADINGS, _FIRST_HEADING = 2, 0.5
"""Headings in half a turn, and the first [rad], which is no axis of symmetry of usual shapes."""
_BEST, _SIZE = 2, 1.5
"""Shapes whose loops are starts, and the length of these over the least that a gait may have."""
_DRY = 1e-2
"""Delta at unit rates, over the first one of the problem."""
_ALIKE, _UNUSED = 1e-3, 1e-6
"""Relative difference of the efficiencies of mirror images; weights that do not count."""


@checkpointed
def small_loops(problem: Problem) -> list[AnyGait]:
    """Loops of the class that starts are drawn from, both ways round, best first; none where the
    pace matters."""
    if problem.froude or not rate_independent(problem.law):
        return []
    size = _SIZE * 2 * np.pi * problem.smallest_shape_speed
    return [
        to_class(
            problem.gait.start_class,
            Corners(small.path(shape, size, back=back)),
            problem.body,
            problem.joint_limit,
            problem.smallest_shape_speed,
        )
        for small, shape in _best_small_gaits(problem)[:_BEST]
        for back in (False, True)
    ]


def _best_small_gaits(problem: Problem) -> list[tuple[SmallGait, np.ndarray]]:
    """Distinct best small gaits, with their shapes, best first."""
    body, friction, shapes = problem.body, problem.law, _shapes(problem)
    n, joints = problem.n_motor, problem.joint_map
    directions = np.hstack([one_joint(n, half=False), unit_directions(n, _SHAPES, half=False)])
    if joints is not None:
        directions = joints.joint_rates(directions)
    count, delta = directions.shape[1], _DRY * problem.delta_start
    angles, rates = np.repeat(shapes, count, axis=1), np.tile(directions, shapes.shape[1])
    solved = body.solve(friction, angles, rates, delta)
    now = body.motion(friction, angles, rates, delta, solved)
    # around a closed loop every point of the body is carried as far
    motions = CoulombMotion(angles, rates, now.centre, now.z[2], now.power)
    half_turns = 1 if friction.reversible else 2
    headings = _FIRST_HEADING + np.arange(_HEADINGS * half_turns) * np.pi / _HEADINGS
    best: list[tuple[SmallGait, np.ndarray]] = []
    for k, shape in enumerate(shapes.T):
        columns = np.arange(k * count, (k + 1) * count)
        here = motions.take(columns[solved.converged[columns]])
        try:
            weights = max(
                (best_mixture(here, h) for h in headings), key=lambda mixture: mixture[0]
            )[1]
            heading = heading_of(here, weights)
            value, weights, _ = best_mixture(here, heading)
        except NotConvergedError:
            continue
        used = weights > _UNUSED * weights.max()
        if not any(abs(value - other.efficiency) < _ALIKE * value for other, _ in best):
            best.append((SmallGait(value, heading, here.rates[:, used], weights[used]), shape))
    return sorted(best, key=lambda pair: -pair[0].efficiency)


def _shapes(problem: Problem) -> np.ndarray:
    """Distinct admissible mean shapes ``(n_joint, n)`` of gaits of the class."""
    body = problem.body
    seeds = problem.gait.start_class
    limit = problem.joint_limit
    n_joint = problem.body.n_joint
    rng = np.random.default_rng(2)
    drawn = rng.choice(_LEVELS, (_SHAPES, n_joint)) * widest(limit)
    none, rest = np.zeros((n_joint, 1)), seeds.offset(n_joint)[:, 0]
    constant = (Fourier(mean, none, none) for mean in drawn)
    means = np.array([seeds.member(seeds.parameters(each), n_joint).mean for each in constant])
    # of a shape and its mirror image, the one whose first bend is to the left
    first = np.take_along_axis(means, (means != 0).argmax(axis=1)[:, None], axis=1)
    means = np.unique(np.where(first < 0, -means, means) + 0.0, axis=0)
    factors = [
        min(1.0, largest_factor(body, limit, mean[:, None], rest[:, None])) for mean in means
    ]
    return np.array(
        [rest + (mean - rest) * factor for mean, factor in zip(means, factors, strict=True)]
    ).T
