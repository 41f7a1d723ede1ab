"""A robot in SI units as a problem file, whatever units are typed."""

import math
from contextlib import suppress

import pytest

from colloc.commands.ending import BAD_PROBLEM, OK
from colloc.commands.solve import init as main
from colloc.gaits.problem_file import read_problem_file


def test_a_robot_in_si_units_is_stated_whatever_units_are_typed(tmp_path):
    robots = []
    for name, size in (("m", ("0.62", "0.9", "60")), ("cm", ("62cm", "900g", "60000ms"))):
        path, (length, mass, period) = tmp_path / f"{name}.py", size
        words = (
            f"--links 22 30 30 22 --mu 0.3 --joint-limit 85deg --max-speed 60rpm --length {length}"
        )
        words += f" --mass {mass} --period {period} --max-torque 1.2 --idle-power 2 --backlash 1deg"
        assert main([str(path), *words.split()]) == OK
        problem = read_problem_file(path).problem
        robots.append(problem.robot)
        assert problem.joint_limit == pytest.approx(math.radians(85), abs=1e-5)
        assert problem.friction.mu_b == 0.3
        assert problem.least_distance is None  # electronics that run make it go far
    assert robots[0] == robots[1]
    assert robots[0].max_speed == pytest.approx(2 * math.pi)
    assert robots[0].backlash == pytest.approx(math.radians(1))


def test_without_a_battery_a_gait_is_asked_for_that_one_sees(tmp_path):
    assert main([str(path := tmp_path / "plain.py")]) == OK
    assert read_problem_file(path).problem.least_distance == 0.1


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("--length 62 --mass 1 --period 2", "write length=0.62"),
        ("--length 0.62", "--mass and --period are missing"),
        ("--links 3.5", "whole number of links"),
        ("--joint-limit 85grad", "must be a number"),
    ],
)
def test_what_looks_mistyped_is_asked_about(words, says, tmp_path, capsys):
    path = tmp_path / "mine.py"
    with suppress(SystemExit):
        assert main([str(path), *words.split()]) == BAD_PROBLEM
    assert says in capsys.readouterr().err
    assert not path.exists()
