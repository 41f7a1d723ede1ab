"""Run the notebook of the documentation, docs/notebook.ipynb, and keep what it shows:
python -m scripts.notebook

Needs the extra ``docs``. What depends on the machine or the time of day is left out, so that a run
without a change of results changes the file little.
"""

from __future__ import annotations

import ast
import tempfile
import textwrap
from pathlib import Path
from typing import Any

from scripts.program import command_line

NOTEBOOK = Path(__file__).resolve().parents[1] / "docs/notebook.ipynb"
_SECONDS = 300


def notebook_of(script: Path) -> Any:
    """The notebook of a problem file that is a script: its text, the statement, the run, and the
    figure and film that it wrote."""
    from nbformat import v4

    source = script.read_text(encoding="utf-8")
    lines, module = source.splitlines(), ast.parse(source)
    title, _, story = (ast.get_docstring(module) or "").partition("\n")
    _, first, *_, main = module.body
    stated = "\n".join(lines[first.lineno - 1 : main.lineno - 1])
    run = textwrap.dedent("\n".join(lines[main.lineno :]))
    shown = [f'Image("{script.stem}.{kind}")' for kind in ("png", "gif")]
    code = [stated, run, f"from IPython.display import Image\n\n{shown[0]}", shown[1]]
    cells = [v4.new_markdown_cell(f"# {title}\n{story}")]
    return _tidy(v4.new_notebook(cells=cells + [v4.new_code_cell(cell.strip()) for cell in code]))


def executed(path: Path, folder: Path) -> Any:
    """A notebook as it is after running all its cells in a folder."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    options: dict[str, Any] = {
        "timeout": _SECONDS,
        "kernel_name": "python3",
        "resources": {"metadata": {"path": str(folder)}},
    }
    NotebookClient(notebook, **options).execute()
    return _tidy(notebook)


def _tidy(notebook: Any) -> Any:
    for number, cell in enumerate(notebook.cells):
        cell["id"] = f"cell-{number}"
        cell.metadata.clear()
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}
    }
    return notebook


def main() -> None:
    command_line(__doc__)
    import nbformat

    with tempfile.TemporaryDirectory() as folder:
        nbformat.write(executed(NOTEBOOK, Path(folder)), NOTEBOOK)
    print(f"saved {NOTEBOOK.name} ({NOTEBOOK.stat().st_size / 1000:.0f} kB)")


if __name__ == "__main__":
    main()
