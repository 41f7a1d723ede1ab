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

_THIN = 0.02
"""Width and height of links that have none [body lengths]."""
_POINTS = 16
"""On which a pad or a link stands."""
_STEPS, _LONGEST = 8000, 1e-3
"""Of a period, and the longest one [s]: where a period is long, weight and friction set the time,
not the gait."""
_AXIS, _MASS = 1e-4, 1e-6
"""Half of the length of a capsule and the mass of a foot, in those of the body: as good as none."""
_STIFF = 5000.0
"""Gain of the position servos, over the largest torque of the gait, per rad."""
_LEAST = 1e-5
"""Coefficient of MuJoCo."""
_COLOUR = "0.85 0.4 0.1 1"
_UNTOUCHED = {"contype": "0", "conaffinity": "0"}
"""Of a shape that touches nothing, or what a pair names alone: parts of a body never touch each
other, which is the gait's business."""
_REACH = 1.5
"""Effort that is allowed of a joint, over the largest that the gait needs."""


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
    chain, half, problem = _chain(robot), 0.5 * _height(robot), robot.solution.problem
    root = Element("mujoco", model=problem.name)
    SubElement(root, "compiler", angle="radian", autolimits="true")
    pull = problem.regime.pull(np.array([[getattr(robot.solution.gait, "theta", None) or 0.0]]))
    # the floor is level, and gravity leans
    ahead, aside = (0.0, 0.0) if pull is None else pull[:, 0]
    step = robot.period / max(_STEPS, np.ceil(robot.period / _LONGEST))
    gravity = " ".join(f"{robot.pressing * part + 0.0:.9g}" for part in (ahead, aside, -1.0))
    solver = {"cone": "elliptic", "impratio": "1000", "jacobian": "sparse", "tolerance": "1e-10"}
    SubElement(
        root, "option", solver, timestep=f"{step:.12g}", gravity=gravity, integrator="implicitfast"
    )
    look = SubElement(root, "asset")
    colours = {"rgb1": "0.55 0.57 0.6", "rgb2": "0.45 0.47 0.5", "width": "100", "height": "100"}
    SubElement(look, "texture", colours, name="squares", type="2d", builtin="checker")
    SubElement(
        look, "material", name="squares", texture="squares", texrepeat="5 5", texuniform="true"
    )
    world = SubElement(root, "worldbody")
    SubElement(world, "light", pos="0 0 3", dir="0 0 -1", ambient="0.4 0.4 0.4")
    pairs: list[dict[str, str]] = []
    if contacts := contacts and rate_independent(problem.law):
        SubElement(
            world, "geom", _UNTOUCHED, name="floor", type="plane", size="0 0 1", material="squares"
        )
    feet = _points(chain, problem.friction) if contacts else ()
    # a foot gives way within a thousandth of the body, a contact within two steps
    soft = {
        "condim": "3",
        "solref": f"{2 * step:.12g} 1",
        "solimp": f"0 0.95 {1e-3 * robot.length:.9g} 0.5 2",
    }
    parent, at = world, f"0 0 {half:.9g}"
    peaks, ranges = robot.facts["peak_torque_N_m"], _ranges(robot)
    for k, (length, mass) in enumerate(zip(_lengths(robot), _masses(robot), strict=True)):
        parent = SubElement(parent, "body", name=f"link_{k + 1}", pos=at)
        if k:
            low, high = ranges[k - 1]
            SubElement(
                parent,
                "joint",
                name=f"joint_{k}",
                type="hinge",
                axis="0 0 1",
                range=f"{low:.9g} {high:.9g}",
            )
        else:
            for name, kind, axis in (
                ("x", "slide", "1 0 0"),
                ("y", "slide", "0 1 0"),
                ("heading", "hinge", "0 0 1"),
            ):
                SubElement(parent, "joint", name=name, type=kind, axis=axis)
        inertia = " ".join(f"{value:.9g}" for value in _inertia(robot, k, mass))
        SubElement(
            parent, "inertial", pos=f"{length / 2:.9g} 0 0", mass=f"{mass:.9g}", diaginertia=inertia
        )
        size = f"{length / 2:.9g} {_width(robot) / 2:.9g} {half:.9g}"
        box = {"type": "box", "pos": f"{length / 2:.9g} 0 0", "size": size, "rgba": _COLOUR}
        SubElement(parent, "geom", _UNTOUCHED | box, name=f"box_{k + 1}")
        for number, foot in enumerate(feet, 1):
            if foot.link == k:
                pairs.append(
                    {"geom1": "floor", "geom2": f"foot_{number}"} | _friction(foot.friction) | soft
                )
                _add_foot(parent, robot, number, foot)
        at = f"{length:.9g} 0 0"
    touching = SubElement(root, "contact")
    for pair in pairs:
        SubElement(touching, "pair", pair)
    servos = SubElement(root, "actuator")
    for j, peak in enumerate(peaks, 1):
        gain = {"kp": f"{_STIFF * peak:.9g}", "dampratio": "1"}
        SubElement(servos, "position", gain, name=f"motor_{j}", joint=f"joint_{j}")
    posture = _in_order(chain, feet, robot.solution.gait.angles(np.zeros(1))[:, 0])
    angles = " ".join(f"{angle:.9g}" for angle in robot.solution.gait.angles(np.zeros(1))[:, 0])
    SubElement(SubElement(root, "keyframe"), "key", name="start", qpos=posture, ctrl=angles)
    return _text(root)


def _add_foot(link: Element, robot: Robot, number: int, foot: Foot) -> None:
    """A small body on a vertical slide; a spring presses it on the floor with its weight, and it
    moves as if it had that."""
    place, turned = (
        f"{foot.place * _lengths(robot)[foot.link]:.9g} {foot.offset * robot.length:.9g} 0",
        f"0 0 {foot.angle:.9g}",
    )
    body = SubElement(link, "body", name=f"foot_{number}", pos=place, euler=turned)
    least = f"{_MASS * robot.mass * _height(robot) ** 2:.9g}"
    SubElement(
        body,
        "inertial",
        pos="0 0 0",
        mass=f"{_MASS * robot.mass:.9g}",
        diaginertia=f"{least} {least} {least}",
    )
    borne = robot.mass * float(foot.weight or 0.0)
    spring = {
        "stiffness": f"{borne * robot.pressing / robot.length:.9g}",
        "springref": f"{-robot.length:.9g}",
    }
    SubElement(
        body,
        "joint",
        spring,
        name=f"press_{number}",
        type="slide",
        axis="0 0 1",
        armature=f"{borne:.9g}",
    )
    half, end = f"{0.5 * _height(robot):.9g}", f"{_AXIS * robot.length:.9g}"
    directed = len(set(_friction(foot.friction)["friction"].split()[:2])) > 1
    form = (
        {"type": "capsule", "fromto": f"-{end} 0 0 {end} 0 0"} if directed else {"type": "sphere"}
    )
    SubElement(body, "geom", _UNTOUCHED | form, name=f"foot_{number}", size=half)


def _in_order(chain: Chain, feet: tuple[Foot, ...], angles: np.ndarray) -> str:
    """Of the tail at the origin, the joints, and the slides of the feet, which are 0, link by
    link."""
    values = [0.0, 0.0, 0.0]
    for link in range(chain.n_link):
        values += [*angles[link - 1 : link]] if link else []
        values += [0.0] * sum(foot.link == link for foot in feet)
    return " ".join(f"{value:.9g}" for value in values)


def urdf(robot: Robot) -> str:
    """The robot as a URDF: link_1 is its tail, joint_1 the one nearest to it; efforts and speeds
    are 1.5 times the gait's.

    A URDF has no friction of contacts, and nothing that spreads the weight over them: a simulator
    chooses both. Parameters and errors are as of `mjcf`.
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
        SubElement(
            inertial,
            "inertia",
            ixx=f"{xx:.9g}",
            iyy=f"{yy:.9g}",
            izz=f"{zz:.9g}",
            ixy="0",
            ixz="0",
            iyz="0",
        )
        for kind in ("visual",) if chain.feet else ("visual", "collision"):
            shape = SubElement(link, kind)
            SubElement(shape, "origin", xyz=middle)
            box = f"{length:.9g} {_width(robot):.9g} {height:.9g}"
            SubElement(SubElement(shape, "geometry"), "box", size=box)
        for foot in chain.standing_on:
            if foot.link == k - 1:
                shape = SubElement(link, "collision")
                SubElement(
                    shape,
                    "origin",
                    xyz=f"{foot.place * length:.9g} {foot.offset * robot.length:.9g} 0",
                )
                form = SubElement(shape, "geometry")
                if foot.extent:
                    SubElement(
                        form, "box", size=f"{foot.extent * length:.9g} {height:.9g} {height:.9g}"
                    )
                else:
                    SubElement(form, "sphere", radius=f"{height / 2:.9g}")
    for j, (low, high) in enumerate(_ranges(robot), 1):
        joint = SubElement(root, "joint", name=f"joint_{j}", type="revolute")
        SubElement(joint, "parent", link=f"link_{j}")
        SubElement(joint, "child", link=f"link_{j + 1}")
        SubElement(joint, "origin", xyz=f"{lengths[j - 1]:.9g} 0 0")
        SubElement(joint, "axis", xyz="0 0 1")
        effort, speed = (
            _REACH * facts[name][j - 1] for name in ("peak_torque_N_m", "peak_speed_rad_per_s")
        )
        limit = {"lower": low, "upper": high, "effort": effort, "velocity": speed}
        SubElement(joint, "limit", {name: f"{value:.9g}" for name, value in limit.items()})
    return _text(root)


FORMATS = {".xml": mjcf, ".urdf": urdf}
"""Ending of a file to what writes it."""


def _chain(robot: Robot) -> Chain:
    body = robot.solution.problem.body
    if robot.solution.problem.joint_map is not None:
        raise ProblemError(
            "models for simulators are of a Chain with a motor in every joint: leave gears and "
            "stuck joints out."
        )
    if type(body) is not Chain:
        raise ProblemError(
            f"models for simulators are of a Chain with a motor in every joint, not of a "
            f"{type(body).__name__}."
        )
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
    """About the link's own axes [kg m^2]: about the vertical and across it that of colloc; about
    its length that of the box."""
    upright = robot.mass * robot.length**2 * float(_chain(robot).inertia_column()[link, 0])
    return mass * (_width(robot) ** 2 + _height(robot) ** 2) / 12, upright, upright


def _ranges(robot: Robot) -> list[tuple[float, float]]:
    limit, count = robot.solution.problem.joint_limit, _chain(robot).n_joint
    return [range_of(own) for own in (limit if isinstance(limit, tuple) else (limit,) * count)]


def floor_of(robot: Robot) -> tuple[Chain, Law]:
    """The robot's body and law of friction as the contacts of its MJCF have them."""
    chain, law = _chain(robot), robot.solution.problem.friction
    feet = tuple(
        replace(foot, friction=foot.friction and _elliptic(foot.friction))
        for foot in chain.standing_on
    )
    return (replace(chain, feet=feet) if chain.feet else chain), _elliptic(law)


def note_of(robot: Robot) -> str:
    """What MJCF makes of the problem's friction, in a sentence; "" where it has the same."""
    own = robot.solution.problem.friction
    if not rate_independent(robot.solution.problem.law):
        return (
            f"contacts of MuJoCo have dry friction alone, not {own.label}: the model touches "
            f"no floor"
        )
    laws = dict.fromkeys([foot.friction or own for foot in _chain(robot).standing_on] or [own])
    made = ", ".join(f"{law.label} is {_elliptic(law).label}" for law in laws if not _as_it_is(law))
    return (
        f"friction in MuJoCo is elliptic, and alike forwards and backwards: {made}" if made else ""
    )


def _as_it_is(law: Law) -> bool:
    """Whether MuJoCo has it."""
    return isinstance(law, Friction) and law.associated and law.reversible


def _elliptic(law: Law) -> Law:
    """What MuJoCo makes of a law that is dry."""
    if _as_it_is(law):
        return law
    one, none = np.ones((1, 1)), np.zeros((1, 1))
    ahead, back, aside = (
        max(float(np.hypot(*(force[0, 0] for force in law.density(*way, none)))), _LEAST)
        for way in ((one, none), (-one, none), (none, one))
    )
    along = float(np.sqrt(ahead * back))
    return Elliptic(mu_t=aside, mu_f=along, mu_b=along)


def _friction(law: Law | None) -> dict[str, str]:
    """Of a contact, along and across the foot; it knows no other resistance."""
    has = _elliptic(law)  # type: ignore[arg-type]
    return {"friction": f"{has.mu_f:.9g} {has.mu_t:.9g} 0 0 0"}  # type: ignore[attr-defined]


def _points(chain: Chain, law: Law) -> tuple[Foot, ...]:
    """On which it stands, each with its weight and its friction."""
    nodes, shares = np.polynomial.legendre.leggauss(_POINTS)
    found = []
    for foot in chain.standing_on or whole_links(chain.weight_column()[:, 0]):
        foot = replace(foot, friction=foot.friction or law)
        spread = zip(nodes, shares, strict=True) if foot.extent else [(0.0, 2.0)]
        for node, share in spread:
            place, weight = (
                foot.place + 0.5 * node * foot.extent,
                0.5 * share * float(foot.weight or 0.0),
            )
            found.append(replace(foot, place=place, weight=weight, extent=0.0))
    return tuple(found)


def _text(root: Element) -> str:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
