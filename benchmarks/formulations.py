"""The search in the reduced space and the literal route, with both formulations, from the same random starts.

    python -m benchmarks --only formulations

Every start runs to delta = 1e-4, mesh refinement and certificate included. The reduced search is answered by IPOPT on the
formulation named; on the literal route IPOPT solves that at every level of delta. The starts are those of
`benchmarks.robustness` (Latin hypercube, seed 0, one harmonic, no symmetry imposed).
"""

from __future__ import annotations

from functools import partial
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.robustness import DELTA, TIME_LIMIT, case_problem
from benchmarks.tables import markdown_table
from colloc.gaits.starts import LATIN_HYPERCUBE, start_gait
from colloc.mechanics.bodies import FORMULATIONS
from colloc.results.outcome import Outcome
from colloc.results.solution import SOLVED
from colloc.studies.campaign import run_guess

LAWS = ((1, 1, 1), (10, 1, 1), (1, 1, 3))
ROUTES = {
    f"{search} search, {name}": (name, search == "literal") for search, name in product(("reduced", "literal"), FORMULATIONS)
}


def report(quick: bool, folder: Path) -> str:
    """The table, and what fails."""
    starts = range(2 if quick else 8)
    rows, failures = [], []
    for law in LAWS:
        found: dict[str, list[Outcome]] = {name: [] for name in ROUTES}
        # in turns, so that disturbances fall on all alike
        for start in starts:
            for name, outcomes in found.items():
                formulation, literal = ROUTES[name]
                problem = case_problem(law, "none", DELTA, 0.1).with_(formulation=formulation)
                guess = partial(start_gait, problem, LATIN_HYPERCUBE, 0, start)
                outcomes.append(run_guess(problem, guess, start, TIME_LIMIT, literal=literal))
        for name, outcomes in found.items():
            certified = [o for o in outcomes if o.status == SOLVED]
            rows.append(
                (
                    law,
                    name,
                    f"{len(certified)} of {len(outcomes)}",
                    max((o.efficiency for o in certified), default=np.nan),
                    float(np.median([o.cpu_seconds for o in outcomes])),
                    max(o.cpu_seconds for o in outcomes),
                    int(np.median([o.iterations for o in outcomes])),
                )
            )
            failures += [f"- {law}, {name}, start {o.start}: {o.message}" for o in outcomes if o.status != SOLVED]
    header = (
        "(mu_t, mu_f, mu_b)",
        "search, formulation",
        "certified",
        "best d/W",
        "median s",
        "longest s",
        "median iterations",
    )
    text = "Down to delta = 1e-4, refinement and certificate included, from the same random starts.\n\n"
    return text + markdown_table(header, rows) + "\n\nStarts that fail:\n\n" + "\n".join(failures or ["none"])
