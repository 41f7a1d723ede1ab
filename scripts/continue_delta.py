"""Follow the best three-link gait from delta = 1e-2 to 1e-5, and extrapolate its efficiency to delta = 0.

python -m scripts.continue_delta
"""

from colloc import Harmonic, Problem, ellipse
from colloc.results.delta_limit import resolution_warning, value_at_zero_delta
from colloc.search.optimise import optimum

if __name__ == "__main__":
    problem = Problem("three_link", gait=Harmonic(1, "bilateral"), guess=ellipse(0.1, 2.6, 1.2), delta=1e-5, delta_start=1e-2)
    solution = optimum(problem, lambda level: print(f"{level.delta:.1e} {level.efficiency:.6f} {level.optimal}"))
    limit = value_at_zero_delta(solution)
    print(f"delta -> 0: {limit.value:.6f} +- {limit.error:.0e}")
    print(resolution_warning(solution) or f"delta is resolved by {solution.mesh.n} intervals")
