"""Optimisation of a gait in the reduced space by quasi-Newton SQP, continuation in delta, and
refinement of the mesh.

Subproblems are solved within a trust region, with the shape constraints at the worst instants of
the last gait, until constraints, trust region and gait settle. Pairs of links more than two apart
are constrained only once they cross (a cutting-plane method), as few ever come near each other.

Every mesh is planned for the gait at hand (`colloc.verification.mesh_error`), and panels with it.
"""

import time
from dataclasses import replace

import numpy as np

from colloc.gaits.gait import NONE, delta_per_period
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.linear import enclosed_area
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.mechanics.contact import Pairs, far_pairs, link_width, overlapping_pairs
from colloc.numerics.sqp import Stationarity, stationarity, stationarity_around
from colloc.reduced.compiled_search import minimize, nearest
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.reduced.second_order import curvature
from colloc.search.checkpoint import active_run, checkpoint
from colloc.search.iterate import STATIONARY, Iterate, evaluate_at, space_near, space_of
from colloc.search.options import (
    FINE,
    MEDIUM,
    OPTIONS,
    TOLERANCES,
    max_rounds,
    objective_accuracy,
)
from colloc.smooth.smooth_body import on_panels, panels_of
from colloc.system.errors import NotConvergedError
from colloc.verification.mesh_error import AIM, MOST_POINTS, plan_mesh


def solve_subproblems(
    program: ReducedProgram, v: np.ndarray, kkt: float, hessian: np.ndarray | None = None
) -> tuple[np.ndarray, Stationarity, int, np.ndarray | None]:
    """Minimise from v ``(n,)``, updating the active instants, until nothing changes; with the
    number of iterations, and the Hessian if it is known."""
    iterations, violation, ends, reach = 0, np.inf, [v], 0.0
    program.place_rows(v)
    for done in range(2 * max_rounds(kkt)):
        if done >= max_rounds(kkt) and violation <= max(kkt, MEDIUM):
            break  # more rounds are for gaits beyond their limits, else given up
        before, violation_before, is_fresh = v, violation, hessian is None
        if len(ends) > 1:
            # with the instants fixed, rounds overshoot where they move far with the gait
            program.follow_worst()
        result = minimize(program, v, OPTIONS.radius, objective_accuracy(kkt), curvature=hessian)
        v, iterations = result.v, iterations + result.iterations
        rows = program.rows(v)
        excess = np.maximum(program.row_lower - rows, rows - program.row_upper).max(initial=0.0)
        admissible = program.place_rows(v, reach) <= TOLERANCES.violation
        conditions = stationarity(program, v)
        stationary = conditions.kkt_error < kkt
        # an estimate from across kinks may end the search too early
        hessian = result.curvature if stationary else None
        step, violation = np.abs(v - before).max(initial=0.0), conditions.violation
        unchanged = is_fresh and step < TOLERANCES.violation
        if admissible and not result.on_edge and (stationary or unchanged):
            break
        stalled = abs(violation - violation_before) < OPTIONS.stalled * violation_before
        if violation > MEDIUM and stalled and not result.on_edge:
            if excess > MEDIUM and 0 < reach <= step:
                break  # the constraints are infeasible near here
            reach = step  # rounds may go to and fro, each beyond what has no row in it
            program.place_rows(v, reach)
        ends.append(v)
        # the first round, with instants fixed, may leave an optimum that the second comes back to
        if len(ends) > 3 and np.abs(v - ends[-3]).max() < OPTIONS.stalled * step:
            break  # between two worst instants of one cell, where only a finer mesh helps
    return v, conditions, iterations, hessian


@checkpoint
def optimise(
    space: SearchSpace, v: np.ndarray, delta: float, kkt: float, hessian: np.ndarray | None = None
) -> Iterate:
    """Optimum that SQP reaches from parameters v ``(n,)``, not necessarily admissible, at delta (in
    the units of the class), with every interval halved where there is no periodic motion at v;
    `NotConvergedError` if there is none on that either."""
    begin, start, problem = time.perf_counter(), v, space.control.problem
    while True:
        program = ReducedProgram(space, delta)
        if np.isnan(program.objective(start)):  # as where few points see a coasting body slip
            space = space_of(problem, halve(space.mesh.edges), space.scheme, space.far)
            program = ReducedProgram(space, delta)
        if np.isnan(program.objective(start)):
            lack = program.motion.kind.lack
            raise NotConvergedError(f"there is no motion to begin with: {lack}.")
        end, conditions, iterations, hessian = solve_subproblems(program, start, kkt, hessian)
        crossing = tuple(pair for pair in crossing_pairs(space, end) if pair not in space.far)
        if not crossing:
            break
        start, hessian = last_free(space, v, end), None
        space = space_of(problem, space.edges, space.scheme, space.far + crossing)
    space.motion = program.motion
    return evaluate_at(
        *(space, end, delta, kkt, program, conditions),
        iterations=iterations,
        seconds=time.perf_counter() - begin,
        hessian=hessian,
    )


def halve(edges: np.ndarray) -> np.ndarray:
    return np.sort(np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1])]))


def crossing_pairs(space: SearchSpace, v: np.ndarray) -> Pairs:
    """Pairs of links more than two apart that cross at a thousand instants of a gait, by plain
    intersection: the smooth clearance keeps a distance that links which only touch do not need."""
    body, fraction = space.control.admissible.body, space.control.admissible.fraction
    if not (pairs := far_pairs(body)):
        return ()
    ends = np.stack(body.outline(space.member(v).angles(np.linspace(0.0, fraction, 1000))))
    return overlapping_pairs(ends, pairs, link_width(body), TOLERANCES.violation)


def last_free(space: SearchSpace, free: np.ndarray, crossing: np.ndarray) -> np.ndarray:
    """Parameters on the line from a free gait to a crossing one, as far as links stay apart."""
    last = free
    for fraction in np.linspace(0.05, 0.95, 19):
        between = free + fraction * (crossing - free)
        if crossing_pairs(space, between):
            break
        last = between
    return last


def with_kink(iterate: Iterate) -> Iterate:
    """The iterate with the first-order conditions of gradients sampled around it, if they hold
    there and not at it: it lies on a kink."""
    if iterate.optimal:
        return iterate
    program = iterate.program()
    here = stationarity(program, iterate.v)
    # where slopes are small the radius misses the objective by less than an equation may be
    # violated
    radius = min(max(TOLERANCES.kkt, TOLERANCES.violation / here.kkt_error), TOLERANCES.kink)
    around = stationarity_around(program, iterate.v, here, radius, enough=iterate.kkt)
    errors = {name: getattr(around, name) for name in ("kkt_error", "violation", "complementarity")}
    step = replace(iterate.step, kkt_error=around.kkt_error, optimal=True, status=STATIONARY)
    history = (*iterate.history[:-1], step)
    kink = replace(iterate, **errors, on_kink=True, history=history)
    return kink if kink.optimal else iterate


def delta_levels(problem: Problem, first: float) -> list[float]:
    levels = [first]
    while levels[-1] > problem.delta:
        levels.append(max(OPTIONS.delta_ratio * levels[-1], problem.delta))
    return levels


def descend(iterate: Iterate) -> Iterate:
    """The gait at the problem's delta, on the same mesh; `NotConvergedError` if there is no
    periodic motion on the way."""
    levels = delta_levels(iterate.problem, iterate.delta)[1:]
    for done, delta in enumerate(levels):
        active_run().report("descend", done, len(levels), iterate)
        lower = optimise(iterate.space, iterate.v, delta, MEDIUM, iterate.hessian)
        iterate = lower.after(iterate.history)
    return iterate


def regularisation_dominated(iterate: Iterate) -> bool:
    """True if the gait loses half of its value at the next delta, as slow parts of a retraced gait
    do."""
    space = iterate.space
    drier = ReducedProgram(space, OPTIONS.delta_ratio * iterate.delta)
    drier.motion = space.motion or drier.motion  # which knows velocities to begin from
    share = (1 - OPTIONS.lost) * abs(iterate.objective)
    return not drier.objective(iterate.v) <= iterate.objective + share


def leave_saddle(iterate: Iterate) -> Iterate | None:
    """A better gait reached along the direction of negative curvature; None if there is none.

    A start with more symmetry than its class never leaves it, as the gradient has that symmetry
    too: it may satisfy the first-order conditions and be a saddle. Where rows bind they bend away
    from the line, so it is the Lagrangian that has to fall.
    """
    program = iterate.program()
    here = curvature(program, iterate.v)
    if here.smallest + here.error >= 0:
        return None
    size, value = np.linalg.norm(iterate.v), here.lagrangian(iterate.v)
    for step in (OPTIONS.saddle_step, OPTIONS.saddle_step**2):
        for side in (1.0, -1.0):
            start = iterate.v + side * step * size * here.direction
            if here.lagrangian(start) >= value:
                continue
            other = optimise(iterate.space, start, iterate.delta, MEDIUM)
            gain = objective_accuracy(MEDIUM) * abs(iterate.objective)
            if other.objective < iterate.objective - gain:
                return other.after(iterate.history)
    return None


@checkpoint
def project_to_zero_rotation(problem: Problem, gait: AnyGait, delta: float) -> AnyGait:
    """A gait near a given one that turns the body as prescribed and encloses the same area.

    Where reversed rates reverse the motion, net rotation and displacement are odd under reversal of
    the gait. So every retraced gait closes its rotation, goes nowhere and is a critical point of
    the efficiency, into which searches that start far from closure fall: 19 of 75 starts. With the
    rotation closed first, at constant enclosed area, which a retraced gait lacks, none does.

    The gait itself where a symmetry closes the rotation, nothing prescribes it, or the gait is no
    Fourier series.
    """
    seeds, is_open = problem.gait.start_class, problem.gait.symmetry == NONE
    if not is_open or problem.rotation is None or not gait.is_series or not seeds.linear:
        return gait
    delta = delta_per_period(problem.gait, gait, delta)
    free_otherwise = {"at_least": (), "torque_limit": None, "power_limit": None}
    level = {"gait": seeds, "guess": gait, "intervals": 30 + 4 * seeds.harmonics}
    level |= free_otherwise | {"grade": 0.0, "towards": None}
    if problem.regime.free:
        level |= {"objective": EFFICIENCY, "froude": problem.regime.froude, "limits": ()}
    space, target = space_near(problem.without_robot.with_(**level), gait)
    program, area = ReducedProgram(space, delta), enclosed_area(seeds, problem.body.n_joint)
    # limits of the angles are kept by the search that begins here
    program.place_rows(np.zeros_like(target))
    # few steps: a start need not be perfect
    return space.member(nearest(program, target, area, 1e-8, 30))


def refine(iterate: Iterate) -> Iterate:
    """The gait optimised to the last digit on a mesh that meets the problem's ``mesh_tolerance``;
    its `message` says what is missing if no mesh was fine enough."""
    problem, n_first = iterate.problem, OPTIONS.meshes_of_first_aim
    if problem.regime.slides and iterate.objective > -TOLERANCES.zero_value:
        return iterate  # the relative error is undefined for a zero objective
    knots, count = np.array(problem.gait.stages), 0
    while True:
        active_run().report("refine", count, OPTIONS.meshes, iterate)
        if count and iterate.violation > MEDIUM:
            return iterate  # the constraints are infeasible; refining cannot help
        problem, gait, space = iterate.problem, iterate.gait, iterate.space
        at_optimum = iterate.step.iterations == 0  # no mesh moves the gait far from there
        v, kkt, hessian = iterate.v, FINE, iterate.hessian
        try:
            more_panels = plan = None
            if problem.mesh_tolerance > 0 and (more_panels := on_more_panels(iterate)) is None:
                mesh = space.control.in_phases(space.mesh, gait)
                # where kinks move to and fro with the mesh, later meshes aim at a half and a
                # quarter of the error and keep all knots
                plan = plan_mesh(
                    space.control,
                    mesh,
                    gait,
                    delta_per_period(problem.gait, gait, iterate.delta),
                    problem.mesh_tolerance,
                    knots=knots,
                    nested=count >= n_first,
                    aim=AIM * 0.5 ** min(max(0, count - n_first), n_first),
                    # the gait will move, and a finer plan be wasted
                    most_points=min(MOST_POINTS, OPTIONS.growth * mesh.n_point),
                )
            if more_panels is None and plan is None and iterate.kkt == FINE:
                return iterate
            if count == OPTIONS.meshes:
                text = f"Mesh refinement stopped after {count} meshes without converging."
                return replace(iterate, message=text)
            if more_panels is not None:
                (space, v), kkt = more_panels, MEDIUM
            if plan is not None:
                count, knots = count + 1, np.concatenate([knots, plan.knots])
                space, v = space_near(problem, gait, plan.edges, plan.scheme, space.far)
                kkt = FINE if at_optimum or count > n_first else MEDIUM
            hessian = hessian if iterate.v.size == v.size else None
            finer = optimise(space, v, iterate.delta, kkt, hessian)
            strayed, iterate = iterate.strays, finer.after(iterate.history)
            if strayed and iterate.strays:
                return iterate  # it would on the next mesh, too
        except NotConvergedError as error:
            # keep the unrefined gait; its certificate records the mesh error
            return replace(iterate, message=f"Refinement ended, as on a finer mesh: {error}")


def on_more_panels(iterate: Iterate) -> tuple[SearchSpace, np.ndarray] | None:
    """The space with a smooth body on as many panels as the gait needs, and its parameters; None if
    half as many panels change the objective by less than six times the mesh tolerance."""
    old, here, problem = iterate.space, iterate.objective, iterate.problem
    panels, finer = panels_of(problem.body), None
    if panels == 0:
        return None

    def on(count):
        richer = problem.with_(body=on_panels(problem.body, count))
        space = space_of(richer, old.edges, old.scheme, old.far)
        v = space.parameters(iterate.gait)
        return (space, v), ReducedProgram(space, iterate.delta).objective(v)

    before, most = on(panels // 2)[1], min(OPTIONS.growth * panels, OPTIONS.max_panels)
    allowed = OPTIONS.panel_error * problem.mesh_tolerance
    while abs(here - before) > allowed * abs(here) and 2 * panels <= most:
        panels, before = 2 * panels, here
        finer, here = on(panels)
    return finer
