"""What a person who imports colloc holds: light, complete, documented by examples that run, and
clear about mistakes."""

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
from colloc.gaits.fitted_gait import fitted_gait

ROOT = Path(__file__).resolve().parents[1]
HEAVY = ("casadi", "matplotlib", "h5py", "scipy", "xarray", "pandas", "numpy", "inspect")


def test_importing_colloc_loads_nothing_heavy_and_shows_every_public_name():
    code = (
        f"import sys, colloc; print([m for m in {HEAVY!r} if m in sys.modules], "
        f"set(colloc.__all__) <= set(dir(colloc)))"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout
        == "[] True\n"
    )


def test_stub_and_face_say_the_same():
    stub = ast.parse((ROOT / "colloc/__init__.pyi").read_text(encoding="utf-8")).body
    assert {
        alias.name: node.module
        for node in stub
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    } == colloc._HOME


def test_completion_offers_the_public_names_and_nothing_else():
    offered = {name for name in dir(colloc) if not name.startswith("__")}
    assert offered == set(colloc.__all__)
    assert "__version__" in dir(colloc)
    stated = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "version"
    ]
    assert colloc.__version__ == stated


@pytest.mark.parametrize("name", colloc.__all__)
def test_every_public_docstring_has_an_example(name):
    home = importlib.import_module(colloc._HOME[name])  # colloc.solve may be the module by now
    assert ">>> " in (getattr(home, name).__doc__ or "")


WITH_EXAMPLES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in sorted((ROOT / "colloc").glob("*/*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_the_examples_of_the_docstrings_run(module, monkeypatch):
    monkeypatch.chdir(ROOT)
    ended = doctest.testmod(
        importlib.import_module(module), optionflags=doctest.NORMALIZE_WHITESPACE
    )
    assert ended.attempted > 0
    assert ended.failed == 0


def test_the_module_behind_python_m_is_also_the_function():
    """``import colloc.solve`` binds the module where ``colloc.solve(problem)`` is expected."""
    module = importlib.import_module("colloc.solve")
    with pytest.raises(colloc.ProblemError, match=r"there is no problem file nothing\.py"):
        module("nothing.py")
    with pytest.raises(colloc.ProblemError, match=r"there is no problem file nothing\.py"):
        colloc.solve("nothing.py")


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: colloc.Problem("x", frction=1), "did you mean friction"),
        (lambda: colloc.Problem(), "Problem needs name"),
        (lambda: colloc.Friction(mu=1), "did you mean mu_t, mu_f or mu_b"),
        (lambda: colloc.Harmonic(harmonic=2), "did you mean harmonics"),
        (lambda: colloc.Problem("x").with_(intervalls=3), "did you mean intervals"),
        (lambda: colloc.Polygon(colour=1), "it takes corners, symmetry, axis"),
        (
            lambda: colloc.solve(5),
            "problem must be a Problem, text or a path, not 5",
        ),
        (
            lambda: colloc.solve(colloc.Problem("x"), starts=0),
            "starts must be a whole number of at least 1",
        ),
        (
            lambda: colloc.solve(colloc.Problem("x"), seconds=np.nan),
            "seconds must be a number, not nan",
        ),
    ],
)
def test_a_wrong_argument_is_named_with_what_is_right(made, said):
    with pytest.raises(colloc.ProblemError, match=said):
        made()


def test_a_gait_stands_where_a_path_is_asked_for(three_link):
    problem, certificate = three_link.problem, three_link.certificate
    measured = colloc.replay(problem.body, problem.friction, three_link.gait, problem.delta)
    assert (
        abs(measured.efficiency - certificate.efficiency)
        <= certificate.efficiency_error + measured.error
    )


def test_a_solution_becomes_a_figure_a_page_a_film_and_tables(three_link, tmp_path):
    assert len(three_link.plot().axes) == 5
    assert three_link.plot()._repr_png_().startswith(b"\x89PNG")  # by which a notebook shows it
    assert (
        three_link.report(tmp_path / "x.html")
        .read_text(encoding="utf-8")
        .startswith("<!DOCTYPE html>")
    )
    axes = Figure().add_subplot()
    assert three_link.plot(ax=axes) is axes
    assert axes.collections  # the path
    for panel in ("power", "mesh", "shape-1-2"):
        axes = Figure().add_subplot()
        assert three_link.plot(axes, panel) is axes
    with pytest.raises(
        colloc.ProblemError,
        match="there is no panel 'pwoer'; there are gait, filmstrip, lab, angles",
    ):
        three_link.plot(axes, "pwoer")
    with pytest.raises(
        colloc.ProblemError, match=r"ax must be a matplotlib Axes .* not 'x.png'; .*savefig"
    ):
        three_link.plot("x.png")
    assert (
        three_link.animate(tmp_path / "x.gif", periods=1, seconds=0.2, fps=10, width=200)
        .stat()
        .st_size
        > 1000
    )
    with pytest.raises(colloc.ProblemError, match=r"should end in \.gif or \.mp4"):
        three_link.animate(tmp_path / "x.avi")
    t = np.array([0.0, 0.3])
    dataset, frame = three_link.to_xarray(t), three_link.to_dataframe(t)
    motion = three_link.sample(t)
    np.testing.assert_array_equal(dataset.joint_angles.sel(joint=2), motion.angles[1])
    np.testing.assert_array_equal(dataset.centre.sel(axis="x"), motion.centre[0])
    np.testing.assert_array_equal(frame.tail_velocity_omega, motion.z[2])
    assert dataset.power.attrs["units"] == "weight length/period"
    assert dataset.attrs["efficiency"] == three_link.certificate.efficiency


def test_labelled_angles_come_back_as_the_gait_they_are_of(three_link):
    angles = three_link.to_xarray().joint_angles
    back = fitted_gait(
        angles.transpose(), 2, period=1.0
    ).gait  # whatever the order of their dimensions
    t = np.linspace(0.0, 1.0, 50)
    np.testing.assert_allclose(back.angles(t), three_link.gait.angles(t), atol=1e-9)


def test_a_gait_is_exported_from_python_as_by_the_command(three_link, tmp_path, capsys):
    from colloc.commands.main import main

    colloc.save(three_link, tmp_path / "x.h5")
    for name, settings in (("x.csv", {"period": 4}), ("x.json", {"max_speed": [2, 1], "rate": 20})):
        stated = three_link.export(tmp_path / name, **settings)
        assert stated["period_s"] * stated["rate_hz"] == stated["samples_per_period"]
        by_hand = (tmp_path / name).read_text(encoding="utf-8")
        words = [
            f"--{key.replace('_', '-')} {' '.join(map(str, np.ravel(value)))}"
            for key, value in settings.items()
        ]
        assert (
            main(
                [
                    "export",
                    str(tmp_path / "x.h5"),
                    "--output",
                    str(tmp_path / name),
                    *" ".join(words).split(),
                ]
            )
            == 0
        )
        assert (tmp_path / name).read_text(encoding="utf-8") == by_hand
    (tmp_path / "x.csv").unlink()
    for name, settings, words in (
        ("x.txt", {}, r"should end in \.csv or \.json"),
        ("x.csv", {"periods": 0}, "periods must be a whole number of at least 1"),
        ("x.csv", {"length": 1.0}, "both the length and the mass"),
        ("x.csv", {"mass": 2.0}, "both the length and the mass"),
    ):
        with pytest.raises(colloc.ProblemError, match=words):
            three_link.export(tmp_path / name, period=4, **settings)
        assert not (tmp_path / name).exists()


def test_a_missing_library_is_named(three_link, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        colloc.CollocError, match=r"this needs pandas, which is not installed: pip install pandas"
    ):
        three_link.to_dataframe()


def test_as_many_starts_are_tried_as_are_asked_for_else_as_the_file_states(tmp_path, monkeypatch):
    from colloc.commands.main import main

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
            assert (
                main(["solve", str(path), "--output", str(to), *(f"--starts={n}" for n in given)])
                == 2
            )
    assert asked == [None] * 3 + [5] * 3 + [3] * 3 + [5] * 3


def test_progress_is_told_and_printed_only_if_asked(capsys):
    problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    told, outcomes = [], []
    solution = colloc.solve(problem, starts=1, progress=told.append)
    assert [news.stage for news in told][-2:] == ["confirm", "certify"]
    assert told[-1].best.value == pytest.approx(solution.value, rel=1e-3)
    found = colloc.multistart(problem, 2, progress=outcomes.append)
    assert {o.start for o in outcomes} == {0, 1}
    assert found.optima[0].best.efficiency == max(o.efficiency for o in outcomes)
    assert capsys.readouterr().out == ""
    colloc.solve(problem, starts=1, verbose=True)
    assert len(capsys.readouterr().out.splitlines()) == len(told)


def test_an_archive_is_gone_on_with_and_its_starts_are_opened(tmp_path, capsys):
    from colloc.commands.main import main

    problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    path, again = tmp_path / "quick.starts.h5", []
    first = colloc.multistart(problem, 2, archive=path)
    colloc.multistart(problem, 2, archive=path, progress=again.append)
    assert again == []
    assert main(["open", str(path)]) == 0
    assert f"{first.optima[0].best.efficiency:.6f}" in capsys.readouterr().out
    assert main(["open", str(path), "--start", "1", "--quiet"]) == 0
    opened = colloc.load(tmp_path / "quick.start-1.h5")
    assert opened.success
    assert opened.efficiency == pytest.approx(first.outcomes[1].efficiency, rel=1e-4)
    assert main(["open", str(path), "--start", "7"]) == 2
    assert "holds no start 7" in capsys.readouterr().err
    assert main(["open", str(tmp_path / "other.h5")]) == 2
    assert "colloc multistart makes one" in capsys.readouterr().err
