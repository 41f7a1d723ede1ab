"""A planar serial chain out of a model of a robot, URDF or MJCF, as `Chain` counts it.

In the posture that the file calls zero the joints lie on a line. What is fixed together is one
link. Free hinges across with nothing behind them are wheels, slides with a spring feet. A URDF is
read as the MJCF that says the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, ParseError, SubElement, fromstring

import numpy as np
from scipy.spatial.transform import Rotation

from colloc.system.errors import ProblemError

_SMALL = 1e-3  # sine of an angle, or part of a length or mass, that counts as none
_OFF = 0.05  # distance of a link's mass from its middle that is spoken of, over its length
_ROLLS = 0.5  # friction along over that across, below which a contact is a wheel
_LINE = 16  # Gauss points of a pad in MJCF
_RARE = "include replicate attach frame *[@xyaxes] *[@zaxis] *[@axisangle]"
_UNREAD = {
    "moments of inertia (links count as uniform rods)": "inertia *[@diaginertia] *[@fullinertia]",
    "friction and damping of joints": "dynamics *[@damping] *[@frictionloss]",
    "couplings of joints": "mimic equality",
    "limits of actuators (--max-torque)": "*[@forcerange] *[@actuatorfrcrange]",
    "friction of Gazebo": "mu1 mu2",
}
"""What is said not to be taken, and the elements that have it."""


_NAMES = {
    "origin": {"xyz": "pos", "rpy": "euler"},
    "axis": {"xyz": "axis"},
    "mass": {"value": "mass"},
    "limit": {"lower": "lower", "upper": "upper", "velocity": "speed", "effort": "torque"},
}
"""Elements of a URDF, and attributes of MJCF by theirs."""


class Model(NamedTuple):
    """Links from tail to head, in SI units, with angles as colloc counts them."""

    lengths: list[float]
    masses: list[float]  # empty if the file lacks some
    limits: list[tuple[float, float]]
    max_speed: list[float]  # empty unless every joint has one
    max_torque: list[float]
    joints: str  # the file's angles by colloc's
    feet: list[str]  # as Python
    mu: float | None  # the coefficient of friction, if there is one of all parts
    notes: list[str]


@dataclass(eq=False)
class _Part:
    name: str
    parent: _Part | None = None
    joint: str = ""
    kind: str = "hinge"
    sprung: bool = False
    place: Any = 0.0  # of its joint
    axis: Any = 0.0
    turn: Any = 0.0
    limit: tuple[float, float] | None = None
    speed: float = 0.0
    torque: float = 0.0
    friction: list[tuple[float, float]] = field(default_factory=list)  # along its x and across
    mass: float = 0.0
    moment: Any = 0.0  # sum of mass times place
    solids: list[tuple[np.ndarray, np.ndarray, int]] = field(default_factory=list)
    """Middle, half axes as columns, and the norm that tells how far they reach: 1 of a box."""

    @property
    def coefficients(self) -> tuple[float, float]:
        return (self.friction or [(1.0, 1.0)])[-1]

    def reach(self, way: np.ndarray) -> list[float]:
        return [float(x @ way + np.linalg.norm(way @ axes, n)) for x, axes, n in self.solids]


def read_model(path: Path) -> Model:
    """Read a URDF or MJCF file. `ProblemError` for what is no planar serial chain."""
    try:
        root = fromstring(path.read_bytes())
    except (OSError, ParseError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise ProblemError(f"cannot read {path} as XML: {why}.") from None
    try:
        if any("xacro" in each.tag for each in root.iter()):
            raise ProblemError("it is a xacro: write `xacro FILE > robot.urdf` first.")
        if root.tag not in ("robot", "mujoco"):
            raise ProblemError(f"<{root.tag}> is neither a URDF (<robot>) nor an MJCF (<mujoco>).")
        model = _chain(_parts(_as_mjcf(root) if root.tag == "robot" else root))
    except (ProblemError, ValueError) as error:
        raise ProblemError(f"{path}: {error}") from None
    unread = [what for what, tags in _UNREAD.items() if _first(root, tags)]
    return model._replace(notes=model.notes + [f"not used: {', '.join(unread)}"] * bool(unread))


def _first(root: Element, tags: str) -> str:
    return next((tag for tag in tags.split() if root.find(f".//{tag}") is not None), "")


def _row(element: Element | None, name: str, default: str, of: str) -> np.ndarray:
    text = default if element is None else element.get(name, default)
    try:
        row = np.array(text.split(), dtype=float)
    except ValueError:
        row = np.array([np.nan])
    if not np.isfinite(row).all() or row.size != (len(default.split()) or row.size):
        raise ProblemError(f'{of}: {name}="{text}" must be finite numbers, as "{default or 1}".')
    return row


def _as_mjcf(root: Element) -> Element:
    """A URDF as MJCF; spheres of collision under another shape are feet."""
    for each in root.iter():
        for tag, names in _NAMES.items():
            for says in each.findall(tag)[:1]:
                each.attrib |= {names[x]: y for x, y in says.items() if x in names}
    links, behind = {link.get("name"): link for link in root.findall("link")}, []
    for joint in root.findall("joint"):
        ends = [getattr(joint.find(x), "attrib", {}).get("link") for x in ("parent", "child")]
        if not {*ends} <= {*links}:
            raise ProblemError(f'joint "{joint.get("name")}" names a link that is not there.')
        parent, child = (links[x] for x in ends)
        behind.append(child)
        child.attrib |= {x: joint.attrib.pop(x, "0 0 0") for x in ("pos", "euler")}
        parent.append(child)
        kind, low, high = (joint.get(x, "0") for x in ("type", "lower", "upper"))
        joint.attrib |= {"range": f"{low} {high}", "axis": joint.get("axis", "1 0 0")}
        joint.attrib |= {"limited": str(kind == "revolute").lower()}
        if kind in ("revolute", "continuous"):
            joint.set("type", "hinge")
        if kind != "fixed":
            child.append(joint)
    tops = [link for link in links.values() if link not in behind]
    if len(tops) != 1 or len({*behind}) < len(behind):
        raise ProblemError("its joints must lead from one link to every other one, on one way.")
    for name, link in links.items():
        link.tag, kinds = "body", []
        for use in ("visual", "collision"):
            shapes = [(x, y) for x in link.findall(use) for y in x.findall("geometry/*")]
            kinds.append({shape.tag for _, shape in shapes})
            for each, shape in shapes:
                size = _row(shape, "size", "0 0 0", of := f'link "{name}"')
                if shape.tag != "box":
                    r, length = (_row(shape, x, "0", of) for x in ("radius", "length"))
                    size = np.append(2 * r, length)
                attributes = {"type": shape.tag, "size": " ".join(map(str, (0.5 * size).tolist()))}
                SubElement(link, "geom", each.attrib | attributes, contype="0", conaffinity="0")
                if use == "collision" and kinds[1] == {"sphere"} < kinds[0] | {"sphere"}:
                    foot = SubElement(link, "body", each.attrib)
                    SubElement(foot, "joint", type="slide", stiffness="1")
    model = Element("mujoco")
    SubElement(model, "compiler", angle="radian", eulerseq="XYZ")
    SubElement(model, "worldbody").append(tops[0])
    return model


def _parts(root: Element) -> list[_Part]:
    if rare := _first(root, _RARE):
        raise ProblemError(
            f"{rare} is not read: load it in MuJoCo and save it with mj_saveLastXML first."
        )
    compiler = {name: x for each in root.findall("compiler") for name, x in each.items()}
    unit = 1.0 if compiler.get("angle") == "radian" else math.pi / 180
    order = compiler.get("eulerseq", "xyz").swapcase()  # capitals turn with the body in SciPy
    classes: dict[str, dict[str, dict[str, str]]] = {}
    pairs = {x.get("geom2"): x for x in root.findall("contact/pair")}
    parts: list[_Part] = []

    def inherit(default, above):
        usual = above | {x.tag: above.get(x.tag, {}) | x.attrib for x in default}
        classes[default.get("class", "main")] = usual
        for each in default.findall("default"):
            inherit(each, usual)

    for default in root.findall("default"):
        inherit(default, {})

    def elements(body, tag, usual):
        each = [(classes.get(x.get("class", usual), {}), x) for x in body.findall(tag)]
        return [Element(tag, names.get(tag, {}) | x.attrib) for names, x in each]

    def friction_of(element, of):
        row = _row(element, "friction", "", of) if element.get("friction") else np.ones(1)
        along, across = np.resize(row[:2], 2).tolist()
        return along, across

    def frame_of(element, frame, of):
        place, turn = frame
        inner = Rotation.from_quat(np.roll(_row(element, "quat", "1 0 0 0", of), -1))
        if element.get("euler"):
            inner = Rotation.from_euler(order, unit * _row(element, "euler", "0 0 0", of))
        return place + turn @ _row(element, "pos", "0 0 0", of), turn @ inner.as_matrix()

    def grow(body, part, usual, above):
        usual, of = body.get("childclass", usual), f'"{body.get("name")}"'
        place, turn = frame = frame_of(body, above, of)
        # joints of the first body place it in the world
        joints = elements(body, "joint", usual) if part else []
        if len(joints) == 2 and joints[0].get("stiffness"):  # a wheel that a spring presses
            del joints[0]
        part = part or _Part(body.get("name", ""))
        if len(joints) > 1:
            raise ProblemError(f"{of} has {len(joints)} joints: a chain has one between two links.")
        for joint in joints:
            part = _Part(body.get("name", ""), part, joint.get("name", ""), turn=turn)
            part.kind, part.sprung = joint.get("type", "hinge"), bool(joint.get("stiffness"))
            part.place = place + turn @ _row(joint, "pos", "0 0 0", of)
            axis = turn @ _row(joint, "axis", "0 0 1", of)
            part.axis = axis / (float(np.linalg.norm(axis)) or 1.0)
            low, high = unit * _row(joint, "range", "0 0", of) - unit * _row(joint, "ref", "0", of)
            limited = joint.get("limited", "true" if low < high else "false")
            if limited == "true" or (limited == "auto" and low < high):
                part.limit = (low, high)
            part.speed, part.torque = (_row(joint, x, "0", of).item() for x in ("speed", "torque"))
        if part not in parts:
            parts.append(part)
        inertials = elements(body, "inertial", usual)
        weights = [(each, frame_of(each, frame, of)[0]) for each in inertials]
        for geom in elements(body, "geom", usual):
            kind, name = geom.get("type", "sphere"), geom.get("name")
            size, (middle, axes) = _row(geom, "size", "", of), frame_of(geom, frame, of)
            if geom.get("fromto"):
                ends = _row(geom, "fromto", "0 0 0 0 0 1", of).reshape(2, 3) @ turn.T
                middle, half = place + ends.mean(axis=0), 0.5 * (ends[1] - ends[0])
                axes = Rotation.align_vectors([half], [[0, 0, 1]])[0].as_matrix()
                size = np.append(size[:1], np.linalg.norm(half))
            if kind == "box":
                part.solids.append((middle, axes * size, 1))
            elif kind in ("sphere", "cylinder", "capsule"):
                r, h = (*size, 0.0, 0.0)[:2]
                z = {"sphere": r, "cylinder": h}.get(kind, r + h)
                part.solids.append((middle, axes * [r, r, z], 2))
            if name in pairs:
                part.friction.append(friction_of(pairs[name], of))
            elif {geom.get("contype"), geom.get("conaffinity")} != {"0"}:
                part.friction.append(max(friction_of(geom, of)[:1] * 2, floor))
            weights.append((geom, middle))
        for each, middle in weights[: len(inertials) or None]:
            mass = float(_row(each, "mass", "0", of)[0])
            part.mass, part.moment = part.mass + mass, part.moment + mass * middle
        for each in body.findall("body"):
            grow(each, part, usual, frame)

    world = root.find("worldbody") or root
    ground = [friction_of(x, "floor")[:1] * 2 for x in elements(world, "geom", "main")]
    floor = max(ground, default=(1.0, 1.0))  # two that touch have the larger coefficient
    bodies = [x for x in root.findall("worldbody/body") if x.find(".//body/joint") is not None]
    if len(bodies) != 1:
        raise ProblemError(f"{len(bodies)} bodies of its world have joints in them: one must.")
    grow(bodies[0], None, "main", (np.zeros(3), np.eye(3)))
    return parts


def _chain(parts: list[_Part]) -> Model:
    up, stand = _contacts(parts)
    links = _in_series(parts, stand)
    joints = [b if b.parent is a else a for a, b in pairwise(links)]
    turns = zip(joints, links[1:], strict=True)
    signs = [math.copysign(1, x.axis @ up) * (1 if x is b else -1) for x, b in turns]
    ahead, at = _line(joints, up)
    at, notes = _with_ends(links, stand, ahead, at)
    lengths = np.diff(at)
    # lighter ones are points of contact
    heavy = [x for x in stand if x.parent and x.mass > _SMALL * x.parent.mass]
    masses = [math.fsum(x.mass for x in (y, *heavy) if y in (x, x.parent)) for y in links]
    if min(masses) <= 0:
        masses = []
        notes.append("a link has no mass there, so all have weights in proportion to their lengths")
    for part, a, b in zip(links, at, at[1:], strict=False):
        if part.mass and abs(part.moment @ ahead / part.mass - 0.5 * (a + b)) > _OFF * (b - a):
            notes.append(f"the mass of {part.name} is taken to be in its middle, which it is not")
    feet, directed = list[str](), [x for x in stand if x.kind != "hinge" and _rolls(x)]
    left, middle = np.cross(up, ahead), joints[0].place
    for k, part in enumerate(links):
        rows = []
        for x in (y for y in stand if y.parent is part):
            kind, more = _kind_of_foot(x, up, ahead)
            offset = (x.place - middle) @ left / lengths.sum()
            more = f", offset={offset:.6g}" * bool(abs(offset) > 1e-6) + more
            place = (x.place @ ahead - at[k]) / lengths[k]
            rows.append((round(float(place), 6) + 0.0, kind, more))
        feet += _feet_of_link(k, sorted(rows), part, ahead, at[k], lengths[k])
    if all(foot.endswith(", 0.0000, 1.0000)") for foot in feet):
        feet = []
    mus = {mu for part in parts for each in part.friction if part not in directed for mu in each}
    if len(mus) > 1:
        notes.append(
            f"its coefficients of friction, from {min(mus):g} to {max(mus):g}, are not used: "
            f"state --mu"
        )
    motors = ([getattr(x, name) for x in joints] for name in ("speed", "torque"))
    speeds, torques = (most if min(most) > 0 else [] for most in motors)
    names = [f"{x.joint} = {'-' * (y < 0)}joint_" for x, y in zip(joints, signs, strict=True)]
    return Model(
        [round(float(x), 9) for x in lengths],
        [round(x, 9) for x in masses],
        [_limits(*both) for both in zip(joints, signs, strict=True)],
        speeds,
        torques,
        ", ".join(f"{name}{j}" for j, name in enumerate(names, 1)),
        feet,
        mus.pop() if len(mus) == 1 else None,
        notes,
    )


def _contacts(parts: list[_Part]) -> tuple[np.ndarray, list[_Part]]:
    """The axis about which links turn, upwards, and wheels and feet."""
    carries = {part.parent for part in parts}
    # wheels have neither a limit nor something behind
    hinges = [part for part in parts[1:] if part.kind == "hinge"]
    known = {x: (x.limit is not None) + (x in carries) for x in hinges}
    if not known:
        raise ProblemError("no joint of it turns: a chain has hinges between its links.")
    first = max(known, key=lambda part: known[part])
    up = -first.axis if first.axis[2] < -_SMALL else first.axis
    stand = []
    for part in parts[1:]:
        cos = abs(float(part.axis @ up))
        what, cure = f'joint "{part.joint}"', "fix it in the file if the robot can hold it"
        is_foot = part.kind == "slide" and part.sprung and part not in carries
        if is_foot or (known.get(part) == 0 and cos < _SMALL):
            stand.append(part)
        elif part not in known:
            raise ProblemError(f"{what} is {part.kind}: a chain has hinges alone; {cure}.")
        elif cos < 1 - _SMALL**2:
            raise ProblemError(
                f"{what} is {math.degrees(math.acos(cos)):.3g} degrees off the axis of "
                f'"{first.joint}": a planar chain turns about parallel axes; {cure}.'
            )
    return up, stand


def _in_series(parts: list[_Part], stand: list[_Part]) -> list[_Part]:
    """The links from tail to head, as far as names tell which is which."""
    links = [x for x in parts if x not in stand]
    carried = {part: [x for x in links if x.parent is part] for part in links}
    for part, on in carried.items():
        if len(on) > 1 + (part is parts[0]):
            raise ProblemError(
                f'link "{part.name}" carries joints {", ".join(x.joint for x in on)}: a chain has '
                f"no branches; take all but one away, or fix them."
            )

    def arm(part):
        return [part, *(y for x in carried[part] for y in arm(x))]

    arms = [arm(x) for x in carried[parts[0]]]
    links = [*(x for each in arms[1:] for x in each[::-1]), parts[0], *arms[0]]
    ends = links[0].name.lower(), links[-1].name.lower()
    if any(x in ends[0] for x in ("head", "front")) or any(x in ends[1] for x in ("tail", "rear")):
        links.reverse()
    return links


def _line(joints: list[_Part], up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Direction of the straight body, and places of its joints that way."""
    places = np.array([part.place for part in joints]) @ (np.eye(3) - np.outer(up, up))
    span = float(np.linalg.norm(places[-1] - places[0]))
    ahead = (places[-1] - places[0]) / (span or 1.0)
    at, off = places @ ahead, np.abs((places - places[0]) @ np.cross(up, ahead)).max()
    if not span or off > _SMALL * span or np.diff(at).min() <= _SMALL * span:
        raise ProblemError(
            "where all joints are at zero they must lie on a line, each before the next: write "
            "origins so that zero is the straight body."
        )
    return ahead, at


def _with_ends(
    links: list[_Part], stand: list[_Part], ahead: np.ndarray, at: np.ndarray
) -> tuple[np.ndarray, list[str]]:
    """Places of the joints and both tips, and remarks."""
    notes, span = list[str](), np.ptp(at)
    for k, side in ((0, -1), (-1, 1)):
        part = links[k]
        tips = [side * float(x.place @ ahead) for x in stand if x.parent is part]
        tips += part.reach(side * ahead)
        if not part.solids and part.mass:
            tips = [side * (2 * float(part.moment @ ahead) / part.mass - at[k])]
            notes.append(f"{part.name} is taken to be twice as long as its mass is from its joint")
        if not tips or max(tips) - side * at[k] <= _SMALL * span:
            raise ProblemError(
                f'nothing says where link "{part.name}" ends (meshes are not read): give it a box, '
                f"or the origin of its mass."
            )
        at = np.insert(at, 0 if k == 0 else at.size, side * max(tips))
    return at, notes


def _limits(joint: _Part, sign: float) -> tuple[float, float]:
    low, high = sorted(sign * x for x in joint.limit or (-math.pi, math.pi))
    if not low < 0 < high:
        raise ProblemError(
            f'joint "{joint.joint}" goes from {low:.4g} to {high:.4g} rad: 0, straight, must be '
            f"between."
        )
    return max(low, -math.pi), min(high, math.pi)


def _rolls(foot: _Part) -> bool:
    along, across = foot.coefficients
    return along < _ROLLS * across


def _kind_of_foot(foot: _Part, up: np.ndarray, ahead: np.ndarray) -> tuple[str, str]:
    """Name of its function in Python, and arguments."""
    is_wheel = foot.kind == "hinge"
    if not is_wheel and not _rolls(foot):
        return "Foot", ""
    way = np.cross(foot.axis, up) if is_wheel else foot.turn[:, 0]
    angle = math.remainder(math.atan2(way @ np.cross(up, ahead), way @ ahead), math.pi)
    along, across = foot.coefficients
    more = f", angle={angle:.6g}" * (abs(angle) > _SMALL)
    if is_wheel:
        return "Wheel", more + ", rolling={rolling:g}, sideways={mu:g}, axle=True"
    return "Wheel", more + f", rolling={along:g}, sideways={across:g}"


def _feet_of_link(
    k: int, rows: list[Any], part: _Part, ahead: np.ndarray, begin: float, length: float
) -> list[str]:
    """Feet of link k as Python, from rows of (place, kind, arguments): Gauss points are a pad, and
    so is what a link without feet lies on."""
    spots, nodes = np.array([row[0] for row in rows]), np.polynomial.legendre.leggauss(_LINE)[0]
    if len(rows) == _LINE:
        middle, half = 0.5 * (spots[0] + spots[-1]), np.ptp(spots) / np.ptp(nodes)
        if np.allclose(spots, middle + half * nodes, rtol=0, atol=1e-4):
            return [f"Pad({k}, {middle - half:.4f}, {middle + half:.4f})"]
    if not rows:
        reached = (max(part.reach(way), default=math.inf) for way in (-ahead, ahead))
        ends = ((np.array([*reached]) * (-1, 1) - begin) / length).clip(0.0, 1.0)
        low, high = ends if 0 < np.ptp(ends) < 0.9 else (0.0, 1.0)
        return [f"Pad({k}, {low:.4f}, {high:.4f})"]
    return [f"{kind}({k}, {place:g}{more})" for place, kind, more in rows]
