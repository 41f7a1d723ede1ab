"""Errors of a collocated gait, interval by interval, and meshes refined to a requested one.

On an interval the scheme takes the rate of a state to be the polynomial through its values at the
nodes; the integral of the *defect*, that polynomial less the true rate, is the error it adds.

A gait can be tried on any mesh, so a mesh is planned as a whole (docs/developers/error_control.md).
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from colloc.dynamics.chain import joint_torques
from colloc.dynamics.collocated import CollocatedPose, stage_weights
from colloc.dynamics.control_problem import Admissible, ControlProblem
from colloc.dynamics.dynamics import OMEGA, Inertial, PeriodTotals, Shapes, Trajectory
from colloc.gaits.gait import NONE
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.robot import under_one_limit
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_depth, far_pairs
from colloc.mechanics.inertia import STATES
from colloc.mechanics.law import Law
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import Scheme, scheme
from colloc.verification.adaptive_motion import (
    LEAST,
    FineMotion,
    Path,
    fine_motion,
    rates_at,
    totals_along,
)
from colloc.verification.differential_motion import GaitOnSlope, GaitWithInertia, amplification

FINER = 0.05
"""What the panels may miss, over the error they measure or the tolerance."""
_SAMPLES = 32
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
_ZOOMS, _PLACES = 5, 9
_SEPARATE = 1e-6


@dataclass(frozen=True, eq=False)
class MeshError:
    """Errors of collocating one gait on one mesh; arrays over intervals, ``(n,)``."""

    value: np.ndarray
    """Contribution to the relative error of the objective, signed, to first order."""
    violation: np.ndarray
    """Largest excess over a joint limit [rad] or penetration of links [rad or body lengths]."""
    total: float  # relative error of the collocated objective, not linearised
    unresolved: float  # what the panels may have missed of it
    turning: float
    """Rotation that collocation misses over a period, times half a length over the distance; 0
    where a symmetry closes it. It makes the distance of a closed gait ambiguous."""

    @property
    def estimate(self) -> float:
        """Relative error of the objective: magnitudes, as an optimiser exploits cancellation."""
        return float(np.abs(self.value).sum() + self.unresolved)


class ReferenceMotion(NamedTuple):
    """The motion of a gait with states by its differential equation."""

    at: Callable[[np.ndarray], np.ndarray]
    """Momenta if they are states, theta, place, work against friction, ``(4 or 7, n)``, at
    ascending phases, seen from axes that turn evenly."""
    error: float  # about that of these states
    sums: Callable[[np.ndarray], np.ndarray] | None = None
    """Quantities that forces are needed for up to ascending phases, ``(k, n)``."""
    solve_intervals: Callable[..., Any] | None = None
    """`colloc.dynamics.dynamics.Inertial.solve_intervals`; None: errors of intervals are seen in
    the whole motion."""


class Reference(NamedTuple):
    """A gait, delta per period, and its motion (`gait_motion`)."""

    control: ControlProblem
    gait: AnyGait
    delta: float
    fine: Any


def gait_motion(
    control: ControlProblem, gait: AnyGait, delta: float, mesh: Mesh, tolerance: float
) -> Any:
    """The gait's motion, delta per period, to a relative error of the objective: a `FineMotion`;
    where it has states, a `ReferenceMotion`, by an error of the states. A regime of one's own has
    it as ``reference``."""
    kind = control.dynamics
    body, law, regime = kind.body, kind.law, kind.regime
    if not kind.followed:
        return fine_motion(
            body, law, gait, delta, mesh.edges, tolerance, control.aims.objective,
            quantities=control.aims.integrals, turn=kind.turn, periods=kind.periods,
        )  # fmt: skip
    _, along, _, _, period = _collocate(control, mesh, gait, delta)
    counts = sum(map(abs, control.aims.objective.shares(period).values()))
    error = tolerance / counts if np.isfinite(counts) else tolerance
    if hasattr(regime, "reference"):
        return regime.reference(control, gait, delta, mesh, error)
    integrals = control.aims.integrals
    if regime.froude:
        paced = regime.at(gait)
        how: Any = {"froude": paced.froude, "turn": kind.turn, "regime": paced}
        moving = GaitWithInertia(body, law, gait, delta, quantities=integrals, **how)
        begin, _, slopes = moving.rough_period(along.edges[:, 0])
        times = 1.0 + np.abs(amplification(slopes)).sum(axis=1).max()
        run = moving.periodic_run(begin, max(error / times, LEAST), slopes)
        by_interval = kind.solve_intervals  # type: ignore[attr-defined]
        sums = moving.integrals(run.course, run.aim)
        return ReferenceMotion(run.course.at, times * run.aim, sums, by_interval)
    if regime.slides:
        on = GaitOnSlope(body, law, gait, delta, regime, gait.corner_phases, integrals)
        motion = on.integrate(gait.theta, error)
        return ReferenceMotion(lambda t: motion.at(t)[:4], error, on.integrals(motion, error))
    raise NotImplementedError(
        f"no differential equation is known for {type(regime).__name__}: give it a reference."
    )


def mesh_error(
    control: ControlProblem,
    mesh: Mesh,
    gait: AnyGait,
    delta: float,
    tolerance: float = 1e-6,
    fine: Any = None,
) -> MeshError:
    """Errors of collocating a gait on a mesh, delta per period; relative ones below the tolerance
    need not be exact. `NotConvergedError` without a balance."""
    if fine is None:
        fine = gait_motion(control, gait, delta, mesh, FINER * tolerance)
    reference, kind = Reference(control, gait, delta, fine), control.dynamics
    violation = constraint_violation(control.admissible, mesh, gait)
    if kind.followed:
        return MeshError(**_errors_with_states(reference, mesh), violation=violation)
    value, turning, pose, integrals = _collocated_cells(
        reference, mesh.scheme, mesh.edges[:-1], mesh.edges[1:]
    )
    objective, rotation = control.aims.objective, pose.theta[-1] - kind.turn
    _, on_mesh = _period(control, pose.place[-1], rotation, integrals)
    return MeshError(
        value=value,
        violation=violation,
        total=objective(on_mesh) / objective(_exact(reference)[1]) - 1,
        unresolved=float(fine.unresolved.sum()),
        turning=abs(float(turning.sum())),
    )


def _first_order(
    control: ControlProblem,
    cycle: PeriodTotals,
    period: Mapping[str, float],
    rotation: np.ndarray,
    displacement: np.ndarray,
    integrals: np.ndarray,
) -> np.ndarray:
    """Relative changes of the objective by errors of intervals: `displacement` at the end,
    `integrals` work and others ``(1 + k, n)``."""
    kind, weights = control.dynamics, control.aims.objective.shares(period)
    value = np.zeros(rotation.size)
    for name, share in kind.total_gradients(cycle).items():
        way = (np.conj(share.side) * displacement).real
        value += weights.get(name, 0.0) * (
            way + share.rotation * rotation + share.work * integrals[0]
        )
    for each, error in zip(control.aims.integrals, integrals[1:], strict=True):
        value += weights[each.name] * kind.periods * error
    return value


def _collocated_cells(
    reference: Reference, rule: Scheme, left: np.ndarray, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray, CollocatedPose, np.ndarray]:
    """What intervals add to the error of the objective and to the turning; pose, work and integrals
    ``(1 + k,)``."""
    (control, gait, delta, fine), h = reference, right - left
    nodes, kind = left[:, None] + h[:, None] * rule.c, control.dynamics
    how: Any = {"quantities": control.aims.integrals, "turn": kind.turn}
    guess = fine.velocity(nodes)
    rates = rates_at(kind.body, kind.law, gait, delta, nodes, guess=guess, **how)
    pose = CollocatedPose(rule, h, rates.z[2], rates.centre)
    totals = (h[:, None] * rule.b * rates.densities).sum(axis=2)
    (theta, path, *before), (theta_right, path_right, *after) = fine.at(left), fine.at(right)
    rotation = pose.rotations - (theta_right - theta)
    excess = totals - (np.array(after) - np.array(before))
    displacement = pose.displacements * np.exp(1j * theta) - (path_right - path)
    # an error of rotation turns everything after it
    added = displacement + 1j * rotation * (fine.path[-1] - path_right)
    value = _first_order(control, *_exact(reference), rotation, added, excess)
    closed = control.admissible.gait.symmetry != NONE
    turning = rotation * (0.0 if closed else 0.5 / abs(fine.path[-1]))
    return value, turning, pose, totals.sum(axis=1)


def interval_shares(
    reference: Reference, rule: Scheme, left: np.ndarray, right: np.ndarray
) -> np.ndarray:
    """Magnitudes of what intervals add to the relative error of the objective and to the
    turning."""
    value, turning, *_ = _collocated_cells(reference, rule, left, right)
    return np.abs(value) + np.abs(turning)


def _period(
    control: ControlProblem, end: complex, rotation: float, integrals: np.ndarray, static: Any = ()
) -> tuple[PeriodTotals, dict[str, float]]:
    """The solved part, and quantities of the period, from work and integrals ``(1 + k,)``."""
    kind, (work, *sums) = control.dynamics, integrals.tolist()
    cycle = PeriodTotals(complex(end), float(rotation), work, static)
    more = zip(control.aims.integrals, sums, strict=True)
    return cycle, kind.totals(cycle) | {each.name: kind.periods * total for each, total in more}


def _exact(reference: Reference) -> tuple[PeriodTotals, dict[str, float]]:
    fine, turn = reference.fine, reference.control.dynamics.turn
    return _period(reference.control, fine.path[-1], fine.theta[-1] - turn, fine.totals[:, -1])


def _collocate(
    control: ControlProblem, mesh: Mesh, gait: Any, delta: float, guess: np.ndarray | None = None
) -> tuple[Shapes, Trajectory, CollocatedPose, np.ndarray, dict[str, float]]:
    """A gait on a mesh: work and integrals of intervals ``(1 + k, n)``, quantities of the
    period."""
    kind, weights = control.dynamics, stage_weights(mesh)
    angles, rates = gait(mesh.times)
    shapes = Shapes(angles, rates, delta)
    static = np.array([getattr(gait, each.name) for each in kind.static_parameters])
    along = kind.simulate(mesh, shapes, static, guess)
    theta = kind.initial_heading(along.static)
    pose = CollocatedPose.on_mesh(mesh, along.now.z[OMEGA] - kind.turn, along.now.centre, theta)
    now = kind.instants(shapes, pose.theta_on(mesh), along.now.z)
    if isinstance(kind, Inertial):
        how: Any = {"delta": delta, "froude": kind.froude_at(shapes, along.static)}
        at = kind.chain, kind.law, gait, mesh.times, along.states[: len(STATES)]
        now = replace(now, moments=joint_torques(*at, **how), froude=how["froude"])
    densities = along.now.power, *(each.at(now)[0] for each in control.aims.integrals)
    integrals = np.array([(weights * each[mesh.points]).sum(axis=1) for each in densities])
    totals = pose.place[-1], pose.rotations.sum(), integrals.sum(axis=1), along.static
    return shapes, along, pose, integrals, _period(control, *totals)[1]


def _errors_with_states(reference: Reference, mesh: Mesh) -> dict[str, Any]:
    (control, gait, delta, exact), kind = reference, reference.control.dynamics
    # momenta, perhaps theta
    at_edges, guess = exact.at(mesh.edges), exact.at(mesh.times)[: len(kind.states)]
    shapes, along, pose, integrals, on_mesh = _collocate(control, mesh, gait, delta, guess)
    objective = control.aims.objective
    angle, *place = at_edges[-4:-1]
    theta, x, y, work = np.diff(at_edges[-4:], axis=1)
    forced = iter([] if exact.sums is None else np.diff(exact.sums(mesh.edges), axis=1))
    more = (
        next(forced)
        if each.needs_forces
        else totals_along(each, gait, mesh.edges[:-1], mesh.edges[1:], 4)
        for each in control.aims.integrals
    )
    true = np.array([work, *more])
    totals = x.sum() + 1j * y.sum(), theta.sum(), true.sum(axis=1), along.static
    cycle, period = _period(control, *totals)
    weights, rotation = objective.shares(period), pose.rotations - theta
    displacement = np.diff(pose.place) - (x + 1j * y)
    turning = abs(float(rotation.sum())) * 0.5 / max(abs(period["distance"]), 1e-300)
    by_states: Any = 0.0
    if exact.solve_intervals is not None:
        states = at_edges[: len(kind.states)]
        out, ends, solved = exact.solve_intervals(mesh, shapes, along, states[:, :-1], guess)
        local = CollocatedPose.on_mesh(mesh, out[OMEGA] - kind.turn, out[3:5])
        rotation = local.rotations - theta
        integrals[0] = (stage_weights(mesh) * out[5][mesh.points]).sum(axis=1)
        displacement = np.exp(1j * angle[:-1]) * local.displacements - (x + 1j * y)
        if not kind.states[3:]:  # an error of rotation turns everything after it
            path = place[0] + 1j * place[1]
            displacement += 1j * rotation * (path[-1] - path[1:])
        shares, (_, on_states) = kind.total_gradients(cycle), along.slopes()
        *_, on_ends = kind.vjp(mesh, pose, shares.values(), on_states)
        counts = np.array([weights.get(name, 0.0) for name in shares])
        by_states = np.einsum("m,mkn,kn->n", counts, on_ends, ends - states[:, 1:])
        by_states[~solved] = 1.0
    off = integrals - true
    value = by_states + _first_order(control, cycle, period, rotation, displacement, off)
    return {
        "value": value if along.exist.all() else np.nan * value,
        "total": float(objective(on_mesh) / objective(period) - 1),
        "unresolved": float(exact.error * sum(map(abs, weights.values()))),
        "turning": turning if control.admissible.gait.symmetry == NONE else 0.0,
    }


def constraint_violation(admissible: Admissible, mesh: Mesh, gait: AnyGait) -> np.ndarray:
    """Largest excess over a joint limit or penetration of links in each interval; 0 if none."""
    t = (mesh.edges[:-1, None] + mesh.h[:, None] * np.linspace(0.0, 1.0, _SAMPLES + 1)).ravel()
    angles, body = gait.angles(t), admissible.body
    angles_at, limit = under_one_limit(angles, admissible.joint_limit)
    rows = [
        np.abs(body.bounded_angles.rows @ angles_at).max(axis=0, initial=0.0) - limit,
        crossing_depth(body, angles, far_pairs(body)),
        *(contact.excess(angles)[0] for contact in body.contacts()),
    ]
    return np.maximum(np.max(rows, axis=0), 0.0).reshape(mesh.n, -1).max(axis=1)


@dataclass(frozen=True, eq=False)
class MeshPlan:
    scheme: str
    edges: np.ndarray  # (n + 1,)
    estimate: float  # relative error of the gait's value
    reached: bool  # whether that is below the request
    knots: np.ndarray  # phases that have to stay knots, as they split violating intervals

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

    def slowness(t, z):
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
        places = centre[:, None] + radius[:, None] * np.linspace(-1, 1, _PLACES)
        rates = rates_at(body, friction, path, delta, places, guess=fine.velocity(places))
        sampled = slowness(places.ravel(), rates.z.reshape(3, -1))[
            np.repeat(link, _PLACES), np.arange(places.size)
        ]
        best = sampled.reshape(places.shape).argmin(axis=1)
        centre, least = places[rows, best], sampled.reshape(places.shape)[rows, best]
        radius *= 2.0 / (_PLACES - 1)
    jumps = (np.abs(np.diff(velocity)).max(axis=0) > _SLOW * delta) & (np.diff(t) < _SEPARATE)
    kinks = np.sort(np.concatenate([centre[least < _SLOW * delta], 0.5 * (t[1:] + t[:-1])[jumps]]))
    kinks = kinks[(kinks > fine.edges[0] + _SEPARATE) & (kinks < fine.edges[-1] - _SEPARATE)]
    kinks = kinks[np.diff(kinks, prepend=-np.inf) > _SEPARATE]
    phases: list[float] = []
    for kink in kinks.tolist():
        if not phases or kink - phases[-1] > apart:
            phases.append(kink)
    return np.array(phases)


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
    knots: np.ndarray | tuple[()] = (),
    nested: bool = False,
    aim: float = AIM,
    most_points: int = MOST_POINTS,
) -> MeshPlan | None:
    """A mesh for a gait that was found on `mesh`, or None if that is good already.

    The planned error is `aim` times the tolerance; `knots` stay, `nested` all of the mesh, so that
    a flat optimum has nowhere to come back to. `NotConvergedError` without a balance.
    """
    fine = gait_motion(control, gait, delta, mesh, FINER * tolerance)
    reference = Reference(control, gait, delta, fine)
    error = mesh_error(control, mesh, gait, delta, tolerance, fine)
    accurate = error.estimate <= _GOOD * tolerance and error.turning <= TURNING
    if accurate and error.violation.max() <= VIOLATION:
        return None
    middles = 0.5 * (mesh.edges[1:] + mesh.edges[:-1])
    knots = np.union1d(middles[error.violation > VIOLATION], knots)
    if accurate:
        edges = np.union1d(mesh.edges, knots)
        return MeshPlan(mesh.scheme.name, edges, error.estimate, True, knots)
    gaits, rules = control.admissible.gait, [scheme(control.scheme)]
    if match := re.fullmatch(r"(gauss|radau)-(\d+)", control.scheme):
        more = [rules[0].s + n for n in _MORE_NODES]
        rules += [scheme(f"{match[1]}-{s}") for s in more[1:] if s <= _MOST_NODES]
    best: MeshPlan | None = None

    def try_rule(rule, refine, *start):
        nonlocal best
        budget = most_points if best is None else min(most_points, best.points / _HANDICAP)
        edges, estimate = refine(reference, rule, *start, tolerance=aim * tolerance, budget=budget)
        plan = MeshPlan(rule.name, edges, estimate, estimate <= tolerance, knots)
        fewer = best is None or not best.reached or plan.points * _HANDICAP < best.points
        if best is None or (plan.reached and fewer):
            best = plan

    if control.dynamics.followed:
        uniform = np.linspace(0.0, control.admissible.fraction, control.intervals + 1)
        first = np.union1d(mesh.edges if nested else uniform, knots)
        for rule in rules:
            try_rule(rule, _halve, first)
        return best
    apart = _ONE_KINK * control.admissible.fraction
    kinks = kink_phases(control.dynamics.body, control.dynamics.law, gait, delta, fine, apart)
    # where the rates jump edges may be added, not moved
    keeps = nested or gaits.relative_delta or not gaits.free
    n = max(int(_COARSE * gaits.fraction), _A_HARMONIC * gaits.harmonics)
    coarse = mesh.edges if keeps else np.linspace(mesh.edges[0], mesh.edges[-1], n + 1)
    for rule in rules:
        # a node right on the instant at which mu_b takes over from mu_f makes the efficiency itself
        # kinked
        switches = not control.dynamics.law.reversible and (rule.left or rule.right)
        targets = on_knots = kinks[:0] if switches else kinks
        if on_knots.size:
            # and the knots that the kinks have just left (docs/developers/error_control.md)
            nearest = mesh.edges[np.abs(mesh.edges[:, None] - kinks).argmin(axis=0)]
            just_left = np.abs(nearest - kinks) < _LEFT * np.diff(mesh.edges).mean()
            targets = np.union1d(kinks, nearest[just_left])
        edges = move_knots(np.union1d(coarse, knots), targets, 0.0 if keeps else _SNAP)
        try_rule(rule, _split, edges, on_knots)
    return best


def _by_error(shares: np.ndarray, tolerance: float) -> tuple[np.ndarray, int]:
    """Intervals by falling error, and how many of them hold most of the excess."""
    order = np.argsort(shares)[::-1]
    return order, int((np.cumsum(shares[order]) < shares.sum() - 0.3 * tolerance).sum())


def _split(
    reference: Reference,
    rule: Scheme,
    edges: np.ndarray,
    kinks: np.ndarray,
    *,
    tolerance: float,
    budget: float,
) -> tuple[np.ndarray, float]:
    """Cut the intervals with the largest errors, in the middle or near an end that is a kink; the
    edges and the error that is left."""
    left, right = edges[:-1], edges[1:]
    shares = interval_shares(reference, rule, left, right)
    unresolved = float(reference.fine.unresolved.sum())
    tolerance = max(tolerance - unresolved, 0.25 * tolerance)
    while shares.sum() > tolerance and left.size * (rule.s - rule.left) < budget:
        # half of those that hold the excess at a time: what they leave behind is not known yet
        order, count = _by_error(shares, tolerance)
        cut = order[: max(1, count // 2)]
        cut = cut[right[cut] - left[cut] > 2 * _NARROWEST]
        if cut.size == 0:
            break
        a, b = left[cut], right[cut]
        at_a, at_b = np.isin(a, kinks), np.isin(b, kinks)
        middle = a + np.where(at_a & ~at_b, GRADE, np.where(at_b & ~at_a, 1 - GRADE, 0.5)) * (b - a)
        new_left, new_right = np.concatenate([a, middle]), np.concatenate([middle, b])
        new = interval_shares(reference, rule, new_left, new_right)
        left, right, shares = (
            np.concatenate([np.delete(old, cut), added])
            for old, added in ((left, new_left), (right, new_right), (shares, new))
        )
    return np.sort(np.append(left, right.max())), float(shares.sum() + unresolved)


def _halve(
    reference: Reference, rule: Scheme, edges: np.ndarray, *, tolerance: float, budget: float
) -> tuple[np.ndarray, float]:
    control, gait, delta, fine = reference
    while True:
        error = mesh_error(control, Mesh(rule, edges), gait, delta, fine=fine)
        shares = np.abs(error.value)
        small, full = shares.sum() <= tolerance, edges.size * rule.s > budget
        if small or full or np.isnan(shares).any():
            return edges, error.estimate
        order, count = _by_error(shares, tolerance)
        cut = order[: max(1, count)]
        cut = cut[shares[cut] > _WORST * shares.max()]
        edges = np.sort(np.concatenate([edges, 0.5 * (edges[cut] + edges[cut + 1])]))
