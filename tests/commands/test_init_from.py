"""The problem file that `colloc init` writes: in whatever units a robot is typed; of URDF and MJCF as
computed by hand, what colloc exports read back, and what is no planar chain refused by name."""

from __future__ import annotations

import math
from contextlib import suppress
from itertools import product

import numpy as np
import pytest

import colloc
from colloc import Chain, Foot, Friction, Harmonic, Pad, Problem, Wheel
from colloc.commands.main import BAD_PROBLEM, OK
from colloc.commands.solve import init as main
from colloc.gaits.problem_file import read_problem_file
from tests.shared.cases import slow_but

# of a worm of three segments whose second axis points down
LINKS = {"tail": (0.12, 0.05), "mid": (0.20, 0.06), "head": (0.28, 0.05)}
LIMIT = '<limit lower="-0.5" upper="1.2" effort="1.5" velocity="5"/>'
THERE = {
    "strips": Chain((0.2, 0.3, 0.3, 0.2), width=0.02),
    "weights": Chain((0.25, 0.35, 0.4), weights=(0.3, 0.3, 0.4), feet=1),
    "feet": Chain((0.25, 0.35, 0.4), feet=(Foot(0, 0.2), Foot(1), Foot(2, 0.9))),
}
QUICK = [("urdf", "strips"), ("xml", "weights"), ("urdf", "feet")]
SWIMMER = """
<mujoco>
<compiler angle="degree"/>
<default><geom type="capsule" size="0.01" mass="0.3"/><joint range="-100 100"/>
<default class="weak"><joint range="-30 60"/></default></default>
<worldbody>
<geom type="plane" size="1 1 1"/>
<body name="torso">
<freejoint/>
<geom fromto="0.19 0 0 0.01 0 0"/>
<body name="mid" pos="0 0 0" euler="0 0 180">
<joint name="rot2" axis="0 0 1"/>
<geom fromto="0 0 0 0.2 0 0"/>
<body name="back" pos="0.2 0 0">
<joint name="rot3" class="weak" axis="0 0 1"/>
<geom fromto="0.01 0 0 0.19 0 0"/>
</body></body></body>
</worldbody>
</mujoco>
"""


def link(name, mass=0.1, at="0 0 0", more=""):
    inertial = f'<inertial><mass value="{mass}"/><origin xyz="{at}"/></inertial>'
    return f'<link name="{name}">{inertial}{more}</link>'


def joint(name, parent, child, at, axis="0 0 1", kind="revolute", limit=LIMIT):
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    place = f'<origin xyz="{at}"/><axis xyz="{axis}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{place}{limit}</joint>'


WORM = (
    *(link(name, mass, f"{middle} 0 0") for name, (mass, middle) in LINKS.items()),
    joint("j1", "tail", "mid", "0.10 0 0"),
    joint("j2", "mid", "head", "0.12 0 0", axis="0 0 -1", limit=LIMIT.replace('"1.5"', '"1.1"')),
)


def read(tmp_path, content, *words, kind="urdf"):
    """The exit code of `colloc init --from` of such a file, and the problem, if it is one."""
    source, path = tmp_path / f"robot.{kind}", tmp_path / "mine.py"
    if kind == "urdf" and isinstance(content, (tuple, list)):
        content = f"<robot name='r'>{''.join(content)}</robot>"
    if isinstance(content, str):
        source.write_text(content, encoding="utf-8")
    path.unlink(missing_ok=True)
    code = main([str(path), "--from", str(source), *words])
    return read_problem_file(path).problem if code == OK else code


def test_a_urdf_is_the_chain_that_one_computes_by_hand(tmp_path, capsys):
    problem = read(tmp_path, WORM, "--period", "2")
    # from joint to joint, and at the ends twice as far as the mass is from the joint
    lengths, masses = np.array([0.10, 0.12, 0.10]), np.array([0.12, 0.20, 0.28])
    assert problem.body.lengths == pytest.approx(lengths / 0.32)
    assert problem.body.weights == pytest.approx(masses / 0.6)
    # counter-clockwise seen from above: the second joint counts the other way round
    assert problem.joint_limit == ((-0.5, 1.2), (-1.2, 0.5))
    robot = problem.robot
    assert (robot.length, robot.mass, robot.period) == pytest.approx((0.32, 0.6, 2.0))
    assert (robot.max_speed, robot.max_torque) == (5.0, (1.5, 1.1))
    typed = read(tmp_path, WORM, "--period", "2", "--mass", "0.9", "--max-speed", "3").robot
    assert (typed.mass, typed.max_speed) == (0.9, 3.0)
    said = capsys.readouterr().out
    for words in (
        "j1 = joint_1, j2 = -joint_2",
        "tail is taken to be twice",
        "head is taken to be",
    ):
        assert words in said
    assert "j1 = joint_1, j2 = -joint_2" in (tmp_path / "mine.py").read_text(encoding="utf-8")
    # without a period nothing is in SI units; a limit that is typed is the limit
    problem = read(tmp_path, WORM, "--joint-limit", "85deg")
    assert problem.robot is None
    assert problem.joint_limit == pytest.approx(math.radians(85), abs=1e-5)


def test_what_is_fixed_is_one_link_and_a_chain_may_begin_anywhere(tmp_path):
    box = '<visual><geometry><box size="0.2 0.1 0.1"/></geometry></visual>'
    ahead = box.replace("<geometry>", '<origin xyz="0.1 0 0"/><geometry>')
    turned = [
        link("base", 0.3, more=box),  # from -0.1 to 0.1
        link("cap", 0.1),
        link("front", 0.2, "0.1 0 0", more=ahead),
        link("rear", 0.2, "-0.1 0 0"),
        joint("lid", "base", "cap", "0 0 0.05", kind="fixed"),
        joint("ahead", "base", "front", "0.1 0 0", limit='<limit lower="-1" upper="0.4"/>'),
        joint("behind", "base", "rear", "-0.1 0 0", limit='<limit lower="-1" upper="0.6"/>'),
    ]
    problem = read(tmp_path, turned)
    assert problem.body.lengths == pytest.approx([1 / 3] * 3)
    assert problem.body.weights == pytest.approx([0.25, 0.5, 0.25])
    # what turns the rear to the left bends the joint in front of it to the right
    assert problem.joint_limit == ((-0.6, 1.0), (-1.0, 0.4))
    # counted from the other end, if it is the one called the head
    flipped = [x.replace('"front"', '"aft"').replace('"rear"', '"head"') for x in turned]
    assert read(tmp_path, flipped).joint_limit == ((-0.4, 1.0), (-1.0, 0.6))


def test_free_hinges_across_are_wheels_and_spheres_under_a_box_feet(tmp_path):
    wheels = []
    for name in LINKS:
        for side in (-1, 1):
            wheel, how = f"{name}{side}", (f"0.05 {0.02 * side} 0", "0 1 0", "continuous", "")
            wheels += [link(wheel, 0.01), joint(f"axle of {wheel}", name, wheel, *how)]
    problem = read(tmp_path, [*WORM, *wheels], "--mu", "0.4")
    offsets = sorted(foot.offset * 0.32 for foot in problem.body.feet)
    assert offsets == pytest.approx([-0.02] * 3 + [0.02] * 3)
    assert [foot.place for foot in problem.body.feet[::2]] == pytest.approx([0.5, 5 / 12, 0.5])
    assert {foot.friction for foot in problem.body.feet} == {
        Wheel(0, rolling=0.05, sideways=0.4, axle=True).friction
    }
    assert problem.body.weights == pytest.approx(np.array([0.14, 0.22, 0.30]) / 0.66)
    ball = '<collision><origin xyz="0.03 0 0"/><geometry><sphere radius="0.01"/></geometry></collision>'
    box = '<visual><origin xyz="0.05 0 0"/><geometry><box size="0.1 0.1 0.1"/></geometry></visual>'
    stands = [link(name, 0.1, "0.05 0 0", box + ball) for name in LINKS]
    body = read(tmp_path, [*stands, *WORM[3:]]).body
    assert [foot.place for foot in body.feet] == pytest.approx([0.3, 0.25, 0.3])
    assert read(tmp_path, [*stands, *WORM[3:]], "--wheels").body.feet[0].kind == "wheel"
    # a wheel beyond the box is where the link ends
    how, lengths = ("0.13 0 0", "0 1 0", "continuous", ""), np.array([0.1, 0.12, 0.13]) / 0.35
    rolls = [*stands, *WORM[3:], link("wheel", 0.01), joint("axle", "head", "wheel", *how)]
    assert read(tmp_path, rolls).body.lengths == pytest.approx(lengths)
    assert len(read(tmp_path, [*stands, *WORM[3:]], "--feet", "2").body.feet) == 6


def feet(body):
    return [
        (f.kind, f.link, *(round(x, 5) for x in (f.place, f.weight, f.offset, f.extent, f.angle)))
        for f in body.standing_on
    ]


@pytest.mark.parametrize(("kind", "body"), slow_but(QUICK, product(("urdf", "xml"), THERE)))
def test_a_model_that_colloc_writes_is_read_as_the_same_body(kind, body, tmp_path):
    body = THERE[body]
    limits = ((-1.0, 1.4), *(1.1, 1.2)[: body.n_joint - 1])
    at = {"friction": Friction(0.5, 0.5, 0.5), "delta": 0.1, "mesh_tolerance": 1e-2}
    problem = Problem("there", body=body, joint_limit=limits, **at)
    n = body.n_joint
    gait = colloc.Fourier(np.zeros(n), 0.6 * np.eye(n)[:, :1], 0.6 * np.eye(n)[:, 1:2])
    solution = colloc.evaluate(problem.with_(gait=Harmonic(1, "none")), gait)
    solution.export(tmp_path / f"robot.{kind}", period=4.0, length=0.8, mass=1.5)
    back = read(tmp_path, None, "--period", "4", "--mu", "0.5", kind=kind)
    assert back.body.lengths == pytest.approx(body.lengths, rel=1e-8)
    assert back.body.mass_column() == pytest.approx(body.mass_column(), rel=1e-8)
    assert back.body.weight_column() == pytest.approx(body.weight_column(), rel=1e-8)
    assert feet(back.body) == feet(body)
    assert back.joint_limit == limits
    assert (back.robot.length, back.robot.mass) == pytest.approx((0.8, 1.5))


def test_wheels_and_pads_come_back_from_mjcf(tmp_path):
    parts = [Pad(1, 0.2, 0.7)]
    for k, side in ((0, -1), (0, 1), (2, -1), (2, 1)):
        at = {"angle": 0.3 * side, "offset": 0.05 * side}
        parts.append(Wheel(k, 0.4, 0.05, 0.8, axle=k == 2, **at))
    at = {"gait": Harmonic(1, "none"), "delta": 0.1, "mesh_tolerance": 1e-2}
    problem = Problem("there", body=Chain(feet=parts), **at)
    gait = colloc.Fourier(np.zeros(2), 0.6 * np.eye(2)[:, :1], 0.6 * np.eye(2)[:, 1:])
    colloc.evaluate(problem, gait).export(tmp_path / "robot.xml", period=4.0, length=0.8, mass=1.5)
    assert sorted(feet(read(tmp_path, None, kind="xml").body)) == sorted(feet(problem.body))


def test_an_mjcf_has_classes_degrees_and_capsules(tmp_path, capsys):
    problem = read(tmp_path, SWIMMER, kind="xml")
    assert problem.body.lengths == pytest.approx([1 / 3] * 3)
    assert problem.body.weights == ()
    limits = [np.degrees(np.ravel(x)).tolist() for x in problem.joint_limit]
    assert limits == [pytest.approx([100], rel=1e-5), pytest.approx([-30, 60], rel=1e-5)]
    assert "rot2 = joint_1, rot3 = joint_2" in capsys.readouterr().out
    usual = SWIMMER.replace('<compiler angle="degree"/>', "")
    assert read(tmp_path, usual, kind="xml").hash == problem.hash
    foot = '<joint type="slide" axis="0 0 1" stiffness="9"/><geom type="sphere"/></body><body '
    stands = SWIMMER.replace('<body name="back"', f'<body pos="0.1 0 0">{foot}name="back"')
    stands = stands.replace("0.19 0 0 0.01", "0.19 0 0 0.09")  # from 0.08 to 0.2
    body = read(
        tmp_path, stands.replace('"rot2"', '"rot2" actuatorfrcrange="0 1"'), kind="xml"
    ).body
    assert body.weights == pytest.approx([0.25, 0.5, 0.25])
    assert [(x.kind, x.extent) for x in body.feet[::2]] == [("pad", 0.6), ("pad", 1.0)]
    assert "not used: limits of actuators (--max-torque)" in capsys.readouterr().out


def test_an_mjcf_counts_angles_from_its_reference_and_the_stated_mass_of_a_body_alone(
    tmp_path, capsys
):
    turned = SWIMMER.replace('name="rot3" class="weak"', 'name="rot3" class="weak" ref="10"')
    heavy = turned.replace(
        '<joint name="rot2"', '<inertial pos="0.1 0 0" mass="0.6"/><joint name="rot2"'
    )
    problem = read(tmp_path, heavy, kind="xml")
    assert np.degrees(problem.joint_limit[1]).tolist() == pytest.approx([-40, 50], rel=1e-5)
    assert problem.body.weights == pytest.approx([0.25, 0.5, 0.25])
    # the ends of cylinders are flat
    flat, lengths = SWIMMER.replace("capsule", "cylinder"), np.array([0.19, 0.2, 0.19])
    assert read(tmp_path, flat, kind="xml").body.lengths == pytest.approx(lengths / lengths.sum())
    off = heavy.replace('pos="0.1', 'pos="0.12')
    light = SWIMMER.replace('<geom fromto="0.01', '<geom mass="0" fromto="0.01')
    said = "the mass of mid is taken to be in its m", "a link has no m"
    for model, note in zip((off, light), said, strict=True):
        assert note not in capsys.readouterr().out
        assert (read(tmp_path, model, kind="xml").body.weights == ()) == (model is light)
        assert note in capsys.readouterr().out


def test_friction_of_an_mjcf_is_that_of_geoms_on_the_floor_what_is_left_is_said(tmp_path, capsys):
    """Of two geoms that touch, MuJoCo takes the larger coefficient; one that is not stated is 1."""
    floor = SWIMMER.replace('<geom type="plane"', '<geom type="plane" friction="0.2"')
    slippery = floor.replace('<geom type="capsule"', '<geom type="capsule" friction="0.4 0.01"')
    assert read(tmp_path, slippery, kind="xml").friction == Friction(0.4, 0.4, 0.4)
    rough = '<geom type="plane" friction="0.6"/><geom type="plane"'
    steps = slippery.replace('<geom type="plane"', rough)
    assert read(tmp_path, steps, kind="xml").friction == Friction(0.6, 0.6, 0.6)
    assert read(tmp_path, floor, kind="xml").friction == Friction(1, 1, 1)
    assert read(tmp_path, slippery, "--mu", "0.3", kind="xml").friction.mu_t == 0.3
    capsys.readouterr()
    mixed = slippery.replace('<geom fromto="0.01', '<geom friction="0.7" fromto="0.01')
    assert read(tmp_path, mixed, kind="xml").friction == Friction(1, 1, 1)
    assert "from 0.4 to 0.7, are not used: state --mu" in capsys.readouterr().out
    assert read(tmp_path, mixed, "--mu", "0.5", kind="xml").friction.mu_f == 0.5
    assert "not used" not in capsys.readouterr().out
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    damped = [each.replace("</inertial>", inertia) for each in WORM]
    damped[-1] = damped[-1].replace("</joint>", '<dynamics damping="0.1"/></joint>')
    read(tmp_path, damped)
    said = capsys.readouterr().out
    assert "used: moments of inertia (links count as uniform rods), friction and damping" in said


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ((link("leg"), joint("hip", "mid", "leg", "0 0 0")), ('link "mid" carries', "j2, hip", "no branches")),
        ((link("leg"), joint("slot", "head", "leg", "0.1 0 0", kind="prismatic")), ('"slot" is prismatic', "fix it")),
        ((link("leg"), joint("lift", "head", "leg", "0.1 0 0", "0 1 0")), ('"lift" is 90 degrees off', '"j1"', "fix it")),
        ((link("leg"), joint("none", "head", "leg", "0.1 0 0", "0 0 0")), ('"none" is 90 degrees off',)),
        ((link("leg"), joint("side", "head", "leg", "0 0.1 0")), ("on a line", "origins")),
        ((link("leg"), joint("knee", "head", "leg", "0.1 0 0")), ('where link "leg" ends', "box")),
        ((joint("knee", "head", "leg", "0.1 0 0"),), ('"knee" names a link', "not there")),
        ((link("leg"),), ("lead from one link",)),
        ((link("leg", at="0.1 0 0"), joint("k", "head", "leg", "0.1 0 0", limit='<limit upper="1"/>')), ('"k" goes from 0', "straight")),
        ((link("leg", mass="big"), joint("k", "head", "leg", "0.1 0 0")), ("big", "finite")),
    ],
)  # fmt: skip
def test_what_is_no_planar_chain_is_refused_by_name_and_with_a_cure(more, words, tmp_path, capsys):
    assert read(tmp_path, [*WORM, *more]) == BAD_PROBLEM
    said = capsys.readouterr().err
    assert "robot.urdf" in said
    for word in words:
        assert word in said


BODY = "<mujoco><worldbody><body><body name='x'>{}</body></body></worldbody></mujoco>"


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (WORM, "--from and --links"),
        ("<sdf/>", "<sdf>"),
        ("no xml", "as XML"),
        ("<robot xmlns:xacro='http://ros.org/wiki/xacro'><xacro:arm/></robot>", "xacro FILE"),
        ("<mujoco><worldbody/></mujoco>", "0 bodies"),
        ("<mujoco><include file='a.xml'/></mujoco>", "mj_saveLastXML"),
        (BODY.format("<joint/><joint/>"), "has 2 joints: a chain has one"),
        (BODY.format("<joint type='slide'/>"), "no joint of it turns"),
    ],
)
def test_other_files_are_named_for_what_they_are(content, word, tmp_path, capsys):
    assert read(tmp_path, content, *["--links", "4"] if content is WORM else []) == BAD_PROBLEM
    assert word in capsys.readouterr().err


def stated(path, words=""):
    assert main([str(path), *words.split()]) == OK
    return read_problem_file(path).problem


@pytest.mark.parametrize("links", [3, 4, 7])
def test_the_file_states_a_problem_of_so_many_links(links, tmp_path, capsys):
    problem = stated(path := tmp_path / "mine.py", f"--links {links}")
    assert problem.name == "mine"
    assert problem.body.lengths == pytest.approx([1 / links] * links)
    assert f"colloc solve {path}" in capsys.readouterr().out
    # without a battery a gait is asked for that one sees
    assert problem.least_distance == 0.1


def test_lengths_in_any_unit_and_wheels_are_the_robot_s(tmp_path):
    lengths = "22 30 30 22", "0.22 0.3 0.3 0.22"
    cm, m = (stated(tmp_path / f"{k}.py", f"--links {lengths[k]} --wheels").body for k in (0, 1))
    assert cm.lengths == pytest.approx([22 / 104, 30 / 104, 30 / 104, 22 / 104])
    assert m.lengths == pytest.approx(cm.lengths)
    wheels = tuple(Wheel(link, rolling=0.05, axle=True) for link in range(4))
    assert cm == Chain(cm.lengths, feet=wheels)


def test_a_body_that_differs_from_both_ends_is_given_gaits_that_it_can_have(tmp_path):
    """Nor with inertia, which counts the sooner the more easily a body rolls."""
    slow = "1 2 1 --length 1 --mass 1 --period 20"
    for k, links in enumerate(("1 2 1", "1 2 3", slow, f"{slow} --wheels")):
        symmetry = stated(tmp_path / f"{k}.py", f"--links {links}").gait.symmetry
        assert symmetry == ("bilateral", "none")[k % 2]


def test_a_robot_in_si_units_is_stated_whatever_units_are_typed(tmp_path):
    words = "--links 22 30 30 22 --mu 0.3 --joint-limit 85deg --max-torque 1200mNm"
    words += " --idle-power 2W --backlash 1deg --length {} --mass {} --period {} --max-speed {}"
    sizes = f"0.62 0.9 60 {2 * math.pi}", "62cm 900g 60000ms 60rpm", "620mm 0.9kg 60s 360deg/s"
    typed = [words.format(*each.split()) for each in sizes]
    problems = [stated(tmp_path / f"{k}.py", each) for k, each in enumerate(typed)]
    for problem in problems:
        assert problem.joint_limit == pytest.approx(math.radians(85), abs=1e-5)
        assert problem.friction.mu_b == 0.3
        assert problem.least_distance is None  # electronics that run make it go far
    robot = problems[0].robot
    assert robot == problems[1].robot == problems[2].robot
    assert robot.max_speed == pytest.approx(2 * math.pi)
    assert robot.backlash == pytest.approx(math.radians(1))
    sought = stated(tmp_path / "sought.py", "--length 1 --mass 1 --period 2 20")
    assert sought.robot.period == (2, 20)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("--length 62 --mass 1 --period 2", "write length=0.62"),
        ("--length 0.62", "missing: --mass, --period"),
        ("--links 3.5", "whole number of links"),
        ("--joint-limit 85grad", "must be a number, or one in rad or deg, not '85grad'"),
        ("--joint-limit 85", "--joint-limit is at most pi [rad], not 85; write degrees as 85deg"),
    ],
)
def test_what_looks_mistyped_is_asked_about(words, says, tmp_path, capsys):
    with suppress(SystemExit):
        assert main([str(tmp_path / "mine.py"), *words.split()]) == BAD_PROBLEM
    assert says in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
