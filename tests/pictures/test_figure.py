"""The figure of a solution can be read: no words over words, nothing cut off, snapshots apart, and PDF only on demand."""

import subprocess
import sys
from itertools import pairwise

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from shared.readable import assert_readable

from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.limits import under_one_limit
from colloc.gaits.problem import Problem
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.pictures.figure import draw_filmstrip, forbidden, strips
from colloc.pictures.publication import panels
from colloc.pictures.solution_figure import solution_figure
from colloc.pictures.style import save
from colloc.smooth.modal_body import ModalBody
from scripts.gallery import picture


def crawler(n_link, size=0.6):
    j = np.arange(n_link - 1)
    guess = Fourier(np.zeros(n_link - 1), size * np.cos(0.9 * j)[:, None], size * np.sin(0.9 * j)[:, None] + 0.1)
    lengths = (1 / n_link,) * n_link
    return Problem("crawler", guess, Chain(lengths), Friction(1.5, 1.0, 1.2), gait=Harmonic(1), delta=1e-2, intervals=8)


def test_strips_have_the_width_of_the_links_and_round_ends():
    ends = np.array([[0.0, 0.4, 0.4], [0.0, 0.0, 0.6]])
    for strip, length in zip(strips(ends, 0.1), (0.4, 0.6), strict=True):
        x, y = strip.T
        area = 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
        assert area == pytest.approx(0.1 * length + np.pi * 0.05**2, rel=0.01)
    assert np.ptp(strips(ends, 0.1)[0], axis=0) == pytest.approx([0.5, 0.1])


@pytest.mark.parametrize(("n_link", "size"), [(2, 0.1), (2, 1.5), (3, 0.3), (4, 0.6), (5, 0.6), (8, 0.3)])
def test_no_words_over_words_and_nothing_cut_off(n_link, size, unsolved):
    solution = unsolved(crawler(n_link, size))
    texts = assert_readable(solution_figure(solution))
    assert "joint angle 2  [rad]" in texts if n_link == 3 else {"joint 1", *(f"{j}" for j in range(2, n_link))} <= set(texts)


def test_the_solved_problem_can_be_read(three_link):
    texts = assert_readable(solution_figure(three_link))
    assert any("efficiency d/W = 0.26003" in text for text in texts)


@pytest.mark.parametrize("name", ["lab", "angles", "speeds", "power", "convergence", "mesh", "shape-1-2", "filmstrip"])
def test_panels_alone_can_be_read(name, three_link):
    assert_readable(panels(three_link)[name].figure())


def test_a_reader_of_words_sees_an_overlap():
    figure = Figure(figsize=(4, 2))
    figure.text(0.1, 0.5, "one")
    figure.text(0.11, 0.5, "two")
    with pytest.raises(AssertionError, match="lies on"):
        assert_readable(figure)


@pytest.mark.parametrize("n_link", [2, 3, 5])
def test_snapshots_never_touch(n_link, unsolved):
    axes = Figure().add_subplot()
    draw_filmstrip(axes, unsolved(crawler(n_link, 1.5)))
    bodies = [line.get_xdata() for line in axes.lines if line.get_linestyle() == "-"]
    assert len(bodies) == 11
    for left, right in pairwise(bodies):
        assert right.min() - left.max() > 0.1


def test_forbidden_shapes_are_the_exact_set_of_the_three_link_body():
    """Design: crossing iff both angles positive and min(2 a + b, a + 2 b) > 2 pi, or the mirror image."""

    def area(limit):
        return float((forbidden(Chain(), limit)[1][:-1, :-1] > 0).mean()) * (2 * np.pi) ** 2

    # per sign: the triangle-like region min(2a+b, a+2b) > 2 pi in [0, pi]^2 has area pi^2 / 6
    assert area(np.pi) == pytest.approx(2 * np.pi**2 / 6, rel=0.03)
    assert area(np.pi / 2) == pytest.approx(3 * np.pi**2, rel=0.03)


@pytest.mark.parametrize(
    ("body", "limit", "plane", "share"),
    [
        (Chain(), 2.5, (0, 1), None),
        (Chain((0.25,) * 4), (1.0, 2.0, 3.0), (1, 2), 1 - 2.0 * 3.0 / np.pi**2),
        (Chain((0.2,) * 5), np.pi, (2, 3), 0.0),
        (ModalBody(2, panels=4), 0.8, (0, 1), None),
        (ModalBody(3, panels=4), 0.8, (1, 2), 0.0),
    ],
    ids=["three links", "limits of each joint", "five links", "two modes", "three modes"],
)
def test_no_shape_that_is_allowed_lies_in_the_grey(body, limit, plane, share):
    grid, excess = forbidden(body, limit, *plane)
    if share is not None:
        assert (excess > 0).mean() == pytest.approx(share, abs=0.01)
    shapes = np.random.default_rng(7).uniform(-np.pi, np.pi, (body.n_joint, 20000))
    shapes = np.concatenate([shapes, 0.4 * shapes], axis=1)
    stretched, most = under_one_limit(shapes, limit)
    allowed = shapes[:, (body.largest_angles(stretched) <= most) & (body.crossing_depth(shapes) == 0)]
    assert allowed.shape[1] > 100
    column, row = (np.abs(grid[:, None] - allowed[j]).argmin(axis=0) for j in plane)
    assert excess[row, column].max() < 2.5 * (grid[1] - grid[0])  # no deeper than the nearest point of the grid may be


def test_only_the_kinds_asked_for_are_written_and_nobodys_settings_change(tmp_path):
    before = dict(matplotlib.rcParams)
    figure = Figure(figsize=(1, 1))
    assert save(figure, tmp_path / "x.y", ("png",)) == [tmp_path / "x.y.png"]
    assert {path.name for path in tmp_path.iterdir()} == {"x.y.png"}
    assert dict(matplotlib.rcParams) == before


def test_solving_and_drawing_load_nothing_that_is_not_used():
    program = (
        "import sys, colloc.commands.solve; assert 'matplotlib' not in sys.modules; import colloc.studies.saved, "
        "colloc.pictures.solution_figure;"
        "print(*sys.modules)"
    )
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    assert "matplotlib.figure" in loaded
    parts = {f"scipy.{part}" for part in ("integrate", "interpolate", "optimize", "special", "stats")}
    assert not {"matplotlib.pyplot", "matplotlib.backends.backend_pdf", "jinja2", *parts} & set(loaded)


@pytest.mark.parametrize(("n_link", "size"), [(2, 1.5), (3, 0.3), (5, 0.6)])
def test_pictures_of_the_gallery_can_be_read(n_link, size, unsolved):
    assert_readable(picture(unsolved(crawler(n_link, size))))


@pytest.mark.parametrize(("size", "times"), [(0.02, 21), (0.6, 1)])
def test_a_flat_motion_is_drawn_higher_and_says_so(size, times, unsolved):
    body, gait = Chain((0.25,) * 4), Fourier(np.zeros(3), size * np.ones((3, 1)), size * np.array([[1.0], [0.0], [-1.0]]))
    axes = Figure().add_subplot()
    problem = Problem("flat", gait, body, gait=Harmonic(1), delta=1e-2, intervals=8, smallest_shape_speed=1e-3)
    draw_filmstrip(axes, unsolved(problem))
    said = [text.get_text() for text in axes.texts if "heights" in text.get_text()]
    drawn = np.ptp(np.concatenate([line.get_ydata() for line in axes.lines if line.get_linestyle() == "-"]))
    assert drawn > 0.2
    assert said == ([] if times == 1 else [f"heights drawn {times} times as large"])
