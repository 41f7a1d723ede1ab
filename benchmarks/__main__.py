"""All measurements: python -m benchmarks [--quick] [--only PART ...] [--output FOLDER]

Writes FOLDER/benchmarks/benchmarks.md (FOLDER is results by default) and a figure (PNG and PDF) for the parts that have one.
A part that is run alone replaces its section and keeps the others. Times are processor time of one core unless a table says
otherwise; the file says which machine they are from. Statements about counts are tests (tests/collocation/test_budgets.py).
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import platform
import time
from pathlib import Path

import casadi

from colloc.system.versions import versions

PARTS = {
    "link_integrals": "Friction on a link",
    "balance_solvers": "Solving the balance at one instant",
    "time_schemes": "Schemes in time on a fixed gait",
    "mesh_tolerance": "The whole solve: error against time",
    "smooth_panels": "Smooth bodies",
    "map_resolution": "The tabulated velocity map",
    "formulations": "The reduced search and the literal route",
    "kernel": "The compiled kernel beside NumPy",
    "cost": "Where the time goes",
    "scaling": "Growth with mesh, links and harmonics",
    "peer_table": "Other tools on the same problem",
}


def machine() -> str:
    """What the numbers were measured on, and how busy it was."""
    model = (
        next(
            (line.split(":")[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines() if "model name" in line), "?"
        )
        if Path("/proc/cpuinfo").exists()
        else platform.processor()
    )
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    busy = os.getloadavg()[0]
    return f"{os.cpu_count()} cores ({model}), {memory:.0f} GiB, load average {busy:.1f}; casadi {casadi.__version__}"


def document(sections: dict[str, dict]) -> str:
    """The report of all sections measured so far, in the order of PARTS."""
    text = [
        "# Benchmarks",
        "",
        "Written by `python -m benchmarks`; see docs/developers/benchmarks.md for what follows from it.",
    ]
    text += [f"Versions: {', '.join(f'{k} {v}' for k, v in versions().items())}.", ""]
    for name, title in PARTS.items():
        if name in sections:
            section = sections[name]
            figure = f"\n\n![{title}]({name}.png)" if section["figure"] else ""
            text += [
                f"## {title}",
                "",
                f"`{section['command']}`, {section['seconds']:.0f} s. {section['machine']}.{figure}",
                "",
            ]
            text += [section["text"], ""]
    text += ["## Robustness over random starts", "", "See `python -m benchmarks.robustness` and its table robustness.md.", ""]
    return "\n".join(text)


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure speed against error; see the top of this file.")
    parser.add_argument("--quick", action="store_true", help="fewer sizes and repetitions: minutes instead of half an hour")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--output", type=Path, default=Path("results"))
    options = parser.parse_args()
    folder = options.output / "benchmarks"
    folder.mkdir(parents=True, exist_ok=True)
    kept = folder / "sections.json"
    sections = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    for name in options.only:
        begin, where = time.perf_counter(), machine()
        text = importlib.import_module(f"benchmarks.{name}").report(options.quick, folder)
        seconds = time.perf_counter() - begin
        command = f"python -m benchmarks --only {name}" + (" --quick" if options.quick else "")
        figure = (folder / f"{name}.png").exists()
        sections[name] = {"text": text, "seconds": seconds, "machine": where, "command": command, "figure": figure}
        kept.write_text(json.dumps(sections, indent=1) + "\n", encoding="utf-8")
        (folder / "benchmarks.md").write_text(document(sections), encoding="utf-8")
        print(f"## {PARTS[name]} ({seconds:.0f} s)\n\n{text}\n", flush=True)


if __name__ == "__main__":
    main()
