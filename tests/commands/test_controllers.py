"""What controllers of robots are sent: the angles of the CSV, in the units and files they take."""

import json
import shutil
import subprocess

import numpy as np
import pandas
import pytest

import colloc
from colloc import save
from colloc.commands.results import export

CLAMP = "--clamp 1000 2000 900 3000"
CLAMPED = np.array([[1000, 900], [2000, 3000]])[..., None]
PULSES = {
    "": (1500, 100 / 9, (1, 1), (500, 2500)),
    "--sign 1 -1": (1500, 100 / 9, (1, -1), (500, 2500)),
    "--neutral 2048 --scale 11.378": (2048, 11.378, (1, 1), (-np.inf, np.inf)),
    f"--scale 8 10 --neutral 1500 1480 {CLAMP}": ((1500, 1480), (8, 10), (1, 1), CLAMPED),
}
PRINTING = """
#include <stdio.h>
#include "{file}"
int main(void) {{
  printf("%d %g %g\\n", x_joints, x_rate_hz, x_period_s);
  for (int k = 0; k < x_ramp_samples; k++) printf("%.9g %.9g\\n", (double)x_ramp[k][0], (double)x_ramp[k][1]);
  for (int k = 0; k < x_cycle_samples; k++)
    printf("%.9g %.9g\\n", (double)x_cycle[k][0], (double)x_cycle[k][1]);
  return 0;
}}
"""


@pytest.fixture
def sent(three_link, tmp_path):
    """A function from options to what the command writes; the angles as JSON beside it."""
    file = save(three_link, tmp_path / "x.h5")
    three_link.export(tmp_path / "x.json", period=4.0, rate=25.0)

    def written(options, name):
        assert export([str(file), "--period", "4", "--rate", "25", *options.split()]) == 0
        return tmp_path / name

    return written


def angles_of(path):
    data = json.loads((path.parent / "x.json").read_text())
    return [np.array(data[name]) for name in ("angles_rad", "speeds_rad_per_s")]


@pytest.mark.parametrize("options", PULSES)
def test_pulses_are_those_of_the_angles_and_what_is_clamped_is_said(options, sent, capsys):
    path = sent(f"--format pulses {options}", "x.pulses.csv")
    neutral, scale, sign, (low, high) = PULSES[options]
    angles, _ = angles_of(path)
    neutral, scale, sign = (np.resize(x, 2)[:, None] for x in (neutral, scale, sign))
    wanted = neutral + sign * scale * angles * 180 / np.pi
    table = pandas.read_csv(path, comment="#")
    assert [*table] == ["time_s", "joint_1_pulse", "joint_2_pulse"]
    pulses = table.to_numpy()[:, 1:].T
    assert (pulses == np.floor(np.minimum(np.maximum(wanted, low), high) + 0.5)).all()
    assert pulses[:, 0].tolist() == neutral.ravel().tolist()
    beyond = ((wanted < low) | (wanted > high)).sum(axis=1)
    lines = path.read_text().splitlines()
    stated = dict(line[2:].split(": ", 1) for line in lines if line.startswith("#"))
    assert json.loads(stated["clamped_samples"]) == beyond.tolist()
    assert json.loads(stated["scale"])[0] == pytest.approx(scale[0, 0])
    assert (f"{beyond[0]} of joint 1" in capsys.readouterr().out) == (beyond[0] > 0)


def test_degrees_are_read_again_as_the_same_gait(sent, three_link, tmp_path):
    read = colloc.evaluate(three_link.problem, sent("--degrees", "x.csv"))
    assert read.efficiency == pytest.approx(three_link.efficiency, rel=1e-4)


@pytest.mark.parametrize("periods", [1, 2])
def test_a_message_of_ros_begins_and_ends_straight_at_rest_with_the_gait_between(periods, sent):
    path = sent(f"--format ros --periods {periods}", "x.yaml")
    message = pytest.importorskip("yaml").safe_load(path.read_text())
    assert message.keys() == {"joint_names", "points"}
    assert message["joint_names"] == ["joint_1", "joint_2"]
    points = message["points"]
    assert all(type(x) is float for point in points for x in point["positions"])
    stamps = [point["time_from_start"] for point in points]
    time = np.array([stamp["sec"] + 1e-9 * stamp["nanosec"] for stamp in stamps])
    angles, speeds = (
        np.array([point[name] for point in points]).T for name in ("positions", "velocities")
    )
    np.testing.assert_allclose(time, np.arange(len(time)) / 25, atol=1e-9)
    assert not speeds[:, [0, -1]].any()
    assert np.abs(angles[:, [0, -1]]).max() < 1e-4
    before, fast = angles_of(path)  # the way in, and a period
    n = before.shape[1]
    np.testing.assert_allclose(angles[:, :n], before, atol=1e-6)
    np.testing.assert_allclose(speeds[:, :n], fast, atol=1e-6)
    mean = 0.5 * (speeds[:, 1:] + speeds[:, :-1])
    np.testing.assert_allclose(np.diff(angles) * 25, mean, atol=0.03 * np.abs(speeds).max())
    assert np.abs(speeds).max() < 1.001 * np.abs(fast).max()


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
@pytest.mark.parametrize("options", ["", "--output x.h --sign -1 --neutral 40000 --scale 10"])
def test_c_compiles_without_a_warning_and_holds_the_same(options, sent, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = sent(f"--format c {options}", "x.h")
    code, program = tmp_path / "x.c", tmp_path / "x.out"
    code.write_text(PRINTING.format(file=path.name))
    warnings = "-std=c99 -Wall -Wextra -Wpedantic -Wconversion -Werror"
    subprocess.run(["gcc", *warnings.split(), code, "-o", program], check=True)
    printed = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    head, *rows = printed.splitlines()
    assert head == "2 25 4"
    angles, _ = angles_of(path)
    wanted = 40000 - 10 * np.degrees(angles) if options else angles
    rows = np.array([row.split() for row in rows], dtype=float).T
    assert rows.shape == angles.shape
    np.testing.assert_allclose(rows, wanted, atol=0.5 if options else 1e-6)
