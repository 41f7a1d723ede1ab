"""A problem file for somebody who has none yet: it runs as it is, says what its lines mean, and
replaces nothing."""

from __future__ import annotations

import pytest

from colloc import Chain, Wheel
from colloc.commands.ending import BAD_PROBLEM, OK
from colloc.commands.solve import init as main
from colloc.gaits.problem_file import read_problem_file


@pytest.mark.parametrize("links", [3, 4, 7])
def test_the_file_states_a_problem_of_so_many_links(links, tmp_path, capsys):
    path = tmp_path / "mine.py"
    assert main([str(path), "--links", str(links)]) == OK
    problem = read_problem_file(path).problem
    assert problem.name == "mine"
    assert problem.body.lengths == pytest.approx([1 / links] * links)
    assert f"colloc solve {path}" in capsys.readouterr().out


def test_lengths_in_any_unit_and_wheels_are_the_robot_s(tmp_path):
    bodies = []
    for name, lengths in (("cm", ("22", "30", "30", "22")), ("m", ("0.22", "0.3", "0.3", "0.22"))):
        path = tmp_path / f"{name}.py"
        assert main([str(path), "--lengths", *lengths, "--wheels"]) == OK
        bodies.append(read_problem_file(path).problem.body)
    assert bodies[0].lengths == pytest.approx([22 / 104, 30 / 104, 30 / 104, 22 / 104])
    assert bodies[1].lengths == pytest.approx(bodies[0].lengths)
    assert bodies[0] == Chain(
        bodies[0].lengths, feet=tuple(Wheel(link, rolling=0.02, sideways=1.0) for link in range(4))
    )


def test_a_body_that_differs_from_both_ends_is_given_gaits_that_it_can_have(tmp_path):
    for lengths, symmetry in ((("1", "2", "1"), "bilateral"), (("1", "2", "3"), "none")):
        path = tmp_path / f"{symmetry}.py"
        assert main([str(path), "--lengths", *lengths]) == OK
        assert read_problem_file(path).problem.gait.symmetry == symmetry


@pytest.mark.parametrize(
    ("name", "links", "says"),
    [
        ("mine.py", "2", "3 to 12"),
        ("mine.txt", "4", "end in .py"),
        ("my body.py", "4", "letters, digits"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(name, links, says, tmp_path, capsys):
    assert main([str(tmp_path / name), "--links", links]) == BAD_PROBLEM
    assert says in capsys.readouterr().err
    assert not (tmp_path / name).exists()


def test_an_existing_file_is_left_alone(tmp_path, capsys):
    path = tmp_path / "mine.py"
    path.write_text("mine", encoding="utf-8")
    assert main([str(path)]) == BAD_PROBLEM
    assert path.read_text(encoding="utf-8") == "mine"
    assert "is there already" in capsys.readouterr().err
