"""A record of joint angles is read as robots, loggers and spreadsheets write it, or refused in a
sentence with a cure."""

import time

import numpy as np
import pytest

import colloc
from colloc.gaits.fitted_gait import fitted_gait

GAIT = colloc.Fourier(
    [0.2, -0.1, 0.1], [[0.6, 0.05], [0.3, 0.0], [-0.3, 0.0]], [[0.0, 0.1], [0.5, -0.05], [0.4, 0.0]]
)
T = np.arange(60) / 60
SECONDS, ANGLES = 4 * T, GAIT.angles(T)
DEGREES = np.degrees(ANGLES)
A, B, C = ANGLES
D, E, F = DEGREES
STAMPS = [f"2026-01-31T12:00:{s:09.6f}Z" for s in SECONDS]
NANOSECONDS = [f"{1_700_000_000_000_000_000 + round(s * 1e9)}" for s in SECONDS]


def table(*columns, between=",", comma=False, end="\n", digits=9):
    lines = []
    for row in zip(*columns, strict=True):
        cells = [cell if isinstance(cell, str) else f"{cell:.{digits}g}" for cell in row]
        lines.append(between.join(cell.replace(".", ",") if comma else cell for cell in cells))
    return end.join([*lines, ""])


def read(tmp_path, content, **settings):
    path = tmp_path / "record.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return fitted_gait(path, 3, **settings)


ROS = "%time,field.header.seq,field.header.frame_id,field.name0,field.name1,field.name2,field.position0,field.position1,field.position2,field.velocity0\n"
TOPIC = "/joint_states/joint_"
# fmt: off
READ = {
    "tail last": ("time_s,joint_3_rad,joint_2_rad,joint_1_rad\n" + table(SECONDS, C, B, A), "by name from joint_1_rad"),
    "from zero": ("t,q2,q0,q1\n" + table(SECONDS, C, A, B), "from q0 ... q2, radians; time from t"),
    "numbers of one digit and two": ("t,q11,q9,q10\n" + table(SECONDS, C, A, B), "from q9 ... q11"),
    "letters": ("ElapsedTime, Axis_B, Axis_A, Axis_C\n" + table(SECONDS, B, A, C), "from Axis_A ... Axis_C"),
    "units in brackets": ("Time [ms],Joint 3 [deg],Joint 1 [deg],Joint 2 [deg]\n" + table(1000 * SECONDS, F, D, E), "degrees; time in ms"),
    "one column of degrees": ("t,joint_1_rad,joint_2_deg,joint_3_rad\n" + table(SECONDS, A, E, C), r"radians \(but joint_2_deg degrees\)"),
    "the joint at the tail in degrees": ("t,joint_1_deg,joint_2_rad,joint_3_rad\n" + table(SECONDS, D, B, C), r"radians \(but joint_1_deg degrees\)"),
    "units in a row": ("time,joint_1,joint_2,joint_3,current_1\ns,deg,deg,deg,mA\n" + table(SECONDS, D, E, F, T), "degrees; time in s; ignored: current_1 mA"),
    "rostopic echo": (ROS + table(NANOSECONDS, range(60), ["base"] * 60, *([f"j{j}"] * 60 for j in (3, 1, 2)), C, A, B, A), "from j1 ... j3"),
    "a bag by pandas": ("Time,name,position_0,position_1,position_2\n" + table(SECONDS, ["\"['j3', 'j1', 'j2']\""] * 60, C, A, B), "from j1 ... j3"),
    "PlotJuggler": ("__time," + ",".join(f"{TOPIC}{j}/{what}" for j in (1, 2, 3) for what in ("position", "velocity")) + "\n" + table(1.7e9 + SECONDS, A, A, B, B, C, C, digits=16), "ignored: /joint_states/joint_1/velocity"),
    "driver of an arm": ("time_ms,read_attempt,joint_0_pos,joint_1_pos,joint_2_pos,joint_0_vel,joint_1_vel,joint_2_vel\n" + table(1000 * SECONDS, range(60), A, B, C, A, B, C), "from joint_0_pos ... joint_2_pos"),
    "commanded and measured": ("t,cmd_1,cmd_2,cmd_3,meas_1,meas_2,meas_3\n" + table(SECONDS, B, C, A, A, B, C), "from meas_1 ... meas_3"),
    "seconds and nanoseconds": ("stamp.sec,stamp.nanosec,q1,q2,q3\n" + table([f"{int(s) + 1000}" for s in SECONDS], [f"{round(s % 1 * 1e9)}" for s in SECONDS], A, B, C), "time in s"),
    "date and time": ("timestamp,joint_1,joint_2,joint_3\n" + table(STAMPS, A, B, C), "time of day, in s"),
    "time of day": ("clock,q1,q2,q3\n" + table([s[11:-1].replace("12:", "9:", 1) for s in STAMPS], A, B, C), "time of day, in s"),
    "minutes and seconds": ("time,q1,q2,q3\n" + table([f"{int(58 + s) // 60:02}:{(58 + s) % 60:09.6f}" for s in SECONDS], A, B, C), "time of day, in s"),
    "a clock past midnight": ("date,time,q1,q2,q3\n" + table(*zip(*(("05-04", f"00:00:{s - 2:09.6f}") if s >= 2 else ("05-03", f"23:59:{s + 58:09.6f}") for s in SECONDS), strict=True), A, B, C), "time of day, in s; ignored: date"),
    "a period in seconds": ("# period_s: 4\nt_ms,q1,q2,q3\n" + table(1000 * SECONDS, A, B, C), "time in ms"),
    "no times": ("Servo1 Position,Servo2 Position,Servo3 Position\n" + table(A, B, C), "time in equal steps"),
    "counted samples, two dropped": ("seq,q1,q2,q3\n" + table(*(np.delete(each, [7, 30]) for each in (np.arange(60), A, B, C))), r"time in samples \(seq\)"),
    "every third row missing": ("t,q1,q2,q3\n" + table(*(np.delete(each, np.s_[2::3]) for each in (SECONDS * 3, A, B, C))), "time from t; 2 harmonics"),
    "no names": (table(1.7e9 + SECONDS, A, B, C, digits=16), "as it has no names"),
    "names in a comment": ("# t q1 q2 q3\n" + table(SECONDS, A, B, C, between=" "), "spaces between"),
    "an index of pandas": (",t,q1,q2,q3\n" + table(range(60), SECONDS, A, B, C), "time from t"),
    "OpenSim": ("Coordinates\nversion=1\nnRows=60\ninDegrees=yes\nendheader\n" + "time\tjoint_1\tjoint_2\tjoint_3\n" + table(SECONDS, D, E, F, between="\t"), "degrees; time from time; tabs between"),
    "a spreadsheet, decimal commas": ("\ufeffZeit (s);Winkel 1 (°);Winkel 2 (°);Winkel 3 (°);\r\n" + table(SECONDS, D, E, F, between=";", comma=True, end=";\r\n"), "degrees; time in s; semicolons between; decimal commas"),
    "decimal commas and tabs": (table(SECONDS, A, B, C, between="\t", comma=True), "tabs between; decimal commas"),
    "UTF-16": (("t\t#1\t#2\t#3\r\n" + table(SECONDS, A, B, C, between="\t")).encode("utf-16"), "tabs between"),
    "Latin-1": (("t;q1 [°];q2 [°];q3 [°]\n" + table(SECONDS, D, E, F, between=";")).encode("cp1252"), "degrees"),
    "quoted": ('"t","q1","q2","q3"\n' + table(*([f'"{x:.8e}"'.replace("e", "D") for x in each] for each in (SECONDS, A, B, C))), "from q1"),
    "thousands": ("t_ms;q1;q2;q3\n" + table([f"{1e4 * s:,.1f}" for s in SECONDS], A, B, C, between=";"), "commas in numbers"),
    "whole thousands": ("t_ms;q1;q2;q3\n" + table([f"{100 * k:,}" for k in range(60)], A, B, C, between=";"), "time in ms; .* commas of thousands"),
    "equal rows": ("t,q1,q2,q3\n" + "".join(line + "\n" + line + "\n" for line in table(SECONDS, A, B, C).splitlines()), "60 rows like the one before left out"),
    "blank cells": ("t,q1,q2,q3\n0,,,\n" + table(SECONDS[1:], A[1:], B[1:], C[1:]) + "4,nan,0.2,-\n", "2 rows with blank cells left out"),
    "a last line cut short": ("t,q1,q2,q3\n" + table(SECONDS, A, B, C) + "4.0,0.8", "line 62, the last one, cut short"),
    "rounded stamps": ("t,q1,q2,q3\n" + table(np.round(SECONDS, 1), A, B, C), "rounded to 0.1 taken as equal steps"),
    "equal stamps": ("t,q1,q2,q3\n" + table(np.floor(SECONDS), A, B, C), "rounded to 1 taken as equal steps"),
    "angles without a sign": ("t,q1_deg,q2_deg,q3_deg\n" + table(SECONDS, D % 360, E % 360, F % 360), "whole turns taken out"),
    "two with numbers": ("t,j1,j2,wrist\n" + table(SECONDS, A, B, C), "in the file's order, tail to head"),
    "other columns": ("t,q1,q2,q3,load1,load2,temp1,temp2\n" + table(SECONDS, A, B, C, A, B, C, A), "ignored: load1, load2, temp1 and 1 more"),
    "times called otherwise": ("Uhr,Gelenk1,Gelenk2,Gelenk3\n" + table(SECONDS, A, B, C), "time from Uhr"),
}
REFUSED = {
    "ticks": ("t,m1,m2,m3\n" + table(SECONDS, *np.round(512 + DEGREES * 1023 / 300)), "m1 goes up to .* like ticks .* of a servo"),
    "pulses": ("millis,s1,s2,s3\n" + table(1000 * SECONDS, *np.round(1500 + DEGREES / 0.09)), r"\(microseconds - 1500\)"),
    "turns": ("t,q1_rev,q2_rev,q3_rev\n" + table(SECONDS, *DEGREES / 360), "q1_rev holds rev: write degrees or radians"),
    "parts of pi": ("t,q1/pi,q2/pi,q3/pi\n" + table(SECONDS, *ANGLES / np.pi), "q1/pi holds pi"),
    "few ticks": ("t,q1_ticks,q2_ticks,q3_ticks\n" + table(SECONDS, *DEGREES * 1023 / 300), "q1_ticks holds ticks"),
    "directions of links": ("t,theta1,theta2,theta3,theta4\n" + table(SECONDS, T, A, B, C), "if they are directions of links"),
    "positions": ("t,x0,y0,x1,y1,x2,y2\n" + table(SECONDS, A, B, C, A, B, C), "look like positions of points"),
    "leader and follower": ("t,j1,j2,j3,l_j1,l_j2,l_j3\n" + table(SECONDS, A, B, C, A, B, C), "j1 ... j3, and l_j1 ... l_j3"),
    "one name twice": ("t,q1,q1,q2\n" + table(SECONDS, A, B, C), "two columns are called q1"),
    "head first, or not": ("t,head,middle,tail\n" + table(SECONDS, A, B, C), "head, middle, tail is not clear"),
    "an order in words": ("t,joint_two,joint_one,joint_three\n" + table(SECONDS, A, B, C), "joint_two, joint_one, joint_three is not clear"),
    "a unit in cells": ("t,q1,q2,q3\n" + table(SECONDS, *([f"{x:.4f}°" for x in each] for each in DEGREES)), r"line 2, column q1: '.*°' is no number"),
    "a unit of some": ("t,q1_deg,q2,q3_deg\n" + table(SECONDS, D, E, F), "q2 does not: call it q2_deg or q2_rad"),
    "radians beside degrees": ("t,q1_deg,q2_rad,q3_deg\n" + table(SECONDS, D, 50 * B, F), r"rad \(q2_rad\)"),
    "no number": ("t,q1,q2,q3\n" + table(SECONDS, A, B, C).replace("\n2,", "\n2,E!", 1), r"line 32, column q1: .* is no number: mend it"),
    "a longer line": ("t,q1,q2,q3\n" + table(SECONDS, A, B, C).replace("\n", ",1\n", 1) + "4,0,0,0\n", "line 2, has 5 cells, and the lines below have 4"),
    "a longer line inside": ("t,q1,q2,q3\n" + table(SECONDS, A, B, C).replace("\n", ",1\n", 2).replace(",1\n", "\n", 1), "line 3, has 5 cells, and the lines about it have 4"),
    "one column": ("q1\n" + table(A), "has one column: at least two are needed"),
    "two records": ("t,q1,q2,q3\n" + 2 * table(SECONDS, A, B, C), "the times fall after line 61"),
    "a gap": ("t,q1,q2,q3\n" + table(SECONDS, A, B, C) + table(100 + SECONDS, A, B, C), "no samples for 96.07 of a period of 104"),
    "names twice": (2 * ("t,q1,q2,q3\n" + table(SECONDS, A, B, C)), "line 62, names the columns again"),
    "commas for both": ("t,q1,q2,q3\n" + table(*(np.round(each + 0.1234, 6) for each in (SECONDS, A, B, C)), comma=True), "line 1, has 4 cells, and the lines below have .* decimal commas"),
    "joints by turns": ("t,q1,q2,q3\n" + "".join(f"{s},{x:.4f},,\n{s},,{x:.4f},\n{s},,,{x:.4f}\n" for s, x in zip(SECONDS, A, strict=True)), "only 0 of 180 lines .* write all joints in every line"),
    "lists in cells": ("t,positions\n" + "".join(f'{s},"[{a}, {a}]"\n' for s, a in zip(SECONDS, A, strict=True)), "1 column of angles, and the body has 3 joints; write a column of times, then one for each joint: call columns of joints joint_1"),
    "one blank": ("t,a,b,c\n0,1,nan,1\n1,2,3,4\n5,0,0,0\n6,0,0,0\n7,0,0,0\n8,0,0,0\n", r"only 5 of 6 lines have a number in each .* \(line 2 has not\)"),
    "two samples": ("t,a,b,c\n0,0,0,0\n1,1,0,0\n", "holds 2 samples"),
    "nothing": ("", "holds 0 samples"),
    "degrees without a word": ("t,a,b,c\n0,0,0,0\n1,90,0,0\n2,0,90,0\n5,0,0,0\n6,0,0,0\n7,0,0,0\n8,0,0,0\n", "an angle of 90 rad .*: if angles are degrees, say so"),
    "two with numbers": ("t,j2,j1,wrist\n" + table(SECONDS, A, B, C), "the order of the columns j2, j1, wrist is not clear"),
    "no number, no names": (table(SECONDS, A, B, C).replace("\n2,", "\n2,E!", 1), "line 31, column 2: .* is no number"),
    "degrees without names": (table(SECONDS, A, 50 * B, C), r"rad \(column 3\)"),
    "another column": ("t,q1_deg,q2_deg,q3_deg\n" + table(SECONDS, *20 * DEGREES), "is it the right column"),
    "no names, a joint less": (table(A, B), "it has 1 column of angles, and the body has 3 joints"),
    "another time": ("t,q1,q2,q3\n" + table([f"31.01. {k}h" for k in range(60)], A, B, C), "line 2: the time .* write seconds"),
    "one instant": (table(np.ones(60), A, B, C), "all times are 1"),
    "JSON": (b'{"time_s": [0, 1]}', "is no text of numbers"),
    "a workbook": (b"PK\x03\x04\x14\x00\x06", "save as CSV"),
}
# fmt: on


@pytest.mark.parametrize("kind", READ)
def test_a_record_is_read_right_and_what_was_taken_is_said(kind, tmp_path):
    content, said = READ[kind]
    found = read(tmp_path, content)
    start = 1 / 60 if kind == "blank cells" else 0.0  # its first sample is blank
    np.testing.assert_allclose(found.gait.angles(T - start), ANGLES, atol=1e-5)
    assert found.describe().startswith("read 3 joints ")
    with pytest.raises(AssertionError, match=said):
        raise AssertionError(found.describe())


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_no_record_or_several_is_refused_with_a_cure(kind, tmp_path):
    content, said = REFUSED[kind]
    with pytest.raises(colloc.ProblemError, match=said) as refused:
        read(tmp_path, content)
    assert "record.csv" in str(refused.value)


def test_radians_are_no_degrees_whatever_is_asked_for_and_the_period_is_the_one_asked_for(tmp_path):
    content = "t,joint_1_rad,joint_2_rad,joint_3_rad\n" + table(SECONDS, A, B, C)
    with pytest.raises(colloc.ProblemError, match="joint_1_rad holds radians"):
        read(tmp_path, content, degrees=True)
    with_period = "# period_s: 4\n" + content.replace("t,", "t_s,", 1)
    assert read(tmp_path, with_period, period=2.0).period == 2.0  # whatever the file says


@pytest.mark.parametrize(
    ("periods", "noise"), [(3.0, 0.0), (3.32, 0.02), (1.2, 0.01), (17.3, 0.02)]
)
def test_the_period_of_a_record_that_holds_several_is_found(periods, noise, tmp_path):
    rng, t = np.random.default_rng(0), np.arange(0, periods, 1 / 60)
    t += rng.uniform(-0.004, 0.004, t.size) if periods > 4 else 0.0
    angles = GAIT.angles(t) + noise * rng.normal(size=(3, t.size))
    found = read(tmp_path, "t,q1,q2,q3\n" + table(4 * t, *angles))
    assert found.period == pytest.approx(4, rel=1e-7 if noise == 0 else 5e-3)
    np.testing.assert_allclose(found.gait.angles(T - t[0]), ANGLES, atol=1e-6 + 0.8 * noise)
    assert f"of {found.periods:.3g} cycles of" in found.describe()


def test_where_a_period_is_told_from_a_wave_its_phase_at_the_start_is_known_half_as_well(tmp_path):
    """The bound of Cramer and Rao (Rife & Boorstyn, 1974)."""
    t, rng, path = np.arange(240) / 60, np.random.default_rng(3), tmp_path / "wave.csv"
    path.write_text("t,q1\n" + table(t, np.cos(2 * np.pi * t) + 0.01 * rng.normal(size=t.size)))
    told, given = (fitted_gait(path, 1, harmonics=1, period=period) for period in (None, 1.0))
    assert told.period == pytest.approx(1.0, rel=1e-3)
    # of the sine
    off = [np.linalg.norm(found.uncertainty.directions[:, 0, 2]) for found in (told, given)]
    assert off[0] / off[1] == pytest.approx(2.0, rel=0.1)


def test_bursts_of_samples_with_one_stamp_are_read_as_well_as_the_stamps_are(tmp_path):
    t = np.sort(np.random.default_rng(0).uniform(0, 3, 600))
    t[200:] += 0.6
    stamps = np.floor(50 * t) / 50
    found = read(tmp_path, "t,q1,q2,q3\n" + table(stamps, *GAIT.angles(t)))
    assert found.period == pytest.approx(1, rel=5e-3)
    assert found.largest < 0.3  # a stamp is 0.02 of a period wide
    np.testing.assert_allclose(found.gait.angles(T - 0.01 - stamps[0]), ANGLES, atol=0.02)


def test_slow_noise_does_not_hide_a_period(tmp_path):
    rng, t = np.random.default_rng(6), np.arange(0, 3.3, 1 / 40)
    noise = 0.005 * rng.normal(size=(3, t.size))
    for k in range(1, t.size):
        noise[:, k] += 0.7 * noise[:, k - 1]
    found = read(tmp_path, "t,q1,q2,q3\n" + table(t, *(GAIT.angles(t) + noise)))
    assert found.period == pytest.approx(1, rel=0.01)


@pytest.mark.slow
def test_a_long_log_is_read_in_seconds(tmp_path):
    t = np.arange(20_000) / 400
    begin = time.process_time()
    found = read(tmp_path, "t,q1,q2,q3\n" + table(4 * t, *GAIT.angles(t)))
    assert time.process_time() - begin < 10
    np.testing.assert_allclose(found.gait.angles(T), ANGLES, atol=1e-5)
    assert "of 20000 rows, the first 5000 in steps of 4 taken" in found.describe()


@pytest.mark.parametrize(("rows", "every"), [(60, 1), (240, 5)])  # of a period
def test_rows_of_a_long_log_are_left_out_only_if_the_others_follow_it(
    rows, every, tmp_path, monkeypatch
):
    monkeypatch.setattr("colloc.gaits.record._MOST", 120)
    t = np.arange(600) / rows
    found = read(tmp_path, "t,q1,q2,q3\n" + table(4 * t, *GAIT.angles(t)))
    assert f"of 600 rows, the first 120 in steps of {every} taken" in found.describe()
    np.testing.assert_allclose(found.gait.angles(T), ANGLES, atol=1e-5)


def test_joints_that_all_move_about_a_right_angle_are_hinted_at(tmp_path):
    found = read(tmp_path, "t,s1_deg,s2_deg,s3_deg\n" + table(SECONDS, *(DEGREES + 90)))
    assert found.centre == 90
    assert "all joints move about 90°, which servos may count from" in found.describe()
    assert read(tmp_path, "t,s1_deg,s2_deg,s3_deg\n" + table(SECONDS, *DEGREES)).centre == 0


def test_a_mirrored_record_is_fitted_as_well_and_off_by_as_much():
    """And one of which the joints are named from the other end."""
    t, rng = np.arange(30) / 30, np.random.default_rng(6)
    angles = np.stack([np.cos(2 * np.pi * t), 0.5 * np.sin(2 * np.pi * t) + 0.02 * t])
    angles = angles + 0.01 * rng.exponential(size=angles.shape)  # larger to one side
    known = fitted_gait(angles, 2, harmonics=1)
    for image, back in ((-angles, lambda x: -x), (angles[::-1], lambda x: x[::-1])):
        other = fitted_gait(image, 2, harmonics=1)
        for name in ("rms", "largest", "drift"):
            assert getattr(other, name) == pytest.approx(getattr(known, name), abs=1e-12), name
        np.testing.assert_allclose(back(other.gait.angles(t)), known.gait.angles(t), atol=1e-9)
