"""Models of robots for simulators: links, joints and masses, and that MuJoCo moves as colloc does."""

from xml.etree import ElementTree

import numpy as np
import pytest

import colloc
from colloc import Chain, Coupled, Foot, Friction, Harmonic, Pad, Problem, ProblemError, Wheel
from colloc.mechanics.inertia import kinetic_energy
from colloc.pictures.export import mjcf, urdf
from colloc.results.solution import direction_of_travel
from tests.shared.cases import slow

SIZE = {"length": 1.2, "mass": 3.0, "period": 5.0}
UNEVEN, MASSES, INERTIAS = (0.2, 0.5, 0.3), (0.3, 0.2, 0.5), (0.002, 0.006, 0.001)
TURNED = tuple(
    Wheel(k, 0.4, angle=s * (0.3, 1.5, 0.2)[k], offset=0.03 * s) for k in range(3) for s in (1, -1)
)
WHEELS = tuple(map(Wheel, range(3)))
AXLES = tuple(Wheel(link, 0.4, rolling=0.05, axle=True) for link in range(3))
PADS = tuple(Pad(link, 0.25, 0.75) for link in range(3))


@pytest.fixture(scope="module")
def uneven(unsolved):
    """Own lengths, weights, masses, inertias and feet; ranges to one side."""
    pair = (Foot(2, 0.7, offset=side * 0.02, weight=0.15) for side in (1, -1))
    feet = Foot(0, 0.2, weight=0.2), Foot(1, weight=0.5), *pair
    body = Chain(UNEVEN, weights=UNEVEN, feet=feet, masses=MASSES, inertias=INERTIAS)
    how = {"joint_limit": ((-1.0, 2.0), 1.5), "delta": 1e-2, "gait": Harmonic(1)}
    gait, friction = colloc.ellipse(0.2, 0.6, 0.7), Friction(mu_t=2, mu_f=1, mu_b=1)
    return unsolved(Problem("uneven", gait, body, friction, **how))


def numbers(text):
    return [float(part) for part in text.split()]


def test_an_mjcf_has_the_ranges_feet_and_first_pose_of_the_robot(uneven):
    root = ElementTree.fromstring(mjcf(uneven.robot(**SIZE)))
    ranges = [numbers(joint.get("range")) for joint in root.iter("joint") if joint.get("range")]
    assert ranges == [[-1.0, 2.0], [-1.5, 1.5]]
    bodies = root.find("worldbody").iter("body")
    feet = [numbers(body.get("pos")) for body in bodies if body.get("name").startswith("foot")]
    places = [[0.048, 0, 0], [0.3, 0, 0], [0.252, -0.024, 0], [0.252, 0.024, 0]]
    np.testing.assert_allclose(feet, places, atol=1e-12)
    joints = [joint.get("name") for joint in root.iter("joint")]
    springs = [joint for joint in root.iter("joint") if joint.get("name").startswith("press")]
    borne = [-float(spring.get("stiffness")) * float(spring.get("springref")) for spring in springs]
    assert borne == pytest.approx(np.multiply(3.0 * 9.81, (0.2, 0.5, 0.15, 0.15)))
    start = dict(zip(joints, numbers(root.find("keyframe/key").get("qpos")), strict=True))
    angles = [angle for name, angle in start.items() if name.startswith("joint")]
    assert angles == pytest.approx(uneven.gait.angles(np.zeros(1))[:, 0])


def links_of_mjcf(root):
    """Of every link: its place in the one behind, its middle, mass, and moment of inertia."""
    for body in root.iter("body"):
        if body.get("name").startswith("link"):
            own = body.find("inertial")
            inertia = numbers(own.get("diaginertia"))[2]
            place, middle = numbers(body.get("pos"))[0], numbers(own.get("pos"))[0]
            yield place, middle, float(own.get("mass")), inertia


def links_of_urdf(root):
    places = [numbers(joint.find("origin").get("xyz"))[0] for joint in root.iter("joint")]
    for place, link in zip([0.0, *places], root.iter("link"), strict=True):
        own = link.find("inertial")
        mass, inertia = own.find("mass").get("value"), own.find("inertia").get("izz")
        yield place, numbers(own.find("origin").get("xyz"))[0], float(mass), float(inertia)


@pytest.mark.parametrize(("write", "links"), [(mjcf, links_of_mjcf), (urdf, links_of_urdf)])
def test_a_model_has_the_energy_and_the_centre_of_mass_of_the_robot(write, links, uneven):
    body, size, rng = uneven.problem.body, SIZE["length"], np.random.default_rng(0)
    angles, rates, z = (rng.normal(size=(n, 1)) for n in (2, 2, 3))
    root = ElementTree.fromstring(write(uneven.robot(**SIZE)))
    place, heading, joint, spin = 0j, 0.0, size * complex(*z[:2, 0]), float(z[2, 0])
    energy, moment, turns = 0.0, 0j, zip([0.0, *angles[:, 0]], [0.0, *rates[:, 0]], strict=True)
    for (ahead, middle, mass, inertia), (angle, rate) in zip(links(root), turns, strict=True):
        along = ahead * np.exp(1j * heading)
        place, joint = place + along, joint + 1j * spin * along
        heading, spin = heading + angle, spin + rate
        arm = middle * np.exp(1j * heading)
        energy += 0.5 * mass * abs(joint + 1j * spin * arm) ** 2 + 0.5 * inertia * spin**2
        moment += mass * (place + arm)
    known = float(kinetic_energy(body, angles, rates, z)[0, 0])
    assert energy == pytest.approx(SIZE["mass"] * size**2 * known, rel=1e-6)
    centre = complex(*(each[0, 0] for each in body.centre_of_mass(body.posture(angles))))
    assert moment == pytest.approx(SIZE["mass"] * size * centre, rel=1e-6)


def test_every_contact_has_the_coefficients_of_its_foot_both_ways(uneven, unsolved, tmp_path):
    directed = Foot(1, friction=Friction(mu_t=3, mu_f=4, mu_b=1))
    body = Chain(feet=(Foot(0), directed, Wheel(2, rolling=0.04, sideways=1.0)))
    other = {"body": body, "friction": Friction(9, 9, 9), "joint_limit": 3.0}
    solution = unsolved(uneven.problem.with_(**other))
    root = ElementTree.fromstring(mjcf(solution.robot(**SIZE)))
    pairs = {x.get("geom2"): numbers(x.get("friction"))[:2] for x in root.iter("pair")}
    assert pairs == {"foot_1": [9, 9], "foot_2": [2, 3], "foot_3": [0.04, 1]}
    note = "friction (3, 4, 1) is elliptic friction (3, 2, 2), fric"
    assert f"and backwards: {note}" in solution.export(tmp_path / "x.xml", **SIZE)["note"]
    assert "nothing of friction" in solution.export(tmp_path / "x.urdf", **SIZE)["note"]
    stated = solution.export(tmp_path / "x.csv", period=4.0)["friction"]
    assert [law["mu_t"] for law in stated["laws"]] == [9, 3, 1]


def test_a_wheel_on_an_axle_resists_with_its_rolling_friction_at_its_radius(unsolved):
    gait, how = colloc.ellipse(0.0, 0.8, 0.6), {"gait": Harmonic(1), "delta": 0.1, "intervals": 8}
    solution = unsolved(Problem("axles", gait, Chain(feet=AXLES), **how))
    root = ElementTree.fromstring(mjcf(solution.robot(**SIZE)))
    losses = [float(x.get("frictionloss")) for x in root.iter("joint") if x.get("frictionloss")]
    radii = [numbers(x.get("size"))[0] for x in root.iter("geom") if x.get("type") == "ellipsoid"]
    assert losses == pytest.approx(0.05 * 9.81 * np.array(radii), rel=1e-5)  # a kilogram on each


def played(path, gait, period, periods=2):
    """Places [m] of centre of mass and tail in the last of some periods of a file in MuJoCo."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(path))
    data, steps = mujoco.MjData(model), round(period / model.opt.timestep)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    angles, places = gait.angles(np.arange(steps) / steps), []
    for k in range(periods * steps + 1):
        data.ctrl[:] = angles[:, k % steps]
        mujoco.mj_step(model, data)
        if k >= (periods - 1) * steps:
            places.append([data.subtree_com[1][:2].copy(), data.qpos[:2].copy()])
    return np.moveaxis(places, 0, -1)


@pytest.mark.parametrize(
    ("body", "mu_t", "gait"),
    [
        (Chain(UNEVEN, masses=MASSES), 1, (0.2, 1.0, 0.9)),
        slow((Chain(feet=1), 1, (0.0, 1.6, 1.1))),
        slow((Chain(UNEVEN, feet=WHEELS, masses=MASSES), 1, (0.0, 0.8, 0.6))),
        slow((Chain(feet=TURNED), 1, (0.1, 0.8, 0.6))),
        slow((Chain(UNEVEN, feet=AXLES, masses=MASSES), 1, (0.0, 0.8, 0.6))),
        slow((Chain(feet=PADS), 2, (0.0, 1.6, 1.1))),
    ],
    ids=["lying", "feet", "wheels", "turned wheels", "axles", "pads"],
)
def test_a_file_moves_in_mujoco_as_it_is_as_colloc_says(body, mu_t, gait, unsolved, tmp_path):
    gait, friction = colloc.ellipse(*gait), Friction(mu_t=mu_t, mu_f=1, mu_b=1)
    solution = unsolved(Problem("moves", gait, body, friction, Harmonic(1), delta=1e-3))
    size = {"length": 1.04, "mass": 2.0, "period": 1.5}
    stated = solution.export(tmp_path / "x.xml", **size)
    of_wheels = any(isinstance(foot.friction, Friction) for foot in body.feet)
    assert ("note" in stated) == (mu_t != 1 or of_wheels)  # else friction is that of MuJoCo
    centre, tail = played(tmp_path / "x.xml", solution.gait, size["period"])
    moved = np.hypot(*(centre[:, -1] - centre[:, 0])) / 1.04
    assert moved == pytest.approx(stated["moves_body_lengths_per_period"], rel=0.04)
    assert direction_of_travel(centre, tail) == solution.robot(**size).facts["travels"]


def test_a_model_of_a_slow_robot_takes_short_steps_too(three_link, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    three_link.export(tmp_path / "x.xml", period=20.5, length=0.5, mass=1.0)
    step = mujoco.MjModel.from_xml_path(str(tmp_path / "x.xml")).opt.timestep
    assert step == pytest.approx(20.5 / np.ceil(20.5 / 1e-3))


@pytest.mark.slow
def test_a_coasting_robot_comes_in_mujoco_to_the_speed_that_colloc_says(unsolved, tmp_path):
    """README's robot and about its best gait, which takes many cycles to build up its speed."""
    wheels = tuple(Wheel(link, rolling=0.05, sideways=0.3, axle=True) for link in range(4))
    body = Chain(tuple(x / 104 for x in (22, 30, 30, 22)), feet=wheels)
    table = [
        [0.026, 0.793, 0.0, -0.08, -0.248],
        [-0.02, 0.562, -0.64, -0.259, 0.041],
        [-0.04, -0.105, -0.79, 0.002, 0.233],
    ]
    gait = colloc.Fourier.from_table(np.array(table))
    solution = unsolved(Problem("mine", gait, body, gait=Harmonic(2), delta=1e-3))
    stated = solution.export(tmp_path / "mine.xml", length=0.62, mass=0.9, period=2.5)
    assert "note" not in stated  # the file has the problem's friction
    centre, _ = played(tmp_path / "mine.xml", solution.gait, 2.5, periods=16)
    moved = np.hypot(*(centre[:, -1] - centre[:, 0])) / 0.62
    assert moved == pytest.approx(stated["moves_body_lengths_per_period"], rel=0.02)


def test_a_urdf_is_a_tree_of_links_with_efforts_and_speeds_that_suffice(uneven):
    robot = uneven.robot(**SIZE)
    root = ElementTree.fromstring(urdf(robot))
    joints = root.findall("joint")
    tree = [(j.find("parent").get("link"), j.find("child").get("link")) for j in joints]
    assert tree == [("link_1", "link_2"), ("link_2", "link_3")]
    limits = [joint.find("limit") for joint in joints]
    for k, limit in enumerate(limits):
        assert float(limit.get("effort")) >= robot.facts["peak_torque_N_m"][k]
        assert float(limit.get("velocity")) >= robot.facts["peak_speed_rad_per_s"][k]
    ends = [float(limit.get(end)) for limit in limits for end in ("lower", "upper")]
    assert ends == [-1, 2, -1.5, 1.5]
    assert len(root.findall("link/collision/geometry/sphere")) == 4
    feet = [numbers(shape.find("origin").get("xyz")) for shape in root.findall("link/collision")]
    places = [[0.048, 0, 0], [0.252, -0.024, 0], [0.252, 0.024, 0], [0.3, 0, 0]]
    np.testing.assert_allclose(sorted(feet), places, atol=1e-9)
    for inertia in root.iter("inertia"):  # a body in space can have them
        a, b, c = (float(inertia.get(name)) for name in ("ixx", "iyy", "izz"))
        assert a + b >= c * (1 - 1e-9)


def test_bodies_without_a_motor_in_every_joint_are_refused_in_a_sentence():
    gait = Coupled(Harmonic(1), stuck={1: 0.1})
    problem = Problem("stuck", body=Chain((0.25,) * 4), gait=gait, delta=0.1, mesh_tolerance=1e-2)
    with pytest.raises(ProblemError, match="of a Chain with a motor in every joint"):
        mjcf(colloc.evaluate(problem, colloc.ellipse(0, 1, 1)).robot(**SIZE))
