"""Build and solve times of a free path: python -m benchmarks.free_path

Processor time to build the program on 60 and 240 intervals of order 3, and of the full continuation in delta from 0.01 to 1e-5
on 60 intervals without refinement (design target: 0.5 s and 5 s). Certificates are not part of it: 60 intervals over-report.
"""

import argparse
import time

from colloc import FreePath, Problem, ellipse
from colloc.reduced.spaces import transcribed
from colloc.results.solution import Solution
from colloc.search.explore import begin_at
from colloc.search.ipopt import Solver
from colloc.search.solve import confirmed


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    print("intervals  build [s]  continuation [s]  levels  iterations  efficiency")
    for intervals in (60, 240):
        problem = Problem(
            "free_path", ellipse(0, 2.8, 1.3), gait=FreePath(8, "bilateral"), intervals=intervals, delta=1e-5, mesh_tolerance=0
        )
        begin = time.process_time()
        Solver(transcribed(problem))
        built = time.process_time() - begin
        if intervals > 60:
            print(f"{intervals:9d} {built:10.2f}")
            continue
        begin = time.process_time()
        solution = Solution(problem, confirmed(begin_at(problem, problem.guess)))
        spent = time.process_time() - begin
        iterations = sum(level.iterations for level in solution.history)
        found = f"{solution.answer.efficiency:.6f}" if solution.answer.optimal else solution.answer.status
        print(f"{intervals:9d} {built:10.2f} {spent:17.2f} {len(solution.history):7d} {iterations:11d}  {found}")


if __name__ == "__main__":
    main()
