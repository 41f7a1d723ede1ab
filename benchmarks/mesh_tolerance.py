"""Schemes and mesh tolerance against a replay that shares nothing with them: python -m benchmarks.mesh_tolerance

The isotropic one-harmonic three-link optimum at delta = 1e-4, from a good guess. Prints a Markdown table: intervals that
refinement ended with, collocated efficiency, its relative difference to a replay of the same gait, and seconds (one run).
"""

from colloc import Harmonic, Problem, certify, ellipse
from colloc.continuation import continue_delta

SCHEMES = ("trapezoid", "hermite-simpson", "gauss-2", "gauss-3", "gauss-5", "radau-3")


def main() -> None:
    print("| scheme | tolerance | intervals (half period) | efficiency | error against replay | iterations | seconds |")
    print("|---|---|---|---|---|---|---|")
    for name in SCHEMES:
        for tolerance in (0.0, 1e-4, 1e-5, 1e-6):
            if name == "trapezoid" and 0 < tolerance < 1e-4:
                continue  # second order: thousands of intervals
            problem = Problem(
                "optimum",
                ellipse(0, 2.85, 1.29),
                gait=Harmonic(1, "bilateral"),
                delta_start=1e-3,
                intervals=20,
                scheme=name,
                mesh_tolerance=tolerance,
            )
            solution = continue_delta(problem)
            replayed = certify(solution, tolerance=1e-8, instants=6400).efficiency
            error = solution.efficiency / replayed - 1
            effort = sum(level.iterations for level in solution.levels)
            label = "uniform" if tolerance == 0 else f"{tolerance:.0e}"
            print(
                f"| {name} | {label} | {solution.mesh.n} | {solution.efficiency:.7f} | {error:+.1e} | {effort} "
                f"| {solution.seconds:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
