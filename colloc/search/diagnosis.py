"""Why a solve failed: which equation, which link, which time window, and what to try."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from colloc.numerics.mesh import Mesh
from colloc.numerics.multiplier_estimate import quasi_definite_factors
from colloc.search.ipopt import NlpResult, Solver
from colloc.search.options import TOLERANCES
from colloc.transcription.full_program import ACTUATORS, FullProgram

SMALLEST_DELTA = 1e-9
"""Below it the Lagrangian's gradient cannot be told from zero: links at stick move at the order of
delta, tail velocities resolve 1e-16, so the gradient is known to 1e-16/delta. Measured on one
harmonic of three links: KKT errors of 1.8e-8 at 1e-8, 1.3e-7 at 1e-9, 2e-6 at 1e-10."""
_EQUATIONS = {
    "tail": "the direction of the tail",
    "velocity x": "the joining of links",
    "velocity y": "the joining of links",
    "force x": "the balance of forces",
    "force y": "the balance of forces",
    "torque": "the balance of torques",
    "balance": "the balance of the body",
}
_OF_PERIOD = {
    "at least": "a value that has to be reached",
    "shape speed": "the lower bound on the shape speed",
    "heading": "where the body points at the start",
    "across": "the way across the direction that was asked for",
}
_SMALLEST_EIGENVALUE = 1e-12
"""Least eigenvalue of J J' for unit rows of J: n intervals that sum up distance have 1.2 / n^2,
redundant rows 1e-18."""
_UNITS = {"moment": " weight x body length", "power": " weight x body length per period"}
_STEPS, _SHARE = 2, 0.1
"""Steps of inverse iteration; share of the largest weight that counts."""


def row_meaning(program: FullProgram, row: int) -> tuple[str, float]:
    """Meaning of a constraint row, and its phase."""
    name, rows = next((n, s) for n, s in program.groups.items() if s.start <= row < s.stop)
    index, mesh, count = row - rows.start, program.mesh, rows.stop - rows.start
    body, aims = program.control.dynamics.body, program.control.aims
    if name == ACTUATORS:
        point, which = divmod(index, len(program.control.actuators.names))
        limit = program.control.actuators.names[which]
        return f"the limit on the {limit}", float(mesh.times[point])
    if name == "rotation":
        return "closure of the net rotation", float(mesh.edges[-1])
    named = _OF_PERIOD | {each.name: f"the {each.meaning or each.name}" for each in aims.integrals}
    if name in named:
        return named[name], 0.0
    if name in program.cells:
        what = "contact of" if name.startswith("links") else "the limit of"
        what = what if name.startswith("links") or name in body.bounded_angles.names else "the"
        return f"{what} {name}", float(mesh.edges[program.cells[name][index]])
    if name in ("angles", "rates"):
        joint = f"{body.defaults.coordinate} {index // mesh.n_point + 1}"
        return f"the {name[:-1]} of {joint} against its gait", _phase(mesh, index)
    if name.startswith("force law"):
        return "the law of friction", _phase(mesh, index)
    if count % mesh.n_point == 0:  # rows of points, part by part
        return _EQUATIONS.get(name, f"the {name}"), _phase(mesh, index)
    between = {"orientation": "the rotation between nodes"} | {
        way: f"the {way} gained over an interval" for way in ("distance", "work")
    }
    return between.get(name, f"the {name}"), float(mesh.edges[index * mesh.n // count])


def _phase(mesh: Mesh, index: int) -> float:
    return float(mesh.times[index % mesh.n_point])


def time_window(program: FullProgram, excess: np.ndarray, group: str) -> tuple[float, float]:
    """First and last phase where rows of a group are violated by a tenth of the worst."""
    rows = program.groups[group]
    bad = rows.start + np.flatnonzero(excess[rows] >= 0.1 * excess[rows].max())
    phases = [row_meaning(program, int(row))[1] for row in bad]
    return min(phases), max(phases)


def explanation(program: FullProgram, result: NlpResult, delta: float) -> str:
    """Sentences on the worst violated row, and what to try next."""
    worst = int(np.argmax(result.excess))
    if result.excess[worst] > TOLERANCES.violation:
        what, when = row_meaning(program, worst)
        group = next(n for n, s in program.groups.items() if s.start <= worst < s.stop)
        first, last = time_window(program, result.excess, group)
        window = (
            f"at phase {when:.3f}"
            if first == last
            else f"between phases {first:.3f} and {last:.3f}, worst at {when:.3f}"
        )
        failed = f"{what} is off by {result.excess[worst]:.1e} {window}"
        if group == ACTUATORS:
            needed = f"the gait takes {1 + result.excess[worst]:.4g} times as much"
            failed = f"{what} is {_stated_limit(program, worst)}, and {needed} {window}"
        advice = _advice(group)
    elif result.status == "still moving":
        failed = "the gait kept moving from trust region to trust region"
        advice = "start from a better guess"
    else:
        what = program.control.aims.objective.name
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


def _stated_limit(program: FullProgram, row: int) -> str:
    limits = program.control.problem.path_limits
    index = (row - program.groups[ACTUATORS].start) % len(limits.names)
    each = [(limit.function, most) for limit in limits.each for most in np.ravel(limit.most)]
    function, most = each[index]
    return f"{most:g}{_UNITS.get(function, '')}"


def _advice(group: str) -> str:
    if group in _EQUATIONS or group.startswith("force law"):
        return (
            "start the continuation at a larger delta_start, use more intervals, or another "
            "formulation"
        )
    if group == ACTUATORS:
        return "allow the joints more, take other links, or start from another guess"
    if group == "at least":
        return "ask for less, or start from a guess that reaches it"
    if group == "rotation":
        return "start from a guess with less net rotation, or impose a symmetry that closes it"
    if group.startswith(("joint", "links", "tangent")):
        return "start from a guess of smaller amplitude"
    return "use more intervals or another guess"


def redundant_equations(solver: Solver, x: np.ndarray, delta: float) -> list[str]:
    """Names of equations that are (nearly) linear combinations of others at x ``(n,)``."""
    program = solver.program
    jacobian, equality = solver.equality_jacobian(x, delta)
    scale = np.sqrt(np.asarray(jacobian.multiply(jacobian).sum(axis=1)).ravel())
    rows = (sparse.diags(1.0 / np.maximum(scale, 1e-300)) @ jacobian).tocsr()
    # inverse iteration on rows rows' + eps: the combination of the rows that nearly vanishes
    factors = quasi_definite_factors(rows)
    combination = np.random.default_rng(0).normal(size=equality.size)
    for _ in range(_STEPS):
        combination = factors.solve(np.concatenate([np.zeros(rows.shape[1]), -combination]))[
            rows.shape[1] :
        ]
        combination /= np.linalg.norm(combination)
    if np.linalg.norm(rows.T @ combination) ** 2 > _SMALLEST_EIGENVALUE:
        return []
    suspicious = equality[np.abs(combination) > _SHARE * np.abs(combination).max()]
    names = {n for n, s in program.groups.items() for row in suspicious if s.start <= row < s.stop}
    return sorted(names)
