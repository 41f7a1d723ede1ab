"""Does the suite catch a wrong program? One small fault at a time is put into a copy of colloc, and its tests are run.

    python -m benchmarks.mutation --mutants 200 [--seed 0] [--seconds 600]

Faults are drawn from the packages that results rest on, as many of each as it has, but at least one in twenty: an operator,
a comparison, a constant, a sign, a condition or an `abs`, `min`, `max` is changed, in Python and in the C of the kernel. One
run of the default suite without any fault records which tests run which lines, also in the programs that they start
(`benchmarks.reach`). A fault meets those that run its line, of the folder that mirrors its package first, until one fails;
as many as fit in 20 s of processor time. What takes far longer than without a fault counts as caught (it hangs). Those that
survive are printed with their line: they are a gap of the tests, or a change without consequences. C that the compiler turns
into the same library is no fault, and is named so.
What the record has of the same sources is not done again, so that the same command goes on with a run that was ended; a sample
of other sources has other mutants. Which tests run what is kept beside it.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import hashlib
import importlib
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from benchmarks.faults import faults_of
from benchmarks.reach import Test, load, named_line, save

_NEEDED = "casadi clarabel filelock h5py jinja2 matplotlib.pyplot mpmath rich.progress scipy.integrate scipy.optimize xarray"
"""What the children would import one after the other."""
ROOT = Path(__file__).resolve().parents[1]
_LEFT_BEHIND = shutil.ignore_patterns(".*_cache", ".git", ".venv", ".hypothesis", "__pycache__", "reach-*.json")
"""What the copy does without."""
MUTATED = ("bounds", "smooth", "mechanics", "results", "verification", "system")
_NOT_MUTATED = ("dask_pool", "interruption", "progress", "processors", "late_binding", "task_pool", "arguments")
"""What no result rests on."""
TESTS = {
    "bounds": ("tests/bounds", "tests/recorded"),
    "smooth": ("tests/smooth", "tests/recorded"),
    "mechanics": ("tests/mechanics", "tests/hard", "tests/recorded"),
    "results": ("tests/results", "tests/recorded"),
    "verification": ("tests/verification", "tests/recorded"),
    "system": ("tests/system",),
    "laws": ("tests/laws",),
}
"""What mirrors a package comes first; the rest of the suite is for those that survive it."""
_OF_ALL_CALLS = "colloc/mechanics/native_kernel.py::address"
_OF_OWN_LAWS = "colloc/laws/link_quadrature.py::ByQuadrature.kernel_source"
_OF_CALLS = {
    "enclosure.h": "colloc/bounds/enclosure.py::by_convexity",
    "growth.h": "colloc/bounds/enclosure.py::by_convexity",
    "cell_link.h": "colloc/bounds/enclosure.py::by_convexity",
    "loaded.h": "colloc/bounds/loaded_balance.py::loaded_balance",
    "motion.h": "colloc/mechanics/native_kernel.py::compiled_motion",
    "link_quadrature.h": _OF_OWN_LAWS,
    "dual.h": _OF_OWN_LAWS,
}
"""The Python that calls the C of a file; any call at all for the other files."""
_OF_CLASSES = "tests/test_data_classes.py"
"""Looks at classes and calls nothing; for what stands outside functions."""
_MOST = 20.0
"""Recorded processor seconds of the tests that one fault is met with; two thirds of it for those that mirror its package."""
_LEAST_SHARE = 20
"""At least one mutant in so many is of each package."""


class Mutant(NamedTuple):
    """One fault: a span of a file and what it is replaced by."""

    file: str
    start: int
    end: int
    new: str

    @property
    def package(self) -> str:
        return self.file.split("/")[1]

    def described(self, texts: dict[str, str]) -> str:
        text = texts[self.file]
        number = text.count("\n", 0, self.start) + 1
        line = text.splitlines()[number - 1].strip()
        return f"{self.file}:{number}: {text[self.start : self.end]!r} -> {self.new!r} in: {line}"

    def reached_by(self, texts: dict[str, str]) -> Iterator[set[str]]:
        """What a test runs that meets it, as `benchmarks.reach` names it: its line, or else the statement, the function."""
        if not self.file.endswith(".py"):
            yield {_OF_CALLS.get(Path(self.file).name, _OF_ALL_CALLS)}
            return
        text, number = texts[self.file], texts[self.file].count("\n", 0, self.start) + 1
        lines, tree = text.splitlines(), ast.parse(text)
        function = f"{self.file}::{_function_at(tree, number)}"
        around = [n for n in ast.walk(tree) if isinstance(n, ast.stmt) and n.lineno <= number <= (n.end_lineno or n.lineno)]
        if function.endswith("::"):  # of the module: those that use what it says
            targets = [name.id for node in around for name in ast.walk(node) if isinstance(name, ast.Name)]
            yield {"*", *(named_line(self.file, line) for line in lines if set(targets[:1]) & set(re.findall(r"\w+", line)))}
        else:
            for line in (number, max((n.lineno for n in around), default=number)):
                yield {named_line(self.file, lines[line - 1]), f"{function}*"}
            yield {function, f"{function}*"}


def _function_at(node: ast.AST, number: int, outer: str = "") -> str:
    """Qualified name of the innermost function that holds a line."""
    for inner in ast.iter_child_nodes(node):
        if getattr(inner, "lineno", number) <= number <= (getattr(inner, "end_lineno", number) or number):
            if isinstance(inner, ast.ClassDef):
                return _function_at(inner, number, f"{outer}{inner.name}.")
            if isinstance(inner, ast.FunctionDef):
                return _function_at(inner, number, f"{outer}{inner.name}.<locals>.") or outer + inner.name
            if found := _function_at(inner, number, outer):
                return found
    return ""


def _rank(test: Test) -> float:
    """Cheap tests come first, and those that speak of little else."""
    return test.seconds * len(test.calls)


def tests_of(mutant: Mutant, texts: dict[str, str], known: dict[str, list[Test]]) -> tuple[list[str], float]:
    """Names and processor seconds of the tests that run its line, or else its function, or anything of its file."""
    every = [test for tests in known.values() for test in tests]
    for reached in mutant.reached_by(texts):
        if meeting := [test for test in every if reached & test.calls]:
            meeting += [test for test in every if "*" in reached and test.name.startswith(_OF_CLASSES)]
            break
    else:
        meeting = [test for test in every if any(name.startswith(f"{mutant.file}::") for name in test.calls)]
    mirroring = tuple(f"{folder}/" for folder in TESTS[mutant.package])
    chosen, spent = [], 0.0
    for test in sorted(meeting, key=lambda test: (not test.name.startswith(mirroring), _rank(test))):
        if spent + test.seconds < (_MOST * 2 / 3 if test.name.startswith(mirroring) else _MOST):
            chosen.append(test.name)
            spent += test.seconds
    return chosen, spent


def sources() -> dict[str, str]:
    """Texts of the files that faults are put in."""
    files = [path for package in MUTATED for path in sorted((ROOT / "colloc" / package).rglob("*"))]
    mutated = (path for path in files if path.suffix in (".py", ".c", ".h") and path.stem not in _NOT_MUTATED)
    return {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in mutated}


def mutants(texts: dict[str, str]) -> Iterator[Mutant]:
    """Every fault that can be put in."""
    for file, text in texts.items():
        for start, end, new in faults_of(text, python=file.endswith(".py")):
            yield Mutant(file, start, end, new)


def drawn(found: list[Mutant], number: int, seed: int) -> list[Mutant]:
    """A sample: of each package as many as it has of all, but at least one in `_LEAST_SHARE`."""
    packages = Counter(mutant.package for mutant in found)
    room = {name: max(number // _LEAST_SHARE, number * packages[name] // len(found)) for name in packages}
    room[max(room, key=lambda name: room[name])] += number - sum(room.values())
    chosen = []
    for mutant in random.Random(seed).sample(found, len(found)):
        if room[mutant.package] > 0:
            room[mutant.package] -= 1
            chosen.append(mutant)
    return chosen


_COMPILED = ("cc", "-std=c11", "-O2", "-fno-math-errno", "-ffp-contract=off", "-fPIC", "-shared")
_OWN_LAW = "from colloc import OwnLaw; print(OwnLaw('-vs/speed', '-vn/speed*(1 + exp(-speed))').kernel_source)"


@cache
def _own_law(copy: Path) -> Path:
    """A folder with the C of a law of one's own."""
    (copy.parent / "law").mkdir()
    made = subprocess.run([sys.executable, "-c", _OWN_LAW], cwd=copy, stdout=subprocess.PIPE, check=True).stdout
    (copy.parent / "law" / "own_law.h").write_bytes(made)
    return copy.parent / "law"


def kernels_of(copy: Path) -> Iterator[bytes]:
    """What the compiler makes of the C as it is, without a law of one's own and with one; empty if it refuses."""
    library, source = copy.parent / "kernel.so", copy / "colloc/mechanics/native/kernel.c"
    for flags in ([], ["-DOWN_LAW", f"-I{_own_law(copy)}", f"-I{source.parent}"]):
        done = subprocess.run([*_COMPILED, *flags, source, "-o", library, "-lm"], capture_output=True)
        yield b"" if done.returncode else library.read_bytes()


@cache
def _faultless(copy: Path) -> tuple[bytes, ...]:
    """The same before any fault is put in."""
    return tuple(kernels_of(copy))


def outcome(mutant: Mutant, copy: Path, cache: Path, tests: list[str], seconds: float) -> tuple[str, str]:
    """ "caught", "survived", "hangs", "not reached" or "same code", and the test that failed; in a child of this process, which
    has the libraries."""
    if not tests:
        return "not reached", ""
    file = copy / mutant.file
    text, known = file.read_text(encoding="utf-8"), () if file.suffix == ".py" else _faultless(copy)
    file.write_text(text[: mutant.start] + mutant.new + text[mutant.end :], encoding="utf-8")
    try:
        if known and all(made and made == before for made, before in zip(kernels_of(copy), known, strict=True)):
            return "same code", ""
        status = _in_child(copy, lambda: _tests_in(copy, cache, tests, int(1.5 * seconds) + 20))
    finally:
        file.write_text(text, encoding="utf-8")
    said = (copy.parent / "said.txt").read_text(encoding="utf-8", errors="replace")
    failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", said, flags=re.MULTILINE)
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL, signal.SIGALRM):
        return "hangs", ""
    return "survived" if status == 0 else "caught", failed.group(1) if failed else ""


@cache
def sound(copy: Path, cache: Path, test: str) -> bool:
    """Whether a test passes by itself without any fault: one that needs others before it says nothing of a fault."""
    return _in_child(copy, lambda: _tests_in(copy, cache, [test], 200)) == 0


def _in_child(copy: Path, work: Callable[[], int]) -> int:
    """Status of a fork that does some work in the copy; what it says is in a file beside that."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.setpgid(0, 0)
            os.chdir(copy)
            sys.path = [str(copy), *(entry for entry in sys.path if Path(entry or ".").resolve() != ROOT)]
            for name in [name for name in sys.modules if name.split(".")[0] == "benchmarks"]:
                del sys.modules[name]
            said = os.open(copy.parent / "said.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(said, 1)
            os.dup2(said, 2)
            code = work()
        except BaseException:  # whatever it is, it ends here
            traceback.print_exc()
        finally:  # never back into the parent's program
            os._exit(code)
    status = os.waitpid(child, 0)[1]
    with contextlib.suppress(ProcessLookupError):  # what a fault left running
        os.killpg(child, signal.SIGKILL)
    return status


def _tests_in(copy: Path, cache: Path, tests: list[str], seconds: int) -> int:
    """Exit code of pytest, told to stop at the first failure."""
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    signal.setitimer(signal.ITIMER_REAL, 5 * seconds + 60)
    os.environ |= {"PYTHONPATH": str(copy), "COLLOC_CODE": str(cache), "PYTHONDONTWRITEBYTECODE": "1"}
    sys.dont_write_bytecode = True
    return int(pytest.main(["-x", "-n", "0", "-p", "no:cacheprovider", *tests]))


def _reached(copy: Path, cache: Path, folder: str) -> list[Test]:
    """The tests of a folder and what they call, from a run without any fault."""

    def work() -> int:
        os.environ |= {"PYTHONPATH": str(copy), "COLLOC_CODE": str(cache)}
        import benchmarks.reach as reach

        found, code = reach.recorded((folder,))
        reach.save(found, copy.parent / "reach.json")
        sys.stdout.flush()
        return code

    failed = _in_child(copy, work)
    said = (copy.parent / "said.txt").read_text(encoding="utf-8")
    print("\n".join(line for line in said.splitlines() if line.startswith("not used")))
    if failed:
        raise SystemExit(f"the tests of {folder} fail without any fault:\n{said[-3000:]}")
    return load(copy.parent / "reach.json")


def _processor_seconds() -> float:
    """Of all children so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _recorded(copy: Path, cache: Path, beside: Path, chosen: list[str]) -> dict[str, list[Test]]:
    """What the tests of every folder run, or of those chosen, kept beside the record under a name made of the tests' text."""
    known = {}
    places = [path for path in sorted((copy / "tests").iterdir()) if any(path.glob("test_*.py")) or path.match("test_*.py")]
    for place in [place for place in places if not chosen or place.name in chosen]:
        files = sorted(place.rglob("*.py")) if place.is_dir() else [place]
        name = str(place.relative_to(copy))
        edition = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:8]
        kept = beside / f"reach-{name.replace('/', '-').removesuffix('.py')}-{edition}.json"
        if not kept.exists():
            before = _processor_seconds()
            save(_reached(copy, cache, name), kept)
            print(f"{name} without a fault: {_processor_seconds() - before:.0f} s", flush=True)
        known[name] = load(kept)
    return known


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutants", type=int, default=200, metavar="N")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=1e9, metavar="S", help="processor time after which none is begun")
    parser.add_argument("--record", type=Path, default=Path("results/mutation.jsonl"), help="one line a mutant is added here")
    parser.add_argument("--only", default="", metavar="TEXT", help="of the sample those in files whose path holds this")
    parser.add_argument("--tests", nargs="*", default=[], metavar="FOLDER", help="these of the suite, and not all of it")
    parser.add_argument(
        "--part", nargs=2, type=int, default=(1, 1), metavar=("K", "N"), help="the K-th of N that share the work"
    )
    options = parser.parse_args()
    texts = sources()
    found, edition = list(mutants(texts)), hashlib.sha256(json.dumps(texts).encode()).hexdigest()[:12]
    chosen = drawn(found, min(options.mutants, len(found)), options.seed)
    done = dict[int, str]()
    if options.record.exists():
        rows = map(json.loads, options.record.read_text(encoding="utf-8").splitlines())
        same = {"sources": edition, "seed": options.seed, "sample": len(chosen)}
        done = {row["index"]: row["outcome"] for row in rows if same.items() <= row.items()}
    options.record.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        copy, cache = Path(folder) / "colloc", Path(folder) / "cache"
        shutil.copytree(ROOT, copy, ignore=_LEFT_BEHIND)
        cache.mkdir(mode=0o700)
        for library in _NEEDED.split():
            importlib.import_module(library)
        known = _recorded(copy, cache, options.record.parent, options.tests)
        _in_child(
            copy, lambda: int(pytest.main(["-n", "0", "-p", "no:cacheprovider", "--collect-only", *known]))
        )  # compiles them
        for index, mutant in enumerate(chosen):
            elsewhere = index % options.part[1] != options.part[0] - 1 or options.only not in mutant.file
            if index in done or elsewhere or _processor_seconds() > options.seconds:
                continue
            before = _processor_seconds()
            tests, seconds = tests_of(mutant, texts, known)
            what, failed = outcome(mutant, copy, cache, tests, seconds)
            while what == "caught" and failed in tests and not sound(copy, cache, failed):
                tests.remove(failed)
                what, failed = outcome(mutant, copy, cache, tests, seconds)
            done[index], described = what, mutant.described(texts)
            line = {"sources": edition, "seed": options.seed, "sample": len(chosen), "index": index, "outcome": what}
            with options.record.open("a", encoding="utf-8") as record:
                record.write(json.dumps(line | {"tests": len(tests), "failed": failed, "mutant": described}) + "\n")
            print(f"{index:4d} {what:11s} {_processor_seconds() - before:6.1f} s  {described}", flush=True)
    print(f"{len(done)} of {len(chosen)} mutants: {dict(Counter(done.values()))}")


if __name__ == "__main__":
    main()
