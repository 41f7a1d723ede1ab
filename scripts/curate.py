"""Copy the curated results and record what made them: python -m scripts.curate [folder of results]

Keeps the paper's table and figures (PNG) and the main figure under results/curated, with a manifest of commit, versions and
the command of each file.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

from colloc.solution import versions

COMMANDS = {
    "three_link.png": "python -m colloc.solve problems/three_link.py",
    "paper.md": "python -m scripts.reproduce_paper",
    "paper/*.png": "python -m scripts.reproduce_paper",
}
KEPT = {
    "bound_table.md": "python -m scripts.bound_table",
    "cycles.md": "python -m scripts.search_cycles --cases 32,1 24,2 24,4 24,7",
    "small_gaits.png": "python -m scripts.infinitesimal_map --steps 20",
    "mesh_tolerance.md": "python -m benchmarks.mesh_tolerance",
    "robustness.md": "python benchmarks/robustness.py --starts 6 --symmetries none bilateral",
    "robustness.json": "python benchmarks/robustness.py --starts 6 --symmetries none bilateral",
}


def main() -> None:
    source = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
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
        entries[name] = {"command": command, "added in commit": written, "versions": versions()}
    manifest.write_text(json.dumps(entries, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    main()
