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
import contextlib
import hashlib
import importlib
import json
import os
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

import pytest

from benchmarks.mutants import ROOT, Mutant, drawn, mutants, sources, tests_of
from benchmarks.reach import Test, load, save

_NEEDED = "casadi clarabel filelock h5py jinja2 matplotlib.pyplot mpmath rich.progress scipy.integrate scipy.optimize xarray"
"""What the children would import one after the other."""
_LEFT_BEHIND = shutil.ignore_patterns(".*_cache", ".git", ".venv", ".hypothesis", "__pycache__", "reach-*.json")
"""What the copy does without."""
_COMPILED = ("cc", "-std=c11", "-O2", "-fno-math-errno", "-ffp-contract=off", "-fPIC", "-shared")
_OWN_LAW = "from colloc import OwnLaw; print(OwnLaw('-vs/speed', '-vn/speed*(1 + exp(-speed))').kernel.own_law)"


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
