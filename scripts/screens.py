"""Photograph the report of the tutorial's problem in a headless browser: python -m scripts.screens

Needs chromium or google-chrome. Writes results/curated/screens/report_top.png.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from colloc.commands.results import report
from colloc.commands.solve import solve
from scripts.browser import BROWSERS, OPTIONS, browser
from scripts.program import command_line

ROOT = Path(__file__).resolve().parents[1]
TARGET = ROOT / "results/curated/screens/report_top.png"
_SIZE, _WIDTH, _COLOURS = 1120, 900, 128


def tutorial_problem() -> str:
    """The problem file of docs/tutorial.md."""
    text = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python[^\n]*\n(.*?)^```", text, re.M | re.S)
    return next(block for block in blocks if "PROBLEM" in block)


def main() -> int:
    command_line(__doc__)
    program = browser()
    if program is None:
        print(f"no browser: install one of {', '.join(BROWSERS)}.", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "mine.py").write_text(tutorial_problem(), encoding="utf-8")
        code = solve([str(folder / "mine.py"), "--output", name, "--no-figure", "--quiet"])
        if code:
            return code
        report([str(folder / "mine.h5"), "--quiet"])
        options = [f"--window-size={_SIZE},{_SIZE}", f"--screenshot={folder / 'shot.png'}"]
        options += ["--allow-file-access-from-files", "--virtual-time-budget=3000"]
        options += [f"--user-data-dir={folder / 'profile'}", f"file://{folder / 'mine.html'}#t=1.4"]
        subprocess.run([program, *OPTIONS, *options], check=True, capture_output=True)
        image = Image.open(folder / "shot.png").convert("RGB")
        image = image.resize((_WIDTH, round(image.height * _WIDTH / image.width)))
        # kmeans: without it the palest grey becomes blue
        how = {"kmeans": 2, "dither": Image.Dither.NONE}
        image.quantize(_COLOURS, Image.Quantize.MAXCOVERAGE, **how).save(TARGET, optimize=True)
    print(f"saved {TARGET.relative_to(ROOT)} ({TARGET.stat().st_size / 1000:.0f} kB)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
