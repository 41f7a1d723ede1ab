"""The documentation says what is there: commands and options exist, quoted messages are the program's, code is Python."""

import ast
import contextlib
import importlib
import io
import re
from pathlib import Path

import numpy as np
import pytest

from colloc.commands.main import SUBCOMMANDS
from colloc.gaits.harmonic import ellipse

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted((ROOT / "docs").rglob("*.md"))
SOURCES = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "colloc").rglob("*.py"))


def blocks(page, language):
    return re.findall(rf"^```{language}[^\n]*\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def options_of(command):
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        importlib.import_module(f"colloc.commands.{SUBCOMMANDS[command][0]}").main(["--help"])
    return set(re.findall(r"--[a-z][a-z-]*", text.getvalue()))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_and_options_in_the_pages_exist(page):
    for block in blocks(page, "sh"):
        for command, rest in re.findall(r"^(?:\. )?colloc ([a-z]+)([^#\n]*)", block, re.MULTILINE):
            if command in SUBCOMMANDS:
                assert set(re.findall(r"--[a-z][a-z-]*", rest)) <= options_of(command), (page.name, command, rest)
            else:
                assert command == "sweep", (page.name, command)
        for module in re.findall(r"python3? -m ([\w.]+)", block):
            if module.startswith(("colloc.", "scripts.", "benchmarks.")):
                assert (ROOT / (module.replace(".", "/") + ".py")).exists(), (page.name, module)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_python_in_the_pages_parses_and_imports_what_exists(page):
    for block in blocks(page, "python"):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("colloc"):
                module = importlib.import_module(node.module)
                assert all(hasattr(module, alias.name) for alias in node.names), (page.name, node.module)


def test_the_problem_of_the_tutorial_is_solved_by_its_own_text(tmp_path, capsys):
    from colloc.commands.solve import main

    text = next(block for block in blocks(ROOT / "docs/tutorial.md", "python") if "PROBLEM" in block)
    (tmp_path / "mine.py").write_text(text, encoding="utf-8")
    assert main([str(tmp_path / "mine.py"), "--output", str(tmp_path), "--no-figure"]) == 0
    printed = capsys.readouterr().out
    assert "efficiency d/W  0.335" in printed
    assert "distance d      0.243" in printed

    (tmp_path / "mine.py").write_text(text.replace("joint_limit=3.14", "joint_limit=4"), encoding="utf-8")
    assert main([str(tmp_path / "mine.py"), "--output", str(tmp_path)]) == 2
    said = capsys.readouterr().err.replace(str(tmp_path) + "/", "")
    quoted = next(block for block in blocks(ROOT / "docs/tutorial.md", "text") if "joint_limit" in block)
    assert said == quoted


def test_messages_quoted_in_troubleshooting_are_the_programs_own():
    text = (ROOT / "docs/troubleshooting.md").read_text(encoding="utf-8")
    quoted = [part for part in re.findall(r"`([^`\n]+)`", text) if len(part) > 17 and " " in part and part[0] != "-"]
    words = re.sub(r'"\s*\n\s*f?"', "", SOURCES)  # literals continued on the next line
    known = " ".join(re.sub(r"\{[^{}]*\}", "...", words).split())
    for message in quoted:
        pieces = [piece.strip() for piece in re.split(r"\.\.\.|\bN\b|mine\.py.*", message) if len(piece.strip()) > 8]
        for piece in pieces:
            plain = re.sub(r"joint \d+ ", "joint ... ", piece)
            assert piece in known or plain in known, (message, piece)


def test_readme_and_tutorial_name_every_documented_command():
    tutorial = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")
    for name in ("init", "solve", "report", "animate", "verify", "multistart", "export", "compare"):
        assert f"colloc {name}" in tutorial


@pytest.mark.slow
def test_the_scripts_page_runs_from_top_to_bottom(tmp_path, monkeypatch):
    """Every block in one namespace; what the text leaves to the reader (shapes, rates, a path) is given here."""
    monkeypatch.chdir(tmp_path)
    t = np.linspace(0.0, 1.0, 50)
    gait = ellipse(0.0, 2.0, 1.0)
    names = {"angles": gait.angles(t), "rates": gait.rates(t), "path": lambda t: (gait.angles(t), gait.rates(t))}
    for block in blocks(ROOT / "docs/howto/scripts.md", "python"):
        exec(compile(block, "scripts.md", "exec"), names)
    assert names["solution"].status == "solved"
    assert names["z"].shape == (3, 50)
    assert names["measured"].efficiency > 0.1
    assert [s.problem.friction.mu_t for s in names["solutions"]] == [1.7, 2, 3, 5]
    assert (tmp_path / "results/mine.h5").exists()
