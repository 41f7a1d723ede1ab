"""Where a search begins: the class of gaits of a problem on its first mesh, and the member nearest to a gait."""

from __future__ import annotations

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.harmonic_space import HarmonicSpace
from colloc.path_space import PathSpace
from colloc.reduced_program import SearchSpace


def space_near(
    problem: Problem, gait: AnyGait, edges: np.ndarray | None = None, scheme: str = ""
) -> tuple[SearchSpace, np.ndarray]:
    """The class of a problem on its first mesh, or a given one, and the parameters of its member nearest to a gait."""
    space = PathSpace(problem, gait, edges, scheme) if problem.has_path else HarmonicSpace(problem, edges, scheme)
    return space, space.parameters(gait)
