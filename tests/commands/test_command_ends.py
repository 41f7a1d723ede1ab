"""Commands end in a sentence and an exit code: Ctrl-C, full disks, encodings, odd names, no home."""

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
from functools import wraps
from pathlib import Path

import casadi
import pytest

from colloc import Chain, Harmonic, Problem, ProblemError, StoreError, load, save
from colloc.bounds.optimality_gap import upper_bound
from colloc.commands.main import exit_code
from colloc.commands.main import main as colloc
from colloc.commands.solve import summary_lines
from colloc.gaits import gait_fields
from colloc.gaits.problem_file import read_problem_file
from colloc.results.store import save_result
from colloc.search.checkpoint import Run
from colloc.system.row_file import CACHE, put_rows
from tests.conftest import ROOT
from tests.shared.cases import slow

QUICK = """
from colloc import *
PROBLEM = Problem("quick", ellipse(0.0, 1.4, 0.8), gait=Harmonic(1, "bilateral"), delta=0.3, delta_start=0.3, intervals=12)
STARTS = 1
"""
posix = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and permissions")
needs_full = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no such device")
needs_bash = pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
OK = (0, 4)  # solved; certified or not, at so large a delta
LETTERS = "# Länge der Schlange: µ_t = 1" + QUICK
WIDE = """
from colloc import *
import numpy as np
t = np.arange(30000) / 30000 * 2 * np.pi
PROBLEM = Problem("wide", Corners(np.array([np.cos(t), np.sin(t)]), "none"), gait=Polygon(8, "none"))
"""
PRINTING = """
print("hello from the file")
from colloc import *
from colloc.gaits import gait_fields
class Talkative(Chain):
    def describe(self):
        print("hello from the body")
        return super().describe()
gait_fields.BODIES.append(Talkative)
"""
ONE_AFTER_ANOTHER = """
from colloc import *
FLOOR = Friction(mu_t=4, mu_f=1, mu_b=1)
PROBLEM = Problem("p", gait=Harmonic(1, "bilateral"), friction=FLOOR, delta=3e-3, mesh_tolerance=1e-4)
"""
PARETO = ["--points", "2", "--objectives", "speed", "efficiency"]
SEVERAL = {"steer": ["--turn", "10"], "pareto": PARETO}
NO_LANGUAGE = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0"}
# CasADi before 3.8 ends the process where Python cannot read the name of the folder that it is in
if casadi.__file__.isascii() or [*map(int, casadi.__version__.split(".")[:2])] >= [3, 8]:
    NO_LANGUAGE["PYTHONUTF8"] = "0"
NO_CACHE = {"XDG_CACHE_HOME": "/proc/nowhere", "MPLCONFIGDIR": "/proc/nowhere"}
OF_A_USER = ("HOME", "USER", "LOGNAME", "XDG_CACHE_HOME", "LANG")


@pytest.fixture
def result(three_link, tmp_path):
    return save(three_link, tmp_path / "three_link.h5")


@pytest.fixture
def quick(tmp_path):
    (tmp_path / "quick.py").write_text(QUICK, encoding="utf-8")
    return str(tmp_path / "quick.py")


@pytest.fixture
def solve(quick, capsys):
    """A function from options to the exit code of a solve and what it prints, out and as errors."""

    def run(*options, text=QUICK):
        Path(quick).write_text(text, encoding="utf-8")
        code = colloc(["solve", quick, "--output", f"{Path(quick).parent}/", *options])
        return code, *capsys.readouterr()

    return run


def python(*words, stdout=subprocess.PIPE, **options):
    streams = {"stdout": stdout, "stderr": subprocess.PIPE, "text": True}
    done = subprocess.run([sys.executable, *map(str, words)], **streams, **options)
    return done.returncode, done.stdout, done.stderr


@posix
@pytest.mark.parametrize(
    ("module", "words"),
    [
        ("argparse", "colloc.solve x"), ("dataclasses", "colloc verify --json x"),
        ("numpy", "colloc solve quick.py"), ("casadi", "colloc solve quick.py"),
    ],
)  # fmt: skip
def test_ctrl_c_while_libraries_are_imported_leaves_no_traceback(module, words, quick, tmp_path):
    """From inside the import; at numpy as in a dataclass, where Python would end by the signal."""
    pressed = "import signal; signal.raise_signal(signal.SIGINT)"
    (tmp_path / "library").mkdir()
    library = tmp_path / "library" / f"{module}.py"
    library.write_text(f"exec({pressed!r})" if module == "numpy" else pressed)
    environment = {**os.environ, "PYTHONPATH": str(library.parent)}
    code, said, complaint = python("-m", *words.split(), env=environment, cwd=tmp_path)
    assert (code, complaint) == (130, "colloc: interrupted; nothing was written.\n")
    assert "--json" not in words or json.loads(said)["exit_code"] == 130


@posix
def test_ctrl_c_after_the_end_does_not_change_it(tmp_path):
    code = (
        "import atexit, signal, sys\nfrom colloc.__main__ import start\n"
        "atexit.register(lambda: signal.raise_signal(signal.SIGINT))\nstart(['init', sys.argv[1]])"
    )
    assert python("-c", code, tmp_path / "x.py")[::2] == (0, "")
    assert (tmp_path / "x.py").exists()


@needs_full
@pytest.mark.parametrize(
    ("words", "buffered"), [("verify", ""), ("verify --compare", ""), ("verify", "1")]
)
def test_a_full_disk_behind_standard_output_is_said_once(words, buffered, result):
    command, *options = words.split()
    more = [*options, result] if options else []
    environment = {**os.environ, "PYTHONUNBUFFERED": buffered}
    with open("/dev/full", "wb") as full:
        code, _, said = python("-m", "colloc", command, result, *more, stdout=full, env=environment)
    assert code == 2
    assert said == "colloc: cannot read or write the output: No space left on device.\n"


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8"])
def test_letters_that_an_encoding_lacks_are_printed_as_words(encoding, three_link, monkeypatch):
    printed = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(printed, encoding=encoding))
    lines = summary_lines(three_link, None, verbose=True)
    assert exit_code(lambda: print("\n".join(lines)) or 0) == 0
    shown = "cos 2πt" if encoding == "utf-8" else "cos 2 pi t"
    assert shown in printed.getvalue().decode(encoding)


def test_a_cache_of_bounds_that_cannot_be_written_costs_a_warning(quick, tmp_path, monkeypatch):
    problem = read_problem_file(quick).problem
    # anything with fields
    monkeypatch.setattr("colloc.bounds.sampled.compute_bound", lambda *_: (problem.friction, None))
    (tmp_path / "file").write_text("in the way of the folder")
    with pytest.warns(UserWarning, match="cannot write .*The bound is not kept"):
        assert upper_bound(problem, tmp_path / "file" / "below", compute=True) is problem.friction


@pytest.mark.slow
def test_a_broken_cache_of_bounds_costs_a_line_and_no_summary(solve, tmp_path):
    (tmp_path / "bounds.sqlite").write_text("{")
    code, said, complaint = solve("--no-figure")
    assert code in OK
    assert "efficiency d/W" in said
    assert "upper bound 1 (= 1/min mu)" in said
    assert complaint.count("No bound is taken from it") == 1


@pytest.mark.slow
def test_a_bound_that_cannot_be_computed_costs_no_summary(solve, quick, tmp_path):
    text = QUICK.replace("delta=0.3,", 'delta=0.3, objective="speed",')
    code, said, complaint = solve("--bound", "--no-figure", text=text)
    assert code == 2
    assert "quick:" in said
    why = "no bound: upper bounds are of the efficiency, on the level, of gaits that do not turn"
    assert why in complaint
    assert "--bound" not in said  # nobody is sent to ask again
    six = Problem("six", body=Chain((1 / 6,) * 6), gait=Harmonic(1))
    with pytest.raises(ProblemError, match="at most 5 links, not 6"):
        upper_bound(six, tmp_path, compute=True)


def test_a_figure_that_cannot_be_drawn_costs_no_summary(solve, tmp_path):
    for name in ("quick.png", "quick.failed.png"):
        (tmp_path / name / "full").mkdir(parents=True)
    code, said, complaint = solve()
    assert code == 2
    assert "efficiency d/W" in said
    assert "no figure: cannot write" in complaint


@pytest.mark.parametrize("words", [[], slow(["--json"])])
def test_a_result_that_cannot_be_saved_is_told_the_run_is_kept(words, solve, tmp_path, monkeypatch):
    def full(*_):
        raise StoreError("cannot write quick.h5: No space left on device.")

    with monkeypatch.context() as patch:
        patch.setattr("colloc.studies.solve.save_result", full)
        code, said, complaint = solve(*words)
    why = "the result is not saved: cannot write quick.h5: No space left on device."
    assert (code, complaint) == (2, f"colloc: {why}\n")
    if words:
        told = json.loads(said)
        assert told["file"] is None
        assert told["efficiency"] == told["certificate"]["efficiency"]
    else:
        assert "efficiency d/W" in said
        assert "saved" not in said
    # the run, from which the same command goes on
    assert {p.suffix for p in tmp_path.iterdir()} == {".py", ".sqlite"}
    assert solve("--no-figure")[0] in OK
    assert {p.suffix for p in tmp_path.iterdir()} == {".py", ".h5"}


@pytest.mark.parametrize(
    "where", ["bounds.optimality_gap.upper_bound", "pictures.figure.plot_solution"]
)
def test_ctrl_c_after_the_result_is_saved_says_that_it_is(where, solve, tmp_path, monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(f"colloc.{where}", interrupt)
    code, _, complaint = solve()
    (result,) = tmp_path.glob("*.h5")
    assert (code, complaint) == (130, f"colloc: interrupted; {result} is saved.\n")
    assert load(result).certificate.replayed


@posix
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


@posix
@pytest.mark.parametrize("mask", [0o022, 0o077])
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


@pytest.mark.parametrize(
    "words",
    [
        f"report --problem {ROOT}/problems/three_link.py",
        "animate --periods 1 --seconds 0.3 --width 200",
        "export --period 4",
    ],
)
def test_json_is_one_object_on_standard_output(words, result, capsys):
    command, *options = words.split()
    assert colloc([command, str(result), *options, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert command != "report" or b"agrees with 0.259" in Path(said["file"]).read_bytes()
    assert "bytes" not in said or os.path.getsize(said["file"]) == said["bytes"]


def test_an_interrupted_command_leaves_no_workers_behind():
    """Python would wait for them at its end, as long as what they are at takes."""
    working = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(600,))

    def interrupted():
        working.start()
        raise KeyboardInterrupt("one start is kept.")

    assert exit_code(interrupted) == 130
    working.join(timeout=30)
    assert working.exitcode is not None


@pytest.mark.parametrize("text", [QUICK + f"# {'x' * 2**20}\n", WIDE], ids=["file", "description"])
def test_what_results_could_not_keep_is_refused_before_the_search(text, solve, monkeypatch):
    monkeypatch.setattr("colloc.studies.solve.resume", lambda *_, **__: pytest.fail("searched"))
    code, _, complaint = solve(text=text)
    assert code == 2
    assert re.search(r"\.py.* has \d{7} bytes, and results keep at most 1048576", complaint)


def test_what_a_problem_file_and_its_parts_print_does_not_spoil_the_one_object(solve, monkeypatch):
    monkeypatch.setattr(gait_fields, "BODIES", list(gait_fields.BODIES))
    stated = QUICK.replace("from colloc import *", "").replace(
        '"quick", ', '"quick", body=Talkative(), guess='
    )
    code, said, complaint = solve("--json", text=PRINTING + stated)
    assert code in OK
    assert json.loads(said)["name"] == "quick"
    assert "hello from the file" in complaint


def shell(line, folder):
    """Exit code (of the first of a pipe), output and errors of a line with colloc as a function."""
    program = f'colloc() {{ "{sys.executable}" -m colloc "$@"; }}; set -o pipefail; {line}'
    done = subprocess.run(["bash", "-c", program], capture_output=True, text=True, cwd=folder)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.slow
@needs_bash
def test_closed_streams_change_nothing_but_what_is_printed(quick, tmp_path):
    line = f"colloc solve {quick} --no-figure --output {tmp_path}/ <&- >&- 2>&-"
    code, *said = shell(line, tmp_path)
    assert code in OK
    assert said == ["", ""]
    (result,) = tmp_path.glob("*.h5")
    assert load(result).certificate.replayed


@needs_bash
def test_a_pipe_that_is_closed_early_is_one_sentence_and_a_code_of_its_own(result, tmp_path):
    code, _, complaint = shell(f"colloc verify {result} | :", tmp_path)
    assert code == 141
    assert (
        complaint == "colloc: the output was closed by its reader; what was saved before is kept.\n"
    )


@pytest.mark.slow
def test_without_compiled_code_it_is_said_once_that_all_is_slower(quick, tmp_path):
    """No compiler, so no extension module; other sources, so that no installed one is taken."""
    library, kernel = Path(gait_fields.__file__).parents[1], shutil.ignore_patterns("_kernel.*")
    copied = shutil.copytree(library, tmp_path / "colloc", ignore=kernel)
    (copied / "mechanics" / "native" / "parts.h").write_text("/* another */")
    Path(quick).write_text(QUICK.replace("=12", "=6, mesh_tolerance=0.0"), encoding="utf-8")
    environment = {**os.environ, "PATH": "", "PYTHONPATH": str(tmp_path)}
    words = f"-m colloc multistart {quick} --starts 2 --workers 2 --quiet --output {tmp_path}/"
    code, _, complaint = python(*words.split(), env=environment, cwd=tmp_path)
    assert code in (0, 3)
    slowly = "colloc: the balance is solved by NumPy, 10 to 60 times more slowly: the compiled"
    assert complaint.startswith(slowly)
    assert complaint.count("\n") == 1


@pytest.mark.parametrize("name", SEVERAL)
def test_an_interrupted_command_goes_on_from_its_last_problem(name, tmp_path, monkeypatch, capsys):
    (tmp_path / "p.py").write_text(ONE_AFTER_ANOTHER, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    command = [name, "p.py", *SEVERAL[name], "--starts", "1", "--no-figure", "--quiet"]
    kept, computed, interruptions = Run.result, [], []

    def interrupted_at_the_second(run, stage, arguments):
        @wraps(stage)
        def counted(*arguments):
            computed.append(run.problem.hash)
            if computed[0] != computed[-1] and not interruptions:
                interruptions.append("once")
                raise KeyboardInterrupt
            return stage(*arguments)

        return kept(run, counted, arguments)

    monkeypatch.setattr(Run, "result", interrupted_at_the_second)
    assert colloc(command) == 130
    assert "the same command goes on" in capsys.readouterr().err
    second = computed[-1]
    computed.clear()
    assert colloc(command) == 0
    assert set(computed) == {second}
    assert not list(tmp_path.glob("**/*.sqlite"))


def run(words, without=(), **environment):
    """``colloc`` in a process of its own whose environment has been changed."""
    kept = {name: value for name, value in os.environ.items() if name not in without}
    return python("-m", "colloc", *words, env=kept | environment, errors="replace")


@pytest.fixture
def place(tmp_path):
    """A folder with blanks and letters beyond ASCII in its name, and a problem in it."""
    folder = tmp_path / "a földer, 名前"
    folder.mkdir()
    (folder / "quick.py").write_text(LETTERS, encoding="utf-8")
    return folder


def solved_and_verified(place, words, without, environment):
    words = ["solve", place / "quick.py", "--output", place, *words]
    code, _, complaint = run(words, without, **environment)
    assert code in OK, complaint
    assert "Traceback" not in complaint
    result = next(place.glob("quick*.h5"))
    assert load(result).source == LETTERS
    again, _, complaint = run(["verify", result], without, **environment)
    assert again == code
    slowly = "colloc: the balance is solved by NumPy, 10 to 60 times more slowly: "
    assert not complaint or (complaint.startswith(slowly) and complaint.count("\n") == 1)


@posix
def test_a_solve_needs_nothing_of_the_user(place):
    environment = NO_LANGUAGE | {"PYTHONIOENCODING": "cp1252"}
    solved_and_verified(place, ["--no-figure"], OF_A_USER, environment)


@posix
@pytest.mark.slow
@pytest.mark.parametrize(
    ("without", "environment"),
    [((), NO_LANGUAGE), ((), {"PYTHONIOENCODING": "cp1252"}), (OF_A_USER, {}), ((), NO_CACHE)],
    ids=["no language", "Windows letters", "no home", "no cache"],
)
def test_nor_does_a_figure(without, environment, place):
    solved_and_verified(place, [], without, environment)


@posix
@pytest.mark.slow
def test_text_files_are_utf_8_whatever_the_language(place, three_link):
    result = save(three_link, place / "Länge.h5")
    for words, name in (
        (["export", result, "--period", "4"], "*.csv"),
        (["report", result], "*.html"),
    ):
        code, _, complaint = run([*words, "--output", f"{place}/"], **NO_LANGUAGE)
        assert code == 0, complaint
        (written,) = place.glob(name)
        written.read_text(encoding="utf-8")


@posix
def test_a_name_as_long_as_systems_allow_is_kept(three_link, tmp_path):
    # 203 bytes; with those of the temporary file below 255
    path = save(three_link, tmp_path / ("ä" * 100 + ".h5"))
    assert load(path).certificate == three_link.certificate
