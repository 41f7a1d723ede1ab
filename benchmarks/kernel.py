"""The compiled kernel beside NumPy in the same run: python -m benchmarks.kernel

Balances of three links from rest, by each in turn: processor time, as a ratio, and its distance to
one bare evaluation of the forces a step.
"""

from __future__ import annotations

from dataclasses import astuple
from functools import partial
from unittest.mock import patch

import numpy as np

from benchmarks.tables import interleaved_seconds, markdown_table
from colloc import Chain, Friction, solve_balance
from colloc.mechanics import native_kernel
from scripts.program import command_line

BODY, MANY = Chain(), 10_000
LAWS = (Friction(), Friction(mu_t=2.5, mu_f=1, mu_b=1.6))


def random_instants(count: int, seed: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Angles over all of shape space and rates with the larger one 1, ``(2, count)`` each."""
    rng = np.random.default_rng(seed)
    angles, rates = rng.uniform(-np.pi, np.pi, (2, count)), rng.uniform(-1, 1, (2, count))
    return angles, rates / np.abs(rates).max(axis=0)


def main() -> None:
    command_line(__doc__)
    if native_kernel.native_kernel() is None:
        raise SystemExit("no C compiler on this machine, so there is nothing to compare.")
    rows = []
    for law in LAWS:
        for delta in (1e-2, 1e-4, 1e-8):
            many = BODY, law, *random_instants(MANY), delta
            steps = solve_balance(*many).iterations.mean() + 1
            bare = interleaved_seconds({"": partial(solve_balance, *many, tolerance=1e300)})[""]
            for count in (60, MANY):
                balances = partial(solve_balance, BODY, law, *random_instants(count), delta)

                def by_numpy(balances: partial = balances) -> None:
                    with patch.object(native_kernel, "library", lambda: None):
                        balances()

                spent = interleaved_seconds({"C": balances, "NumPy": by_numpy}, at_least=0.2)
                speeds = (f"{count / spent[way]:,.0f}" for way in ("C", "NumPy"))
                floor = bare * steps * count / MANY
                ratios = spent["NumPy"] / spent["C"], spent["C"] / floor
                rows.append([astuple(law), f"{delta:.0e}", count, *speeds, *ratios])
    head = "friction (t, f, b)", "delta", "at once", "C, a second", "NumPy, a second", "ratio"
    print(markdown_table((*head, "times the floor"), rows))


if __name__ == "__main__":
    main()
