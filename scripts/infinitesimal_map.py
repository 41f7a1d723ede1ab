"""Map of the best infinitesimal gait over shape space (three equal links); writes JSON and a figure.

python -m scripts.infinitesimal_map [--mu MU_T MU_F MU_B] [--steps 32] [--out results]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from colloc.bounds.coulomb_motion import admissible, fundamental
from colloc.bounds.infinitesimal import small_gait
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from scripts.figures_bound import save_small_gait_map


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mu", type=float, nargs=3, default=(1.0, 1.0, 1.0))
    parser.add_argument("--steps", type=int, default=32)
    parser.add_argument("--out", type=Path, default=Path("results"))
    arguments = parser.parse_args()
    body, friction = Chain(), Friction(*arguments.mu)
    n = arguments.steps
    axis = np.linspace(-np.pi, np.pi, n + 1)
    table = np.full((n + 1, n + 1), np.nan)
    for i, a in enumerate(axis):
        for j, b in enumerate(axis):
            shape = np.array([[a], [b]])
            if admissible(body, shape, 1e-9)[0] and fundamental(body, shape)[0]:
                value = small_gait(body, friction, shape[:, 0], directions=90, headings=4, rounds=3).efficiency
                # mirror, exchange of the joints, and both
                for k, m in ((i, j), (n - i, n - j), (j, i), (n - j, n - i)):
                    table[k, m] = value
    arguments.out.mkdir(parents=True, exist_ok=True)
    name = "small-gaits-{:g}-{:g}-{:g}".format(*arguments.mu)
    best = np.unravel_index(np.nanargmax(table), table.shape)
    print(f"best small gait {table[best]:.4f} at ({axis[best[0]]:.3f}, {axis[best[1]]:.3f})")
    rows = [[None if np.isnan(value) else value for value in line] for line in table.tolist()]
    entries = {"mu": list(arguments.mu), "axis": axis.tolist(), "efficiency": rows}
    (arguments.out / f"{name}.json").write_text(json.dumps(entries))
    save_small_gait_map(arguments.out / name, axis, table, "friction (t, f, b) = ({:g}, {:g}, {:g})".format(*arguments.mu))


if __name__ == "__main__":
    main()
