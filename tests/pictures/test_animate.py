"""Animations: pictures that move with the body, and files others can play."""

import shutil
import subprocess

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.quiver import Quiver
from PIL import Image

import colloc
from colloc import save
from colloc.commands.results import animate as main
from colloc.pictures.figure import save_panels
from colloc.pictures.movie import frames, pictures, write_movie
from colloc.results.motion import lab_outline


def dark(picture):
    rows, columns = np.nonzero(picture[60:, : int(0.68 * picture.shape[1])].max(axis=2) < 80)
    left, right, top, bottom = columns.min(), columns.max(), 60 + rows.min(), 60 + rows.max()
    return 0.5 * (left + right), 0.5 * (top + bottom), right - left, bottom - top


def test_every_picture_shows_the_body_where_it_is_then(three_link):
    drawn, (low, high) = list(pictures(three_link, 2, 3)), frames(three_link, 3).window
    assert len(drawn) == 6
    tall, wide, _ = drawn[0].shape
    # video wants even numbers
    assert (wide, tall % 2, {picture.shape for picture in drawn}) == (900, 0, {drawn[0].shape})
    scale = 0.68 * wide / (high - low)[0]
    x, y = lab_outline(three_link.problem.body, three_link.sample(np.arange(6) / 2))
    x_mid, y_mid = (0.5 * (each.min(axis=0) + each.max(axis=0)) for each in (x, y))
    room = tall - 0.13 * wide  # the lower part, of this height
    columns = 0.015 * wide + scale * (x_mid - low[0])
    rows = 0.97 * tall - 0.5 * room - scale * (y_mid - 0.5 * (low + high)[1])
    middle_x, middle_y, across, upwards = np.transpose([dark(picture) for picture in drawn])
    np.testing.assert_allclose(middle_x, columns, atol=1.0)
    np.testing.assert_allclose(middle_y, rows, atol=3.0)  # the head is a disc
    for seen, extent in ((across, np.ptp(x, axis=0)), (upwards, np.ptp(y, axis=0))):
        assert np.all(np.abs(seen - scale * extent - 8.0) < 4.0)  # pixels, of the lines


def test_gif_has_the_pictures_and_the_pace_asked_for(three_link, tmp_path, capsys, monkeypatch):
    file = save(three_link, tmp_path / "x.h5")
    words = "--periods 1 --seconds 0.5 --fps 20 --width 300 --no-arrows"
    monkeypatch.setattr(Axes, "quiver", None)
    assert main([str(file), *words.split()]) == 0
    assert "saved" in capsys.readouterr().out
    with Image.open(tmp_path / "x.gif") as image:
        found = image.n_frames, image.info["duration"], image.info["loop"], image.size[0]
        assert found == (10, 50, 0, 300)


def extents(picture):
    """Widths and heights of the bodies in both halves, without the texts."""
    tall, wide, _ = picture.shape
    halves = picture[40 : tall - 100, : wide // 2], picture[40 : tall - 100, wide // 2 :]
    return [[np.ptp(x) for x in np.nonzero(half.max(axis=2) < 80)] for half in halves]


def test_a_gait_beside_itself_is_drawn_twice_alike(three_link, tmp_path, capsys):
    for picture in pictures(three_link, 3, 2, width=1000, beside=three_link):
        left, right = extents(picture)
        assert left == right
        assert max(left) > 100
    files = [str(save(three_link, tmp_path / f"{name}.h5")) for name in "ab"]
    assert main([*files, "--periods", "1", "--seconds", "1", "--fps", "5"]) == 0
    with Image.open(tmp_path / "a-b.gif") as image:
        assert (image.n_frames, image.size[0]) == (5, 900)


def test_robots_side_by_side_are_drawn_in_metres_and_seconds():
    """One of half the length and a quarter of the period; slow, so both do the same."""
    robots = (colloc.Robot(length=x, mass=1, period=t) for x, t in ((0.6, 400), (0.3, 100)))
    stated = (colloc.Problem("robot", gait=colloc.Harmonic(1), robot=robot) for robot in robots)
    big, small = (colloc.evaluate(each, colloc.ellipse(A0=0, A1=1.5, B1=1.0)) for each in stated)
    film = list(pictures(big, 8, 1, arrows=False, beside=small))
    drawn = [extents(picture) for picture in film]
    turned = pictures(small, 8, 1, arrows=False, beside=big)
    np.testing.assert_allclose([extents(picture)[::-1] for picture in turned], drawn, atol=2)
    lines = 9.0  # of joints and head, whose size does not change [pixels]
    (long, short), (_, again) = drawn[0], drawn[2]
    np.testing.assert_allclose(np.subtract(long, lines), 2 * np.subtract(short, lines), atol=9)
    np.testing.assert_allclose(again, short, atol=2)
    # squares are of 10 cm, but where both halves meet
    sides = np.diff(np.flatnonzero(np.median(film[0].mean(axis=2), axis=0) < 253))
    assert (np.abs(sides - np.median(sides)) > 1).sum() == 1
    size = 0.6 * np.ptp(lab_outline(big.problem.body, big.sample(0.0)), axis=(1, 2))[::-1]
    np.testing.assert_allclose(np.subtract(long, lines), size / 0.1 * np.median(sides), atol=9)


def test_friction_turns_with_a_body_that_turns_cycle_by_cycle(monkeypatch):
    drawn, draw = [], Quiver.set_UVC

    def kept(quiver, x, y, *colours):
        drawn.append(np.array(x) + 1j * np.array(y))
        draw(quiver, x, y, *colours)

    gait = colloc.Fourier([1.0, 1.1], [[-1.0], [0.7]], [[1.0], [0.9]])
    turning = colloc.evaluate(colloc.Problem("turns", delta=0.1, mesh_tolerance=1e-2), gait)
    monkeypatch.setattr(Quiver, "set_UVC", kept)
    assert len(list(pictures(turning, 2, 2, width=200))) == 4
    assert abs(turning.rotation) > 0.1
    first, then = np.split(np.array(drawn[-4:]), 2)
    np.testing.assert_allclose(then, np.exp(1j * turning.answer.rotation) * first, atol=1e-9)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_mp4_plays(three_link, tmp_path):
    path = write_movie(three_link, tmp_path / "x.mp4", periods=1, seconds=1.0, fps=10.0, width=301)
    asked = "ffprobe -v error -count_frames -show_entries stream=nb_read_frames,width -of csv=p=0"
    probe = subprocess.run([*asked.split(), path], capture_output=True, text=True, check=True)
    assert probe.stdout.strip() == "300,10"


def test_without_ffmpeg_an_mp4_is_refused_before_drawing(three_link, tmp_path, monkeypatch, capsys):
    file = save(three_link, tmp_path / "x.h5")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main([str(file), "--format", "mp4"]) == 2
    printed = capsys.readouterr().err
    assert "ffmpeg, which is not installed" in printed
    assert "--format gif" in printed
    assert {path.name for path in tmp_path.iterdir()} == {"x.h5"}


@pytest.mark.slow
def test_publication_figures_are_pdf_and_png_of_journal_width(three_link, tmp_path):
    written = save_panels(three_link, tmp_path / "x")
    names = {path.name for path in written}
    shown = ("filmstrip", "lab", "angles", "speeds", "power", "convergence", "mesh", "shape-1-2")
    assert names == {f"x-{n}.pdf" for n in shown}
    assert all(path.read_bytes().startswith(b"%PDF") for path in written)
    with Image.open(tmp_path / "x-power.png") as image:
        assert image.size[0] == pytest.approx(3.4 * 300, abs=1)
