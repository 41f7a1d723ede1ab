"""Commands end in a sentence and an exit code: early Ctrl-C, full disks, encodings, odd names,
broken caches."""

import io
import json
import multiprocessing
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from colloc.bounds.optimality_gap import upper_bound
from colloc.commands import ending
from colloc.commands.ending import exit_code
from colloc.commands.main import main as colloc
from colloc.commands.summary import summary_lines
from colloc.gaits import gait_fields
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import read_problem_file
from colloc.mechanics.chain import Chain
from colloc.results.kept import save_result
from colloc.results.store import load, save
from colloc.system.errors import ProblemError, StoreError
from colloc.system.row_file import CACHE, put_rows

QUICK = """
from colloc import *
PROBLEM = Problem("quick", ellipse(0.0, 1.4, 0.8), gait=Harmonic(1, "bilateral"), delta=0.3, delta_start=0.3, intervals=12)
"""
needs_full = pytest.mark.skipif(
    not os.path.exists("/dev/full"), reason="no device that is always full"
)


@pytest.fixture
def result(three_link, tmp_path):
    return save(three_link, tmp_path / "three_link.h5")


@pytest.fixture
def quick(tmp_path):
    (tmp_path / "quick.py").write_text(QUICK, encoding="utf-8")
    return str(tmp_path / "quick.py")


def command(*words, **options):
    """A run of the installed command in a process of its own, its output as bytes."""
    return subprocess.run(
        [sys.executable, "-m", "colloc", *map(str, words)],
        capture_output=True,
        check=False,
        **options,
    )


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("module", ["numpy", "scipy", "casadi"])
def test_ctrl_c_while_libraries_are_imported_ends_without_a_traceback(module, quick, tmp_path):
    """The signal comes from inside the import, as early as that library is asked for."""
    (tmp_path / "library").mkdir()
    (tmp_path / "library" / f"{module}.py").write_text(
        "import signal\nsignal.raise_signal(signal.SIGINT)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "library")}
    done = command("solve", quick, "--output", f"{tmp_path}/", env=environment)
    assert done.returncode == 130
    assert done.stderr.decode() == "colloc: interrupted; nothing was written.\n"


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize(
    "words", [["colloc", "solve"], ["colloc.solve"], ["colloc", "verify", "--json"]]
)
@pytest.mark.parametrize("module", ["argparse", "dataclasses"])
def test_ctrl_c_before_the_command_is_known_ends_without_a_traceback(module, words, tmp_path):
    """These are what the modules that every command begins with import first."""
    (tmp_path / f"{module}.py").write_text("import signal\nsignal.raise_signal(signal.SIGINT)\n")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-m", *words, "x"], capture_output=True, check=False, env=environment
    )
    assert done.returncode == 130
    assert done.stderr.decode() == "colloc: interrupted; nothing was written.\n"
    if "--json" in words:
        assert json.loads(done.stdout)["exit_code"] == 130


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_ctrl_c_after_the_end_does_not_change_it(tmp_path):
    code = (
        "import atexit, signal, sys\nfrom colloc.__main__ import start\n"
        "atexit.register(lambda: signal.raise_signal(signal.SIGINT))\nstart(['init', sys.argv[1]])"
    )
    words = [sys.executable, "-c", code, str(tmp_path / "x.py")]
    done = subprocess.run(words, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert (tmp_path / "x.py").exists()


@needs_full
@pytest.mark.parametrize("words", [["verify"], ["compare"]])
@pytest.mark.parametrize("buffered", [True, False])
def test_a_full_disk_behind_standard_output_is_said_once(words, buffered, result):
    files = [result] * (2 if words == ["compare"] else 1)
    environment = {**os.environ, "PYTHONUNBUFFERED": "" if buffered else "1"}
    with open("/dev/full", "wb") as full:
        done = subprocess.run(
            [sys.executable, "-m", "colloc", *words, *map(str, files)],
            stdout=full,
            stderr=subprocess.PIPE,
            env=environment,
        )
    assert done.returncode == 2
    assert (
        done.stderr.decode()
        == "colloc: cannot read or write the output: No space left on device.\n"
    )


@pytest.mark.parametrize(
    ("encoding", "shown"), [("ascii", "cos 2 pi t"), ("cp1252", "cos 2 pi t"), ("utf-8", "cos 2πt")]
)
def test_letters_that_an_encoding_lacks_are_printed_as_words(
    encoding, shown, three_link, monkeypatch
):
    printed = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(printed, encoding=encoding))
    assert (
        exit_code(lambda: print("\n".join(summary_lines(three_link, None, verbose=True))) or 0) == 0
    )
    assert shown in printed.getvalue().decode(encoding)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["animate", "RESULT", "--output", "x.avi"], "x.avi should end in .gif or .mp4"),
        (["animate", "RESULT", "--format", "mp4", "--output", "x.gif"], "x.gif should end in .mp4"),
        (
            ["export", "RESULT", "--period", "4", "--output", "x.xlsx"],
            "x.xlsx should end in .csv or .json",
        ),
        (["report", "RESULT", "--output", "x.htm"], "x.htm should end in .html"),
        (["solve", "QUICK", "--output", "out.txt"], "out.txt should end in .h5"),
        (["solve", "QUICK", "--output", "x" * 300 + ".h5"], "too long"),
        (["solve", "QUICK", "--output", "x" * 300], "File name too long"),
        (["solve", "x" * 300], "there is no problem file"),
        (["solve", "QUICK", "--delta", "1e-30"], "delta must be at least 1e-14"),
        (["solve", "RESULT"], "is a results file (HDF5), not a problem file"),
        (["verify", "y" * 300], "File name too long"),
    ],
)
def test_what_cannot_be_meant_is_refused_and_nothing_is_made(
    words, message, quick, result, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    assert colloc([{"RESULT": str(result), "QUICK": quick}.get(word, word) for word in words]) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.count("\n") == 1
    assert printed.out == ""
    assert sorted(tmp_path.iterdir()) == before


def test_a_start_of_another_body_is_named(three_link, tmp_path, capsys):
    start = save(three_link, tmp_path / "three.h5")
    assert (
        colloc(
            ["solve", "problems/four_link.py", "--start", str(start), "--output", f"{tmp_path}/"]
        )
        == 2
    )
    assert f"the gait of {start} cannot be the guess: guess has 2 joints" in capsys.readouterr().err


def test_a_cache_of_bounds_that_cannot_be_written_costs_a_warning_and_not_the_bound(
    quick, tmp_path, monkeypatch
):
    problem = read_problem_file(quick).problem
    # anything with fields
    monkeypatch.setattr("colloc.bounds.sampled.compute_bound", lambda *_: problem.friction)
    (tmp_path / "file").write_text("in the way of the folder")
    with pytest.warns(UserWarning, match="cannot write .*The bound is not kept"):
        assert upper_bound(problem, tmp_path / "file" / "below", compute=True) is problem.friction


def test_a_broken_cache_of_bounds_costs_a_line_and_no_summary(quick, tmp_path, capsys):
    (tmp_path / "bounds.sqlite").write_text("{")
    assert colloc(["solve", quick, "--output", f"{tmp_path}/", "--no-figure"]) in (0, 4)
    printed = capsys.readouterr()
    assert "efficiency d/W" in printed.out
    assert "upper bound 1 = 1/min(mu)" in printed.out
    assert printed.err.count("No bound is taken from it") == 1


def test_a_bound_that_cannot_be_computed_costs_no_summary(tmp_path, capsys):
    (tmp_path / "p.py").write_text(QUICK.replace("delta=0.3,", 'delta=0.3, objective="speed",'))
    assert (
        colloc(
            ["solve", str(tmp_path / "p.py"), "--bound", "--no-figure", "--output", f"{tmp_path}/"]
        )
        == 2
    )
    printed = capsys.readouterr()
    assert "quick:" in printed.out
    assert (
        "no bound: upper bounds are of the efficiency, on the level, of gaits that do not turn"
        in printed.err
    )
    assert "--bound" not in printed.out  # nobody is sent to ask again
    with pytest.raises(ProblemError, match="at most 5 links, not 6"):
        upper_bound(
            Problem("six", body=Chain((1 / 6,) * 6), gait=Harmonic(1, "antipodal")),
            tmp_path,
            compute=True,
        )


def test_a_figure_that_cannot_be_drawn_costs_no_summary(quick, tmp_path, capsys):
    for name in ("quick.png", "quick.failed.png"):
        (tmp_path / name / "full").mkdir(parents=True)
    assert colloc(["solve", quick, "--output", f"{tmp_path}/"]) == 2
    printed = capsys.readouterr()
    assert "efficiency d/W" in printed.out
    assert "no figure: cannot write" in printed.err


@pytest.mark.parametrize("words", [[], ["--json"]])
def test_a_result_that_cannot_be_saved_is_told_and_the_run_kept(
    words, quick, tmp_path, capsys, monkeypatch
):
    def full(*_):
        raise StoreError("cannot write quick.h5: No space left on device.")

    monkeypatch.setattr("colloc.studies.saved.save_result", full)
    assert colloc(["solve", quick, "--output", f"{tmp_path}/", *words]) == 2
    printed = capsys.readouterr()
    if words:
        told = json.loads(printed.out)
        assert told["file"] is None
        assert told["efficiency"] == told["certificate"]["efficiency"]
    else:
        assert "efficiency d/W" in printed.out
        assert "saved" not in printed.out
    assert (
        printed.err
        == "colloc: the result is not saved: cannot write quick.h5: No space left on device.\n"
    )
    # the run, from which the same command goes on
    assert {p.suffix for p in tmp_path.iterdir()} == {".py", ".sqlite"}
    monkeypatch.undo()
    assert colloc(["solve", quick, "--output", f"{tmp_path}/", "--no-figure"]) in (0, 4)
    assert {p.suffix for p in tmp_path.iterdir()} == {".py", ".h5"}


def interrupt(*_, **__):
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    "where",
    ["colloc.bounds.optimality_gap.upper_bound", "colloc.pictures.solution_figure.solution_figure"],
)
def test_ctrl_c_after_the_result_is_saved_says_that_it_is(
    where, quick, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(where, interrupt)
    assert colloc(["solve", quick, "--output", f"{tmp_path}/"]) == 130
    (result,) = tmp_path.glob("*.h5")
    assert capsys.readouterr().err == f"colloc: interrupted; {result} is saved.\n"
    assert load(result).certificate.replayed


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_ctrl_c_while_a_result_is_saved_waits_until_all_of_it_is(three_link, tmp_path, monkeypatch):
    """Of the gait that shrank, too, which is saved after the one of finite size."""

    def saving(solution, path):
        if solution is both:
            signal.raise_signal(signal.SIGINT)
        return save(solution, path)

    monkeypatch.setattr("colloc.results.store.save", saving)
    both = replace(three_link, shrunk=three_link)
    with pytest.raises(KeyboardInterrupt):
        save_result(both, tmp_path / "x.h5")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x.h5", "x.shrunk.h5"]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX permissions")
@pytest.mark.parametrize("mask", [0o022, 0o027, 0o077, 0o002])
def test_files_have_the_permissions_that_the_user_asked_for(mask, three_link, tmp_path):
    before = os.umask(mask)
    try:
        path = save(three_link, tmp_path / "x.h5")
        put_rows(tmp_path / "x.sqlite", CACHE, {"a": 1})
    finally:
        os.umask(before)
    for written in (path, tmp_path / "x.sqlite"):
        assert written.stat().st_mode & 0o777 == 0o666 & ~mask


def test_a_command_that_was_interrupted_says_so_whatever_became_of_the_interruption():
    """CasADi's wrappers turn a KeyboardInterrupt into errors of other kinds."""

    def swallowing():
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise NotImplementedError("Wrong number or type of arguments") from None

    assert exit_code(swallowing) == 130
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_command_imports_nothing_heavy_before_it_can_end_well():
    code = (
        "import sys, colloc.commands.main; print(any(name in sys.modules for name in ('numpy', "
        "'scipy', 'casadi', 'h5py')))"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout
        == "False\n"
    )


@pytest.mark.parametrize(
    "words",
    [
        ["report", "RESULT"],
        [
            "animate",
            "RESULT",
            "--periods",
            "1",
            "--seconds",
            "0.3",
            "--fps",
            "10",
            "--width",
            "200",
        ],
        ["export", "RESULT", "--period", "4"],
        ["compare", "RESULT", "RESULT"],
        ["verify", "RESULT"],
    ],
)
def test_json_is_one_object_on_standard_output(words, result, capsys):
    assert colloc([str(result) if word == "RESULT" else word for word in words] + ["--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert words[0] not in ("report", "animate") or os.path.getsize(said["file"]) == said["bytes"]


def test_an_interrupted_command_leaves_no_workers_behind():
    """Python would wait for them at its end, as long as what they are at takes."""
    working = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(600,))

    def interrupted():
        working.start()
        raise KeyboardInterrupt("one start is kept.")

    assert exit_code(interrupted) == 130
    working.join(timeout=30)
    assert working.exitcode is not None


def stated(folder, text):
    (folder / "p.py").write_text(text, encoding="utf-8")
    return str(folder / "p.py")


@pytest.mark.parametrize("large", ["file", "description"])
def test_what_results_could_not_keep_is_refused_before_the_search(
    large, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr("colloc.studies.saved.resume", lambda *_, **__: pytest.fail("searched"))
    text = QUICK + "# " + "x" * 2**20 + "\n"
    if large == "description":
        text = (
            "from colloc import *\nimport numpy as np\nt = np.arange(30000) / 30000 * 2 * np.pi\n"
        )
        text += (
            "PROBLEM = Problem('wide', Corners(np.array([np.cos(t), np.sin(t)]), 'none'), "
            "gait=Polygon(8, 'none'))\n"
        )
    assert colloc(["solve", stated(tmp_path, text), "--output", f"{tmp_path}/"]) == 2
    assert re.search(
        r"p\.py.* has \d{7} bytes, and results keep at most 1048576", capsys.readouterr().err
    )


@pytest.mark.parametrize(
    "raised",
    [
        "GeneratorExit",
        "type('Own', (BaseException,), {})('no')",
        "BaseExceptionGroup('x', [GeneratorExit()])",
    ],
)
def test_whatever_a_problem_file_raises_is_a_sentence(raised, tmp_path, capsys):
    assert colloc(["solve", stated(tmp_path, f"x = 1\nraise {raised}\n")]) == 2
    printed = capsys.readouterr()
    assert "p.py, line 2: " in printed.err
    assert printed.err.count("\n") == 1
    assert printed.out == ""


PRINTING = """
print("hello from the file")
from colloc import *
class Talkative(Chain):
    def describe(self):
        print("hello from the body")
        return super().describe()
"""


def test_what_a_problem_file_and_its_parts_print_does_not_spoil_the_one_object(tmp_path, capsys):
    own = "gait_fields.BODIES.append(Talkative)\nfrom colloc.gaits import gait_fields\n"
    text = (
        PRINTING
        + "\n".join(reversed(own.splitlines()))
        + QUICK.replace("from colloc import *", "").replace(
            '"quick", ', '"quick", body=Talkative(), guess='
        )
    )
    file = stated(tmp_path, text)
    try:
        assert colloc(["solve", file, "--output", f"{tmp_path}/", "--json"]) in (0, 4)
    finally:
        gait_fields.BODIES[:] = [
            kind for kind in gait_fields.BODIES if kind.__name__ != "Talkative"
        ]
    printed = capsys.readouterr()
    assert json.loads(printed.out)["name"] == "quick"
    assert "hello from the file" in printed.err


def shell(line, folder):
    """A line of a shell with colloc as a function; its exit code (of the first of a pipe), output
    and errors."""
    program = f'colloc() {{ "{sys.executable}" -m colloc "$@"; }}; set -o pipefail; {line}'
    done = subprocess.run(
        ["bash", "-c", program], capture_output=True, text=True, check=False, cwd=folder
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
@pytest.mark.parametrize("closed", [">&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_closed_streams_change_nothing_but_what_is_printed(closed, quick, tmp_path):
    code, out, complaint = shell(
        f"colloc solve {quick} --no-figure --output {tmp_path}/ {closed}", tmp_path
    )
    assert code in (0, 4)
    assert (out, complaint) == ("", "")
    (result,) = tmp_path.glob("*.h5")
    assert load(result).certificate.replayed


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_a_pipe_that_is_closed_early_is_one_sentence_and_a_code_of_its_own(result, tmp_path):
    code, _, complaint = shell(f"colloc verify {result} | :", tmp_path)
    assert code == 141
    assert complaint == "colloc: nobody reads the output any more; what was saved before is kept.\n"


def test_without_compiled_code_it_is_said_once_that_all_is_slower(quick, tmp_path):
    """An installation without a compiler has no extension module; other sources, so that what is
    installed beside is not taken for it."""
    copied = shutil.copytree(
        Path(ending.__file__).parents[1],
        tmp_path / "colloc",
        ignore=shutil.ignore_patterns("_kernel.*"),
    )
    (copied / "mechanics" / "native" / "vectors.h").write_text("/* another */")
    environment = {**os.environ, "PATH": "", "PYTHONPATH": str(tmp_path)}
    words = (
        "multistart",
        quick,
        "--starts",
        "2",
        "--workers",
        "2",
        "--quiet",
        "--output",
        f"{tmp_path}/",
    )
    done = command(*words, env=environment, cwd=tmp_path)
    assert done.returncode in (0, 3)
    assert done.stderr.decode().startswith(
        "colloc: the balance is solved by NumPy, 10 to 60 times more slowly: the compiled"
    )
    assert done.stderr.decode().count("\n") == 1
