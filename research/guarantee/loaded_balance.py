"""The balance of a body under associated friction and a small outside load: the dual certificate of
the bound.

The body minimises its dissipation potential less the load's power. The friction forces found are
admissible (those of some velocity) and what they leave unbalanced is stated, which is all that
`guarantee.guaranteed` needs: a solve that stops early gives a weaker certificate, not a wrong one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.system.errors import ProblemError
from research.guarantee.kernel import compiled_loaded, guarantee_kernel


class Loaded(NamedTuple):
    """States under load, one a column; vectors in the axes of the middle link, about its midpoint.

    velocity (3, n): of the middle link. potential (n,): J_delta. power (n,): of the friction
    forces. forces (n_link, 3, n): minus the friction force on each link in its own axes
    (tangential, normal, couple). residual (2, n): force and torque left. leftover_power (n,): power
    of what is left, load plus friction, on the motion.
    """

    velocity: np.ndarray
    potential: np.ndarray
    power: np.ndarray
    forces: np.ndarray
    residual: np.ndarray
    leftover_power: np.ndarray


def loaded_balance(
    body: Chain,
    friction: Friction,
    angles: np.ndarray,
    rates: np.ndarray,
    load: np.ndarray,
    start: np.ndarray,
    delta: float,
    steps: int = 40,
) -> Loaded:
    """Balance with associated friction under `load` ``(3, n)`` (force, torque on the middle link),
    from `start` ``(3, n)``.

    Compiled. Where Newton's method stalls on the creases of the potential, it is run again through
    falling delta.

    Raises
    ------
    ProblemError
        Without a C compiler, or the kernel that is built with the package.
    """
    library = guarantee_kernel(body)
    if library is None:
        raise ProblemError(
            "a guaranteed bound needs a C compiler (cc, gcc or clang), and colloc installed "
            "with one."
        )
    return Loaded(
        *compiled_loaded(library, body, friction, angles, rates, load, start, delta, steps)
    )
