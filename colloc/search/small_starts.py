"""Small loops where they travel farthest for their work: starts that samples of a class hardly ever
meet.

Dry friction lets a loop of any size move a body, and at a few shapes, such as folded ones, small
loops beat most large gaits. What the best small loop at a shape is worth, and how it runs, a linear
program says (`colloc.bounds.infinitesimal`). It is solved at shapes drawn from a coarse lattice
over all that joints may reach; the search moves shape and loop from there.
"""

from __future__ import annotations

import numpy as np

from colloc.bounds.coulomb_motion import CoulombMotion, one_joint, unit_directions
from colloc.bounds.infinitesimal import SmallGait, best_mixture, heading_of
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.guesses import largest_factor
from colloc.gaits.harmonic import Fourier
from colloc.gaits.limits import widest
from colloc.gaits.polygon import Corners
from colloc.gaits.problem import Problem
from colloc.gaits.starts import laid_into
from colloc.mechanics.law import rate_independent
from colloc.system.errors import NotConvergedError

_DRAWN, _HEADINGS = 60, 2
"""Shapes, and directions of rates at each; headings in half a turn: enough to tell shapes apart;
the search finds the sharp ones."""
_LEVELS = np.linspace(-1.0, 1.0, 5)
"""The values of every angle among which shapes are drawn, of the limit."""
_FIRST = 0.5
"""First heading [rad]: no axis of symmetry of the usual shapes, along and across which a mixture
may go nowhere."""
_SHAPES = 2
_SIZE = 1.5
"""Length of a loop, of the least that a gait may have."""
_DRY = 1e-2
"""Delta at unit rates, of the first one of the problem."""
_ALIKE, _UNUSED = 1e-3, 1e-6
"""Relative difference of the efficiencies of mirror images, which directions are not, and weights
of directions that count."""


def small_loops(problem: Problem) -> list[AnyGait]:
    """Loops about the shapes where small ones travel farthest, each both ways round; none where the
    pace matters.

    Parameters
    ----------
    problem : Problem

    Returns
    -------
    list
        Gaits of the class that starts are drawn from, best first.
    """
    if problem.froude or not rate_independent(problem.law):
        return []
    own, loops = problem.gait.seeds, []
    for small, shape in _best_small_gaits(problem)[:_SHAPES]:
        size = _SIZE * 2 * np.pi * problem.smallest_shape_speed
        for back in (False, True):
            path = Corners(small.path(shape, size, back=back))
            loops.append(
                laid_into(
                    own, path, problem.body, problem.joint_limit, problem.smallest_shape_speed
                )
            )
    return loops


def _best_small_gaits(problem: Problem) -> list[tuple[SmallGait, np.ndarray]]:
    """The best small gait at every shape that was drawn, with the shape, best first; of equally
    good ones one."""
    body, friction, shapes = problem.body, problem.law, _drawn_shapes(problem)
    n, joints = problem.n_motor, problem.joint_map
    directions = np.hstack([one_joint(n, half=False), unit_directions(n, _DRAWN, half=False)])
    if joints is not None:
        directions = joints.joint_rates(directions)
    count, delta = directions.shape[1], _DRY * problem.delta_start
    angles, rates = np.repeat(shapes, count, axis=1), np.tile(directions, shapes.shape[1])
    solved = body.solve(friction, angles, rates, delta)
    now = body.motion(friction, angles, rates, delta, solved)
    # around a closed loop every point of the body is carried as far
    motions = CoulombMotion(angles, rates, now.centre, now.z[2], now.power)
    turns = 1 if friction.reversible else 2
    headings = _FIRST + np.arange(_HEADINGS * turns) * np.pi / _HEADINGS
    found: list[tuple[SmallGait, np.ndarray]] = []
    for k, shape in enumerate(shapes.T):
        here = motions.take(
            np.arange(k * count, (k + 1) * count)[solved.converged[k * count : (k + 1) * count]]
        )
        try:
            weights = max(
                (best_mixture(here, h) for h in headings), key=lambda mixture: mixture[0]
            )[1]
            heading = heading_of(here, weights)
            value, weights, _ = best_mixture(here, heading)
        except NotConvergedError:
            continue
        used = weights > _UNUSED * weights.max()
        if not any(abs(value - other.efficiency) < _ALIKE * value for other, _ in found):
            found.append((SmallGait(value, heading, here.rates[:, used], weights[used]), shape))
    return sorted(found, key=lambda pair: -pair[0].efficiency)


def _drawn_shapes(problem: Problem) -> np.ndarray:
    """Admissible shapes ``(n_joint, n)`` about which a gait of the class may run, without
    repetition."""
    body, own, n_joint = problem.body, problem.gait.seeds, problem.body.n_joint
    drawn = np.random.default_rng(2).choice(_LEVELS, (_DRAWN, n_joint)) * widest(
        problem.joint_limit
    )
    none, rest = np.zeros((n_joint, 1)), own.offset(n_joint)[:, 0]
    means = np.array(
        [own.member(own.parameters(Fourier(mean, none, none)), n_joint).mean for mean in drawn]
    )
    # of a shape and its mirror image, the one whose first bend is to the left
    first = np.take_along_axis(means, (means != 0).argmax(axis=1)[:, None], axis=1)
    means = np.unique(np.where(first < 0, -means, means) + 0.0, axis=0)
    return np.array(
        [
            rest
            + (mean - rest)
            * min(1.0, largest_factor(body, problem.joint_limit, mean[:, None], rest[:, None]))
            for mean in means
        ]
    ).T
