"""Hooks of the documentation (mkdocs.yml): the order of pages, generated pages, formulas, links out
of docs/.

- Four parts, and before them where to start. Pages that `ORDER` does not name, such as those of
  docs/developers, are appended under "For developers", so a new file in docs/ needs no other
  change.
- Generated: the notebook with what it showed, the gallery (problems/ with
  results/curated/gallery.json) and its notebooks, the commands (what --help says), the API.
- Formulas, ```math blocks and $`inline`$ as on GitHub, become MathML when the site is built:
  readers load no script.
- Links to what a generated page shows, such as problems/, lead to that page (`SHOWN`). Links to
  other files of the repository outside docs/ become their names; pictures and tables of
  results/curated are copied.

`python -m scripts.docs_site PAGE` prints a generated page, to read without building the site.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import io
import json
import os
import posixpath
import re
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from textwrap import indent
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parents[1]
ORDER = {
    "Start": "index concepts",
    "Tutorial": "tutorial notebook gallery",
    "How to": """howto/scripts howto/report howto/robot howto/pace howto/motors howto/slopes
        howto/laws howto/steering howto/objectives howto/check howto/sensitivity howto/starts
        howto/studies howto/cluster howto/own_body howto/columns howto/own_gait_class howto/paper
        troubleshooting""",
    "Reference": "reference known published limits commands api modules changelog cite",
    "Explanation": "theory collocation search gait_classes bound bodies smooth_bodies",
}
GALLERY = """three_link three_link_feet inchworm wheeled_snake serpenoid_snake three_link_fast
    three_link_uphill three_link_turning smooth_low_mode concertina purcell weakening_floor"""
"""The problem files that are scripts, in the order of the page."""
PICTURES = (".png", ".gif")
KEPT = (*PICTURES, ".md")
_MATH_BLOCK = re.compile(r"^```math\n(.*?)^```", re.MULTILINE | re.DOTALL)
_MATH_INLINE = re.compile(r"\$`([^`\n]+)`\$")
SHOWN = {
    "problems": "gallery.md",
    "colloc/__init__.py": "api.md",
    "docs/notebook.ipynb": "notebook.md",
}
"""What a code host shows, and the page that shows it here."""
_SCROLLS = '<span style="display: block; overflow-x: auto">{}</span>'
"""On a phone a long formula, and not the page."""
_LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^):#\s]+)(?:#[^)]*)?\)")


def on_config(config: Any) -> Any:
    """The navigation: named pages in their order, then all others."""
    docs = ROOT / "docs"
    rest = {path.relative_to(docs).as_posix() for path in docs.rglob("*.md")} | set(GENERATED)
    nav: list[Any] = []
    for title, names in ORDER.items():
        pages = [page for name in names.split() if (page := f"{name}.md") in rest]
        nav.append({title: pages})
        rest -= set(pages)
    if rest:
        nav.append({"For developers": sorted(rest)})
    config["nav"] = nav
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add the generated pages, the notebooks of the gallery, and the curated pictures and
    tables."""
    from nbformat import writes

    sys.path.insert(0, str(ROOT))
    from scripts.notebook import notebook_of

    for name, make in GENERATED.items():
        files.append(File.generated(config, name, content=make()))
    for name in GALLERY.split():
        notebook = writes(notebook_of(ROOT / f"problems/{name}.py"))
        files.append(File.generated(config, f"gallery/{name}.ipynb", content=notebook))
    curated = ROOT / "results/curated"
    for path in sorted(path for path in curated.rglob("*") if path.suffix in KEPT):
        name = f"curated/{path.relative_to(curated).as_posix()}"
        content = path.read_bytes() if path.suffix in PICTURES else path.read_text()
        files.append(File.generated(config, name, content=content))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Formulas become marks that `on_page_content` replaces, since Markdown would read underscores
    in them."""
    formulas: list[str] = []

    def mark(display: str) -> Any:
        block = display == "block"

        def replaced(match: re.Match[str]) -> str:
            formula = convert(match[1].strip(), display=display)
            formulas.append(_SCROLLS.format(formula) if block else formula)
            name = f"FORMULA{len(formulas) - 1}END"
            return f"\n\n{name}\n\n" if block else name

        return replaced

    markdown = _MATH_INLINE.sub(mark("inline"), _MATH_BLOCK.sub(mark("block"), markdown))
    page.meta["formulas"] = formulas
    return _LINK.sub(lambda match: site_link(match, page.file.src_uri), markdown)


def site_link(match: re.Match[str], page: str) -> str:
    """A link on a page as the site has it: pictures and tables of results/curated stay, other files
    outside docs/ become the page that shows them, or else their name."""
    picture, text, target = match.groups()
    folder, back = posixpath.dirname(page), "../" * page.count("/")
    copied = page.startswith("curated/")
    file = posixpath.normpath(posixpath.join("results" if copied else "docs", folder, target))
    if SHOWN.get(file, page) != page:
        return f"[{text}]({back}{SHOWN[file]})"
    if file.startswith("docs/"):
        return f"[{text}]({back}{file.removeprefix('docs/')})" if copied else match[0]
    if file.startswith("results/curated/") and file.endswith(KEPT):
        return f"{picture}[{text}]({back}curated/{file.removeprefix('results/curated/')})"
    return f"`{file}`" if text.strip("`") in (file, Path(file).name) else f"{text} (`{file}`)"


def on_page_content(html: str, page: Any, config: Any, files: Any) -> str:
    """Put the formulas in."""
    return re.sub(r"FORMULA(\d+)END", lambda match: page.meta["formulas"][int(match[1])], html)


def on_post_page(output: str, page: Any, config: Any) -> str:
    """The search has a name for those who hear the page."""
    return output.replace(
        'data-md-component="search" role="dialog"',
        'data-md-component="search" role="dialog" aria-label="Search"',
    )


def gallery_page() -> str:
    """The films at a glance; of each script its text, numbers, pictures and source; and a row for
    every other problem file."""
    table = json.loads((ROOT / "results/curated/gallery.json").read_text())
    films = [
        f"[![{name}](curated/gallery/{name}.gif){{ width=32% }}](#{name})"
        for name in GALLERY.split()
    ]
    parts = [
        "# Gallery",
        "Twelve scripts: each states a problem, solves it, prints, and draws a figure and a film, as "
        "does its notebook. `python -m scripts.gallery` ran them.",
        "\n".join(films),
    ]
    for name in GALLERY.split():
        title, story, source = _texts(name)
        parts += [
            f"## {title} {{ #{name} }}",
            re.sub(r"\$\$(.*?)\$\$", r"```math\n\1\n```", story, flags=re.DOTALL),
            f"```sh\npython problems/{name}.py    # {table[name]['cpu_seconds']:.0f} s of processor time\n```",
            f"```text\n{table[name]['printed'].strip()}\n```",
            f"![The film of {name}](curated/gallery/{name}.gif)",
            f"![The figure of {name}](curated/gallery/{name}.png)",
            f'[As a notebook](gallery/{name}.ipynb).\n\n??? note "problems/{name}.py"\n\n'
            + indent(f"```python\n{source}\n```", "    "),
        ]
    rows = ["| `colloc solve problems/` | d/W |", "|---|---|"]
    for path in sorted((ROOT / "problems").glob("[!_]*.py")):
        if path.stem not in GALLERY.split():
            rows.append(f"| {path.name} | {table[path.stem]['efficiency']:.5g} |")
    return "\n\n".join([*parts, "## More problem files", "\n".join(rows)]) + "\n"


def _texts(name: str) -> tuple[str, str, str]:
    """Title and story of a problem file, and its source without them."""
    source = (ROOT / f"problems/{name}.py").read_text(encoding="utf-8")
    title, _, story = (ast.get_docstring(ast.parse(source)) or name).partition("\n\n")
    return " ".join(title.split()).rstrip("."), story, source.split('"""', 2)[2].strip()


def root_page(name: str) -> str:
    """A page beside the README, its links as from docs/."""
    text = (ROOT / name).read_text(encoding="utf-8").replace("](docs/", "](")
    for other in ("CHANGELOG", "CONTRIBUTING"):
        text = text.replace(f"]({other}.md", f"]({other.lower()}.md")
    return text


def commands_page() -> str:
    """What every subcommand says about itself."""
    sys.path.insert(0, str(ROOT))
    os.environ["COLUMNS"] = "100"
    from colloc.commands.main import SUBCOMMANDS, help_text, main

    parts = ["# Commands", f"```text\n{help_text()}\n```"]
    for name in SUBCOMMANDS:
        text = io.StringIO()
        with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
            main([name, "--help"])
        parts.append(f"## colloc {name}\n\n```text\n{text.getvalue().rstrip()}\n```")
    return "\n\n".join(parts) + "\n"


def api_page() -> str:
    """The public names, each from its module's docstrings."""
    import colloc

    parts = [
        "# Programming interface",
        "All of these are names of the package: `import colloc`, then `colloc.Problem`, ...",
    ]
    parts += [f"::: {module}.{name}" for name, module in colloc._HOME.items()]
    return "\n\n".join(parts) + "\n"


def modules_page() -> str:
    """First lines of all modules."""
    rows = ["| module | holds |", "|---|---|"]
    for path in sorted((ROOT / "colloc").glob("*/[!_]*.py")):
        page = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        first = page.partition("\n")[0].replace("|", r"\|")
        rows.append(f"| `{path.parent.name}.{path.stem}` | {first} |")
    text = "Imports point down from package to package; `tests/test_layering.py` holds the order."
    return "# Modules\n\n" + text + "\n\n" + "\n".join(rows) + "\n"


def notebook_page() -> str:
    """docs/notebook.ipynb as it was run last (`scripts.notebook`): texts, code, and what it printed
    and showed."""
    parts = []
    for cell in json.loads((ROOT / "docs/notebook.ipynb").read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        parts += [shown(output) for output in cell.get("outputs", ())]
        if len(parts) == 1:
            parts.append("[This page as a notebook](notebook.ipynb)")
    return "\n\n".join(parts) + "\n"


def shown(output: dict[str, Any]) -> str:
    """What a cell of a notebook shows, in the richest form there is."""
    forms = {kind: "".join(content) for kind, content in output.get("data", {}).items()}
    for kind in ("image/gif", "image/png"):
        if kind in forms:
            return f'<img alt="what the cell shows" src="data:{kind};base64,{forms[kind].strip()}">'
    if "text/html" in forms:
        return forms["text/html"]
    text = "".join(output.get("text", "")) or forms.get("text/plain", "")
    return f"```text\n{text.rstrip()}\n```"


GENERATED: dict[str, Callable[[], str]] = {
    "notebook.md": notebook_page,
    "gallery.md": gallery_page,
    "commands.md": commands_page,
    "api.md": api_page,
    "modules.md": modules_page,
    "changelog.md": partial(root_page, "CHANGELOG.md"),
    "contributing.md": partial(root_page, "CONTRIBUTING.md"),
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("page", choices=GENERATED)
    print(GENERATED[parser.parse_args().page](), end="")


if __name__ == "__main__":
    main()
