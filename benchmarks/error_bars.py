"""Do the stated errors hold? Certified numbers of random gaits against
`benchmarks.independent_replay`.

    python -m benchmarks.error_bars --gaits 300 [--own] [--again] [--solved 20] [--record
    results/error_bars.jsonl]

Random bodies of 3 to 6 links, laws of friction and gaits of 1 to 4 harmonics with the symmetries of
the zoo, which close their rotation; and, with --solved, gaits that a search of the zoo's problems
ended at. For efficiency, distance, work, and the efficiency for delta -> 0: how often the stated
error covers the true one, and how many times too large it is in the median. The other program takes
seconds a gait. With --own the reference is colloc's replay to 1e-9, a hundred times faster, after
as many as time allows have shown that both agree. With --again the random gaits of the record are
measured anew, and held against the references that it has.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.independent_replay import Crawler, played
from benchmarks.zoo import zoo_problem
from colloc import Chain, Friction
from colloc.gaits.harmonic import harmonics_within
from colloc.results.measured import Measured, measured
from colloc.results.solution import Solution
from colloc.search.explore import first_optimum
from colloc.search.solve import confirm_optimum
from colloc.system.errors import NotConvergedError
from colloc.verification.replay import replay
from colloc.verification.replay_record import Path as GaitPath
from scripts.program import add_to_record, command_line, read_record

DELTA = 1e-4
LIMIT = 1e-3
"""The reference's part of delta for the limit: what is left of it is far below the stated
errors."""
OWN, OTHER = 1e-9, 1e-7
"""Accuracies asked of the references; what the other reaches is a hundred times better."""
QUANTITIES = ("efficiency", "distance", "work", "limit")
SEED = 24


def random_gait(number: int) -> tuple[Chain, Friction, GaitPath]:
    """Body, law and gait `number`; it depends on that number alone."""
    rng = np.random.default_rng([SEED, number])
    links = int(rng.integers(3, 7))
    lengths = rng.uniform(0.5, 1.5, links)
    symmetry = str(rng.choice(["bilateral", "antipodal"]))
    if symmetry == "bilateral" or rng.random() < 0.3:
        lengths = lengths + lengths[::-1]
    lengths = lengths / lengths.sum()
    body = Chain((*lengths[:-1], 1.0 - lengths[:-1].sum()))
    isotropic = rng.random() < 0.3
    mu_t, mu_b = (
        (1.0, 1.0)
        if isotropic
        else (float(np.exp(rng.uniform(np.log(0.1), np.log(30)))), float(rng.choice([1, 3])))
    )
    kind = harmonics_within(int(rng.integers(1, 5)), symmetry)
    size = kind.size(body.n_joint)
    gait = kind.member(rng.normal(0, rng.uniform(0.2, 1.0), size) / np.sqrt(size / 3), body.n_joint)
    return body, Friction(mu_t=mu_t, mu_f=1.0, mu_b=mu_b), gait


def compared(
    body: Chain,
    friction: Friction,
    path: GaitPath,
    delta: float,
    breaks: np.ndarray | tuple[float, ...] = (),
    own: bool = False,
) -> dict[str, list[float]]:
    """For each quantity: stated value, stated error and the reference's value; and the part of the
    period left open."""
    crawler = Crawler(body.lengths, (friction.mu_t, friction.mu_f, friction.mu_b))
    here, limit = (
        replay(body, friction, path, part * delta, tolerance=OWN, breaks=breaks)
        if own
        else played(crawler, path, part * delta, OTHER, breaks)
        for part in (1.0, LIMIT)
    )
    references = [here.efficiency, here.distance, here.work, limit.efficiency]
    return against(references, measured(body, friction, path, delta, breaks=breaks))


def against(references: Sequence[float], known: Measured) -> dict[str, list[float]]:
    """What is stated of the quantities and by how much it may be wrong, with their references."""
    fine, limit = known.fine, known.value.limit
    values = (fine.efficiency, fine.distance, fine.work, limit.value)
    errors = (known.efficiency.error, known.errors["distance"], known.errors["work"], limit.error)
    rows = zip(QUANTITIES, values, errors, references, strict=True)
    return {name: [value, error, reference] for name, value, error, reference in rows} | {
        "open": [fine.several]
    }


def measured_again(entry: dict) -> dict:
    """An entry of the record on a random gait, with the numbers that it is certified with now."""
    if entry["row"] is None or not entry["name"].startswith("random"):
        return entry
    known = measured(*random_gait(int(entry["name"].split("-")[1])), DELTA)
    return entry | {"row": against([entry["row"][name][2] for name in QUANTITIES], known)}


def solved_gait(number: int, own: bool) -> dict[str, list[float]] | None:
    """The same for the gait that the zoo's problem is solved by; None if the search fails."""
    problem = zoo_problem(number)
    solution = Solution(problem, confirm_optimum(first_optimum(problem, problem.guess)))
    if not solution.history or not solution.answer.optimal:
        return None
    breaks, body = solution.gait.corner_phases, problem.body
    friction = problem.friction
    assert isinstance(body, Chain)  # the zoo has no others
    assert isinstance(friction, Friction)
    return compared(body, friction, solution.gait, solution.delta_per_period, breaks, own)


def summary(rows: list[dict[str, list[float]]]) -> str:
    """A table of coverage and of stated over true errors."""
    lines = [
        "| quantity | gaits | covered | median stated | median true | stated / true, median | "
        "worst true / stated |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in QUANTITIES:
        value, stated, true = np.array([row[name] for row in rows]).T
        wrong, size = np.abs(value - true), np.abs(true)
        covered = wrong <= stated
        ratio = np.median(stated / np.maximum(wrong, 1e-300))
        medians = f"{np.median(stated / size):.1e} | {np.median(wrong / size):.1e}"
        share = f"{covered.sum()} ({100 * covered.mean():.1f} %)"
        lines.append(
            f"| {name} | {len(rows)} | {share} | {medians} | {ratio:.1f} | "
            f"{np.max(wrong / stated):.2f} |"
        )
    several = sum(row["open"][0] > 0 for row in rows)
    return (
        "\n".join(lines)
        + f"\n\n{several} of them run through shapes at which several motions are balanced.\n"
    )


def main() -> None:
    options = command_line(
        __doc__,
        gaits=300,
        own=False,
        again=False,
        solved=0,
        record=Path("results/error_bars.jsonl"),
        seconds=1e9,
    )
    begin = time.monotonic()
    done = {entry["name"]: entry for entry in read_record(options.record)}
    if options.again:
        done = {name: measured_again(entry) for name, entry in done.items()}
        add_to_record(options.record, done.values(), anew=True)
        options.gaits = options.solved = 0
    todo = [("random", k) for k in range(options.gaits)] + [
        ("zoo", k) for k in range(options.solved)
    ]
    for kind, number in todo:
        name = f"{kind}-{number}"
        if name in done or time.monotonic() - begin > options.seconds:
            continue
        try:
            row = (
                compared(*random_gait(number), DELTA, own=options.own)
                if kind == "random"
                else solved_gait(number, options.own)
            )
        except (ArithmeticError, NotConvergedError) as error:  # the reference gives up, and says so
            row = None
            print(name, error, flush=True)
        done[name] = {"name": name, "row": row}
        add_to_record(options.record, [done[name]])
    print(
        f"the reference or the search gave up on "
        f"{sum(entry['row'] is None for entry in done.values())} of {len(done)}\n"
    )
    for kind in ("random", "zoo"):
        rows = [
            entry["row"]
            for entry in done.values()
            if entry["row"] is not None and entry["name"].startswith(kind)
        ]
        if rows:
            print(f"{kind}:\n\n{summary(rows)}")


if __name__ == "__main__":
    main()
