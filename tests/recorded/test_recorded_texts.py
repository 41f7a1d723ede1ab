"""What colloc prints, writes and draws about results in many states is what it was when it was last
read: words to the letter, numbers up to rounding.

A file of `texts` is a record: lines that begin with ``$`` are commands of ``colloc``, or of `ALSO`
below, and what they print follows. They are recorded anew by

    COLLOC_RECORD=1 python -m pytest tests/recorded/test_recorded_texts.py

and what has changed then is to be read before it is committed. Numbers are compared to 2e-4 or a
unit of the last digit, whole ones exactly; those with exponents, which are errors, within a factor
of 3, and not at all where both are rounding. What depends on the machine is left out.
"""

import os
import re
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver

import colloc as library
from colloc import Objective, Reference, save
from colloc.commands.main import main
from colloc.commands.solve import summary_lines
from colloc.gaits.parameters import parameters  # noqa: F401 (which texts name)
from colloc.pictures.movie import pictures
from colloc.pictures.report_page import report_page
from colloc.results.answer import SecondOrder
from colloc.results.archive import StartName
from colloc.search.certify import certify
from colloc.studies.families import Gap, ParetoFront, Steering, read_front
from tests.recorded.states import MADE, STATED, state
from tests.shared.store_samples import archive, outcome

TEXTS = Path(__file__).with_name("texts")
NUMBER = re.compile(r"([-+−]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)")
PRECISION, FACTOR, ROUNDING, OF_MACHINE = 2e-4, 3.0, 1e-6, 1e-12
PAPER = Reference(0.25, 0.02, "a paper")
MACHINE = {
    r"in \d+\.\d s\b": "in ... s",
    r"\d+ (time points|iterations)": r"... \1",
    r"best of 32 starts; \d+ converged": "best of 32 starts; ... converged",
    r"\(\d+ starts?\)": "(... starts)",
    r"\(\d+ kB": "(... kB",
    r"[0-9a-f]{64}": "...",
    r"(?m)^(python|colloc|casadi|numpy|scipy|h5py)\n\d\S*$": r"\1 ...",
    r"colloc \d\S*": "colloc ...",
    r"\d+\.\d+\n\d+\.\d s in all": "... s in all",
    r"(?m)^seconds\n\S+\n\S+$": "seconds ...",
    r"(?m)^(seconds +|iterations +|intervals +)\d.*": r"\1...",
}
"""What no two machines print alike."""
READ = {
    "loop.py": "from colloc import *\nPROBLEM = Problem('loop', gait=Harmonic(1), delta=1e-2)\n",
    "study.py": (
        "from colloc import *\n"
        "STUDY = Study('none', (Axis('mu_t', (1, 2)),), lambda mu_t: Problem('no', delta=-mu_t))\n"
    ),
}
NAMES = "time_s,joint_1,joint_2,x_mm,y_cm"
ALSO = {}


def also(function):
    ALSO[function.__name__] = function
    return function


@also
def colloc(*words):
    code = main(words)
    return f"exit code {code}" * (code != 0)


@also
def summary(name, *verbose):
    return "\n".join(summary_lines(state(name), PAPER if verbose else None, verbose=bool(verbose)))


@also
def show(file, first=1, last=None):
    """Lines of a file."""
    lines = Path(file).read_text(encoding="utf-8").splitlines()
    return "\n".join(lines[int(first) - 1 : int(last or len(lines))])


@also
def say(*words):
    """A text, or what a part says of itself, by any expression with the public names."""
    made = eval(" ".join(words), {x: getattr(library, x) for x in library.__all__} | globals())
    return made.describe() if hasattr(made, "describe") else str(made)


@also
def curvature(*stated):
    """The check of such a curvature, its error and so many free directions."""
    smallest, error, n_free = map(float, stated)
    found = SecondOrder(smallest, error, int(n_free))
    answer = replace(state("swimmer").answer, program="reduced", second_order=found)
    return next(x.line() for x in certify(answer).checks if x.name == "second order")


@also
def film(name, beside=None):
    """What the eighth picture of a film says and draws, in its second cycle."""
    made = []

    def kept(**how):
        made.append(Figure(**how))
        return made[-1]

    how = {"from_rest": True} if beside == "rest" else {"beside": beside and state(beside)}
    with patch("colloc.pictures.movie.Figure", kept):
        drawn = pictures(state(name), 5, 2, width=400, **how)
        for _ in range(8):
            next(drawn)
    return described(made[0])


@also
def page(name, lines=None, beside=None):
    """Words (or lines) of the report without drawings; of a front with a result beside it."""
    more = {"front": front_of(name, beside), "beside": state(beside)} if beside else {}
    more |= {"robot": state(name).robot()} if beside else {}
    text = words_of(report_page(state(name), PAPER, "  upper bound 1", **more))
    # the file that states it has them, too
    words = re.sub(r"(?s)(All fields, as solved).*(How to)", r"\1\n\2", text).splitlines()
    return "\n".join(words[: int(lines or len(words))])


def front_of(*names):
    # copies, for commands say of members of a family which file stated them
    points = tuple(replace(state(name)) for name in names)
    gaps = (Gap(0, "The best gaits are those beside it.", True),)
    aims = Objective("distance"), points[0].problem.objective
    return ParetoFront(points[0].problem, aims, points, gaps)


def words_of(page):
    plain = re.findall(r'"(grid|shape|width|arrowScale)":([^,}]*)', page)
    page += "\n".join(map(" ".join, plain))
    page = re.sub(r'<input [^>]*(min="[^"]*" max="[^"]*")[^>]*>', r"\1", page)
    page = re.sub(r"(?s)<(style|script|svg).*?</\1>", "", page)
    return re.sub(r"\s*\n\s*", "\n", re.sub(r"(<[^>]*>\s*)+", "\n", page))


@also
def draw(name, panel=None):
    solution = state(name)
    if panel is None:
        return described(solution.plot())
    return described(solution.plot(Figure().add_subplot(), panel).figure)


def described(figure):
    """What a figure says and draws; lines of one look but for their colour together."""
    rows = [f"text: {text.get_text()}" for text in figure.texts]
    for axes in figure.axes:
        rows.append(f"axes: {axes.get_title()}")
        for axis, view in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            labelled = axes.axison and axis.get_scale() != "log"  # decades are matplotlib's choice
            ticks = [tick.get_text() for tick in axis.get_ticklabels()] if labelled else []
            named = f"{axis.get_label_text()}: {' '.join(ticks)}"
            rows.append(f"  {named}, {axis.get_scale()}, {span(view)}")
        if legend := axes.get_legend():
            rows.append(f"  legend: {', '.join(text.get_text() for text in legend.get_texts())}")
        if axes.texts:
            said = (x.get_text() or f"arrow {span((*x.xyann, *x.xy))}" for x in axes.texts)
            rows.append(f"  text: {', '.join(said)}")
        looks = {}
        for line in axes.lines:
            xy = np.array(line.get_data(), dtype=float)
            look = f"{line.get_linestyle()} {line.get_marker()} {line.get_linewidth():.3g}"
            looks.setdefault(look, []).append((to_hex(line.get_color()), xy))
        for look, lines in looks.items():
            colours = [*dict.fromkeys(colour for colour, _ in lines)]
            rows.append(
                f"  {len(lines)} x {look}, {len(colours)} colours {' '.join(colours[:4])}: "
            )
            rows[-1] += course(np.concatenate([xy for _, xy in lines], axis=1))
        for marks in axes.collections:
            xy = np.array(marks.get_offsets(), dtype=float).reshape(-1, 2)
            if len(xy) < 2:
                xy = np.concatenate([xy[:0], *(path.vertices for path in marks.get_paths())])
            rows.append(f"  {type(marks).__name__}: {course(xy.T)}")
            if isinstance(marks, Quiver):
                rows.append(f"  its arrows: {course(np.array([marks.U, marks.V]))}")
    return "\n".join(rows)


@also
def pareto():
    front = front_of("robot", "small")
    with patch("colloc.studies.families.pareto_front", return_value=front) as asked:
        colloc("pareto", "loop.py", "--objectives", "speed", "towing", "--no-figure")
    again = read_front(Path("results/loop.front.csv"), front.problem)
    other = read_front(Path("results/loop.front.csv"), front.problem.with_(delta=2e-2))
    said = [front, again, again.gaps, other, {**asked.call_args[1], "progress": None}]
    np.testing.assert_array_equal(again.values, front.values)
    return "\n".join([*map(repr, said), described(front.plot())])


@also
def steer():
    right, straight = replace(state("turning")), replace(state("loop"))
    family = Steering(right.problem, (right.rotation, 0.0), (right, straight), None)
    spot = replace(family, turns=family.turns[:1], points=family.points[:1])
    family = replace(family, on_the_spot=spot)
    with patch("colloc.studies.families.steer", return_value=family) as asked:
        colloc("steer", "loop.py", "--turn", "-10", "5", "--spot", "20")
    how = {**asked.call_args[1], "progress": None}
    return f"{asked.call_args[0][1]}, {how}\n{family!r}\n{described(family.plot())}"


def span(values):
    return " to ".join(f"{x:.4g}" for x in values)


def course(xy):
    """Number of points, and first, last, smallest, largest and mean x and y of these."""
    xy = xy[:, np.isfinite(xy).all(axis=0)]
    if not xy.size:
        return "nothing"
    told = (f"{span(z[[0, -1]])} in {span((z.min(), z.max()))}, mean {z.mean():.4g}" for z in xy)
    return f"{xy.shape[1]} points, {'; '.join(told)}"


def printed(line, capsys):
    name, *words = line.split()
    text = ALSO[name](*words) or ""
    text = "".join(capsys.readouterr()) + text
    for pattern, instead in MACHINE.items():
        text = re.sub(pattern, instead, text)
    text = NUMBER.sub(lambda number: shortened(number[0]), text)
    return [each.rstrip() for each in text.strip("\n").splitlines()]


def shortened(number):
    """A number with no more digits than are compared, and none of rounding."""
    value = float(number.replace("−", "-"))
    if "e-" in number and abs(value) < OF_MACHINE:
        return "0"
    long = "." in number and len(number.strip("+-−0.").replace(".", "")) > 7
    return f"{value:.6g}" if long else number


def same(found, known):
    """Whether two lines say the same."""
    one, other = NUMBER.split(found), NUMBER.split(known)
    if one[::2] != other[::2]:
        return False
    is_error = [bool(re.search(r"(\+- ?|± ?)$", word)) for word in other[::2]]
    return all(map(same_number, one[1::2], other[1::2], is_error))


def same_number(found, known, is_error=False):
    if found == known:
        return True
    a, b = (float(text.replace("−", "-")) for text in (found, known))
    if is_error or "e-" in found + known:
        larger, smaller = max(abs(a), abs(b)), min(abs(a), abs(b))
        alike = larger <= FACTOR * smaller and (a > 0) == (b > 0)
        return alike or larger < (OF_MACHINE if is_error else ROUNDING)
    if "." not in found + known:
        return False
    unit = 10.0 ** -len(known.partition(".")[2].partition("e")[0])
    return abs(a - b) <= 1.01 * unit + PRECISION * abs(b)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with what commands read."""
    made = tmp_path_factory.mktemp("texts")
    for name, text in READ.items():
        (made / name).write_text(text, encoding="utf-8")
    time = np.arange(41) / 10
    motion = state("loop").sample(time / 4)
    angles = [*np.degrees(motion.angles), *np.multiply([[2e3], [2e2]], motion.centre)]
    digits = "%.2f,%.4f,%.4f,%.6f,%.6f"
    np.savetxt(made / "crawls.csv", np.transpose([time, *angles]), digits, header=NAMES)
    found = archive(made / "starts.h5")
    failed = replace(outcome(3), status="not converged", message="It did not end.")
    found.add({StartName("latin-hypercube", 0, 3): failed})
    return made


@pytest.mark.parametrize("name", sorted(file.stem for file in TEXTS.glob("*.txt")))
def test_texts_are_what_they_were(name, folder, solved, monkeypatch, capsys):
    if name == "optimum":
        monkeypatch.setitem(MADE, name, solved("three_link")[0])
    file, found = TEXTS / f"{name}.txt", []
    monkeypatch.chdir(folder)
    recorded = file.read_text(encoding="utf-8").splitlines()
    for line in (each for each in recorded if each.startswith("$ ")):
        for word in line.split():
            stem = word.removesuffix(".h5")
            if stem in {**MADE, **STATED} and stem != word and not Path(word).exists():
                save(state(stem), word)
        found += [line, *printed(line[2:], capsys)]
    if os.environ.get("COLLOC_RECORD"):
        file.write_text("\n".join(found) + "\n", encoding="utf-8")
        return
    differ = [
        f"recorded: {known}\nfound:    {now}"
        for now, known in zip_longest(found, recorded, fillvalue="(nothing)")
        if not same(now, known)
    ]
    assert not differ, "\n".join(differ[:10])
