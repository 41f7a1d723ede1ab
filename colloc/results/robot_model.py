"""The robot of a result for simulators: MJCF (MuJoCo) and URDF, in metres, kilograms and seconds.

Links have the problem's lengths, masses and moments of inertia and are drawn as boxes; joints are hinges about the vertical.
Links of no width are drawn `_THIN` wide. What touches the floor is the whole link, or a small sphere at each foot. A
simulator's own contacts know one coefficient of friction each, here the geometric mean of its smallest and its largest: where
friction has a direction, that floor is another than colloc's (`scripts.play_in_mujoco` applies the law itself).
"""

from __future__ import annotations

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from colloc.gaits.limits import range_of
from colloc.mechanics.chain import Chain
from colloc.mechanics.law import Law
from colloc.results.robot import Robot
from colloc.system.errors import ProblemError

_THIN = 0.02
"""Width and height of links that have none [body lengths]."""
_STIFF = 200.0
"""Gain of the position servos, over the largest torque of the gait, per rad: holds angles to about 1/200 rad."""
_COLOUR = "0.85 0.4 0.1 1"
_SAME = 1e-9
"""Relative difference of coefficients that counts as none."""
_REACH = 1.5
"""Effort that is allowed of a joint, over the largest that the gait needs."""


def mjcf(robot: Robot, *, planar: bool = False) -> str:
    """The robot as a model of MuJoCo, with position servos and its first posture as the keyframe "start".

    Parameters
    ----------
    robot : Robot
    planar : bool
        Whether the tail link slides in the plane without weight and contacts, instead of lying on a floor.

    Returns
    -------
    str
        XML.

    Raises
    ------
    ProblemError
        If the body is no chain with a motor in every joint.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> robot = colloc.solve(problem, starts=1).robot(length=1.2, mass=3, period=5)
    >>> mjcf(robot).count("<joint ")
    2
    """
    chain, half, law = _chain(robot), 0.5 * _height(robot), robot.solution.problem.law
    root = Element("mujoco", model=robot.solution.problem.name)
    SubElement(root, "compiler", angle="radian", autolimits="true")
    pull = robot.solution.problem.regime.pull(np.array([[getattr(robot.solution.gait, "theta", None) or 0.0]]))
    ahead, aside = (0.0, 0.0) if pull is None else pull[:, 0]  # the floor is level, and gravity leans
    g = 0.0 if planar else robot.pressing
    gravity = " ".join(f"{g * part + 0.0:.9g}" for part in (ahead, aside, -1.0))
    SubElement(root, "option", timestep="0.001", gravity=gravity, cone="elliptic", integrator="implicitfast")
    look = SubElement(root, "asset")
    colours = {"rgb1": "0.55 0.57 0.6", "rgb2": "0.45 0.47 0.5", "width": "100", "height": "100"}
    SubElement(look, "texture", colours, name="squares", type="2d", builtin="checker")
    SubElement(look, "material", name="squares", texture="squares", texrepeat="5 5", texuniform="true")
    world = SubElement(root, "worldbody")
    SubElement(world, "light", pos="0 0 3", dir="0 0 -1", ambient="0.4 0.4 0.4")
    if not planar:
        friction = f"{_mean_friction(law):.9g} 0 0"
        SubElement(world, "geom", name="floor", type="plane", size="0 0 1", material="squares", friction=friction, condim="3")
    parent, at = world, f"0 0 {half:.9g}"
    peaks, ranges = robot.facts["peak_torque_N_m"], _ranges(robot)
    for k, (length, mass) in enumerate(zip(_lengths(robot), _masses(robot), strict=True)):
        parent = SubElement(parent, "body", name=f"link_{k + 1}", pos=at)
        if k:
            low, high = ranges[k - 1]
            SubElement(parent, "joint", name=f"joint_{k}", type="hinge", axis="0 0 1", range=f"{low:.9g} {high:.9g}")
        elif planar:
            for name, kind, axis in (("x", "slide", "1 0 0"), ("y", "slide", "0 1 0"), ("heading", "hinge", "0 0 1")):
                SubElement(parent, "joint", name=name, type=kind, axis=axis)
        else:
            SubElement(parent, "freejoint", name="tail")
        inertia = " ".join(f"{value:.9g}" for value in _inertia(robot, k, mass))
        SubElement(parent, "inertial", pos=f"{length / 2:.9g} 0 0", mass=f"{mass:.9g}", diaginertia=inertia)
        size = f"{length / 2:.9g} {_width(robot) / 2:.9g} {half:.9g}"
        box = {"type": "box", "pos": f"{length / 2:.9g} 0 0", "size": size, "rgba": _COLOUR}
        SubElement(parent, "geom", box | _touch(law, not planar and not chain.feet), name=f"box_{k + 1}")
        for number, foot in enumerate(chain.standing_on, 1):
            if foot.link == k:
                place = f"{foot.place * length:.9g} {foot.offset * robot.length:.9g} 0"
                pad = f"{foot.extent * length / 2:.9g} {half:.9g} {half:.9g}"
                form = {"type": "box", "size": pad} if foot.extent else {"type": "sphere", "size": f"{half:.9g}"}
                touch = _touch(foot.friction or robot.solution.problem.friction, not planar)
                SubElement(parent, "geom", form | {"pos": place, "mass": "0"} | touch, name=f"foot_{number}")
        at = f"{length:.9g} 0 0"
    servos = SubElement(root, "actuator")
    for j, peak in enumerate(peaks, 1):
        gain = {"kp": f"{_STIFF * peak:.9g}", "dampratio": "1"}
        SubElement(servos, "position", gain, name=f"motor_{j}", joint=f"joint_{j}")
    first = robot.solution.gait.angles(np.zeros(1))[:, 0]
    angles = " ".join(f"{angle:.9g}" for angle in first)
    pose = "0 0 0" if planar else f"0 0 {half:.9g} 1 0 0 0"
    SubElement(SubElement(root, "keyframe"), "key", name="start", qpos=f"{pose} {angles}", ctrl=angles)
    return _text(root)


def urdf(robot: Robot) -> str:
    """The robot as a URDF: link_1 is its tail, joint_1 the one nearest to it; efforts and speeds are 1.5 times the gait's.

    Parameters and errors are as of `mjcf`.
    """
    chain, height = _chain(robot), _height(robot)
    root = Element("robot", name=robot.solution.problem.name)
    lengths, facts = _lengths(robot), robot.facts
    for k, (length, mass) in enumerate(zip(lengths, _masses(robot), strict=True), 1):
        link = SubElement(root, "link", name=f"link_{k}")
        inertial, middle = SubElement(link, "inertial"), f"{length / 2:.9g} 0 0"
        SubElement(inertial, "origin", xyz=middle)
        SubElement(inertial, "mass", value=f"{mass:.9g}")
        xx, yy, zz = _inertia(robot, k - 1, mass)
        SubElement(inertial, "inertia", ixx=f"{xx:.9g}", iyy=f"{yy:.9g}", izz=f"{zz:.9g}", ixy="0", ixz="0", iyz="0")
        for kind in ("visual",) if chain.feet else ("visual", "collision"):
            shape = SubElement(link, kind)
            SubElement(shape, "origin", xyz=middle)
            box = f"{length:.9g} {_width(robot):.9g} {height:.9g}"
            SubElement(SubElement(shape, "geometry"), "box", size=box)
        for foot in chain.standing_on:
            if foot.link == k - 1:
                shape = SubElement(link, "collision")
                SubElement(shape, "origin", xyz=f"{foot.place * length:.9g} {foot.offset * robot.length:.9g} 0")
                form = SubElement(shape, "geometry")
                if foot.extent:
                    SubElement(form, "box", size=f"{foot.extent * length:.9g} {height:.9g} {height:.9g}")
                else:
                    SubElement(form, "sphere", radius=f"{height / 2:.9g}")
    for j, (low, high) in enumerate(_ranges(robot), 1):
        joint = SubElement(root, "joint", name=f"joint_{j}", type="revolute")
        SubElement(joint, "parent", link=f"link_{j}")
        SubElement(joint, "child", link=f"link_{j + 1}")
        SubElement(joint, "origin", xyz=f"{lengths[j - 1]:.9g} 0 0")
        SubElement(joint, "axis", xyz="0 0 1")
        effort, speed = (_REACH * facts[name][j - 1] for name in ("peak_torque_N_m", "peak_speed_rad_per_s"))
        limit = {"lower": low, "upper": high, "effort": effort, "velocity": speed}
        SubElement(joint, "limit", {name: f"{value:.9g}" for name, value in limit.items()})
    return _text(root)


FORMATS = {".xml": mjcf, ".urdf": urdf}
"""Ending of a file to what writes it."""


def _chain(robot: Robot) -> Chain:
    body = robot.solution.problem.body
    if type(body) is not Chain:
        raise ProblemError(f"models for simulators are of a Chain with a motor in every joint, not of a {type(body).__name__}.")
    return body


def _lengths(robot: Robot) -> np.ndarray:
    return np.asarray(robot.length * np.array(_chain(robot).lengths))


def _masses(robot: Robot) -> np.ndarray:
    return np.asarray(robot.mass * _chain(robot).mass_column()[:, 0])


def _width(robot: Robot) -> float:
    return robot.length * (_chain(robot).width or _THIN)


def _height(robot: Robot) -> float:
    return _THIN * robot.length


def _inertia(robot: Robot, link: int, mass: float) -> tuple[float, float, float]:
    """About the link's own axes [kg m^2]: about the vertical and across it that of colloc; about its length that of the box."""
    upright = robot.mass * robot.length**2 * float(_chain(robot).inertia_column()[link, 0])
    return mass * (_width(robot) ** 2 + _height(robot) ** 2) / 12, upright, upright


def _touch(law: Law, floor: bool) -> dict[str, str]:
    """Of a shape that touches the floor, by its own friction, or nothing: parts of a body never touch each other, which is the
    gait's business."""
    friction = {"priority": "1", "friction": f"{_mean_friction(law):.9g} 0 0"} if floor else {}
    return {"contype": "0", "conaffinity": "1" if floor else "0"} | friction


def _ranges(robot: Robot) -> list[tuple[float, float]]:
    limit, count = robot.solution.problem.joint_limit, _chain(robot).n_joint
    return [range_of(own) for own in (limit if isinstance(limit, tuple) else (limit,) * count)]


def _mean_friction(law: Law) -> float:
    return float(np.sqrt(law.smallest * law.largest))


def one_coefficient(robot: Robot) -> str:
    """What MJCF makes of friction that has a direction, in a sentence; "" where it has none."""
    own = robot.solution.problem.friction
    laws = [foot.friction or own for foot in _chain(robot).standing_on] or [own]
    turned = dict.fromkeys(law for law in laws if law.largest > law.smallest * (1 + _SAME))
    made = ", ".join(f"{law.label} is {_mean_friction(law):.3g}" for law in turned)
    return f"a contact of MuJoCo has one coefficient of friction for all directions: {made}" if made else ""


def _text(root: Element) -> str:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
