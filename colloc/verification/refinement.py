"""Mesh refinement to a requested error of the objective.

A gait can be tried on any mesh (`verification.mesh_error`), so a mesh is planned as a whole: knots
are *moved* onto the kinks where links begin to stick or slip, intervals with the largest errors are
*split*, for schemes with *more nodes* too, of which the mesh with the fewest points wins.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.dynamics.control_problem import ControlProblem
from colloc.gaits.gait_fields import AnyGait
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import Scheme, scheme
from colloc.verification.adaptive_motion import FineMotion
from colloc.verification.kinks import kink_phases
from colloc.verification.mesh_error import FINER, Known, gait_motion, interval_shares, mesh_error

VIOLATION = 5e-7
"""Violation of a joint limit or of self-contact that needs no refinement [rad, body lengths]."""
TURNING = 5e-5
"""Rotation that collocation may miss, times reach over distance: half of what certificates
allow."""
MOST_POINTS = 12_000
AIM = 0.4
"""Planned error over the request: the gait, and its kinks with it, will still move."""
_GOOD = 0.9
"""Error over the request of a mesh that is good already: the answer may still move the gait."""
_MORE_NODES, _MOST_NODES = (0, 2, 4), 9
_HANDICAP = 1.1  # of another order, which starts the optimiser anew
_SNAP = 0.3
_COARSE, _A_HARMONIC = 16, 2  # least intervals of a coarse mesh, a period and a harmonic
GRADE = 0.2
"""Where an interval with a kink at one end is cut, over its length: velocities go like x log|x|,
and cutting in the middle costs schemes of high order twice the points."""
_ONE_KINK = 0.02 / 16
"""Part of the solved period within which kinks share a knot: 2 % of a first mesh's spacing."""
_LEFT = 0.2  # mean intervals by which a kink may have moved from the knot that it left
_NARROWEST = 1e-7
_WORST = 0.1  # of the largest error: with states, intervals below it are not cut


@dataclass(frozen=True, eq=False)
class MeshPlan:
    scheme: str
    edges: np.ndarray  # (n + 1,)
    estimate: float  # relative error of the gait's value
    reached: bool  # whether that is below the request
    kept: np.ndarray  # phases that have to stay knots, as they split violating intervals


def kink_knots(
    control: ControlProblem, gait: AnyGait, delta: float, fine: FineMotion
) -> np.ndarray:
    """Phases of the kinks of a gait's velocities, one for each group of very close ones."""
    apart = _ONE_KINK * control.admissible.fraction
    knots: list[float] = []
    for kink in kink_phases(control.dynamics.body, control.dynamics.law, gait, delta, fine):
        if not knots or kink - knots[-1] > apart:
            knots.append(float(kink))
    return np.array(knots)


def move_knots(edges: np.ndarray, kinks: np.ndarray, snap: float = _SNAP) -> np.ndarray:
    """Move the nearest inner knots onto the kinks; one farther than `snap` spacings gets its
    own."""
    free, spacing = edges[1:-1].copy(), np.median(np.diff(edges))
    for kink in kinks:
        if free.size:
            nearest = int(np.argmin(np.abs(free - kink)))
            if abs(free[nearest] - kink) < snap * spacing:
                free = np.delete(free, nearest)
    knots = np.unique(np.concatenate([edges[[0, -1]], free, kinks]))
    keep = np.diff(knots, prepend=-np.inf) > _NARROWEST
    keep[-1] = True
    return knots[keep]


def plan_mesh(
    control: ControlProblem,
    mesh: Mesh,
    gait: AnyGait,
    delta: float,
    tolerance: float,
    *,
    kept: np.ndarray | None = None,
    nested: bool = False,
    aim: float = AIM,
    most_points: int = MOST_POINTS,
) -> MeshPlan | None:
    """A mesh for a gait that was found on `mesh`, or None if that is good already.

    The planned error is `aim` times the tolerance; the phases `kept` have to be knots; `nested`:
    all knots of the mesh stay, so that a flat optimum has nowhere to come back to.
    `NotConvergedError` without a balance.
    """
    fine = gait_motion(control, gait, delta, mesh, FINER * tolerance)
    known = Known(control, gait, delta, fine)
    error = mesh_error(control, mesh, gait, delta, tolerance, fine)
    accurate = error.estimate <= _GOOD * tolerance and error.turning <= TURNING
    if accurate and error.violation.max() <= VIOLATION:
        return None
    middles = 0.5 * (mesh.edges[1:] + mesh.edges[:-1])
    knots = np.union1d(middles[error.violation > VIOLATION], [] if kept is None else kept)
    if accurate:
        edges = np.union1d(mesh.edges, knots)
        return MeshPlan(mesh.scheme.name, edges, error.estimate, True, knots)
    rules, gaits = _family(scheme(control.scheme)), control.admissible.gait
    asked: Any = {"kept": knots, "tolerance": tolerance, "aim": aim}
    if control.dynamics.followed:
        uniform = np.linspace(0.0, control.admissible.fraction, control.intervals + 1)
        first = np.union1d(mesh.edges if nested else uniform, knots)
        return _fewest(_halve(known, rule, first, budget=most_points, **asked) for rule in rules)
    kinks = kink_knots(control, gait, delta, fine)
    # where the rates jump edges may be added, not moved
    keeps = nested or gaits.relative_delta or not gaits.free
    best: MeshPlan | None = None
    for rule in rules:
        # a node right on the instant at which mu_b takes over from mu_f makes the efficiency itself
        # kinked
        switches = not control.dynamics.law.reversible and (rule.left or rule.right)
        on_knots = kinks[:0] if switches else kinks
        first = np.union1d(mesh.edges if keeps else coarse_edges(control, mesh.edges), knots)
        targets = np.union1d(on_knots, _knots_left(mesh, on_knots))
        edges = move_knots(first, targets, 0.0 if keeps else _SNAP)
        budget = most_points if best is None else min(most_points, _points(best) / _HANDICAP)
        plan = _split(known, rule, edges, on_knots, budget=budget, **asked)
        best = plan if best is None else _fewest([best, plan])
    return best


def coarse_edges(control: ControlProblem, edges: np.ndarray) -> np.ndarray:
    gait = control.admissible.gait
    n = max(int(_COARSE * gait.fraction), _A_HARMONIC * gait.harmonics)
    return np.linspace(edges[0], edges[-1], n + 1)


def _fewest(plans: Iterable[MeshPlan]) -> MeshPlan:
    """The plan with the fewest points of those that reach the request; else the first."""
    best, *others = plans
    for plan in others:
        if plan.reached and (not best.reached or _points(plan) * _HANDICAP < _points(best)):
            best = plan
    return best


def _knots_left(mesh: Mesh, kinks: np.ndarray) -> np.ndarray:
    """Knots that the kinks have just left: collocation errs there in the optimiser's favour, and
    moving the knot after the kink repeats the chase."""
    if kinks.size == 0:
        return kinks
    nearest = mesh.edges[np.abs(mesh.edges[:, None] - kinks).argmin(axis=0)]
    return nearest[np.abs(nearest - kinks) < _LEFT * np.diff(mesh.edges).mean()]


def _family(given: Scheme) -> list[Scheme]:
    match = re.fullmatch(r"(gauss|radau)-(\d+)", given.name)
    if not match:
        return [given]
    nodes = [given.s + more for more in _MORE_NODES if more == 0 or given.s + more <= _MOST_NODES]
    return [scheme(f"{match[1]}-{s}") for s in nodes]


def _points(plan: MeshPlan) -> float:
    rule = scheme(plan.scheme)
    return (plan.edges.size - 1) * (rule.s - rule.left)


def _by_error(shares: np.ndarray, allowed: float) -> tuple[np.ndarray, int]:
    """Intervals by falling error, and how many of them hold the excess over `allowed`."""
    order = np.argsort(shares)[::-1]
    return order, int((np.cumsum(shares[order]) < shares.sum() - allowed).sum())


def _split(
    known: Known,
    rule: Scheme,
    edges: np.ndarray,
    kinks: np.ndarray,
    *,
    kept: np.ndarray,
    tolerance: float,
    aim: float,
    budget: float,
) -> MeshPlan:
    """Cut the intervals with the largest errors, in the middle or near an end that is a kink."""
    left, right = edges[:-1], edges[1:]
    shares = interval_shares(known, rule, left, right)
    unresolved = float(known.fine.unresolved.sum())
    wanted = max(aim * tolerance - unresolved, 0.25 * aim * tolerance)
    while shares.sum() > wanted and left.size * (rule.s - rule.left) < budget:
        # half of those that hold the excess at a time: what they leave behind is not known yet
        order, count = _by_error(shares, 0.3 * wanted)
        chosen = order[: max(1, count // 2)]
        chosen = chosen[right[chosen] - left[chosen] > 2 * _NARROWEST]
        if chosen.size == 0:
            break
        a, b = left[chosen], right[chosen]
        at_a, at_b = np.isin(a, kinks), np.isin(b, kinks)
        middle = a + np.where(at_a & ~at_b, GRADE, np.where(at_b & ~at_a, 1 - GRADE, 0.5)) * (b - a)
        new_left, new_right = np.concatenate([a, middle]), np.concatenate([middle, b])
        new = interval_shares(known, rule, new_left, new_right)
        left, right, shares = (
            np.concatenate([np.delete(old, chosen), added])
            for old, added in ((left, new_left), (right, new_right), (shares, new))
        )
    estimate = float(shares.sum() + unresolved)
    edges = np.sort(np.append(left, right.max()))
    return MeshPlan(rule.name, edges, estimate, estimate <= tolerance, kept)


def _halve(
    known: Known,
    rule: Scheme,
    edges: np.ndarray,
    *,
    kept: np.ndarray,
    tolerance: float,
    aim: float,
    budget: float,
) -> MeshPlan:
    """Halve the intervals with the largest errors of a motion with states."""
    control, gait, delta, fine = known
    while True:
        error = mesh_error(control, Mesh(rule, edges), gait, delta, tolerance, fine)
        shares = np.abs(error.value)
        small, full = shares.sum() <= aim * tolerance, edges.size * rule.s > budget
        if small or full or np.isnan(shares).any():
            return MeshPlan(rule.name, edges, error.estimate, error.estimate <= tolerance, kept)
        order, count = _by_error(shares, 0.3 * aim * tolerance)
        chosen = order[: max(1, count)]
        chosen = chosen[shares[chosen] > _WORST * shares.max()]
        edges = np.sort(np.concatenate([edges, 0.5 * (edges[chosen] + edges[chosen + 1])]))
