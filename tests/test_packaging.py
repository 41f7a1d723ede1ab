"""Versions, requirements and the command are the same in all that packages are made from."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
STATED = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
NEEDED = dict(requirement.split(">=") for requirement in STATED["dependencies"])
RECIPE = (ROOT / "recipe/recipe.yaml").read_text(encoding="utf-8")
CONDA_NAMES = {"matplotlib-base": "matplotlib"}


def listed(part):
    """The entries of a list in the recipe, by the name above it."""
    block = re.search(rf"^  {part}:\n((?:    - .*\n)+)", RECIPE, re.MULTILINE)
    return [line.strip().removeprefix("- ") for line in block[1].splitlines()]


def numbers(version):
    return [int(part) for part in version.split(".")]


def test_the_recipe_needs_what_the_wheel_needs():
    needed = dict(entry.split(" >=") for entry in listed("run"))
    assert needed.pop("python") == STATED["requires-python"].removeprefix(">=")
    assert {CONDA_NAMES.get(name, name): version for name, version in needed.items()} == NEEDED


def test_the_recipe_builds_and_starts_what_the_wheel_does():
    assert f'version: "{STATED["version"]}"' in RECIPE
    assert f"summary: {STATED['description']}" in RECIPE
    assert f"colloc = {STATED['scripts']['colloc']}" in RECIPE
    assert (ROOT / "problems/three_link.py").exists()
    assert (ROOT / "LICENSE").exists()


def test_the_oldest_versions_that_are_tested_are_those_that_are_stated():
    """The wheel is installed with these by .ci/pythons."""
    lines = (ROOT / ".ci/lowest.txt").read_text(encoding="utf-8").splitlines()
    lowest = dict(line.split("==") for line in lines if not line.startswith("#"))
    for name, version in NEEDED.items():
        stated, tested = numbers(version), numbers(lowest[name])
        assert tested[: len(stated)] == stated, name
        assert not any(tested[len(stated) :]), name


def test_binder_takes_a_python_that_is_supported_and_installs_the_clone():
    """For docs/notebook.ipynb; requirements are installed from the root of the clone."""
    python = (ROOT / "binder/runtime.txt").read_text(encoding="utf-8").strip()
    assert numbers(python.removeprefix("python-")) >= numbers(STATED["requires-python"][2:])
    assert (ROOT / "binder/requirements.txt").read_text(encoding="utf-8") == ".\n"
