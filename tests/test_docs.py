"""The documentation says what is there; messages are the program's, and its code runs; the notebook was
run from top to bottom, its page shows it all, and a new run says the same."""

import ast
import contextlib
import importlib
import io
import json
import pkgutil
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray

from colloc import save
from colloc.commands.main import SUBCOMMANDS, main
from colloc.commands.solve import summary_lines

ROOT = Path(__file__).resolve().parents[1]
DOCS, CURATED = ROOT / "docs", ROOT / "results/curated"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
TEXTS = [*PAGES, ROOT / "CHANGELOG.md", ROOT / "CONTRIBUTING.md", DOCS / "notebook.ipynb"]
TEXTS += sorted((ROOT / "results").rglob("*.md"))
PROGRAM = r"python3? -m ((?:colloc|scripts|benchmarks|research)[\w.]*)"
MULTI = re.MULTILINE | re.DOTALL
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)


@cache
def read(path):
    return (ROOT / path).read_text(encoding="utf-8")


def blocks(page, language):
    return re.findall(rf"^```{language}[^\n]*\n(.*?)^```", read(page), MULTI)


def numbers(text):
    return [float(value) for value in re.findall(r"(?<![\w.])\d+\.\d+(?:e-?\d+)?", text)]


@cache
def options_of(command):
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        main([command, "--help"])
    return set(re.findall(r"--[a-z][a-z-]*", text.getvalue()))


def is_program(dotted):
    path = ROOT / dotted.replace(".", "/")
    return path.with_suffix(".py").exists() or (path / "__main__.py").exists()


@each_page
def test_commands_options_and_programs_in_the_pages_exist(page):
    for block in blocks(page, "sh"):
        for command, rest in re.findall(r"^(?:\. )?colloc ([a-z]+)([^#\n]*)", block, re.MULTILINE):
            assert command in SUBCOMMANDS
            assert set(re.findall(r"--[a-z][a-z-]*", rest)) <= options_of(command), (command, rest)
    for program in re.findall(PROGRAM, read(page)):
        assert is_program(program.rstrip(".")), program


@each_page
def test_python_files_and_names_in_the_pages_exist(page):
    for block in blocks(page, "python"):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("colloc"):
                module = importlib.import_module(node.module)
                assert all(hasattr(module, alias.name) for alias in node.names), node.module
    text = re.sub(r"^```.*?^```", "", read(page), flags=MULTI)
    folders = "colloc|tests|scripts|benchmarks|problems|studies|results/curated"
    for path in re.findall(rf"`((?:{folders})/[\w/.]+\w)`", text):
        assert (ROOT / path).exists() or path == "studies/X.py", path
    for dotted in re.findall(r"`(colloc(?:\.\w+){2,})(?:\([^`]*\))?`", text):
        assert pkgutil.resolve_name(dotted) is not None, dotted


def test_the_problem_of_the_tutorial_is_solved_by_its_own_text(tmp_path, capsys):
    text = next(block for block in blocks("docs/tutorial.md", "python") if "PROBLEM" in block)
    file, solve = tmp_path / "mine.py", ["solve", f"{tmp_path}/mine.py", "--output", str(tmp_path)]
    file.write_text(text, encoding="utf-8")
    assert main([*solve, "--no-figure"]) == 0
    printed = capsys.readouterr().out
    assert "efficiency d/W  0.335" in printed
    assert "distance d      0.243" in printed
    file.write_text(text.replace("joint_limit=3.14", "joint_limit=4"), encoding="utf-8")
    assert main(solve) == 2
    quoted = next(block for block in blocks("docs/tutorial.md", "text") if "joint_limit" in block)
    assert capsys.readouterr().err.replace(f"{tmp_path}/", "") == quoted


def test_the_summary_quoted_in_the_tutorial_is_what_a_solve_says(three_link, solved):
    """Words to the letter and numbers to three digits, but for times and counts."""
    texts = blocks("docs/tutorial.md", "text")
    quoted = [block for block in texts if "distance d" in block or "gait   " in block]
    said = summary_lines(three_link, solved("three_link")[1])
    verbose = summary_lines(three_link, None, verbose=True)
    skipped = "three_link:", "all 15 checks", "upper bound", "saved"
    said = [same_lines(*pair, skipped) for pair in zip(quoted, [said, verbose], strict=True)]
    assert sum(said) == 7


def same_lines(block, printed, skipped, rel=1e-3):
    """How many lines of a block are among the printed ones, with such numbers."""
    checked, wordless = 0, re.compile(r"[-+]?\d+(?:\.\d+)?(?:e-?\d+)?")
    for line in filter(str.strip, block.splitlines()):
        if line.lstrip().startswith(skipped):
            continue
        same = next(x for x in printed if wordless.sub("", x) == wordless.sub("", line.rstrip()))
        for mine, theirs in zip(numbers(line), numbers(same), strict=True):
            assert mine == pytest.approx(theirs, rel=rel, abs=1e-3)
        checked += 1
    return checked


@pytest.mark.slow
def test_the_robot_of_the_readme_goes_as_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    commands, printed = blocks("README.md", "sh")[2], blocks("README.md", "text")[1]
    for line in re.findall(r"^colloc ((?:init|solve) [^#\n]*)", commands, re.MULTILINE):
        assert main(line.split()) == 0
    lines = capsys.readouterr().out.splitlines()
    assert same_lines(printed, lines, ("...", "from rest"), rel=0.01) == 2


def test_messages_quoted_in_troubleshooting_are_the_programs_own():
    sources = "\n".join(path.read_text(encoding="utf-8") for path in ROOT.glob("colloc/**/*.py"))
    words = re.sub(r'"\s*\n\s*f?"', "", sources)  # literals continued on the next line
    known = " ".join(re.sub(r"\{[^{}]*\}", "...", words).split())
    for message in re.findall(r"`([^`\n]+)`", read("docs/troubleshooting.md")):
        if len(message) > 17 and " " in message and message[0] != "-":
            for piece in map(str.strip, re.split(r"\.\.\.|\bN\b|mine\.py.*", message)):
                plain = re.sub(r"joint \d+ ", "joint ... ", piece)
                assert len(piece) <= 8 or piece in known or plain in known, (message, piece)


def test_the_manifest_of_the_curated_results_names_files_and_programs_that_are_there():
    manifest = json.loads(read("results/curated/manifest.json"))
    assert len(manifest) > 30
    for name, entry in manifest.items():
        assert (CURATED / name).exists(), name
        (program,) = re.findall(r"python -m ([\w.]+)", entry["command"])
        # what is archived is made by the program of an earlier commit, which is not here any more
        archived = re.fullmatch(r"[0-9a-f]{40}", entry.get("archived", ""))
        assert archived or is_program(program), name


def anchors(path):
    """The names that headings of a page can be reached by, as code hosts and the site make them."""
    headings = re.findall(r"^#+ (.*)", read(path), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_to_files_of_the_repository(page):
    """As a code host follows them; the site's strict build checks its own (`scripts.docs_site`)."""
    text = re.sub(r"```.*?```", "", read(page), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" not in target:
            name, _, anchor = target.partition("#")
            path = (page.parent / name).resolve() if name else page
            assert path.exists(), target
            assert not anchor or anchor in anchors(path), target


def rows_of(path):
    """Cells of all table rows of a page, with the header of their table."""
    header = []
    for line in read(path).splitlines():
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
    for header, row in rows_of(CURATED / name):
        for column, cell in zip(header, row, strict=True):
            yield from numbers(cell) if column in columns else ()


CLASSES = {3: "gait_classes.md", 4: "gait_classes_4.md", 5: "gait_classes_5.md"}


@pytest.mark.parametrize("page", ["docs/known.md", "docs/gait_classes.md"])
def test_efficiencies_are_those_of_the_curated_tables(page):
    """Of the table that a row links to, if it does; else of gallery, gaits without contact or
    bounds, or kept potentials."""
    gallery = json.loads(read("results/curated/gallery.json"))
    general = [row["efficiency"] for row in gallery.values() if "efficiency" in row]
    general += [kept["program"] for kept in json.loads(read("results/curated/potentials.json"))]
    for name in ("without_contact.md", "frontier.md", *CLASSES.values()):
        general += efficiencies(name)
    checked = 0
    for header, cells in rows_of(page):
        if header[0] in ("potential", "intervals"):  # how a bound was computed, once
            continue
        linked = re.findall(r"results/curated/(\w+\.md)\)", " ".join(cells))
        known = np.array([value for name in linked for value in efficiencies(name)] or general)
        for name, cell in zip(header, cells, strict=True):
            if re.fullmatch(r"[\d./ ]+", cell) and name != "gap":
                for value in re.findall(r"0\.\d{3,}", cell):
                    rounding = 0.51 * 10.0 ** -len(value.partition(".")[2])
                    assert np.abs(known - float(value)).min() <= rounding, (cells, value)
                    checked += 1
    assert checked >= 8


def class_row(name):
    """A row of the table of classes; of a polygon the axes of which the better is shown."""
    name = name.replace("at most", "<=")
    if name.endswith("no symmetry"):
        return [name]
    stem = f"{name.removesuffix(', better axis')}, bilateral"
    both = [f"{stem}, axis through a {axis}" for axis in ("corner", "side")]
    return both if name.endswith("better axis") else [stem]


def test_the_table_of_classes_is_that_of_the_curated_tables():
    curated, checked = {}, 0
    for links, name in CLASSES.items():
        for header, cells in rows_of(CURATED / name):
            value = re.match(r"0\.\d+", cells[header.index("efficiency")])  # else none is certified
            # the first table is the isotropic one
            curated.setdefault((links, cells[0]), float(value[0]) if value else None)
    for header, (name, *cells) in rows_of("docs/gait_classes.md"):
        if header[1:] == ["three links", "four", "five"] and header[0].startswith("class"):
            for links, cell in zip((3, 4, 5), cells, strict=True):
                values = [curated.get((links, row)) for row in class_row(name)]
                known = [value for value in values if value is not None]
                assert bool(cell) == bool(known), (name, links)
                # both are rounded
                assert not known or abs(float(cell) - max(known)) < 5.6e-4, (name, links)
                checked += 1
    assert checked == 36


RUN_ELSEWHERE = {"own_body.md", "own_gait_class.md"}
"""Pages that `tests/test_own_parts.py` runs."""
LONG = {"scripts.md", "slopes.md", "report.md", "robot.md", "motors.md"}
WITH_PYTHON = [page for page in PAGES if blocks(page, "python") and page.name not in RUN_ELSEWHERE]
RUN = [
    pytest.param(page, id=page.stem, marks=[pytest.mark.slow] * (page.name in LONG))
    for page in WITH_PYTHON
]


@pytest.fixture
def results_of_a_reader(three_link, tmp_path, monkeypatch):
    """The files that pages speak of and that their commands would have made, in a folder."""
    monkeypatch.chdir(tmp_path)
    for name in ("mine", "three_link"):
        save(three_link, f"results/{name}.h5")
    assert main(["export", "results/mine.h5", "--period", "4"]) == 0
    sides = {"mu_t": [0.5, 1.0], "mu_b": [1.0, 2.0], "symmetry": ["bilateral", "none"]}
    values = xarray.DataArray(np.ones((2, 2, 2)), sides, tuple(sides))
    path = "results/friction_plane.nc"
    values.to_dataset(name="efficiency").to_netcdf(path, engine="h5netcdf")


@pytest.mark.parametrize("page", RUN)
def test_the_python_of_a_page_runs_and_prints_what_the_page_says(page, results_of_a_reader, capsys):
    """In one namespace, with no name that the page does not define: as a reader types it."""
    capsys.readouterr()
    names = {"__name__": "__main__"}
    pairs = r"^```python[^\n]*\n(.*?)^```(?:\s+```text\n(.*?)^```)?"
    for program, quoted in re.findall(pairs, read(page), MULTI):
        optional = r"^(?:import|from) (pandas|xarray|distributed)"
        for module in re.findall(optional, program, re.MULTILINE):
            pytest.importorskip(module)
        exec(compile(program, page.name, "exec"), names)
        said = capsys.readouterr().out
        assert not quoted or len(numbers(said)) == len(numbers(quoted)), (said, quoted)
        for mine, theirs in zip(numbers(quoted), numbers(said), strict=False):
            assert theirs == pytest.approx(mine, rel=1e-3, abs=2e-3)


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


def unsigned(text):
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
        assert unsigned(said(after)) == pytest.approx(unsigned(said(before)), rel=1e-3, abs=2e-3)
    assert {path.name for path in tmp_path.iterdir()} >= {"mine.h5", "mine.gif"}
