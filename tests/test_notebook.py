"""The notebook was run from top to bottom, its page shows it all, and a new run says the same."""

import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOK = ROOT / "docs/notebook.ipynb"
CELLS = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
CODE = [cell for cell in CELLS if cell["cell_type"] == "code"]


def said(cell):
    """The words of a cell's outputs."""
    outputs = cell["outputs"]
    return "".join(
        "".join(o.get("text", "")) + "".join(o.get("data", {}).get("text/plain", "")) + "\n"
        for o in outputs
    )


def numbers(text):
    """Without signs: rounding decides between a gait and its mirror image, worth the same."""
    return [
        float(value)
        for value in re.findall(r"(?<![\w.])\d+\.\d+(?!e)(?:\b)", text.replace("-", " "))
    ]


def test_it_was_run_once_from_top_to_bottom_without_an_error():
    assert [cell["execution_count"] for cell in CODE] == list(range(1, len(CODE) + 1))
    outputs = [output for cell in CODE for output in cell["outputs"]]
    assert not [o for o in outputs if o["output_type"] == "error" or o.get("name") == "stderr"]
    kinds = {kind for output in outputs for kind in output.get("data", {})}
    assert {"image/png", "image/gif", "text/html"} <= kinds


def test_the_page_shows_every_cell_and_every_output():
    pytest.importorskip("mkdocs")
    from scripts.docs_site import notebook_page

    page = notebook_page()
    for cell in CELLS:
        assert "".join(cell["source"]) in page
        for line in said(cell).splitlines() if cell in CODE else ():
            assert line.startswith(("<IPython", "<Picture", "<Solution")) or line in page
    assert page.count("<img ") == 2


@pytest.mark.slow
def test_a_new_run_says_the_same(tmp_path):
    pytest.importorskip("nbclient")
    from scripts.notebook import executed

    again = [cell for cell in executed(NOTEBOOK, tmp_path).cells if cell.cell_type == "code"]
    for before, after in zip(CODE, again, strict=True):
        assert numbers(said(after)) == pytest.approx(numbers(said(before)), rel=1e-3, abs=2e-3)
    assert {path.name for path in tmp_path.iterdir()} >= {"mine.h5", "mine.gif"}
