"""Photograph what people see, in a headless browser: python -m scripts.screens

Solves the tutorial's problem, writes its report, builds the documentation, and renders the README
as a code host would. Needs chromium or google-chrome, and the extra ``docs``. Writes
results/curated/report.png and results/curated/screens/*.png.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from colloc.commands.results import report
from colloc.commands.solve import solve
from scripts.browser import BROWSERS, DARK, OPTIONS, browser
from scripts.program import command_line

ROOT = Path(__file__).resolve().parents[1]
TARGET = ROOT / "results/curated"
_OPTIONS = (*OPTIONS, "--allow-file-access-from-files", "--virtual-time-budget=3000")
_COLOURS = 128
_HOST = """<meta charset="utf-8"><style>body{{font:16px/1.5 sans-serif;max-width:900px;margin:32px auto;color:#1f2328}}
pre{{background:#f6f8fa;padding:16px;overflow:auto;border-radius:6px}}code{{font-size:85%;background:#eff1f3;padding:.2em .4em}}
pre code{{background:none;padding:0}}h1,h2{{border-bottom:1px solid #d1d9e0;padding-bottom:.3em}}
a{{color:#0969da}}img{{max-width:100%}}
table{{border-collapse:collapse}}td,th{{border:1px solid #d1d9e0;padding:6px 13px}}</style>
<base href="{base}">{body}"""
"""The README on a code host, near enough."""


class Screen(NamedTuple):
    """A page, the size of the window, the width of the picture, and options of the browser."""

    page: str
    window: tuple[int, int]
    width: int
    options: tuple[str, ...] = ()


def tutorial_problem() -> str:
    """The problem file of docs/tutorial.md."""
    text = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")
    return next(
        block
        for block in re.findall(r"^```python[^\n]*\n(.*?)^```", text, re.M | re.S)
        if "PROBLEM" in block
    )


def photograph(program: str, screen: Screen, target: Path, folder: Path) -> None:
    """Write a picture of a page, cut where nothing follows."""
    shot = folder / "shot.png"
    size = f"--window-size={screen.window[0]},{screen.window[1]}"
    command = [
        program,
        *_OPTIONS,
        *screen.options,
        f"--user-data-dir={folder / 'profile'}",
        size,
        f"--screenshot={shot}",
    ]
    subprocess.run([*command, screen.page], check=True, capture_output=True)
    image = Image.open(shot).convert("RGB")
    pixels = np.asarray(image)
    pixels = pixels[
        : np.flatnonzero(pixels.any(axis=(1, 2)))[-1] + 1
    ]  # a window may be shorter than it says, the rest is black
    used = np.flatnonzero((pixels != pixels[-1, 0]).any(axis=(1, 2)))[-1] + 20
    image = image.crop((0, 0, image.width, min(int(used), len(pixels))))
    image = image.resize(
        (screen.width, round(image.height * screen.width / image.width)), Image.Resampling.LANCZOS
    )
    target.parent.mkdir(exist_ok=True)
    # kmeans: without it the palest grey becomes blue
    image.quantize(_COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE).save(
        target, optimize=True
    )
    print(f"saved {target.relative_to(ROOT)} ({target.stat().st_size / 1000:.0f} kB)")


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
        import markdown  # of the extra docs

        body = markdown.markdown(
            (ROOT / "README.md").read_text(encoding="utf-8"), extensions=["tables", "fenced_code"]
        )
        (folder / "readme.html").write_text(
            _HOST.format(base=f"file://{ROOT}/", body=body), encoding="utf-8"
        )
        page, site = f"file://{folder / 'mine.html'}#t=1.4", folder / "site"
        for target, screen in {
            "report": Screen(page, (1120, 4400), 900),
            "screens/report_top": Screen(page, (1120, 1120), 900),
            "screens/report_phone": Screen(page, (400, 9000), 400),
            "screens/report_dark": Screen(page, (1120, 4400), 900, (DARK,)),
            "screens/readme": Screen(f"file://{folder / 'readme.html'}", (1000, 4200), 800),
        }.items():
            photograph(program, screen, TARGET / f"{target}.png", folder)
        # with the pictures just made
        subprocess.run(
            [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", site],
            check=True,
            cwd=ROOT,
        )
        for name, height in (("index", 2400), ("gallery", 2400), ("known", 3200)):
            screen = Screen(f"file://{site / name}.html", (1280, height), 900)
            photograph(
                program, screen, TARGET / f"screens/{name.replace('index', 'home')}.png", folder
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
