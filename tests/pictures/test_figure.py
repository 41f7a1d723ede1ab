"""Figures can be read, nothing over words or cut off, whatever backend and style are named."""

import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from scipy.interpolate import RegularGridInterpolator
from shared.readable import assert_readable

from colloc import Chain, Foot, Fourier, Friction, Harmonic, ModalBody, Pad, Problem, Wheel, save
from colloc.gaits.robot import under_one_limit
from colloc.mechanics.contact import crossing_depth
from colloc.pictures.figure import draw_filmstrip, draw_lab, forbidden, panels
from colloc.pictures.style import save as save_figure
from tests.shared.cases import slow, slow_but

STANDS = (
    Foot(0),
    *(Wheel(1, 0.3, offset=side * 0.05, angle=side * 0.6) for side in (1, -1)),
    Pad(2, 0.2, 0.8),
    Wheel(3),
)
COMMANDS = (slow("report one.h5"), slow("animate one.h5 --periods 1 --seconds 0.2 --width 200"))


def crawler(n_link, size=0.6):
    """A travelling wave along a chain."""
    lag = 0.9 * np.arange(n_link - 1.0)[:, None]
    guess = Fourier(0 * lag[:, 0], size * np.cos(lag), size * np.sin(lag) + 0.1)
    body, friction = Chain((1 / n_link,) * n_link), Friction(mu_t=1.5, mu_f=1.0, mu_b=1.2)
    return Problem("crawler", guess, body, friction, Harmonic(1), delta=1e-2, intervals=8)


def bodies(axes):
    """Outlines ``(2, n_point)`` of those that are drawn."""
    return [np.array(line.get_data()) for line in axes.lines if line.get_linewidth() == 2.4]


@pytest.mark.parametrize(
    ("n_link", "size"),
    slow_but(
        [(2, 1.5), (4, 0.6), (9, 0.3)],
        [(2, 0.1), (2, 1.5), (3, 0.3), (4, 0.6), (5, 0.6), (6, 0.5), (9, 0.3), (13, 0.2)],
    ),
)
def test_no_words_over_words_and_nothing_cut_off(n_link, size, unsolved):
    texts = assert_readable(unsolved(crawler(n_link, size)).plot())
    named = range(2, n_link) if n_link <= 9 else (4, 7, 9, 12)
    joints = {"joint angle 2  [rad]"} if n_link == 3 else {"joint 1", *map(str, named)}
    assert joints <= set(texts)


@pytest.mark.parametrize("n_link", [6, slow(13)])
def test_joints_of_a_robot_are_named_above_the_panels_in_colours_that_differ(n_link, unsolved):
    figure = unsolved(crawler(n_link, 0.3)).robot(length=1.0, mass=1.0, period=4.0).plot()
    assert_readable(figure)
    for axes in figure.axes:
        assert axes.get_legend().get_window_extent().y0 >= axes.bbox.y1
        assert len({to_hex(line.get_color()) for line in axes.lines}) == n_link - 1


def test_bars_of_wheels_and_pads_lie_along_them(unsolved):
    body, axes = Chain((0.25,) * 4, feet=STANDS), Figure().add_subplot()
    solution = unsolved(replace(crawler(4), body=body))
    draw_lab(axes, solution)
    _, wheels, pad = axes.lines[-6::2]
    fine = solution.sample(float(axes.get_xlabel().split()[-2]))
    links = fine.theta[0] + np.cumsum(np.insert(fine.angles[:, 0], 0, 0.0))
    for line, wanted in ((wheels, [(1, -0.6), (1, 0.6), (3, 0.0)]), (pad, [(2, 0.0)])):
        first, last = (np.array(line.get_data())[:, end::3] for end in (0, 1))
        off = np.arctan2(*(last - first)[::-1]) - [links[link] + angle for link, angle in wanted]
        np.testing.assert_allclose(np.sin(off), 0, atol=1e-9)


@pytest.mark.parametrize("size", [0.3, 1.5])
def test_planes_of_shapes_of_one_gait_share_one_scale(size, unsolved):
    problem, less = crawler(4, size), [[1.0], [0.2], [0.1]]
    wide = Fourier(problem.guess.mean, problem.guess.cos * less, problem.guess.sin * less)
    drawn = panels(unsolved(problem.with_(guess=wide)))
    axes = [drawn[name].figure().axes[0] for name in drawn if name.startswith("shape")]
    assert len(axes) == 2
    assert np.ptp([[np.ptp(panel.get_xlim()), np.ptp(panel.get_ylim())] for panel in axes]) < 1e-12


def test_the_solved_problem_can_be_read(three_link):
    assert_readable(three_link.plot())


@pytest.mark.parametrize(
    "name", ["lab", "angles", "speeds", "power", "convergence", "mesh", "shape-1-2", "filmstrip"]
)
def test_panels_alone_can_be_read_and_hold_all_that_is_drawn(name, three_link):
    figure = panels(three_link)[name].figure()
    assert_readable(figure)
    (axes,) = figure.axes
    for side in ("intervalx", "intervaly"):
        seen, drawn = getattr(axes.viewLim, side), getattr(axes.dataLim, side)
        rounding = 1e-6 * np.ptp(seen)  # of older ones of matplotlib
        assert min(seen) - rounding <= min(drawn) <= max(drawn) <= max(seen) + rounding


@pytest.mark.parametrize("n_link", [2, 3, 5])
def test_snapshots_never_touch_and_are_the_body_in_the_lab_moved_to_their_places(n_link, unsolved):
    solution, axes = unsolved(crawler(n_link, 1.5)), Figure().add_subplot()
    draw_filmstrip(axes, solution)
    drawn, motion = bodies(axes), solution.sample(np.linspace(0.0, 1.0, 11))
    assert len(drawn) == 11
    for left, right in pairwise(drawn):
        assert 0.1 < right[0].min() - left[0].max() < 0.6
    tails = np.stack([body[:, 0] for body in drawn], axis=1)
    marks = [line.get_data() for line in axes.lines if line.get_marker() == "+"]
    centres = np.concatenate(marks, axis=1)
    np.testing.assert_allclose(tails[1], motion.tail[1], atol=1e-12)
    np.testing.assert_allclose(centres - tails, motion.centre - motion.tail, atol=1e-12)
    said = [float(text.get_text().replace("−", "-")) for text in axes.texts]
    np.testing.assert_allclose(said[::2], np.linspace(0.0, 1.0, 11))
    np.testing.assert_allclose(said[1::2], motion.centre[0], atol=5.1e-3)


def test_forbidden_shapes_are_the_exact_set_of_the_three_link_body():
    """Crossing iff min(2 a + b, a + 2 b) > 2 pi with both positive, or mirrored."""

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
    within = body.bounded_angles.largest(stretched) <= most
    allowed = shapes[:, within & (crossing_depth(body, shapes) == 0)]
    assert allowed.shape[1] > 100
    assert RegularGridInterpolator((grid, grid), excess.T)(allowed[[*plane]].T).max() < 0


def python(*words, folder=None, **environment):
    how = {"capture_output": True, "text": True, "env": os.environ | environment, "cwd": folder}
    done = subprocess.run([sys.executable, *words], **how)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_draw_where_the_environment_names_a_backend_that_there_is_not(
    command, three_link, tmp_path
):
    """A notebook's terminal does: module://matplotlib_inline.backend_inline."""
    save(three_link, tmp_path / "one.h5")
    python("-m", "colloc", *command.split(), folder=tmp_path, MPLBACKEND="no_such_name")
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(
    ("before", "backend"), [("", "module://no.such_name"), slow(("matplotlib, ", "svg"))]
)
def test_a_script_draws_whatever_backend_is_named_and_one_that_there_is_stays(
    before, backend, three_link, tmp_path
):
    save(three_link, tmp_path / "one.h5")
    drawn = f"import os, {before}colloc; colloc.load('one.h5').plot().savefig('one.png')"
    asked = "print(matplotlib.rcParams['backend'] == 'svg', os.environ['MPLBACKEND'])"
    said = python("-c", f"{drawn}; import matplotlib; {asked}", folder=tmp_path, MPLBACKEND=backend)
    assert (tmp_path / "one.png").exists()
    assert said == f"{backend == 'svg'} {backend}\n"


def test_a_style_that_cannot_be_drawn_with_is_of_no_account_and_stays(three_link, tmp_path):
    with matplotlib.rc_context(
        {"text.usetex": True, "figure.figsize": (1.0, 1.0), "font.family": "no such font"}
    ):
        mine = dict(matplotlib.rcParams)
        drawn = save_figure(three_link.plot(), tmp_path / "styled", ("png",))
        assert dict(matplotlib.rcParams) == mine
    usual = save_figure(three_link.plot(), tmp_path / "usual", ("png",))
    assert drawn[0].read_bytes() == usual[0].read_bytes()
