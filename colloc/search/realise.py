"""Certificates of relaxed gaits, and the finite gaits that come near them (`colloc.results.relaxation`)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colloc.gaits.guesses import largest_factor
from colloc.gaits.limits import under_one_limit
from colloc.gaits.polygon import Corners
from colloc.gaits.problem import Problem
from colloc.gaits.relaxed import Mixture
from colloc.results.checks import Certificate, Check
from colloc.results.relaxation import Optimality, Realised, Relaxation
from colloc.search.certify import VIOLATION, gait_certificate
from colloc.search.effort import ROUGH
from colloc.system.errors import NotConvergedError

_NEAR, _MOST_CORNERS = 5e-3, 10_000
"""Relative loss of a finite gait that is near enough, and corners over a period, at most, of one."""
_GRID = 2000
"""Instants at which shapes are looked at, besides the corners."""


def recertified(problem: Problem, found: Relaxation, instants: int, tolerance: float = 1e-6) -> Relaxation:
    """The same with all certificates made anew, on so many instants to begin with."""
    relaxed = relaxed_certificate(problem, found.gait, found.optimality, instants, tolerance)
    realised = tuple(replace(r, certificate=finite_certificate(problem, r.gait, instants, tolerance)) for r in found.realised)
    return replace(found, certificate=relaxed, realised=realised)


def relaxed_certificate(
    problem: Problem, gait: Mixture, optimality: Optimality, instants: int = 1600, tolerance: float = 1e-6
) -> Certificate:
    """The certificate of a relaxed gait."""
    return gait_certificate(
        problem, gait, problem.delta * gait.delta_unit, gait.corner_phases, instants, tolerance,
        claimed=optimality.efficiency,
        before=(
            Check("KKT error", optimality.kkt_error, ROUGH.kkt_error, "gradient of the Lagrangian of the relaxed program"),
            Check("constraint violation", optimality.violation, VIOLATION, "largest violated equation or bound"),
            Check(
                "other directions", min(optimality.price, 0.0), ROUGH.kkt_error,
                "most that time in any other direction gains, per radian",
            ),
        ),
    )  # fmt: skip


def finite_certificate(problem: Problem, gait: Corners, instants: int = 1600, tolerance: float = 1e-6) -> Certificate:
    """The certificate of a polygon that need not be optimal."""
    return gait_certificate(problem, gait, problem.delta * gait.delta_unit, gait.corner_phases, instants, tolerance)


def kept_inside(problem: Problem, gait: Corners) -> Corners:
    """A polygon about admissible shapes, shrunk towards the straight body by as much as its loops reach beyond them."""
    body, angles = problem.body, gait.angles(np.union1d(np.linspace(0.0, 1.0, _GRID + 1), gait.corner_phases))
    stretched, limit = under_one_limit(angles, problem.joint_limit)
    beyond = max(float(body.largest_angles(stretched).max()) - limit, float(body.crossing_depth(angles).max()))
    if beyond <= body.usual.excess:
        return gait
    return Corners(largest_factor(body, problem.joint_limit, angles) * gait.corners, gait.symmetry)


def realised_gaits(
    problem: Problem,
    gait: Mixture,
    repeats: tuple[int, ...],
    tends_to: float = 0.0,
) -> tuple[Realised, ...]:
    """Finite gaits for several numbers of repeats, of either sense of their loops the better one.

    Where none of them comes near the relaxed efficiency `tends_to`, since loops are large, the last number is doubled until one
    does, or has too many corners to be of use. `NotConvergedError` if there are to be none.
    """
    found: list[Realised] = []
    wanted = list(repeats)
    while wanted:
        m = wanted.pop(0)
        both = []
        for sense in (1, -1):
            corners = kept_inside(problem, gait.realised(m, sense))
            both.append(Realised(m, sense, corners, finite_certificate(problem, corners)))
        found.append(max(both, key=lambda r: (r.certificate.passed, r.certificate.efficiency)))
        far = max(r.certificate.efficiency for r in found) < (1 - _NEAR) * tends_to
        if not wanted and far and 2 * found[-1].corners < _MOST_CORNERS:
            wanted.append(2 * m)
    if not found:
        raise NotConvergedError("a relaxed gait was to be realised by no repeats at all.")
    return tuple(found)
