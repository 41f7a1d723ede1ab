"""Look at pages in a headless browser: python -m scripts.browser FOLDER [--axe axe.min.js]

Opens every page of a folder at the widths of a phone, a tablet and a desk, where the reader's
system is light and where it is dark. Prints what is wrong: a page wider than its window, a light
page on a dark system, a search that finds nothing, and with axe-core (`npm pack axe-core`) what it
calls serious. Needs chromium or google-chrome.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from scripts.program import command_line

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--hide-scrollbars",
]
DARK = "--blink-settings=preferredColorScheme=0"
WIDTHS = 360, 768, 1280
_PATIENCE = 600.0
"""Seconds for all pages."""
_LOOK = """<!DOCTYPE html><meta name="color-scheme" content="light dark"><iframe style="height:800px;border:0"></iframe><script>
const {pages, widths, dark, searched, axe} = ASKED, frame = document.querySelector("iframe"), said = [];
const wait = ms => new Promise(done => setTimeout(done, ms));
const open = (page, width) => new Promise(done => {
  frame.style.width = width + "px";
  frame.onload = () => setTimeout(() => done(frame.contentDocument), 50);
  frame.src = page;
});
const behind = page => {
  const colours = [page.body, page.documentElement].map(each => getComputedStyle(each).backgroundColor);
  return (colours.find(colour => !/, 0\\)$/.test(colour)) || (dark ? "rgb(0,0,0)" : "rgb(255,255,255)")).match(/[0-9.]+/g);
};
async function look(name, width) {
  const page = await open(name, width), over = page.documentElement.scrollWidth - width, at = name + " at " + width + ": ";
  if (over > 0) said.push(at + over + " pixels too wide");
  const [red, green, blue] = behind(page), light = (+red + +green + +blue) / 3 > 128;
  if (light === dark) said.push(at + (light ? "light on a dark system" : "dark on a light system"));
  if (!axe || width === 768) return;
  if (!frame.contentWindow.axe) page.head.append(Object.assign(page.createElement("script"), {textContent: axe}));
  const found = await frame.contentWindow.axe.run(page, {resultTypes: ["violations"]});
  for (const each of found.violations) if (["serious", "critical"].includes(each.impact))
    said.push(at + each.id + " (" + each.impact + "), " + each.nodes[0].html.slice(0, 200));
}
async function search(name, words) {
  const page = await open(name, 1280), field = page.querySelector("[data-md-component=search-query]");
  field.focus(); field.value = words;
  for (let k = 0; k < 100 && !page.querySelector(".md-search-result__item a"); k++) {
    field.dispatchEvent(new KeyboardEvent("keyup")); await wait(100);
  }
  if (!page.querySelector(".md-search-result__item a")) said.push(name + ": the search finds nothing for " + words);
}
(async () => {
  try {
    for (const name of pages) for (const width of widths) await look(name, width);
    if (searched) await search(searched, "friction");
  } catch (error) { said.push(String(error)); }
  fetch("/said", {method: "POST", body: JSON.stringify(said)});
})();
</script>"""
"""The page that opens the others, and tells what it saw."""


def browser() -> str | None:
    """The path of a browser, if one is installed."""
    return next((found for found in map(shutil.which, BROWSERS) if found), None)


class _Pages(SimpleHTTPRequestHandler):
    """The files of a folder, the page that looks at them, and where it tells what it saw."""

    server: _Server

    def do_GET(self) -> None:
        if self.path != "/look":
            return super().do_GET()
        self.send_response(200)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.end_headers()
        self.wfile.write(self.server.look)

    def do_POST(self) -> None:
        self.server.said = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_response(204)
        self.end_headers()
        self.server.ended.set()

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing."""


class _Server(ThreadingHTTPServer):
    look: bytes = b""
    said: list[str]

    def __init__(self, folder: Path) -> None:
        super().__init__(("127.0.0.1", 0), partial(_Pages, directory=str(folder)))
        self.ended = threading.Event()


def complaints(program: str, folder: Path, axe: str = "", *, dark: bool = False) -> list[str]:
    """What is wrong with the pages of a folder, in words; `axe` is the text of axe-core.
    `TimeoutError` if the browser does not answer."""
    pages = [path.relative_to(folder).as_posix() for path in sorted(folder.rglob("*.html"))]
    searched = "index.html" if (folder / "search").exists() else ""
    widths = WIDTHS[:1] if dark and not axe else WIDTHS
    asked = {"pages": pages, "widths": widths, "dark": dark, "searched": searched, "axe": axe}
    profiles = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
    with _Server(folder) as server, profiles as profile:
        server.look = _LOOK.replace("ASKED", json.dumps(asked).replace("</", "<\\/")).encode()
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_address[1]}/look"
        command = [program, *OPTIONS, *([DARK] if dark else []), f"--user-data-dir={profile}"]
        command.append("--remote-debugging-port=0")
        opened = subprocess.Popen(
            [*command, address], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            if not server.ended.wait(_PATIENCE):
                raise TimeoutError(f"{program} has not answered in {_PATIENCE:g} s")
        finally:
            opened.terminate()
            opened.wait()
            server.shutdown()
        return server.said


def main() -> int:
    options = command_line(__doc__, ("folder", Path()), axe=Path)
    program = browser()
    if program is None:
        print(f"no browser: install one of {', '.join(BROWSERS)}.", file=sys.stderr)
        return 2
    axe = options.axe.read_text(encoding="utf-8") if options.axe else ""
    said = [
        line
        for dark in (False, True)
        for line in complaints(program, options.folder, axe, dark=dark)
    ]
    nothing = f"nothing is wrong at {', '.join(map(str, WIDTHS))} pixels, light and dark"
    print("\n".join(said) or nothing)
    return 1 if said else 0


if __name__ == "__main__":
    sys.exit(main())
