"""SQP over reduced programs in one call of the compiled kernel (`colloc/mechanics/native/sqp.h`),
where it knows all parts of a program: slow motion on level ground, gaits that are linear in their
parameters, and aims that are arithmetic of distance, work and rotation. Elsewhere
`colloc.numerics.sqp` does it."""

import ctypes
from types import SimpleNamespace
from typing import Any

import numpy as np

from colloc.mechanics.native_kernel import library
from colloc.numerics import sqp
from colloc.numerics.sqp import SqpResult
from colloc.reduced.program import ReducedProgram
from colloc.system.interruption import interruptible

_REALS = (
    "length", "mass", "law", "A", "b", "h", "matrix", "offset", "side", "side_rates", "square",
    "area", "formulas", "shape_numbers", "functions", "basis", "left", "width", "instants",
    "watched_low", "watched_high", "row_low", "row_high", "low", "high", "target", "shares",
)  # fmt: skip
_INDICES = "points", "shape_first", "which", "basis_first", "basis_column", "moving"
_NUMBERS = "turn", "delta", "chord", "repeats", "radius", "accuracy"
_COUNTS = (
    "n_link", "n_time", "n_interval", "n_stage", "n", "n_formula", "n_shape_row", "n_function",
    "n_moving", "n_shape", "n_side", "antipodal", "iterations",
)  # fmt: skip
_QUANTITIES = "distance", "work", "rotation"
_MOST_ROWS = 500
"""Quadratic programs with more take most of the time, and DAQP gives up sooner where their rows
contradict each other: twenty links from one start took 250 s without it."""


class _Search(ctypes.Structure):
    """The struct of that name in native/sqp.h."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in (*_REALS, *_INDICES)),
        *((name, ctypes.c_double) for name in _NUMBERS),
        *((name, ctypes.c_longlong) for name in _COUNTS),
    ]


def minimize(
    program: ReducedProgram,
    v: np.ndarray,
    radius: float,
    accuracy: float,
    iterations: int = 150,
    curvature: np.ndarray | None = None,
) -> SqpResult:
    """`colloc.numerics.sqp.minimize` of a reduced program."""
    fields = {"radius": radius, "accuracy": accuracy, "iterations": iterations}
    result = _minimize(program, v, curvature, fields)
    return result or sqp.minimize(program, v, radius, accuracy, iterations, curvature)


def nearest(
    program: ReducedProgram, target: np.ndarray, area: np.ndarray, accuracy: float, iterations: int
) -> np.ndarray:
    """The parameters nearest to `target` that meet the rows, with its value of the quadratic form
    `area`."""
    enclosed = target @ area @ target
    lower = np.append(program.row_lower, enclosed)
    upper = np.append(program.row_upper, enclosed)
    fields: dict[str, Any] = {"radius": np.inf, "accuracy": accuracy, "iterations": iterations}
    fields |= {"area": area, "target": target, "row_low": lower, "row_high": upper}
    result = _minimize(program, target, None, fields)
    if result is not None:
        return result.v
    projection: Any = SimpleNamespace(
        lower=program.lower,
        upper=program.upper,
        row_lower=lower,
        row_upper=upper,
        objective=lambda v: 0.5 * float(np.sum((v - target) ** 2)),
        gradient=lambda v: v - target,
        rows=lambda v: np.append(program.rows(v), v @ area @ v),
        row_slopes=lambda v: np.vstack([program.row_slopes(v), 2 * area @ v]),
    )
    return sqp.minimize(projection, target, np.inf, accuracy, iterations).v


def _minimize(
    program: ReducedProgram, v: np.ndarray, curvature: np.ndarray | None, fields: dict[str, Any]
) -> SqpResult | None:
    """None where the kernel lacks a part."""
    motion, delta, kernel_rows = program.motion, program.delta, program.constraints.kernel_rows
    formulas = [each.operations(_QUANTITIES) for each in program.formulas]
    listed = [each for each in formulas if each is not None]
    if not v.size or program.actuators or kernel_rows is None or len(listed) < len(formulas):
        return None
    if kernel_rows["which"].size > _MOST_ROWS:
        return None
    start = motion.at(v, delta)
    of_motion = motion.kernel_fields(start)
    if of_motion is None:
        return None
    rows = {"row_low": program.row_lower, "row_high": program.row_upper}
    box = {"low": program.lower, "high": program.upper}
    counts = {"n": v.size, "n_formula": len(formulas), "delta": delta}
    of_program = {"formulas": np.concatenate(listed), **rows, **box, **counts}
    numbers = of_motion | kernel_rows | of_program | fields
    arrays = {
        name: np.ascontiguousarray(value, np.int64 if name in _INDICES else float)
        for name, value in numbers.items()
        if isinstance(value, np.ndarray)
    }
    search = _Search(**numbers | {name: array.ctypes.data for name, array in arrays.items()})
    end, z, out, totals = v.copy(), start.z.copy(), np.empty(start.out.shape), np.empty(4)
    b = np.eye(v.size) if curvature is None else curvature.copy()
    shapes = [np.ascontiguousarray(each) for each in start.shapes[:2]]
    with interruptible():
        count = library().colloc_minimize(  # type: ignore[union-attr]
            ctypes.byref(search), end, *shapes, delta, z, b, curvature is None, out, totals
        )
    if count < 0:
        raise MemoryError("no memory for a search.")
    motion.set(end, delta, z, out, totals)
    on_edge = sqp.is_on_edge(program, v, fields["radius"], end)
    return SqpResult(end, program.objective(end), count, on_edge, b)
