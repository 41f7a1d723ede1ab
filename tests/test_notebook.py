"""The notebook of the documentation: it was run from top to bottom, its page shows all of it, and a
new run says the same."""

import ast
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
    """Without signs: a gait and its mirror image are worth the same, and the last bit of a sine
    says which is found."""
    return [
        float(value)
        for value in re.findall(r"(?<![\w.])\d+\.\d+(?!e)(?:\b)", text.replace("-", " "))
    ]


def test_it_was_run_once_from_top_to_bottom_without_an_error():
    assert [cell["execution_count"] for cell in CODE] == list(range(1, len(CODE) + 1))
    assert not [
        o
        for cell in CODE
        for o in cell["outputs"]
        if o["output_type"] == "error" or o.get("name") == "stderr"
    ]
    kinds = {kind for cell in CODE for o in cell["outputs"] for kind in o.get("data", {})}
    assert {"image/png", "image/gif", "text/html"} <= kinds


def test_the_first_cell_installs_and_the_others_are_python_that_imports_what_exists():
    first, *others = ("".join(cell["source"]) for cell in CODE)
    assert "%pip install -q {SOURCE}" in first
    names = [
        node.attr for source in others for node in ast.walk(ast.parse(source)) if is_of_colloc(node)
    ]
    import colloc

    assert {"Problem", "solve", "replay", "save"} <= set(names) <= set(dir(colloc))


def is_of_colloc(node):
    return (
        isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "colloc"
    )


def test_it_is_the_problem_of_the_tutorial():
    tutorial = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")
    stated = "".join(CODE[1]["source"])
    for line in (
        "1 / 4, 1 / 4, 1 / 4, 1 / 4",
        "mu_t=1.7, mu_f=1.0, mu_b=1.3",
        'harmonics=2, symmetry="bilateral"',
        "joint_limit=3.14",
    ):
        assert line in stated
        assert line in tutorial
    efficiency, distance = re.findall(r"efficiency is about (0\.\d+) with d = (0\.\d+)", tutorial)[
        0
    ]
    words = "".join(map(said, CODE))
    assert f"d/W = {efficiency}" in words
    assert f"distance {distance}" in words


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
