"""What does colloc make of damaged and forged files? Every reader is given them, and is to refuse them in one sentence.

    python -m benchmarks.fuzz --minutes 60 --seed 1

Bytes are changed, cut, left out and put in; files with a seal or checksums are also forged: fields and numbers are exchanged,
and the checksums made right. In texts (tables, problem files) lines, numbers and words are exchanged. A file is read in a
process with 3 GB of memory and 20 s of processor time for each. A finding is an error that is not one of colloc's, a warning
of NumPy's, a crash, a file that takes longer, or one whose checksums do not fit and that is believed. (Rows of a run, which
are for the same solve alone, are believed if their sums fit.)
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import faulthandler
import io
import json
import operator
import os
import re
import resource
import signal
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from benchmarks.tables import markdown_table
from colloc.commands.referee import main as referee
from colloc.gaits.columns import Basis
from colloc.gaits.fitted_gait import fitted_gait
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import read_problem_file
from colloc.laws.fitted_friction import fitted_friction
from colloc.results import archive
from colloc.results.solution import Solution
from colloc.search.solve import solve
from colloc.studies import journal
from colloc.studies.known import known, save_known
from colloc.studies.study import read_study_file
from colloc.system.errors import CollocError, StoreError
from colloc.system.row_file import CACHE, put_rows, read_rows
from colloc.system.sealed_file import SEAL_SIZE, write_sealed
from tests.shared.store_forgery import checked_blocks, forged
from tests.shared.store_samples import HDF5_KINDS, ROW_KINDS, Samples

ROOT = Path(__file__).resolve().parents[1]
ODD: tuple[Any, ...] = (np.nan, np.inf, -np.inf, -1, 0, 1, 2, 0.5, 1e308, 10**40, "", "text", None, True, [], {}, [[1.0]], 65)
ODD_TEXTS = (*map(repr, ODD), "1e400", "(1e400 - 1e400)", "")
BATCH, MEMORY, LONGEST = 20, 3 * 2**30, 20
"""Files a process; its bytes; seconds a file."""
Damage = Callable[[np.random.Generator, bytes], bytes]


def never(before: Any, found: Any) -> bool:
    """For files with a seal: none that was damaged is read."""
    return False


def always(before: Any, found: Any) -> bool:
    """For files without checksums: what can be read is believed."""
    return True


def whole_rows(before: Any, found: Any) -> bool:
    """For files of rows: those that are whole are given back, and the others counted."""
    rows = [part.items() if isinstance(part, dict) else part for part in (before[0], found[0])]
    return all(row in rows[0] for row in rows[1]) and len(rows[1]) + found[1] >= len(rows[0])


class Reader(NamedTuple):
    """Whole files of one kind, how they are damaged, read and written, and whether what was read may be believed."""

    name: str
    file: str
    contents: list[bytes]
    damage: Damage
    read: Callable[[Path], Any]
    believed: Callable[[Any, Any], bool] = always
    write: Callable[[Path, bytes], Any] = Path.write_bytes


def other_bytes(rng: np.random.Generator, data: bytes) -> bytes:
    """The bytes with one of seven kinds of damage. (An empty file of rows is one that has none yet.)"""
    kind, where = rng.integers(7), int(rng.integers(1, len(data)))
    length = int(rng.integers(1, max(2, min(512, len(data) - where))))
    if kind == 6:  # bytes all over the file
        changed = bytearray(data)
        for k in rng.integers(0, len(data), 20):
            changed[k] = rng.integers(256)
        return bytes(changed)
    bit, noise = bytes([data[where] ^ (1 << int(rng.integers(8)))]), rng.bytes(length)
    puts, takes = [(bit, 1), (b"", len(data)), (noise, length), (noise[:1] * length, length), (b"", length), (noise, 0)][kind]
    return data[:where] + puts + data[where + takes :]


def other_text(rng: np.random.Generator, data: bytes) -> bytes:
    """One to three lines, numbers or words of a text exchanged or left out; or bytes of it changed."""
    if rng.integers(5) == 0:
        return other_bytes(rng, data)
    text = data.decode()
    for _ in range(rng.integers(1, 4)):
        kind, lines = rng.integers(4), text.splitlines(keepends=True)
        if kind == 0 and len(lines) > 1:
            k, other = rng.integers(len(lines), size=2)
            lines[k] = ["", lines[k] * 2, lines[other]][rng.integers(3)]
            text = "".join(lines)
            continue
        found = list(re.finditer(r"[\w.]+" if kind == 1 else r"\d+\.?\d*" if kind < 3 else r"[^\w\s]", text))
        if found:
            old, new = (found[k] for k in rng.integers(len(found), size=2))
            put = str(rng.choice(ODD_TEXTS)) if kind == 2 else "" if kind == 3 else new[0]
            text = text[: old.start()] + put + text[old.end() :]
    return text.encode()


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Holder and key of all that is within lists and dictionaries."""
    for key in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
        yield value, key
        yield from _places(value[key])


def other_json(rng: np.random.Generator, data: bytes) -> bytes:
    """One to three places of a JSON text left out, made odd, scaled, or made like another one."""
    value = json.loads(data)
    for _ in range(rng.integers(1, 4)):
        places = list(_places(value))
        if not places:
            break
        (holder, key), (other, there) = (places[k] for k in rng.integers(len(places), size=2))
        kind = rng.integers(4)
        if kind == 0:
            del holder[key]
        elif kind == 1 and isinstance(holder[key], int | float):
            holder[key] *= float(rng.choice([-1, 1e-3, 1e3, 1 + 1e-6]))
        else:
            holder[key] = copy.deepcopy(ODD[rng.integers(len(ODD))] if kind < 3 else other[there])
    return json.dumps(value).encode()


def other_fields(rng: np.random.Generator, data: bytes) -> bytes:
    """An HDF5 file in which one array, text or attribute is left out, or something else."""
    image = io.BytesIO(data)
    with h5py.File(image, "r+") as file:
        names: list[str] = []
        file.visit(names.append)
        holders = [(file, name) for name in names]
        holders += [(file[name].attrs, key) for name in ["/", *names] for key in file[name].attrs if not key.isupper()]
        holder, name = holders[rng.integers(len(holders))]
        thing = holder[name]
        value = None if isinstance(thing, h5py.Group) else np.asarray(thing[()] if isinstance(thing, h5py.Dataset) else thing)
        del holder[name]
        if value is None or rng.integers(4) == 0:
            pass
        elif value.dtype.kind == "S" and value.ndim == 0:
            with contextlib.suppress(ValueError):
                holder[name] = np.bytes_(other_json(rng, value.item()))
        elif value.size and value.dtype.kind in "fiu" and rng.integers(2):
            changed = value.astype(float)
            changed.flat[rng.integers(value.size)] = rng.choice([np.nan, np.inf, -1.0, 0.0, 1e308, 7.0])
            holder[name] = changed
        else:
            holder[name] = [value.ravel()[1:], np.stack([value] * 2), np.bytes_(b"text"), 10**9, -1.0, np.nan][rng.integers(6)]
    return image.getvalue()


def readers(folder: Path, solution: Solution) -> list[Reader]:
    """All that there are. `solution` is one to damage."""
    samples, found = Samples(folder / "whole", solution), []
    for kind in (*HDF5_KINDS, *ROW_KINDS):
        kept = samples.write(kind)
        data, again = kept.read_bytes(), partial(samples.read, kind)
        found.append(Reader(kind, kept.name, [data], other_bytes, again, whole_rows if kind in ROW_KINDS else never))
        if kind in HDF5_KINDS:
            inner = data[:-SEAL_SIZE]
            ways: dict[str, Damage] = {"sealed anew": other_bytes, "other fields": other_fields}
            ways["metadata forged"] = partial(forged, blocks=checked_blocks(inner))
            for how, damage in ways.items():
                found.append(Reader(f"{kind}, {how}", kept.name, [inner], damage, again, always, write_sealed))
        else:
            found.append(_of_rows(kind, kept, {"archive": archive.ROWS, "journal": journal.KIND, "cache": CACHE}[kind], again))
    problem = Problem("quick", gait=Harmonic(1, "bilateral"), delta=1e-2, delta_start=0.1, intervals=12, mesh_tolerance=1e-2)

    def went_on(path: Path) -> Any:
        end = solve(problem, 1, keep=path)
        return end.status, end.answer.x.tobytes()

    run = folder / "quick.run.sqlite"
    went_on(run)
    found.append(Reader("run", run.name, [run.read_bytes()], other_bytes, went_on, operator.eq))
    rows = {row.statement["name"]: row for row in known()}
    save_known(rows.values(), folder / "known.json")
    table = (folder / "known.json").read_bytes()
    save_known([rows["two_link"]], folder / "one.json")
    found.append(Reader("known gaits", "known.json", [table], other_json, lambda path: str([row.gait for row in known(path)])))
    found.append(Reader("referee", "one.json", [(folder / "one.json").read_bytes()], other_json, _refereed))
    for name, heads, columns, read in (
        ("table of friction", "speed,along,across,back", (0.5, 0.9, 0.6), lambda path: str(fitted_friction(path))),
        ("table of a gait", "time_s,left_deg,right_deg,left_N_m", (50, 40, 1), lambda path: str(fitted_gait(path, 2))),
        ("table of columns", "time,a,b", (1, 2), lambda path: Problem("x", gait=Basis(path)).hash),
    ):
        lines = [f"{k},{','.join(f'{c + 0.3 * c * np.cos(k * np.pi / 16 + c):.5f}' for c in columns)}" for k in range(32)]
        found.append(Reader(name, "table.csv", ["\n".join([heads, *lines]).encode()], other_text, read))
    files = sorted(ROOT.glob("problems/[a-z]*.py"))
    stated = [json.dumps(read_problem_file(file).problem.to_dict()).encode() for file in files]
    for name, texts, read in (
        ("problem", files, lambda path: _again(read_problem_file(path).problem.to_dict())),
        ("study", sorted(ROOT.glob("studies/[a-z]*.py")), lambda path: str(read_study_file(path)[0].shape)),
    ):
        contents = [file.read_bytes() for file in texts]
        found.append(Reader(f"{name} file", "x.py", contents, other_text, partial(_executed, read)))
    found.append(Reader("problem as JSON", "x.json", stated, other_json, lambda path: _again(json.loads(path.read_bytes()))))
    return found


def _of_rows(name: str, kept: Path, kind: str, read: Callable[[Path], Any]) -> Reader:
    """A file of rows whose values were exchanged before they were summed."""
    data = json.dumps(read_rows(kept, kind).values).encode()

    def write(path: Path, data: bytes) -> None:
        put_rows(path, kind, json.loads(data))

    return Reader(f"{name}, other rows", kept.name, [data], other_json, read, always, write)


def _refereed(path: Path) -> Any:
    with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.redirect_stderr(io.StringIO()) as why:
        code = referee(["--table", str(path), "--json"])
    if code:
        raise StoreError(why.getvalue() or said.getvalue())
    return said.getvalue()


def _again(stated: dict[str, Any]) -> str:
    """The hash of a problem, which it has however often it is written and read."""
    problem = Problem.from_dict(stated)
    assert Problem.from_dict(json.loads(json.dumps(problem.to_dict()))).hash == problem.hash
    return problem.hash


def _executed(read: Callable[[Path], Any], path: Path) -> str:
    """What a file that is executed states. What it raises is told in a sentence; an error from within colloc is not to be."""
    try:
        return read(path)
    except CollocError as error:
        inner = error.__context__
        frames = traceback.extract_tb(inner.__traceback__ if inner else None)
        within = frames and Path(frames[-1].filename).is_relative_to(ROOT / "colloc")
        if inner and within and not isinstance(inner, CollocError | SyntaxError | UnicodeDecodeError):
            raise inner from None
        raise


def outcomes(reader: Reader, seed: int) -> Iterator[tuple[str, str]]:
    """Of one file after the other what became of it, "refused", "same", "other" or "finding", and what was said or found."""
    before, number = [_tried(reader, data) for data in reader.contents], 0
    while True:
        read, write = os.pipe()
        process = os.fork()
        if process == 0:
            os.close(read)
            _batch(reader, seed, number, before, write)
        os.close(write)
        with os.fdopen(read, encoding="utf-8") as answers:
            done = [json.loads(line) for line in answers]
        ended = os.WTERMSIG(os.waitpid(process, 0)[1])  # 0 for a process that came to its end
        if ended:
            done.append(["finding", f"over {LONGEST} s" if ended == signal.SIGPROF else f"signal {ended}"])
        yield from done
        number += len(done)


def _tried(reader: Reader, data: bytes) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, reader.file)
        reader.write(path, data)
        return reader.read(path)


def _batch(reader: Reader, seed: int, first: int, before: list[Any], write: int) -> None:
    """Read files in a process of their own, and write what became of each as it happens."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    faulthandler.disable()
    for stream in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    warnings.simplefilter("ignore")
    warnings.simplefilter("error", RuntimeWarning)
    for number in range(first, first + BATCH):
        rng = np.random.default_rng([seed, *reader.name.encode(), number])
        k = int(rng.integers(len(reader.contents)))
        signal.setitimer(signal.ITIMER_PROF, LONGEST)
        try:
            data = reader.damage(rng, reader.contents[k])
            same = data == reader.contents[k]
            found = before[k] if same else _tried(reader, data)
            end = "same" if found == before[k] else "other", ""
            if not same and not reader.believed(before[k], found):
                end = "finding", "believed"
        except CollocError as error:
            end = "refused", str(error)
        except BaseException as error:
            last = [frame for frame in traceback.extract_tb(error.__traceback__) if "/colloc/" in frame.filename][-1:]
            where = "".join(f" ({Path(frame.filename).name}:{frame.lineno})" for frame in last)
            end = "finding", f"{type(error).__name__}: {str(error)[:100]}{where}"
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        os.write(write, (json.dumps(end) + "\n").encode())
    os._exit(0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    end, findings = time.monotonic() + 60 * options.minutes, Counter[str]()
    with tempfile.TemporaryDirectory() as folder:
        solution = solve(read_problem_file(ROOT / "problems" / "three_link.py").problem, 1)
        readings = {reader.name: outcomes(reader, options.seed) for reader in readers(Path(folder), solution)}
        seen = {name: Counter[str]() for name in readings}
        while time.monotonic() < end:
            for name, reading in readings.items():
                for became, why in islice(reading, BATCH):
                    seen[name][became] += 1
                    findings[f"{name}: {why}"] += became == "finding"
    heads = ["reader", "files", "refused in a sentence", "the same to the last bit", "other, and valid", "findings"]
    kinds = "refused", "same", "other", "finding"
    print(markdown_table(heads, [[name, sum(one.values()), *(one[kind] for kind in kinds)] for name, one in seen.items()]))
    print("\n".join(f"{count} x {what}" for what, count in (+findings).items()))


if __name__ == "__main__":
    main()
