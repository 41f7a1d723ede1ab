"""Solve the tutorial's problem, write its report, and photograph it in a headless browser: python -m scripts.report_screenshot

Needs chromium or google-chrome. Writes results/curated/report.png.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from colloc.commands.report import main as report
from colloc.commands.solve import main as solve

ROOT = Path(__file__).resolve().parents[1]
TARGET = ROOT / "results/curated/report.png"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--virtual-time-budget=3000",
]
_WINDOW, _WIDTH, _COLOURS = (1120, 4400), 900, 256


def tutorial_problem() -> str:
    """The problem file of docs/tutorial.md."""
    text = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")
    return next(block for block in re.findall(r"^```python[^\n]*\n(.*?)^```", text, re.M | re.S) if "PROBLEM" in block)


def main() -> int:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    browser = next((found for found in map(shutil.which, BROWSERS) if found), None)
    if browser is None:
        print(f"no browser: install one of {', '.join(BROWSERS)}.", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "mine.py").write_text(tutorial_problem(), encoding="utf-8")
        code = solve([str(folder / "mine.py"), "--output", name, "--no-figure"])
        if code:
            return code
        report([str(folder / "mine.h5")])
        shot, page = folder / "shot.png", f"file://{folder / 'mine.html'}#t=1.4"
        size = f"--window-size={_WINDOW[0]},{_WINDOW[1]}"
        profile = f"--user-data-dir={folder / 'profile'}"
        subprocess.run([browser, *OPTIONS, profile, size, f"--screenshot={shot}", page], check=True, capture_output=True)
        image = Image.open(shot).convert("RGB")
    pixels = np.asarray(image)
    used = np.flatnonzero((pixels != pixels[-1, 0]).any(axis=(1, 2)))[-1] + 20
    image = image.crop((0, 0, image.width, int(used)))
    image = image.resize((_WIDTH, round(image.height * _WIDTH / image.width)), Image.Resampling.LANCZOS)
    image.quantize(_COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(TARGET, optimize=True)
    print(f"saved {TARGET.relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
