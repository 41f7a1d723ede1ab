"""Follow the best three-link gait from delta = 1e-2 to 1e-5, and extrapolate its efficiency to
delta = 0.

python -m scripts.continue_delta
"""

import numpy as np

from colloc import Harmonic, Problem, ellipse
from colloc.pictures.figure import mesh_errors
from colloc.results.answer import Step
from colloc.results.measured import Limit
from colloc.results.solution import Solution
from colloc.search.explore import first_optimum
from colloc.search.solve import confirm_optimum

RESOLVED = 1e-4
"""Largest relative error of the objective, of the mesh, at which delta counts as resolved: the
certificate's replay gap."""


def value_at_zero_delta(solution: Solution) -> Limit:
    """Objective of the optimum for delta -> 0, from the levels of the continuation.

    Regularisation acts like c delta at leading order: c is the slope between the two smallest
    deltas, both on the mesh the continuation ran on, and the result is moved by it from the last
    level, which may have a finer mesh. The error bar adds the mesh error of the last level to the
    larger of that whole move and what the next-larger pair of levels would change."""
    first: dict[float, Step] = {}
    for level in solution.history:
        if level.optimal:
            first.setdefault(level.delta, level)
    deltas = np.array(sorted(first))
    if deltas.size < 2 or not solution.answer.optimal:
        raise ValueError(
            "the limit delta -> 0 needs at least two converged levels of delta; start at a larger "
            "delta."
        )
    values = np.array([first[d].value for d in deltas])
    slopes = np.diff(values) / np.diff(deltas)
    move = -slopes[0] * deltas[0]
    error = abs(move)
    if deltas.size > 2:
        error = max(error, abs(slopes[1] - slopes[0]) * deltas[0])
    mesh_error = mesh_errors(solution).sum() * abs(solution.value)
    return Limit(float(solution.value + move), float(error + mesh_error))


def resolution_warning(solution: Solution) -> str | None:
    """One sentence if the last level's mesh does not resolve its delta, None if it does.

    Judged by the error of collocating the gait on its mesh, against a finer quadrature with
    velocities solved anew (see `colloc.verification.mesh_error`): stick phases that fall between
    the nodes show there.
    """
    mesh, level = solution.mesh, solution.answer
    errors = mesh_errors(solution)
    if errors.sum() <= RESOLVED:
        return None
    worst, what = int(np.argmax(errors)), solution.problem.objective.name
    return (
        f"delta = {level.delta:.1e} is under-resolved by {mesh.n} intervals: the mesh changes the "
        f"{what} by about "
        f"{errors.sum():.0e} (relative), most of it at phase {mesh.edges[worst]:.3f} to "
        f"{mesh.edges[worst + 1]:.3f}; "
        "use more intervals or a smaller mesh_tolerance."
    )


if __name__ == "__main__":
    problem = Problem(
        "three_link",
        gait=Harmonic(1, "bilateral"),
        guess=ellipse(0.1, 2.6, 1.2),
        delta=1e-5,
        delta_start=1e-2,
    )
    solution = Solution(problem, confirm_optimum(first_optimum(problem, problem.guess)))
    print(
        "\n".join(f"{step.delta:.1e} {step.value:.6f} {step.optimal}" for step in solution.history)
    )
    limit = value_at_zero_delta(solution)
    print(f"delta -> 0: {limit.value:.6f} +- {limit.error:.0e}")
    print(resolution_warning(solution) or f"delta is resolved by {solution.mesh.n} intervals")
