"""The documentation says what is there: commands, options, links, numbers; messages are the
program's, code is Python."""

import ast
import contextlib
import importlib
import io
import json
import pkgutil
import re
from pathlib import Path

import numpy as np
import pytest
import xarray

from colloc.commands.main import SUBCOMMANDS, main
from colloc.results.store import save

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
TEXTS = [
    *PAGES,
    ROOT / "CHANGELOG.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "results").rglob("*.md")),
]
NOTEBOOK = ROOT / "docs/notebook.ipynb"
SOURCES = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "colloc").rglob("*.py"))


GALLERY = json.loads((ROOT / "results/curated/gallery.json").read_text(encoding="utf-8"))


def blocks(page, language):
    return re.findall(
        rf"^```{language}[^\n]*\n(.*?)^```",
        page.read_text(encoding="utf-8"),
        re.MULTILINE | re.DOTALL,
    )


def options_of(command):
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        main([command, "--help"])
    return set(re.findall(r"--[a-z][a-z-]*", text.getvalue()))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_and_options_in_the_pages_exist(page):
    for block in blocks(page, "sh"):
        for command, rest in re.findall(r"^(?:\. )?colloc ([a-z]+)([^#\n]*)", block, re.MULTILINE):
            if command in SUBCOMMANDS:
                assert set(re.findall(r"--[a-z][a-z-]*", rest)) <= options_of(command), (
                    page.name,
                    command,
                    rest,
                )
            else:
                raise AssertionError((page.name, command))
        for module in re.findall(r"python3? -m ([\w.]+)", block):
            if module.startswith(("colloc.", "scripts.", "benchmarks.")):
                assert (ROOT / (module.replace(".", "/") + ".py")).exists(), (page.name, module)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_python_in_the_pages_parses_and_imports_what_exists(page):
    for block in blocks(page, "python"):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("colloc"):
                module = importlib.import_module(node.module)
                assert all(hasattr(module, alias.name) for alias in node.names), (
                    page.name,
                    node.module,
                )


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_files_and_names_in_the_pages_exist(page):
    text = re.sub(
        r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
    )
    for path in re.findall(
        r"`((?:colloc|tests|scripts|benchmarks|problems|studies|results/curated)/[\w/.]+\w)`", text
    ):
        assert (ROOT / path).exists() or path == "studies/X.py", (page.name, path)
    for dotted in re.findall(r"`(colloc(?:\.\w+){2,})(?:\([^`]*\))?`", text):
        found = pkgutil.resolve_name(dotted)
        assert found is not None, (page.name, dotted)


def test_the_problem_of_the_tutorial_is_solved_by_its_own_text(tmp_path, capsys):
    from colloc.commands.solve import solve as main

    text = next(
        block for block in blocks(ROOT / "docs/tutorial.md", "python") if "PROBLEM" in block
    )
    (tmp_path / "mine.py").write_text(text, encoding="utf-8")
    assert main([str(tmp_path / "mine.py"), "--output", str(tmp_path), "--no-figure"]) == 0
    printed = capsys.readouterr().out
    assert "efficiency d/W  0.335" in printed
    assert "distance d      0.243" in printed

    (tmp_path / "mine.py").write_text(
        text.replace("joint_limit=3.14", "joint_limit=4"), encoding="utf-8"
    )
    assert main([str(tmp_path / "mine.py"), "--output", str(tmp_path)]) == 2
    said = capsys.readouterr().err.replace(str(tmp_path) + "/", "")
    quoted = next(
        block for block in blocks(ROOT / "docs/tutorial.md", "text") if "joint_limit" in block
    )
    assert said == quoted


def test_the_summary_quoted_in_the_tutorial_is_what_a_solve_says(three_link, solved):
    """Words to the letter and numbers to three digits, but for times, roundings and counts of the
    search."""
    from colloc.commands.summary import summary_lines

    quoted = [
        block
        for block in blocks(ROOT / "docs/tutorial.md", "text")
        if "distance d" in block or "gait   " in block
    ]
    said = summary_lines(three_link, solved("three_link")[1])
    told = [said, summary_lines(three_link, None, verbose=True)]
    lines = [
        (line.rstrip(), told[k])
        for k, block in enumerate(quoted)
        for line in block.splitlines()
        if not line.lstrip().startswith(("three_link:", "15 checks", "upper bound", "saved"))
    ]
    assert len(lines) == 6
    wordless = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e-?\d+)?")
    for line, told_lines in lines:
        same = next(
            other for other in told_lines if wordless.sub("", other) == wordless.sub("", line)
        )
        for mine, theirs in zip(numbers(line), numbers(same), strict=True):
            assert mine == pytest.approx(theirs, rel=1e-3, abs=1e-3)


def test_messages_quoted_in_troubleshooting_are_the_programs_own():
    text = (ROOT / "docs/troubleshooting.md").read_text(encoding="utf-8")
    quoted = [
        part
        for part in re.findall(r"`([^`\n]+)`", text)
        if len(part) > 17 and " " in part and part[0] != "-"
    ]
    words = re.sub(r'"\s*\n\s*f?"', "", SOURCES)  # literals continued on the next line
    known = " ".join(re.sub(r"\{[^{}]*\}", "...", words).split())
    for message in quoted:
        pieces = [
            piece.strip()
            for piece in re.split(r"\.\.\.|\bN\b|mine\.py.*", message)
            if len(piece.strip()) > 8
        ]
        for piece in pieces:
            plain = re.sub(r"joint \d+ ", "joint ... ", piece)
            assert piece in known or plain in known, (message, piece)


def test_the_manifest_of_the_curated_results_names_files_and_programs_that_are_there():
    manifest = json.loads((ROOT / "results/curated/manifest.json").read_text(encoding="utf-8"))
    assert len(manifest) > 30
    for name, entry in manifest.items():
        assert (ROOT / "results/curated" / name).exists(), name
        programs = re.findall(r"python -m ([\w.]+)", entry["command"])
        assert len(programs) == 1, (name, entry["command"])
        # what is archived is made by the program of an earlier commit, which is not here any more
        assert (
            re.fullmatch(r"[0-9a-f]{40}", entry["archived"])
            if "archived" in entry
            else is_program(programs[0])
        ), name


@pytest.mark.parametrize("page", [*PAGES, ROOT / "results/README.md"], ids=lambda page: page.stem)
def test_every_program_that_a_page_names_is_there(page):
    for program in re.findall(
        r"python3? -m ((?:colloc|scripts|benchmarks|research)[\w.]*)",
        page.read_text(encoding="utf-8"),
    ):
        assert is_program(program.rstrip(".")), (page.name, program)


def is_program(dotted):
    path = ROOT / dotted.replace(".", "/")
    return path.with_suffix(".py").exists() or (path / "__main__.py").exists()


def anchors(path):
    """The names that headings of a page can be reached by, as code hosts and the site make them."""
    headings = re.findall(r"^#+ (.*)", path.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize(
    "page", [*TEXTS, NOTEBOOK], ids=lambda page: page.relative_to(ROOT).as_posix()
)
def test_links_lead_to_files_of_the_repository(page):
    """As a code host follows them; the site has pages in place of some (`scripts.docs_site`), which
    its strict build checks."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        assert path.exists(), (page.name, target)
        assert not anchor or anchor in anchors(path), (page.name, target)


def numbers(text):
    return [float(value) for value in re.findall(r"(?<![\w.])\d+\.\d+(?:e-?\d+)?", text)]


def rows_of(path):
    """Cells of all table rows of a page, with the header of their table."""
    header = []
    for line in path.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not line.startswith("|"):
            header = []
        elif not header:
            header = cells
        elif not set(line) <= set("|-: "):
            yield header, cells


def efficiencies(name):
    """What a curated table states in its columns of efficiencies."""
    columns = {"efficiency", "d/W", "delta -> 0", "bound", "small gait", "gait", "relaxed"}
    rows = rows_of(ROOT / "results/curated" / name)
    cells = (
        cell for header, row in rows for h, cell in zip(header, row, strict=True) if h in columns
    )
    return [value for cell in cells for value in numbers(cell)]


@pytest.mark.parametrize("page", [f"docs/{name}.md" for name in ("known", "gait_classes")])
def test_efficiencies_are_those_of_the_curated_tables(page):
    """Of the table that a row links to, if it does; else of gallery, gaits without contact or
    bounds, or kept potentials."""
    general = [row["efficiency"] for row in GALLERY.values() if "efficiency" in row]
    general += efficiencies("without_contact.md") + efficiencies("frontier.md")
    general += [
        kept["program"]
        for kept in json.loads((ROOT / "results/curated/potentials.json").read_text())
    ]
    general += [
        value for links in ("", "_4", "_5") for value in efficiencies(f"gait_classes{links}.md")
    ]
    checked = 0
    for header, cells in rows_of(ROOT / page):
        if header[0] in ("potential", "intervals"):  # how a bound was computed, once
            continue
        linked = [
            name
            for name in re.findall(r"results/curated/(\w+\.md)\)", " ".join(cells))
            if efficiencies(name)
        ]
        known = np.array([value for name in linked for value in efficiencies(name)] or general)
        plain = [
            cell
            for name, cell in zip(header, cells, strict=True)
            if re.fullmatch(r"[\d./ ]+", cell) and name != "gap"
        ]
        for value in re.findall(r"0\.\d{3,}", " ".join(plain)):
            rounding = 0.51 * 10.0 ** -len(value.partition(".")[2])
            assert np.abs(known - float(value)).min() <= rounding, (cells, value)
            checked += 1
    assert checked >= 8


def class_row(name):
    """A row of the page's table of classes as the curated tables call it; both axes of a polygon
    where the better is shown."""
    name = name.replace("at most", "<=")
    if name.endswith("no symmetry"):
        return [name]
    stem = f"{name.removesuffix(', better axis')}, bilateral"
    return (
        [f"{stem}, axis through a {axis}" for axis in ("corner", "side")]
        if name.endswith("better axis")
        else [stem]
    )


def test_the_table_of_classes_is_that_of_the_curated_tables():
    curated = {}
    for links, name in ((3, "gait_classes.md"), (4, "gait_classes_4.md"), (5, "gait_classes_5.md")):
        for header, cells in rows_of(ROOT / "results/curated" / name):
            value = re.match(r"0\.\d+", cells[header.index("efficiency")])  # else none is certified
            # the first table is the isotropic one
            curated.setdefault((links, cells[0]), float(value[0]) if value else None)
    checked = 0
    for header, (name, *cells) in rows_of(ROOT / "docs/gait_classes.md"):
        if header[1:] == ["three links", "four", "five"] and header[0].startswith("class"):
            for links, cell in zip((3, 4, 5), cells, strict=True):
                known = [
                    value
                    for row in class_row(name)
                    if (value := curated.get((links, row))) is not None
                ]
                assert bool(cell) == bool(known), (name, links)
                # both are rounded
                assert not known or abs(float(cell) - max(known)) < 5.6e-4, (name, links)
                checked += 1
    assert checked == 36


RUN_ELSEWHERE = {"own_body.md", "own_gait_class.md"}
"""Pages that `tests/test_own_parts.py` runs."""
LONG = {"README.md", "scripts.md", "slopes.md"}
WITH_PYTHON = [page for page in PAGES if blocks(page, "python") and page.name not in RUN_ELSEWHERE]


@pytest.fixture
def results_of_a_reader(three_link, tmp_path, monkeypatch):
    """The files that pages speak of, in a folder of their own; the commands before a snippet would
    have made them."""
    from colloc.commands.results import export as main

    monkeypatch.chdir(tmp_path)
    for name in ("mine", "three_link"):
        save(three_link, f"results/{name}.h5")
    assert main(["results/mine.h5", "--period", "4"]) == 0
    sides, symmetries = {"mu_t": [0.5, 1.0], "mu_b": [1.0, 2.0]}, ["bilateral", "none"]
    values = xarray.DataArray(
        np.ones((2, 2, 2)), sides | {"symmetry": symmetries}, ("mu_t", "mu_b", "symmetry")
    )
    values.to_dataset(name="efficiency").to_netcdf("results/friction_plane.nc", engine="h5netcdf")
    return tmp_path


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=page.stem, marks=[pytest.mark.slow] * (page.name in LONG))
        for page in WITH_PYTHON
    ],
)
def test_the_python_of_a_page_runs_from_top_to_bottom_and_prints_what_the_page_says(
    page, results_of_a_reader, capsys
):
    """In one namespace, with no name that the page does not define: as a reader types it."""
    capsys.readouterr()
    names = {"__name__": "__main__"}
    text = page.read_text(encoding="utf-8")
    for match in re.finditer(
        r"^```python[^\n]*\n(.*?)^```(?:\s+```text\n(.*?)^```)?", text, re.MULTILINE | re.DOTALL
    ):
        program, quoted = match.groups()
        for module in re.findall(
            r"^(?:import|from) (pandas|xarray|dask_jobqueue)", program, re.MULTILINE
        ):
            pytest.importorskip(module)
        exec(compile(program, page.name, "exec"), names)
        said = capsys.readouterr().out
        assert not quoted or len(numbers(said)) == len(numbers(quoted)), (said, quoted)
        for mine, theirs in zip(numbers(quoted or ""), numbers(said), strict=False):
            assert theirs == pytest.approx(mine, rel=1e-3, abs=2e-3)
