"""Why a solve failed, in mechanical words: which equation, which link, which time window, and what
to try."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from colloc.collocation.motion_rows import ACTUATORS
from colloc.collocation.program import GaitProgram
from colloc.numerics.multiplier_estimate import quasi_definite_factors
from colloc.search.certify import VIOLATION
from colloc.search.ipopt import NlpResult, Solver

SMALLEST_DELTA = 1e-9
"""Below it the Lagrangian's gradient cannot be told from zero: a link at stick moves at the order
of delta, the tail velocity that is solved for resolves 1e-16, so the gradient is known to about
1e-16/delta. Measured on one harmonic of three links: a KKT error of 1.8e-8 at 1e-8, 1.3e-7 at 1e-9
and 2e-6 at 1e-10, where 1e-6 is allowed."""
_COMPONENTS = ("force along the tail", "force across the tail", "torque about the tail")
_OF_PERIOD = {
    "at least": "a value that has to be reached",
    "shape speed": "the lower bound on the shape speed",
    "heading": "where the body points at the start",
    "across": "the way across the direction that was asked for",
}
_SMALLEST_EIGENVALUE = 1e-12
"""Of the product of the equations, scaled to length 1, with their transpose: where it is less, they
are redundant. What sums distance and work over n intervals has one of 1.2 / n^2; redundant rows
have one of 1e-18."""
_STEPS, _SHARE = 2, 0.1
"""Steps of inverse iteration; share of the largest weight from which an equation counts as part of
the combination."""


def row_meaning(transcription: GaitProgram, row: int) -> tuple[str, float]:
    """What a constraint row, by its index among all, states, and the phase at which it does."""
    name, rows = next((n, s) for n, s in transcription.groups.items() if s.start <= row < s.stop)
    index, body, mesh = row - rows.start, transcription.control.dynamics.body, transcription.mesh
    if name in ("angles", "rates"):
        point, joint = divmod(index, body.n_joint)
        return f"the {name[:-1]} of {body.coordinate} {joint + 1} against its gait", float(
            mesh.times[point]
        )
    if name == "balance":
        point, component = divmod(index, 3)
        return f"the balance of {_COMPONENTS[component]}", float(mesh.times[point])
    if name == "force law":
        point, which = divmod(index, len(body.force_names))
        return f"the friction law of the {body.force_names[which]}", float(mesh.times[point])
    if name == ACTUATORS:
        point, which = divmod(index, len(transcription.control.actuators.names))
        return f"the limit on the {transcription.control.actuators.names[which]}", float(
            mesh.times[point]
        )
    if name == "orientation":
        return "the rotation between nodes", float(
            mesh.edges[index * mesh.n // (rows.stop - rows.start)]
        )
    if name == "rotation":
        return "closure of the net rotation", float(mesh.edges[-1])
    named = _OF_PERIOD | {
        each.name: f"the {each.meaning or each.name}"
        for each in transcription.control.aims.integrals
    }
    if name in named:
        return named[name], 0.0
    if name in ("distance", "work"):
        return f"the {name} gained over an interval", float(mesh.edges[index])
    phase = float(mesh.edges[index * mesh.n // (rows.stop - rows.start)])
    if name in body.limit_names:
        return f"the limit of {name}", phase
    if name.startswith("links"):
        return f"contact of {name}", phase
    return f"the {name}", phase


def time_window(transcription: GaitProgram, excess: np.ndarray, group: str) -> tuple[float, float]:
    """First and last phase at which a group of rows is violated by at least a tenth of its
    worst."""
    rows = transcription.groups[group]
    bad = rows.start + np.flatnonzero(excess[rows] >= 0.1 * excess[rows].max())
    phases = [row_meaning(transcription, int(row))[1] for row in bad]
    return min(phases), max(phases)


def explanation(transcription: GaitProgram, result: NlpResult, delta: float) -> str:
    """One or two sentences: what failed where, and what to try next."""
    worst = int(np.argmax(result.excess))
    if result.excess[worst] > VIOLATION:
        what, when = row_meaning(transcription, worst)
        group = next(n for n, s in transcription.groups.items() if s.start <= worst < s.stop)
        first, last = time_window(transcription, result.excess, group)
        window = (
            f"at phase {when:.3f}"
            if first == last
            else f"between phases {first:.3f} and {last:.3f}, worst at {when:.3f}"
        )
        failed = f"{what} is off by {result.excess[worst]:.1e} {window}"
        advice = _advice(group)
    elif result.status == "still moving":
        failed, advice = (
            "the gait kept moving from trust region to trust region",
            "start from a better guess",
        )
    else:
        what = transcription.control.aims.objective.name
        failed = (
            f"every equation holds, but the {what} is not stationary (KKT error "
            f"{result.kkt_error:.1e})"
        )
        advice = (
            "use more intervals, since kinks at stick may be under-resolved, or start from "
            "another guess"
        )
        if delta < SMALLEST_DELTA:
            advice = (
                f"ask for a delta of at least {SMALLEST_DELTA:.0e}, below which rounding "
                f"hides the optimum"
            )
    effort = f"not converged at delta = {delta:.1e} after {result.iterations} iterations"
    return f"{effort}: {failed} ({result.status}). Try to {advice}."


def _advice(group: str) -> str:
    if group in ("balance", "force law"):
        return (
            "start the continuation at a larger delta_start, use more intervals, or another "
            "formulation"
        )
    if group == ACTUATORS:
        return "allow the joints more, or start from another guess"
    if group == "at least":
        return "ask for less, or start from a guess that reaches it"
    if group == "rotation":
        return "start from a guess with less net rotation, or impose a symmetry that closes it"
    if group.startswith(("joint", "links", "tangent")):
        return "start from a guess of smaller amplitude"
    return "use more intervals or another guess"


def redundant_equations(solver: Solver, x: np.ndarray, delta: float) -> list[str]:
    """Kinds of equations that are (nearly) linear combinations of others at x ``(n,)`` and delta
    per period; an optimiser fails on those."""
    transcription = solver.transcription
    jacobian, equality = solver.equality_jacobian(x, delta)
    scale = np.sqrt(np.asarray(jacobian.multiply(jacobian).sum(axis=1)).ravel())
    rows = (sparse.diags(1.0 / np.maximum(scale, 1e-300)) @ jacobian).tocsr()
    # inverse iteration on rows rows' + eps: the combination of the rows that nearly vanishes
    factors, combination = (
        quasi_definite_factors(rows),
        np.random.default_rng(0).normal(size=equality.size),
    )
    for _ in range(_STEPS):
        combination = factors.solve(np.concatenate([np.zeros(rows.shape[1]), -combination]))[
            rows.shape[1] :
        ]
        combination /= np.linalg.norm(combination)
    if np.linalg.norm(rows.T @ combination) ** 2 > _SMALLEST_EIGENVALUE:
        return []
    suspicious = equality[np.abs(combination) > _SHARE * np.abs(combination).max()]
    names = {
        n for n, s in transcription.groups.items() for row in suspicious if s.start <= row < s.stop
    }
    return sorted(names)
