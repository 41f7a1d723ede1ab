"""Machine code for a problem: compiled once, loaded by every later solve of the same body and friction."""

from __future__ import annotations

from colloc.collocation.path_equations import path_point
from colloc.collocation.point_equations import balance_steps, point_function
from colloc.gaits.problem import Problem
from colloc.numerics.machine_code import compiling
from colloc.search.path_start import transcribed

DIFFERENTIATED_ONCE = (point_function, balance_steps, path_point)
"""What keeps functions in memory, as they were when first asked for: interpreted, if there was no code for them yet."""


def compile_problem(problem: Problem) -> None:
    """Put the machine code that solves of a problem evaluate into `numerics.machine_code.code_folder`, unless it is there.

    For 2 to 5 links takes 1 to 7 s, for free paths of 3, 4 and 5 links 3, 10 and 20 s. Harmonic gaits share one code, whatever
    their number of harmonics, mesh and guess; so do free paths, whatever their bound on curvature, and so do polygons.

    Raises
    ------
    ProblemError
        If there is no C compiler.
    StoreError
        If it fails, or the folder cannot be written.
    """
    for function in DIFFERENTIATED_ONCE:
        function.cache_clear()
    with compiling():
        transcribed(problem)
        balance_steps(problem.body, problem.friction)
