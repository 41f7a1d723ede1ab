"""Models of robots for simulators: what they say of links, joints and masses, and that MuJoCo moves as colloc does."""

from xml.etree import ElementTree

import numpy as np
import pytest

import colloc
from colloc import Chain, Coupled, Foot, Friction, Harmonic, Problem, ProblemError, Wheel
from colloc.commands.export import main
from colloc.results.robot_model import mjcf, urdf

SIZE = {"length": 1.2, "mass": 3.0, "period": 5.0}
MASSES, INERTIAS = (0.3, 0.2, 0.5), (0.002, 0.006, 0.001)


@pytest.fixture(scope="module")
def uneven():
    """Links of their own lengths, weights, masses and moments of inertia, ranges to one side, and feet."""
    feet = (
        Foot(0, 0.2, weight=0.2),
        Foot(1, weight=0.5),
        Foot(2, 0.7, offset=0.02, weight=0.15),
        Foot(2, 0.7, offset=-0.02, weight=0.15),
    )
    body = Chain((0.2, 0.5, 0.3), weights=(0.2, 0.5, 0.3), feet=feet, masses=MASSES, inertias=INERTIAS)
    limits = ((-1.0, 2.0), 1.5)
    problem = Problem(
        "uneven", body=body, friction=Friction(mu_t=2, mu_f=1, mu_b=1), gait=Harmonic(1), joint_limit=limits, delta=1e-2
    )
    return colloc.evaluate(problem, colloc.ellipse(0.2, 0.6, 0.7))


def numbers(text):
    return [float(part) for part in text.split()]


def test_an_mjcf_has_the_links_masses_ranges_and_feet_of_the_robot(uneven):
    root = ElementTree.fromstring(mjcf(uneven.robot(**SIZE)))
    bodies = list(root.find("worldbody").iter("body"))
    masses = [float(body.find("inertial").get("mass")) for body in bodies]
    assert masses == pytest.approx(np.multiply(3.0, MASSES))
    upright = [numbers(body.find("inertial").get("diaginertia"))[2] for body in bodies]
    assert upright == pytest.approx(np.multiply(3.0 * 1.2**2, INERTIAS))
    assert [numbers(body.get("pos"))[0] for body in bodies[1:]] == pytest.approx([0.24, 0.6])
    assert [numbers(joint.get("range")) for joint in root.iter("joint")] == [[-1.0, 2.0], [-1.5, 1.5]]
    feet = [numbers(geom.get("pos")) for geom in root.iter("geom") if geom.get("name").startswith("foot")]
    np.testing.assert_allclose(feet, np.array([[0.048, 0, 0], [0.3, 0, 0], [0.252, -0.024, 0], [0.252, 0.024, 0]]), atol=1e-12)
    start = numbers(root.find("keyframe/key").get("qpos"))
    assert start[-2:] == pytest.approx(uneven.gait.angles(np.zeros(1))[:, 0])


def test_every_foot_slides_by_the_mean_of_its_own_friction(uneven, tmp_path):
    feet = (Foot(0), Foot(1, friction=Friction(mu_t=4, mu_f=1, mu_b=1)), Wheel(2, rolling=0.04, sideways=1.0))
    problem = uneven.problem.with_(body=Chain(feet=feet), friction=Friction(mu_t=9, mu_f=1, mu_b=1), joint_limit=3.0)
    solution = colloc.evaluate(problem, colloc.ellipse(0.2, 0.6, 0.7))
    root = ElementTree.fromstring(mjcf(solution.robot(**SIZE)))
    found = {geom.get("name"): numbers(geom.get("friction"))[0] for geom in root.iter("geom") if geom.get("priority") == "1"}
    assert found == pytest.approx({"foot_1": 3.0, "foot_2": 2.0, "foot_3": 0.2})
    said = solution.export(tmp_path / "x.xml", **SIZE)["note"]
    assert "one coefficient of friction for all directions: friction (9, 1, 1) is 3, friction (4, 1, 1) is 2, fr" in said
    assert "note" not in solution.export(tmp_path / "x.urdf", **SIZE)
    stated = solution.export(tmp_path / "x.csv", period=4.0)["friction"]
    assert [law["mu_t"] for law in stated["laws"]] == [9, 4, 1]


def test_a_urdf_is_a_tree_of_links_with_efforts_and_speeds_that_suffice(uneven):
    robot = uneven.robot(**SIZE)
    root = ElementTree.fromstring(urdf(robot))
    assert sum(float(mass.get("value")) for mass in root.iter("mass")) == pytest.approx(3.0)
    joints = root.findall("joint")
    assert [(j.find("parent").get("link"), j.find("child").get("link")) for j in joints] == [
        ("link_1", "link_2"), ("link_2", "link_3"),
    ]  # fmt: skip
    for k, limit in enumerate(joint.find("limit") for joint in joints):
        assert float(limit.get("effort")) >= robot.facts["peak_torque_N_m"][k]
        assert float(limit.get("velocity")) >= robot.facts["peak_speed_rad_per_s"][k]
    assert len(root.findall("link/collision/geometry/sphere")) == 4
    inertia = [[float(i.get(name)) for name in ("ixx", "iyy", "izz")] for i in root.iter("inertia")]
    for a, b, c in inertia:  # a body in space can have them
        assert a + b >= c * (1 - 1e-9)


def test_the_command_writes_both_and_says_what_is_missing(three_link, tmp_path, capsys):
    source = str(colloc.save(three_link, tmp_path / "mine.h5"))
    size = ["--length", "1.2", "--mass", "3", "--period", "5"]
    assert main([source, *size, "--format", "mjcf"]) == 0
    assert main([source, *size, "--output", str(tmp_path / "mine.urdf")]) == 0
    assert ElementTree.parse(tmp_path / "mine.xml").getroot().tag == "mujoco"
    assert ElementTree.parse(tmp_path / "mine.urdf").getroot().tag == "robot"
    printed = capsys.readouterr().out
    assert "a robot of 1.2 m and 3 kg" in printed
    assert "note" not in printed  # the same friction in all directions
    assert main([source, "--format", "urdf"]) == 2
    assert "needs the period [s], the length [m] and the mass [kg]" in capsys.readouterr().err
    assert main([source, *size, "--format", "urdf", "--max-speed", "2"]) == 2
    assert "holds no motion: leave max_speed out" in capsys.readouterr().err


def test_bodies_without_a_motor_in_every_joint_are_refused_in_a_sentence():
    problem = Problem("stuck", body=Coupled(Chain((0.25,) * 4), stuck={1: 0.1}), gait=Harmonic(1), delta=1e-2)
    with pytest.raises(ProblemError, match="of a Chain with a motor in every joint, not of a Coupled"):
        mjcf(colloc.evaluate(problem, colloc.ellipse(0, 1, 1)).robot(**SIZE))


@pytest.mark.slow
@pytest.mark.parametrize("froude", [0.005, 0.2])
def test_mujoco_moves_as_colloc_does(uneven, three_link, froude):
    mujoco = pytest.importorskip("mujoco")
    from scripts.play_in_mujoco import compared

    for solution in (three_link, uneven):
        model = mujoco.MjModel.from_xml_string(mjcf(solution.robot(**SIZE)))
        assert model.body_mass.sum() == pytest.approx(3.0)
        assert compared(solution, froude)["apart"] < 1e-4
