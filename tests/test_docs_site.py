"""The site of the documentation: what its hooks make of a page."""

import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("mkdocs")
pytest.importorskip("latex2mathml")
from scripts import docs_site
from scripts.browser import browser, complaints
from scripts.notebook import executed, notebook_of

ROOT = Path(__file__).resolve().parents[1]


def shown(markdown, page="tutorial.md"):
    """A page after both of its hooks."""
    stated = SimpleNamespace(file=SimpleNamespace(src_uri=page), meta={})
    return docs_site.on_page_content(
        docs_site.on_page_markdown(markdown, stated, None, None), stated, None, None
    )


LINKS = """
[a](notebook.ipynb) in tutorial.md: [a](notebook.md)
[a](notebook.ipynb) in notebook.md: [a](notebook.ipynb)
[a](../problems) in index.md: [a](gallery.md)
[a](../../colloc/__init__.py) in howto/scripts.md: [a](../api.md)
[a](../limits.md#files) in howto/check.md: [a](../limits.md#files)
![a](../../results/curated/x.png) in howto/report.md: ![a](../curated/x.png)
[a](../results/curated/gallery.json) in known.md: a (`results/curated/gallery.json`)
[`kernel.c`](../colloc/mechanics/native/kernel.c) in known.md: `colloc/mechanics/native/kernel.c`
[a](https://example.org/x) in known.md: [a](https://example.org/x)
[a](#files) in limits.md: [a](#files)
[a](../../docs/bound.md) in curated/frontier.md: [a](../bound.md)
![a](gallery.png) in curated/frontier.md: ![a](../curated/gallery.png)
"""


@pytest.mark.parametrize("row", LINKS.strip().splitlines())
def test_a_link_of_the_repository_leads_to_the_page_that_shows_it(row):
    link, page, becomes = re.fullmatch(r"(.*) in (.*?): (.*)", row).groups()
    assert shown(link, page) == becomes


@pytest.mark.slow
def test_the_notebook_of_a_script_prints_and_shows_what_the_script_does(tmp_path):
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("nbclient")
    path = tmp_path / "three_link.ipynb"
    nbformat.write(notebook_of(ROOT / "problems/three_link.py"), path)
    run = executed(path, tmp_path)
    printed, *shown = [output for cell in run.cells[2:] for output in cell["outputs"]]
    assert "<Solution three_link, solved, d/W = 0.26003" in printed["text"]
    assert [kind for output in shown for kind in output["data"] if "image" in kind] == [
        "image/png",
        "image/gif",
    ]


@pytest.fixture
def program():
    return browser() or pytest.skip("no chromium, chromium-browser or google-chrome is installed")


@pytest.mark.slow
def test_in_a_browser_no_page_is_too_wide_dark_is_dark_and_the_search_finds(program, tmp_path):
    build = [sys.executable, "-m", "mkdocs", "build", "-q", "-d", tmp_path]
    subprocess.run(build, cwd=ROOT, check=True)
    assert [complaints(program, tmp_path, dark=dark) for dark in (False, True)] == [[], []]


@pytest.mark.slow
def test_a_checker_of_accessibility_finds_no_fault_in_a_report(program, three_link, tmp_path):
    axe = ROOT / "build/package/axe.min.js"
    if not axe.exists():
        pytest.skip("there is no build/package/axe.min.js: npm pack axe-core, as .ci/run does")
    three_link.report(tmp_path / "report.html")
    text = axe.read_text(encoding="utf-8")
    assert [complaints(program, tmp_path, text, dark=dark) for dark in (False, True)] == [[], []]
