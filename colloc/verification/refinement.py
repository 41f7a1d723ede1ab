"""Mesh refinement to a requested error of the objective: knots are moved, intervals split, the
order of the scheme raised.

The gait can be tried on any mesh without solving for it again (`verification.mesh_error`), so a
mesh is planned as a whole:

1. *Move.* The velocities have kinks where links begin to stick or slip. On an interval with a kink
  inside, any scheme is
   of low order. The knots of a coarse uniform mesh nearest to the kinks are moved onto them (or new
   ones are put there).
2. *Split.* Intervals with the largest errors are cut until the sum of all magnitudes is below the
  request.
3. *Raise the order.* Both are done for schemes of the same family with more nodes too; the mesh
  with the fewest points
   wins, with a handicap, since another order starts the optimiser anew.

Intervals in which a joint limit or a distance between links is violated between the instants that
constrain it are halved, which gives them more such instants.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from colloc.gaits.control_problem import ControlProblem
from colloc.gaits.gait_fields import AnyGait
from colloc.motion.kinds import kind_of_motion
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import Scheme, scheme
from colloc.verification.adaptive_motion import FineMotion
from colloc.verification.kinks import kink_phases
from colloc.verification.mesh_error import (
    FINER,
    Known,
    MeshError,
    gait_motion,
    interval_shares,
    mesh_error,
)

VIOLATION = 5e-7
"""Largest violation of a joint limit or of self-contact between nodes that needs no refinement
[rad, body lengths]."""
TURNING = 5e-5
"""Largest rotation that collocation may miss, times the body's reach over the distance: half of
what a certificate allows."""
MOST_POINTS = 12_000
AIM = 0.4
"""The planned error is this fraction of the request: the gait, and its kinks with it, will still
move."""
_GOOD = 0.9
"""A mesh is good already at this fraction of the request: the answer on it may still move the gait
a little."""
_MORE_NODES, _MOST_NODES = (0, 2, 4), 9
_HANDICAP = 1.1
_SNAP = 0.3
_COARSE, _A_HARMONIC = 16, 2
"""Intervals a period, at least, from which a mesh is grown, and for every harmonic."""
GRADE = 0.2
"""Where an interval with a kink at one end is cut, as a fraction of its length from there. Beside a
kink velocities go like x log|x|; cutting in the middle costs schemes of high order twice the
points."""
_ONE_KINK = 0.02 / 16
"""Kinks nearer to each other than this part of the solved period share a knot: 2 % of the spacing
of a first mesh."""
_LEFT = 0.2
"""How far, in mean intervals, a kink can have moved from the knot that it left."""
_NARROWEST = 1e-7
_WORST = 0.1
"""Of the largest error of an interval on a slope: others are not cut with it."""


@dataclass(frozen=True, eq=False)
class MeshPlan:
    """A mesh on which a gait is collocated as accurately as requested, or as the budget allows."""

    scheme: str
    edges: np.ndarray  # (n + 1,)
    estimate: float
    """Relative error of the gait's value on that mesh."""
    reached: bool
    """Whether that is below the request; if not, the budget of points was exhausted."""
    kept: np.ndarray
    """Phases that have to stay knots: they split intervals in which a constraint was violated."""


def kink_knots(
    control: ControlProblem, gait: AnyGait, delta: float, fine: FineMotion
) -> np.ndarray:
    """Phases of the kinks of a gait's velocities, one for each group of very close ones."""
    kinks = kink_phases(*control.dynamics[:2], gait, delta, fine)
    apart = _ONE_KINK * control.admissible.gait.fraction
    knots: list[float] = []
    for kink in kinks:
        if not knots or kink - knots[-1] > apart:
            knots.append(float(kink))
    return np.array(knots)


def moved_knots(edges: np.ndarray, kinks: np.ndarray, snap: float = _SNAP) -> np.ndarray:
    """The mesh with its nearest inner knots moved onto the kinks.

    A kink farther than `snap` (in typical spacings) from any knot gets a knot of its own.
    """
    free, fixed = edges[1:-1].copy(), []
    spacing = np.median(np.diff(edges))
    for kink in kinks:
        fixed.append(kink)
        if free.size:
            nearest = int(np.argmin(np.abs(free - kink)))
            if abs(free[nearest] - kink) < snap * spacing:
                free = np.delete(free, nearest)
    knots = np.unique(np.concatenate([edges[[0, -1]], free, fixed]))
    keep = np.concatenate([[True], np.diff(knots) > _NARROWEST])
    keep[-1] = True
    return knots[keep]


def planned_mesh(
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
    """A mesh for `gait`, or None if `mesh` is good already.

    Parameters
    ----------
    control : ControlProblem
    mesh : Mesh
        The mesh the gait was found on.
    gait : AnyGait
    delta : float
        Regularisation speed, per period.
    tolerance : float
        Largest relative error of the objective.
    kept : array, optional
        Phases that have to be knots.
    nested : bool
        Whether all knots of the mesh stay. Where an optimum is flat, the gait moves far for what
        little it gains on the cells that the mesh has resolved least; with the knots that were
        there it has nowhere to come back to.
    aim : float
        The planned error is this fraction of the tolerance.
    most_points : int
        Budget of collocation points.

    Raises
    ------
    NotConvergedError
        If the balance cannot be solved at some instant.
    """
    fine = gait_motion(control, gait, delta, mesh, FINER * tolerance)
    known, error = (
        Known(control, gait, delta, fine),
        mesh_error(control, mesh, gait, delta, tolerance, fine),
    )
    accurate = error.estimate <= _GOOD * tolerance and error.turning <= TURNING
    if accurate and error.violation.max() <= VIOLATION:
        return None
    knots = np.union1d(violated_middles(mesh, error), [] if kept is None else kept)
    if accurate:
        return MeshPlan(
            mesh.scheme.name,
            np.unique(np.concatenate([mesh.edges, knots])),
            error.estimate,
            True,
            knots,
        )
    given = scheme(control.scheme)
    if kind_of_motion(control.dynamics).followed:
        uniform = np.linspace(0.0, control.admissible.gait.fraction, control.intervals + 1)
        first = np.union1d(mesh.edges if nested else uniform, knots)
        return _fewest(
            _halved(known, Mesh(rule, first), knots, tolerance, aim, most_points)
            for rule in _family(given)
        )
    kinks = kink_knots(control, gait, delta, fine)
    switches = not control.dynamics.law.reversible
    best: MeshPlan | None = None
    for rule in _family(given):
        # a node right on the instant at which mu_b takes over from mu_f makes the efficiency itself
        # kinked
        on_knots = kinks[:0] if switches and (rule.left or rule.right) else kinks
        # where the rates jump edges may be added, not moved
        gait = control.admissible.gait
        keeps = nested or gait.relative_delta or not gait.free
        snap = 0.0 if keeps else _SNAP
        first = np.union1d(mesh.edges if keeps else coarse_edges(control, mesh.edges), knots)
        edges = moved_knots(first, np.union1d(on_knots, _beside(mesh, on_knots)), snap)
        budget = most_points if best is None else min(most_points, _points(best) / _HANDICAP)
        plan = _split(known, rule, edges, knots, on_knots, tolerance, aim, budget)
        best = plan if best is None else _fewest([best, plan])
    return best


def coarse_edges(control: ControlProblem, edges: np.ndarray) -> np.ndarray:
    """The uniform mesh from which a finer one is grown."""
    gait = control.admissible.gait
    n = max(int(_COARSE * gait.fraction), _A_HARMONIC * gait.harmonics)
    return np.linspace(edges[0], edges[-1], n + 1)


def _fewest(plans: Iterable[MeshPlan]) -> MeshPlan:
    """The one with the fewest points of those that reach what is asked for; the first one, if none
    does."""
    best, *others = plans
    for plan in others:
        if plan.reached and (not best.reached or _points(plan) * _HANDICAP < _points(best)):
            best = plan
    return best


def _beside(mesh: Mesh, kinks: np.ndarray) -> np.ndarray:
    """Knots of a mesh that the kinks have just left.

    Where a kink leaves its knot, collocation errs in proportion to how far it went, and the
    optimiser takes what errs in its favour: moving the knot after the kink only repeats the chase.
    Between the old knot and the new one it ends.
    """
    if kinks.size == 0:
        return kinks
    nearest = mesh.edges[np.abs(mesh.edges[:, None] - kinks).argmin(axis=0)]
    return nearest[np.abs(nearest - kinks) < _LEFT * np.diff(mesh.edges).mean()]


def violated_middles(mesh: Mesh, error: MeshError) -> np.ndarray:
    """Midpoints of the intervals in which a shape constraint is violated between its instants."""
    return (0.5 * (mesh.edges[1:] + mesh.edges[:-1]))[error.violation > VIOLATION]


def _family(given: Scheme) -> list[Scheme]:
    match = re.fullmatch(r"(gauss|radau)-(\d+)", given.name)
    if not match:
        return [given]
    nodes = [given.s + more for more in _MORE_NODES if more == 0 or given.s + more <= _MOST_NODES]
    return [scheme(f"{match[1]}-{s}") for s in nodes]


def _points(plan: MeshPlan) -> float:
    rule = scheme(plan.scheme)
    return (plan.edges.size - 1) * (rule.s - rule.left)


def _split(
    known: Known,
    rule: Scheme,
    edges: np.ndarray,
    kept: np.ndarray,
    kinks: np.ndarray,
    tolerance: float,
    aim: float,
    budget: float,
) -> MeshPlan:
    """Cut the intervals with the largest errors until all together are small enough, or the budget
    is exhausted."""
    left, right = edges[:-1], edges[1:]
    shares = interval_shares(known, rule, left, right)
    unresolved = float(known.fine.unresolved.sum())
    wanted = max(aim * tolerance - unresolved, 0.25 * aim * tolerance)
    while shares.sum() > wanted and left.size * (rule.s - rule.left) < budget:
        order = np.argsort(shares)[::-1]
        # those that hold the excess, half of them at a time: what they leave behind is not known
        # yet
        excess = np.cumsum(shares[order]) < shares.sum() - 0.3 * wanted
        chosen = order[: max(1, int(excess.sum()) // 2)]
        chosen = chosen[right[chosen] - left[chosen] > 2 * _NARROWEST]
        if chosen.size == 0:
            break
        middle = _cut(left[chosen], right[chosen], kinks)
        new_left, new_right = (
            np.concatenate([left[chosen], middle]),
            np.concatenate([middle, right[chosen]]),
        )
        new = interval_shares(known, rule, new_left, new_right)
        left, right, shares = (
            np.concatenate([np.delete(old, chosen), added])
            for old, added in ((left, new_left), (right, new_right), (shares, new))
        )
    estimate = float(shares.sum() + unresolved)
    return MeshPlan(
        rule.name, np.sort(np.append(left, right.max())), estimate, estimate <= tolerance, kept
    )


def _halved(
    known: Known, mesh: Mesh, kept: np.ndarray, tolerance: float, aim: float, most_points: int
) -> MeshPlan:
    """A mesh whose intervals with the largest errors are halved until all together are small
    enough."""
    (control, gait, delta, fine), (rule, edges) = known, (mesh.scheme, mesh.edges)
    while True:
        error = mesh_error(control, Mesh(rule, edges), gait, delta, tolerance, fine)
        shares = np.abs(error.value)
        if (
            shares.sum() <= aim * tolerance
            or edges.size * rule.s > most_points
            or np.isnan(shares).any()
        ):
            return MeshPlan(rule.name, edges, error.estimate, error.estimate <= tolerance, kept)
        order = np.argsort(shares)[::-1]
        excess = np.cumsum(shares[order]) < shares.sum() - 0.3 * aim * tolerance
        chosen = (
            order[excess & (shares[order] > _WORST * shares.max())] if excess.any() else order[:1]
        )
        edges = np.sort(np.concatenate([edges, 0.5 * (edges[chosen] + edges[chosen + 1])]))


def _cut(left: np.ndarray, right: np.ndarray, kinks: np.ndarray) -> np.ndarray:
    """Where to cut intervals: in the middle, but near an end that is a kink, where meshes of high
    order want grading."""
    at_left, at_right = np.isin(left, kinks), np.isin(right, kinks)
    fraction = np.where(at_left & ~at_right, GRADE, np.where(at_right & ~at_left, 1 - GRADE, 0.5))
    return left + fraction * (right - left)
