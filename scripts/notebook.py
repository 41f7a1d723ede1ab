"""Run the notebook of the documentation, docs/notebook.ipynb, and keep what it shows:
python -m scripts.notebook

Needs the extra ``docs``. What depends on the machine or the time of day is left out, so that a run
without a change of results changes the file little.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from scripts.program import command_line

NOTEBOOK = Path(__file__).resolve().parents[1] / "docs/notebook.ipynb"
_SECONDS = 300


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
