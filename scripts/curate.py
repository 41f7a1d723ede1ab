"""Copy the curated results and record what made them: python -m scripts.curate [folder of results]

Keeps the paper's table and figures (PNG) and the main figure under results/curated, with a manifest of commit, versions and
the command of each file.
"""

import argparse
import json
import shutil
import subprocess
from pathlib import Path

from colloc.system.versions import versions

COMMANDS = {
    "three_link.png": "python -m colloc.solve problems/three_link.py",
    "paper.md": "python -m scripts.reproduce_paper",
    "paper/*.png": "python -m scripts.reproduce_paper",
    "benchmarks/benchmarks.md": "python -m benchmarks",
    "benchmarks/*.png": "python -m benchmarks",
}
KEPT = {
    "report.png": "python -m scripts.screens",
    "gallery.json": "python -m scripts.gallery",
    "gallery": "python -m scripts.gallery",
    "gallery.png": "python -m scripts.gallery",
    "side_by_side.gif": "python -m scripts.side_by_side",
    "screens": "python -m scripts.screens",
    "concepts": "python -m scripts.concepts",
    "mesh_tolerance.md": "python -m benchmarks.work_precision",
    "gait_classes.md": "python -m scripts.class_table",
    "gait_classes_4.md": "python -m scripts.class_table --links 4",
    "gait_classes_5.md": "python -m scripts.class_table --links 5",
    "gait_classes_5.png": "python -m scripts.class_table --links 5",
    "gait_classes_5.pdf": "python -m scripts.class_table --links 5",
    "gait_classes_4.png": "python -m scripts.class_table --links 4",
    "gait_classes_4.pdf": "python -m scripts.class_table --links 4",
    "gait_classes.png": "python -m scripts.class_table",
    "gait_classes.pdf": "python -m scripts.class_table",
    "chains.md": "python -m benchmarks.chains --output results/curated",
    "error_control.md": "python -m benchmarks.error_control",
    "work_precision.png": "python -m benchmarks.work_precision",
    "work_precision_path.md": "python -m benchmarks.work_precision --path",
    "work_precision_path.png": "python -m benchmarks.work_precision --path",
    "robustness.md": "python -m benchmarks.robustness --starts 35",
    "robustness-3-harmonics.md": "python -m benchmarks.robustness --starts 4 --harmonics 3",
    "grid_confirmation.md": "python -m benchmarks.grid_confirmation",
    "robustness.json": "python -m benchmarks.robustness --starts 35",
    "crawlers.md": "python -m scripts.optimise_crawlers",
    "sweep_scaling.md": "python -m benchmarks.sweep_scaling --cells 24 --tasks 500 --dask",
    "three_link_relaxed.png": "python -m colloc.solve problems/three_link_relaxed.py",
    "measure.png": "python -m scripts.measure_to_gait",
    "frontier.md": "python -m scripts.frontier",
    "frontier.json": "python -m scripts.frontier",
    "plane_from_both_sides.md": "python -m scripts.plane_from_both_sides",
    "plane_from_both_sides.png": "python -m scripts.plane_from_both_sides",
    "potentials.json": "python -m scripts.check_potential",
    "guaranteed.json": "python -m scripts.bound_guaranteed (docs/bound.md, section 5)",
    "without_contact.md": "python -m scripts.without_contact",
    "several_motions.md": "python -m scripts.several_motions",
    "several_motions.png": "python -m scripts.several_motions",
    "error_bars.jsonl": "python -m benchmarks.error_bars --gaits 300",
    "published.md": "python -m benchmarks.published --output results/curated",
    "small_polygons.md": "python -m scripts.small_polygons",
    "three_link_wheels.front.png": "python -m colloc pareto problems/three_link_wheels.py",
    "small_gaits.png": "python -m scripts.infinitesimal_map --steps 20",
    "slopes.md": "python -m scripts.slopes",
    "slopes.png": "python -m scripts.slopes",
    "feet.md": "python -m scripts.feet --output results/curated",
    "pace.md": "python -m scripts.pace --output results/curated",
    "pace.png": "python -m scripts.pace --output results/curated",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", nargs="?", type=Path, default=Path("results"), help="folder of results (default: results)")
    source = parser.parse_args().source
    target = Path("results/curated")
    commit = subprocess.run(
        ["git", "-C", source, "rev-parse", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    manifest = target / "manifest.json"
    entries = json.loads(manifest.read_text()) if manifest.exists() else {}
    for pattern, command in COMMANDS.items():
        for path in sorted(source.glob(pattern)):
            place = target / path.relative_to(source)
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, place)
            entries[str(path.relative_to(source))] = {"command": command, "commit": commit, "versions": versions()}
    for name, command in KEPT.items():
        written = subprocess.run(
            ["git", "log", "-1", "--format=%H", "--", str(target / name)], capture_output=True, text=True, check=True
        ).stdout.strip()
        if entries.get(name, {}).get("added in commit") != written:  # else what made it was something older
            entries[name] = {"added in commit": written, "versions": versions()}
        entries[name]["command"] = command
    manifest.write_text(json.dumps(entries, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    main()
