"""Figure and table of the friction plane: python -m scripts.friction_plane [--results FOLDER] [--output FOLDER]

Reads what ``colloc sweep studies/friction_plane.py`` left in FOLDER/friction_plane.nc, takes the best gait
over the classes searched, and writes friction_plane.png, .pdf and .md. Bounds for every gait of the body, and the best gaits of
any class, are those of `scripts.plane_from_both_sides`.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from colloc.pictures.style import save
from colloc.studies.store import StudyFile, load_study
from colloc.system.errors import StoreError
from scripts.figures_studies import friction_plane_figure

COMMAND = "colloc sweep studies/friction_plane.py && python -m scripts.friction_plane"


def best_over(table_values: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Largest value along an axis, NaN where there is none, and where it is (0 there)."""
    filled = np.where(np.isnan(table_values), -np.inf, table_values)
    where = filled.argmax(axis=axis)
    best = filled.max(axis=axis)
    return np.where(np.isfinite(best), best, np.nan), where


def winners(study: StudyFile) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Largest efficiency over the classes searched, and the winner's other variables."""
    axis = study.dimensions["efficiency"].index("symmetry")
    efficiency, where = best_over(study.variables["efficiency"], axis)
    index = np.expand_dims(where, axis)
    names = ("gait_class", "at_slowest", "winding", "wave", "forward", "retraced")
    rest = {name: np.take_along_axis(study.variables[name], index, axis).squeeze(axis) for name in names}
    return efficiency, rest


def table(mu_t: np.ndarray, mu_b: np.ndarray, efficiency: np.ndarray, rest: dict) -> list[str]:
    """Markdown for people: counts, then a row for each of some points."""
    kinds = Counter(np.where(np.isfinite(efficiency), rest["gait_class"], "no certified gait").ravel())
    lines = ["# The friction plane of the three-link crawler", "", f"Written by `{COMMAND}`."]
    lines += ["One harmonic, delta = 1e-3, mu_f = 1. Every efficiency is certified by an independent replay.", ""]
    lines += [f"{efficiency.size} points, {int(np.isfinite(efficiency).sum())} with a certified gait.", ""]
    lines += ["| kind and symmetry of the best gait | points |", "|---|---|"]
    lines += [f"| {name} | {n} |" for name, n in kinds.most_common()]
    lines += [
        "",
        "| mu_t/mu_f | mu_b/mu_f | efficiency | kind, symmetry | winding | small strokes | 1/min(mu) |",
    ]
    lines += ["|---|---|---|---|---|---|---|"]
    for i in range(0, mu_t.size, 2):
        for j in range(0, mu_b.size, 7):
            limit = 1.0 / min(1.0, mu_t[i], mu_b[j])
            lines.append(
                f"| {mu_t[i]:.3f} | {mu_b[j]:.3f} | {efficiency[i, j]:.4f} | {rest['gait_class'][i, j]} "
                f"| {rest['winding'][i, j]} | {'yes' if rest['at_slowest'][i, j] else ''} | {limit:.3f} |"
            )
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--output", type=Path, help="folder (default: the same)")
    options = parser.parse_args()
    try:
        study = load_study(options.results / "friction_plane.nc")
    except StoreError as error:
        parser.error(f"{error} colloc sweep studies/friction_plane.py makes it.")
    mu_t, mu_b = study.coordinates["mu_t"], study.coordinates["mu_b"]
    efficiency, rest = winners(study)
    parts = [text.split(", ") if text else ("", "") for text in rest["gait_class"].ravel()]
    kind, symmetry = (np.array([p[k].split(" ")[0] for p in parts]).reshape(efficiency.shape) for k in (0, 1))
    figure = friction_plane_figure(mu_t, mu_b, efficiency, kind, symmetry, rest["at_slowest"].astype(bool))
    folder = options.output or options.results
    print(*save(figure, folder / "friction_plane"), sep="\n")
    text = "\n".join(table(mu_t, mu_b, efficiency, rest)) + "\n"
    (folder / "friction_plane.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
