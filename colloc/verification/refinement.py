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
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.law import Law
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import Scheme, scheme
from colloc.verification.adaptive_motion import FineMotion, Path, rates_at
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
_SLOW = 30.0
"""A point counts as at rest below this many delta."""
_ZOOMS, _SAMPLES = 5, 9
_SEPARATE = 1e-6


@dataclass(frozen=True, eq=False)
class MeshPlan:
    scheme: str
    edges: np.ndarray  # (n + 1,)
    estimate: float  # relative error of the gait's value
    reached: bool  # whether that is below the request
    kept: np.ndarray  # phases that have to stay knots, as they split violating intervals

    @property
    def points(self) -> float:
        rule = scheme(self.scheme)
        return (self.edges.size - 1) * (rule.s - rule.left)


def kink_phases(
    body: Body, friction: Law, path: Path, delta: float, fine: FineMotion, apart: float = _SEPARATE
) -> np.ndarray:
    """Phases of kinks and jumps of a gait's velocities inside its solved part, ascending and
    farther `apart`; delta is per period.

    The balance changes like x log|x| where a link slides on with its centre of rotation inside,
    like |x| when it comes to rest; where mu_f and mu_b differ, also where the tangential velocity
    changes its sign; and where a balance ends in a fold, the body jumps. Smooth bodies, and drag,
    make no kinks.
    """

    def slowness(t: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Speeds that vanish at kinks, ``(n_part, n_time)``."""
        if not (isinstance(body, Chain) and body.law(friction).regularised):
            return np.empty((0, t.size))
        angles, rates = path(t)
        velocity = body.velocity(body.posture(angles), rates, z)
        return body.contact.sticking_speeds(friction, velocity)

    t, velocity = fine.nodes.ravel(), fine.rates.z.reshape(3, -1)
    speed = slowness(t, velocity)
    inner = speed[:, 1:-1]
    link, index = np.nonzero((inner <= speed[:, :-2]) & (inner <= speed[:, 2:]))
    centre, least = t[index + 1], inner[link, index]
    radius, rows = np.maximum(t[index + 2] - centre, centre - t[index]), np.arange(centre.size)
    for _ in range(_ZOOMS if centre.size else 0):
        near = centre[:, None] + radius[:, None] * np.linspace(-1, 1, _SAMPLES)
        z = rates_at(body, friction, path, delta, near, near=fine.velocity(near)).z.reshape(3, -1)
        sampled = slowness(near.ravel(), z)[np.repeat(link, _SAMPLES), np.arange(near.size)]
        best = sampled.reshape(near.shape).argmin(axis=1)
        centre, least = near[rows, best], sampled.reshape(near.shape)[rows, best]
        radius *= 2.0 / (_SAMPLES - 1)
    jumps = (np.abs(np.diff(velocity)).max(axis=0) > _SLOW * delta) & (np.diff(t) < _SEPARATE)
    kinks = np.sort(np.concatenate([centre[least < _SLOW * delta], 0.5 * (t[1:] + t[:-1])[jumps]]))
    kinks = kinks[(kinks > fine.edges[0] + _SEPARATE) & (kinks < fine.edges[-1] - _SEPARATE)]
    kinks = kinks[np.diff(kinks, prepend=-np.inf) > _SEPARATE]
    found: list[float] = []
    for kink in kinks.tolist():
        if not found or kink - found[-1] > apart:
            found.append(kink)
    return np.array(found)


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
    gaits, rules = control.admissible.gait, [scheme(control.scheme)]
    if match := re.fullmatch(r"(gauss|radau)-(\d+)", control.scheme):
        more = [rules[0].s + n for n in _MORE_NODES]
        rules += [scheme(f"{match[1]}-{s}") for s in more[1:] if s <= _MOST_NODES]
    asked: Any = {"kept": knots, "tolerance": tolerance, "aim": aim}
    if control.dynamics.followed:
        uniform = np.linspace(0.0, control.admissible.fraction, control.intervals + 1)
        first = np.union1d(mesh.edges if nested else uniform, knots)
        return _fewest(_halve(known, rule, first, budget=most_points, **asked) for rule in rules)
    apart = _ONE_KINK * control.admissible.fraction
    kinks = kink_phases(control.dynamics.body, control.dynamics.law, gait, delta, fine, apart)
    # where the rates jump edges may be added, not moved
    keeps = nested or gaits.relative_delta or not gaits.free
    n = max(int(_COARSE * gaits.fraction), _A_HARMONIC * gaits.harmonics)
    coarse = mesh.edges if keeps else np.linspace(mesh.edges[0], mesh.edges[-1], n + 1)
    best: MeshPlan | None = None
    for rule in rules:
        # a node right on the instant at which mu_b takes over from mu_f makes the efficiency itself
        # kinked
        switches = not control.dynamics.law.reversible and (rule.left or rule.right)
        targets = on_knots = kinks[:0] if switches else kinks
        if on_knots.size:
            # and the knots that the kinks have just left: collocation errs there in the optimiser's
            # favour, and moving the knot after the kink repeats the chase
            nearest = mesh.edges[np.abs(mesh.edges[:, None] - kinks).argmin(axis=0)]
            just_left = np.abs(nearest - kinks) < _LEFT * np.diff(mesh.edges).mean()
            targets = np.union1d(kinks, nearest[just_left])
        edges = move_knots(np.union1d(coarse, knots), targets, 0.0 if keeps else _SNAP)
        budget = most_points if best is None else min(most_points, best.points / _HANDICAP)
        plan = _split(known, rule, edges, on_knots, budget=budget, **asked)
        best = plan if best is None else _fewest([best, plan])
    return best


def _fewest(plans: Iterable[MeshPlan]) -> MeshPlan:
    """The plan with the fewest points of those that reach the request; else the first."""
    best, *others = plans
    for plan in others:
        if plan.reached and (not best.reached or plan.points * _HANDICAP < best.points):
            best = plan
    return best


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
