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
from colloc.search.checkpoint import checkpoint
from colloc.system.errors import NotConvergedError

_SHAPES = 60  # that are drawn, and directions of rates at each


@checkpoint
def small_loops(problem: Problem) -> list[AnyGait]:
    """Loops of the class that starts are drawn from, both ways round, best first; none where the
    pace matters."""
    if problem.froude or not rate_independent(problem.law):
        return []
    body, law, joints = problem.body, problem.law, problem.joint_map
    n, shapes = problem.n_motor, _shapes(problem)
    directions = np.hstack([one_joint(n, half=False), unit_directions(n, _SHAPES, half=False)])
    if joints is not None:
        directions = joints.joint_rates(directions)
    count, delta = directions.shape[1], 1e-2 * problem.delta_start  # dry
    angles, rates = np.repeat(shapes, count, axis=1), np.tile(directions, shapes.shape[1])
    solved = body.solve(law, angles, rates, delta)
    now = body.motion(law, angles, rates, delta, solved)
    # around a closed loop every point of the body is carried as far
    motions = CoulombMotion(angles, rates, now.centre, now.z[2], now.power)
    # two headings in half a turn, the first of which is no axis of symmetry of usual shapes
    headings = 0.5 + 0.5 * np.pi * np.arange(2 if law.reversible else 4)
    best: list[tuple[SmallGait, np.ndarray]] = []
    for k, shape in enumerate(shapes.T):
        columns = np.arange(k * count, (k + 1) * count)
        here = motions.take(columns[solved.converged[columns]])
        try:
            first = max((best_mixture(here, h) for h in headings), key=lambda mixture: mixture[0])
            heading = heading_of(here, first[1])
            value, weights, _ = best_mixture(here, heading)
        except NotConvergedError:
            continue
        used = weights > 1e-6 * weights.max()
        # mirror images differ by less
        if not any(abs(value - other.efficiency) < 1e-3 * value for other, _ in best):
            best.append((SmallGait(value, heading, here.rates[:, used], weights[used]), shape))
    best.sort(key=lambda pair: -pair[0].efficiency)
    seeds, least = problem.gait.start_class, problem.smallest_shape_speed
    size = 1.5 * 2 * np.pi * least
    return [
        to_class(
            seeds, Corners(small.path(shape, size, back=back)), body, problem.joint_limit, least
        )
        for small, shape in best[:2]
        for back in (False, True)
    ]


def _shapes(problem: Problem) -> np.ndarray:
    """Distinct admissible mean shapes ``(n_joint, n)`` of gaits of the class."""
    body, limit, seeds = problem.body, problem.joint_limit, problem.gait.start_class
    n_joint = body.n_joint
    levels, rng = np.linspace(-1.0, 1.0, 5), np.random.default_rng(2)
    drawn = rng.choice(levels, (_SHAPES, n_joint)) * widest(limit)
    none, rest = np.zeros((n_joint, 1)), seeds.offset(n_joint)[:, 0]
    constant = (Fourier(mean, none, none) for mean in drawn)
    means = np.array([seeds.member(seeds.parameters(each), n_joint).mean for each in constant])
    # of a shape and its mirror image, the one whose first bend is to the left
    first = np.take_along_axis(means, (means != 0).argmax(axis=1)[:, None], axis=1)
    means = np.unique(np.where(first < 0, -means, means) + 0.0, axis=0)
    factors = (
        min(1.0, largest_factor(body, limit, mean[:, None], rest[:, None])) for mean in means
    )
    return np.array(
        [rest + (mean - rest) * factor for mean, factor in zip(means, factors, strict=True)]
    ).T
