"""How long a front takes over the solve that it begins at: python -m benchmarks.front [FILE.py ...]

In processor time, by one process (OMP_NUM_THREADS=1); the search for its other end is in it.
"""

from __future__ import annotations

import time
from pathlib import Path

import colloc
from colloc.search.options import OPTIONS
from scripts.program import command_line


def main() -> None:
    default = [Path("problems/three_link.py"), Path("problems/three_link_feet.py")]
    for file in command_line(__doc__, ("problems", default)).problems:
        begin = time.process_time()
        best = colloc.solve(file)
        middle = time.process_time()
        front = colloc.pareto_front(best.problem, best=best, starts=OPTIONS.reach_starts)
        solve, more = middle - begin, time.process_time() - middle
        print(f"{file}: solve {solve:.1f} s, front {more / solve:.1f} times that; {front}")


if __name__ == "__main__":
    main()
