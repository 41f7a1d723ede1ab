"""What `import colloc` gives: light, complete, with examples that run, clear about mistakes."""

import ast
import doctest
import importlib
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import colloc
from colloc.commands.main import main
from colloc.gaits.fitted_gait import fitted_gait

ROOT = Path(__file__).resolve().parents[1]
HEAVY = ("casadi", "matplotlib", "h5py", "scipy", "xarray", "pandas", "numpy", "inspect")
WITH_EXAMPLES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in sorted((ROOT / "colloc").glob("*/*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]
LONG = ("studies.solve", "studies.families", "search.evaluate", "verification.differential_motion")
QUICK = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)


def python(code):
    command = [sys.executable, "-c", code]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_importing_colloc_loads_nothing_heavy_and_shows_every_public_name():
    shown = "set(colloc.__all__) <= set(dir(colloc))"
    loaded = "[m for m in HEAVY if m in sys.modules]"
    code = f"import sys, colloc; HEAVY = {HEAVY!r}; print({loaded}, {shown})"
    assert python(code) == "[] True\n"
    code = f"import sys, colloc.commands.main; HEAVY = {HEAVY[:-1]!r}; print({loaded})"
    assert python(code) == "[]\n"
    code = "import sys, colloc.search.solve, colloc.search.evaluate; print({!r} in sys.modules)"
    assert python(code.format("scipy.optimize")) == "False\n"


def test_completion_offers_the_public_names_and_nothing_else():
    assert {name for name in dir(colloc) if not name.startswith("__")} == set(colloc.__all__)
    stub = ast.parse((ROOT / "colloc/__init__.pyi").read_text(encoding="utf-8")).body
    imports = [node for node in stub if isinstance(node, ast.ImportFrom)]
    homes = {alias.name: node.module for node in imports for alias in node.names}
    assert homes == colloc._HOME
    assert sorted(homes) == list(colloc.__all__)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert colloc.__version__ == project["version"]


@pytest.mark.parametrize("name", colloc.__all__)
def test_every_public_name_has_an_example_that_is_run(name):
    home = importlib.import_module(colloc._HOME[name])  # colloc.solve may be the module by now
    assert ">>> " in (getattr(home, name).__doc__ or "")
    assert colloc._HOME[name] in WITH_EXAMPLES


@pytest.mark.parametrize(
    "module",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name.removeprefix("colloc.") in LONG))
        for name in WITH_EXAMPLES
    ],
)
def test_the_examples_of_the_docstrings_run(module, monkeypatch):
    monkeypatch.chdir(ROOT)
    code = importlib.import_module(module)
    ended = doctest.testmod(code, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert ended.attempted > 0
    assert ended.failed == 0


def test_the_module_behind_python_m_is_also_the_function():
    """``import colloc.solve`` binds the module where ``colloc.solve(problem)`` is expected."""
    for solve in (importlib.import_module("colloc.solve"), colloc.solve):
        with pytest.raises(colloc.ProblemError, match=r"there is no problem file nothing\.py"):
            solve("nothing.py")


def test_a_solution_becomes_a_figure_a_page_a_film_and_tables(three_link, tmp_path):
    assert len(drawn := three_link.plot().axes) == 5
    assert "against friction" in drawn[-1].get_title("left")
    assert three_link.plot()._repr_png_().startswith(b"\x89PNG")  # by which a notebook shows it
    page = three_link.report(tmp_path / "x.html").read_text(encoding="utf-8")
    assert page.startswith("<!DOCTYPE html>")
    axes = Figure().add_subplot()
    assert three_link.plot(ax=axes) is axes
    assert axes.collections  # the path
    for panel in ("power", "mesh", "shape-1-2"):
        axes = Figure().add_subplot()
        assert three_link.plot(axes, panel) is axes
    there = "there is no panel 'pwoer'; there are gait, filmstrip, lab, angles"
    for words, said in ((axes, "pwoer"), there), (("x.png",), r"ax must be .* not 'x.png'"):
        with pytest.raises(colloc.ProblemError, match=said):
            three_link.plot(*words)
    film = three_link.animate(tmp_path / "x.gif", periods=1, seconds=0.2, fps=10, width=200)
    assert film.stat().st_size > 1000
    with pytest.raises(colloc.ProblemError, match=r"should end in \.gif or \.mp4"):
        three_link.animate(tmp_path / "x.avi")
    t = np.array([0.0, 0.3])
    dataset, frame = three_link.to_xarray(t), three_link.to_dataframe(t)
    motion = three_link.sample(t)
    np.testing.assert_array_equal(dataset.joint_angles.sel(joint=2), motion.angles[1])
    np.testing.assert_array_equal(dataset.centre.sel(axis="x"), motion.centre[0])
    np.testing.assert_array_equal(frame.tail_velocity_omega, motion.z[2])
    units = {"power": "weight length/period", "joint_rates": "rad/period", "centre": "length"}
    assert {name: dataset[name].attrs["units"] for name in units} == units
    assert dataset.attrs["efficiency"] == three_link.certificate.efficiency
    # labelled angles come back as the gait they are of, whatever the order of their dimensions
    back = fitted_gait(three_link.to_xarray().joint_angles.transpose(), 2, period=1.0).gait
    t = np.linspace(0.0, 1.0, 50)
    np.testing.assert_allclose(back.angles(t), three_link.gait.angles(t), atol=1e-9)


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("x.csv", {"period": 4}, ["--period", "4s"]),
        ("x.json", {"max_speed": [2, 1], "rate": 20}, ["--max-speed", "2", "1", "--rate", "20"]),
    ],
)
def test_a_gait_is_exported_by_python_as_by_commands(name, settings, words, three_link, tmp_path):
    colloc.save(three_link, tmp_path / "x.h5")
    stated = three_link.export(tmp_path / name, **settings)
    assert stated["period_s"] * stated["rate_hz"] == stated["samples_per_period"]
    by_hand = (tmp_path / name).read_text(encoding="utf-8")
    assert main(["export", f"{tmp_path}/x.h5", "--output", f"{tmp_path}/{name}", *words]) == 0
    assert (tmp_path / name).read_text(encoding="utf-8") == by_hand


def test_a_missing_library_is_named(three_link, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    needs = r"this needs pandas, which is not installed: pip install pandas"
    with pytest.raises(colloc.CollocError, match=needs):
        three_link.to_dataframe()


def test_as_many_starts_are_tried_as_are_asked_for_else_as_the_file_states(tmp_path, monkeypatch):
    asked = []

    def stopping(problem, starts, *_):
        asked.append(starts)
        raise colloc.ProblemError("enough")

    monkeypatch.setattr("colloc.search.solve.explore", stopping)
    path, to = tmp_path / "p.py", tmp_path / "p.h5"
    for stated in ("", "\nSTARTS = 3"):
        path.write_text(f"from colloc import *\nPROBLEM = Problem('p'){stated}\n", encoding="utf-8")
        for given in ((), (5,)):
            for output in (None, to):
                with pytest.raises(colloc.ProblemError, match="enough"):
                    colloc.solve(path, *given, output=output)
            words = ["solve", str(path), "--output", str(to), *(f"--starts={n}" for n in given)]
            assert main(words) == 2
    assert asked == [None] * 3 + [5] * 3 + [3] * 3 + [5] * 3
    for given, tried in (([], 3), (["--starts=5"], 5)):
        assert main(["steer", str(path), "--output", str(tmp_path / "p.json"), *given]) == 2
        assert asked[-1] == tried


def test_progress_is_told_and_printed_only_if_asked(capsys):
    told, outcomes = [], []
    solution = colloc.solve(QUICK, starts=4, progress=told.append)
    assert [news.stage for news in told][-2:] == ["confirm", "certify"]
    assert told[-1].best.value == pytest.approx(solution.value, rel=1e-3)
    found = colloc.multistart(QUICK, 2, progress=outcomes.append)
    assert {o.start for o in outcomes} == {0, 1}
    assert found.optima[0].best.efficiency == max(o.efficiency for o in outcomes)
    for start, known in ((None, found.optima[0].best), (1, outcomes[1])):
        assert found.solution(start).efficiency == pytest.approx(known.efficiency, rel=1e-4)
    assert capsys.readouterr().out == ""
    slippery = QUICK.with_(friction=colloc.Friction(10, 10, 10))  # values in its own units
    colloc.solve(slippery, starts=4, verbose=True)
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == len(told)
    assert printed[4].startswith("explore, 4 of 4; best d/W = 0.02")


@pytest.mark.slow
def test_an_archive_is_gone_on_with_and_its_starts_are_opened(tmp_path, capsys):
    path, again = tmp_path / "quick.starts.h5", []
    first = colloc.multistart(QUICK, 2, archive=path)
    colloc.multistart(QUICK, 2, archive=path, progress=again.append)
    assert again == []
    assert main(["multistart", str(path)]) == 0
    assert f"{first.optima[0].best.efficiency:.6f}" in capsys.readouterr().out
    assert main(["multistart", str(path), "--start", "1", "--quiet"]) == 0
    opened = colloc.load(tmp_path / "quick.start-1.h5")
    assert opened.success
    assert opened.efficiency == pytest.approx(first.outcomes[1].efficiency, rel=1e-4)
    assert main(["multistart", str(path), "--start", "7"]) == 2
    assert "holds no start 7" in capsys.readouterr().err
    ignored = ["--mesh", "30", "--starts", "5", "--bound"]
    assert main(["multistart", str(path), "--start", "1", *ignored]) == 2
    assert "leave --mesh, --starts, --bound out" in capsys.readouterr().err
