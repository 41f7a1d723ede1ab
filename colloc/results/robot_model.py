"""The robot of a result for simulators: MJCF (MuJoCo) and URDF, in metres, kilograms and seconds.

Links have the problem's lengths, masses and moments of inertia and are drawn as boxes; joints are
hinges about the vertical. Links of no width are drawn `_THIN` wide.

In MJCF the tail link slides in the plane, and what touches the floor presses with the weight that
the problem says: each foot is a small body on a vertical slide with a spring, and what lies on the
floor, a pad or a link, stands on `_POINTS` of them (Gauss points). MuJoCo gives a contact two
coefficients, along and across, in an explicit `<pair>`; it lays the first one along the axis of a
capsule, so a foot whose friction has a direction is a very short one. Its friction is that of
`colloc.Elliptic` (of all forces within an ellipse the one that takes the most power), also where
the problem's is another law; `floor_of` is the floor that the file has, on which colloc says how it
moves. A sliding contact of MuJoCo is lifted the more the longer it takes to respond: hence the
short steps, the constraints of two steps, and an impedance that begins at 0.

URDF has no friction, no springs and no motors: the shapes that touch the floor alone.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from colloc.gaits.limits import range_of
from colloc.laws.elliptic import Elliptic
from colloc.mechanics.chain import Chain
from colloc.mechanics.feet import Foot, whole_links
from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law, rate_independent
from colloc.results.robot import Robot
from colloc.system.errors import ProblemError

_THIN = 0.02  # width and height of links that have none [body lengths]
_POINTS = 16  # on which a pad or a link stands
_STEPS, _LONGEST = 8000, 1e-3
"""Time steps of a period, and the longest one [s]: where a period is long, weight and friction set
the time, not the gait."""
_AXIS, _MASS = 1e-4, 1e-6
"""Half of the length of a capsule and the mass of a foot, in those of the body: next to nothing."""
_STIFF = 5000.0  # gain of the position servos per rad, over the largest torque of the gait
_LEAST = 1e-5  # smallest coefficient of friction in MuJoCo
_RESERVE = 1.5  # effort and speed that a URDF allows a joint, over the largest of the gait
_UNTOUCHED = {"contype": "0", "conaffinity": "0"}
"""Of a shape that touches nothing but what a pair names: parts of a body never touch each other,
which is the gait's business."""


class _Parts(NamedTuple):
    chain: Chain
    lengths: np.ndarray  # of links
    masses: np.ndarray
    inertias: np.ndarray  # about their own axes, (n_link, 3)
    width: float
    height: float
    ranges: list[tuple[float, float]]  # of joints


def _parts(robot: Robot) -> _Parts:
    """Links and joints in SI units. About the vertical and across a link its inertia is that of
    colloc, about its length that of the box."""
    chain, limit = robot.solution.problem.body, robot.solution.problem.joint_limit
    if type(chain) is not Chain:
        raise ProblemError(
            f"models for simulators are of a Chain with a motor in every joint, not of a "
            f"{type(chain).__name__}."
        )
    width, height = robot.length * (chain.width or _THIN), _THIN * robot.length
    masses = robot.mass * chain.mass_column()[:, 0]
    upright = robot.mass * robot.length**2 * chain.inertia_column()[:, 0]
    return _Parts(
        chain,
        robot.length * np.array(chain.lengths),
        masses,
        np.stack([masses * (width**2 + height**2) / 12, upright, upright], axis=1),
        width,
        height,
        [range_of(x) for x in (limit if isinstance(limit, tuple) else (limit,) * chain.n_joint)],
    )


def _add(parent: Element, tag: str, *given: dict[str, Any], **attributes: Any) -> Element:
    """A child whose attributes are texts, or numbers, which are written to nine digits."""
    every = {key: value for part in (*given, attributes) for key, value in part.items()}
    return SubElement(parent, tag, {key: _written(value) for key, value in every.items()})


def _written(value: Any) -> str:
    return value if isinstance(value, str) else " ".join(f"{x:.9g}" for x in np.ravel(value))


def _text(root: Element) -> str:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def mjcf(robot: Robot, *, contacts: bool = True) -> str:
    """The robot as a model of MuJoCo, with position servos and its first posture as the keyframe
    "start".

    Parameters
    ----------
    robot : Robot
    contacts : bool
        Whether it touches a floor. Under a law that is not dry, which no contact has, it never
        does.

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
    >>> mjcf(robot).count('type="hinge"')
    3
    """
    parts, problem, gait = _parts(robot), robot.solution.problem, robot.solution.gait
    contacts = contacts and rate_independent(problem.law)
    step = robot.period / max(_STEPS, np.ceil(robot.period / _LONGEST))
    # a foot gives way within a thousandth of the body, a contact within two steps
    soft = {"condim": "3", "solref": f"{2 * step:.12g} 1"}
    soft["solimp"] = f"0 0.95 {_written(1e-3 * robot.length)} 0.5 2"
    root = Element("mujoco", model=problem.name)
    world = _add_surroundings(root, robot, step, contacts)
    feet = _points(parts.chain, problem.friction) if contacts else ()
    start, pairs = gait.angles(np.zeros(1))[:, 0], []
    posture = [0.0, 0.0, 0.0]  # the tail, joints, and feet on their slides, link by link
    parent, place = world, (0.0, 0.0, 0.5 * parts.height)
    for k, length in enumerate(parts.lengths):
        middle = (length / 2, 0, 0)
        parent = _add(parent, "body", name=f"link_{k + 1}", pos=place)
        if k:
            hinge = {"name": f"joint_{k}", "type": "hinge", "axis": "0 0 1"}
            _add(parent, "joint", hinge, range=parts.ranges[k - 1])
            posture.append(start[k - 1])
        else:
            _add(parent, "joint", name="x", type="slide", axis="1 0 0")
            _add(parent, "joint", name="y", type="slide", axis="0 1 0")
            _add(parent, "joint", name="heading", type="hinge", axis="0 0 1")
        _add(parent, "inertial", pos=middle, mass=parts.masses[k], diaginertia=parts.inertias[k])
        box = {
            "type": "box",
            "pos": middle,
            "size": (length / 2, parts.width / 2, parts.height / 2),
        }
        _add(parent, "geom", _UNTOUCHED, box, rgba="0.85 0.4 0.1 1", name=f"box_{k + 1}")
        for number, foot in enumerate(feet, 1):
            if foot.link == k:
                _add_foot(parent, robot, parts, number, foot)
                touching = {"geom1": "floor", "geom2": f"foot_{number}"}
                pairs.append(touching | {"friction": _coefficients(foot.friction)} | soft)
                posture.append(0.0)
        place = (length, 0, 0)
    contact = _add(root, "contact")
    for pair in pairs:
        _add(contact, "pair", pair)
    servos = _add(root, "actuator")
    for j, peak in enumerate(robot.facts["peak_torque_N_m"], 1):
        gain = {"kp": _STIFF * peak, "dampratio": "1"}
        _add(servos, "position", gain, name=f"motor_{j}", joint=f"joint_{j}")
    _add(_add(root, "keyframe"), "key", name="start", qpos=posture, ctrl=start)
    return _text(root)


def _add_surroundings(root: Element, robot: Robot, step: float, floor: bool) -> Element:
    """Settings, light and floor; returns the world. The floor is level, and gravity leans."""
    pull = robot.solution.problem.regime.pull(
        np.array([[getattr(robot.solution.gait, "theta", None) or 0.0]])
    )
    leaning = (0.0, 0.0) if pull is None else pull[:, 0]
    gravity = robot.pressing * np.append(leaning, -1.0) + 0.0  # no -0
    solver = {"cone": "elliptic", "impratio": "1000", "jacobian": "sparse", "tolerance": "1e-10"}
    _add(root, "compiler", angle="radian", autolimits="true")
    solver["timestep"] = f"{step:.12g}"
    _add(root, "option", solver, gravity=gravity, integrator="implicitfast")
    look = _add(root, "asset")
    colours = {"rgb1": "0.55 0.57 0.6", "rgb2": "0.45 0.47 0.5", "width": "100", "height": "100"}
    _add(look, "texture", colours, name="squares", type="2d", builtin="checker")
    _add(look, "material", name="squares", texture="squares", texrepeat="5 5", texuniform="true")
    world = _add(root, "worldbody")
    _add(world, "light", pos="0 0 3", dir="0 0 -1", ambient="0.4 0.4 0.4")
    if floor:
        plane = {"name": "floor", "type": "plane", "size": "0 0 1", "material": "squares"}
        _add(world, "geom", _UNTOUCHED, plane)
    return world


def _add_foot(link: Element, robot: Robot, parts: _Parts, number: int, foot: Foot) -> None:
    """A small body on a vertical slide; a spring presses it on the floor with its weight, and it
    moves as if it had that."""
    place = (foot.place * parts.lengths[foot.link], foot.offset * robot.length, 0)
    body = _add(link, "body", name=f"foot_{number}", pos=place, euler=(0, 0, foot.angle))
    mass = _MASS * robot.mass
    _add(body, "inertial", pos="0 0 0", mass=mass, diaginertia=[mass * parts.height**2] * 3)
    borne = robot.mass * float(foot.weight or 0.0)
    spring = {"stiffness": borne * robot.pressing / robot.length, "springref": -robot.length}
    slide = {"name": f"press_{number}", "type": "slide", "axis": "0 0 1"}
    _add(body, "joint", spring, slide, armature=borne)
    along, across, *_ = _coefficients(foot.friction).split()
    form: dict[str, Any] = {"type": "sphere"}
    if along != across:
        end = _AXIS * robot.length
        form = {"type": "capsule", "fromto": (-end, 0, 0, end, 0, 0)}
    _add(body, "geom", _UNTOUCHED, form, name=f"foot_{number}", size=0.5 * parts.height)


def urdf(robot: Robot) -> str:
    """The robot as a URDF: link_1 is its tail, joint_1 the one nearest to it; efforts and speeds
    are 1.5 times the gait's.

    A URDF has no friction of contacts, and nothing that spreads the weight over them: a simulator
    chooses both. Parameters and errors are as of `mjcf`.
    """
    parts, root = _parts(robot), Element("robot", name=robot.solution.problem.name)
    chain, height = parts.chain, parts.height

    def add_shape(link: Element, kind: str, place: Any, form: str, **size: Any) -> None:
        shape = _add(link, kind)
        _add(shape, "origin", xyz=place)
        _add(_add(shape, "geometry"), form, **size)

    for k, length in enumerate(parts.lengths):
        link, middle = _add(root, "link", name=f"link_{k + 1}"), (length / 2, 0, 0)
        inertial = _add(link, "inertial")
        _add(inertial, "origin", xyz=middle)
        _add(inertial, "mass", value=parts.masses[k])
        moments = dict(zip(("ixx", "iyy", "izz"), parts.inertias[k], strict=True))
        _add(inertial, "inertia", moments, ixy="0", ixz="0", iyz="0")
        for kind in ("visual",) if chain.feet else ("visual", "collision"):
            add_shape(link, kind, middle, "box", size=(length, parts.width, height))
        for foot in chain.standing_on:
            place = (foot.place * length, foot.offset * robot.length, 0)
            if foot.link == k and foot.extent:
                pad = (foot.extent * length, height, height)
                add_shape(link, "collision", place, "box", size=pad)
            elif foot.link == k:
                add_shape(link, "collision", place, "sphere", radius=height / 2)
    most = (robot.facts["peak_torque_N_m"], robot.facts["peak_speed_rad_per_s"])
    for j, ((low, high), effort, speed) in enumerate(zip(parts.ranges, *most, strict=True), 1):
        joint = _add(root, "joint", name=f"joint_{j}", type="revolute")
        _add(joint, "parent", link=f"link_{j}")
        _add(joint, "child", link=f"link_{j + 1}")
        _add(joint, "origin", xyz=(parts.lengths[j - 1], 0, 0))
        _add(joint, "axis", xyz="0 0 1")
        allowed = {"effort": _RESERVE * effort, "velocity": _RESERVE * speed}
        _add(joint, "limit", {"lower": low, "upper": high}, allowed)
    return _text(root)


FORMATS = {".xml": mjcf, ".urdf": urdf}
"""Ending of a file to what writes it."""


def floor_of(robot: Robot) -> tuple[Chain, Law]:
    """The robot's body and law of friction as the contacts of its MJCF have them."""
    chain, law = _parts(robot).chain, robot.solution.problem.friction
    feet = tuple(
        replace(foot, friction=foot.friction and _elliptic(foot.friction))
        for foot in chain.standing_on
    )
    return (replace(chain, feet=feet) if chain.feet else chain), _elliptic(law)


def note_of(robot: Robot) -> str:
    """What MJCF makes of the problem's friction, in a sentence; "" where it has the same."""
    problem = robot.solution.problem
    stated = problem.friction
    if not rate_independent(problem.law):
        return (
            f"contacts of MuJoCo have dry friction alone, not {stated.label}: the model touches "
            f"no floor"
        )
    feet = _parts(robot).chain.standing_on
    laws = dict.fromkeys([foot.friction or stated for foot in feet] or [stated])
    made = ", ".join(f"{x.label} is {_elliptic(x).label}" for x in laws if not _is_exact(x))
    return f"friction in MuJoCo is elliptic, and alike forwards and backwards: {made}" * bool(made)


def _is_exact(law: Law) -> bool:
    return isinstance(law, Friction) and law.associated and law.reversible


def _elliptic(law: Law) -> Law:
    """What MuJoCo makes of a law that is dry."""
    if _is_exact(law):
        return law
    one, none = np.ones((1, 1)), np.zeros((1, 1))
    ahead, back, aside = (
        max(float(np.hypot(*(force[0, 0] for force in law.density(*way, none)))), _LEAST)
        for way in ((one, none), (-one, none), (none, one))
    )
    along = float(np.sqrt(ahead * back))
    return Elliptic(mu_t=aside, mu_f=along, mu_b=along)


def _coefficients(law: Law | None) -> str:
    """Along and across a foot; a contact has no other resistance."""
    made: Any = _elliptic(law)  # type: ignore[arg-type]
    return _written((made.mu_f, made.mu_t, 0, 0, 0))


def _points(chain: Chain, law: Law) -> tuple[Foot, ...]:
    """On which it stands, each with its weight and its friction."""
    points = []
    for foot in chain.standing_on or whole_links(chain.weight_column()[:, 0]):
        foot = replace(foot, friction=foot.friction or law)
        rule = np.polynomial.legendre.leggauss(_POINTS) if foot.extent else ([0.0], [2.0])
        for node, share in zip(*rule, strict=True):
            place = foot.place + 0.5 * node * foot.extent
            weight = 0.5 * share * float(foot.weight or 0.0)
            points.append(replace(foot, place=place, weight=weight, extent=0.0))
    return tuple(points)
