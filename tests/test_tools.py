"""Each module of scripts/ and benchmarks/ imports without doing anything, and explains itself."""

import ast
import importlib
import runpy
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("scripts", "scripts/paper", "scripts/models", "benchmarks")
MODULES = sorted(
    path for folder in FOLDERS for path in (ROOT / folder).glob("*.py") if path.stat().st_size
)
OPTIONAL = {"docs_site": "mkdocs", "play_in_mujoco": "mujoco"}
"""Modules that need more than the tests do."""
EXAMPLES = ("continue_delta", "continue_epsilon")
"""A dozen lines without a function, to be read."""
LONGEST_IMPORT = 5.0
"""Processor seconds; the libraries take one or two, the shortest of the studies ten."""


def needed(path):
    if path.stem in OPTIONAL:
        pytest.importorskip(OPTIONAL[path.stem])


def name_of(path):
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_importing_a_module_does_nothing_else(path, tmp_path, monkeypatch, capfd):
    needed(path)
    monkeypatch.chdir(tmp_path)
    before = time.process_time()
    # a fresh run of the file, whoever imported the module before
    runpy.run_path(str(path), run_name="imported")
    spent = time.process_time() - before
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())
    assert spent < LONGEST_IMPORT


def starts_itself(path):
    """Whether a module does something when it is run."""
    last = ast.parse(path.read_text(encoding="utf-8")).body[-1:]
    return bool(last) and isinstance(last[0], ast.If) and "__main__" in ast.unparse(last[0].test)


PROGRAMS = [path for path in MODULES if starts_itself(path) and path.stem not in EXAMPLES]


@pytest.fixture
def ended(tmp_path, monkeypatch, capfd):
    """A function from a program and an option to its exit code, output and errors."""

    def run(path, option):
        needed(path)
        module = importlib.import_module(name_of(path))
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", [str(path), option])
        with pytest.raises(SystemExit) as ended:
            module.main()
        assert not list(tmp_path.iterdir())
        return ended.value.code, *capfd.readouterr()

    return run


@pytest.mark.parametrize("path", PROGRAMS, ids=name_of)
def test_a_program_answers_help_before_it_does_anything_and_refuses_what_it_does_not_understand(
    path, ended
):
    code, said, complaints = ended(path, "--help")
    assert (code, complaints) == (0, "")
    assert said.startswith("usage:")
    assert len(said.split()) > 10, "says nothing but its usage"
    code, _, complaints = ended(path, "--no-such-option")
    assert code == 2
    assert complaints.startswith("usage:")
