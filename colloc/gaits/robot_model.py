"""A planar serial chain out of a model of a robot, URDF or MJCF, as `Chain` counts it.

In the posture that the file calls zero the joints lie on a line. What is fixed together is one
link. Free hinges across with nothing behind them are wheels, slides with a spring feet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, ParseError, fromstring

import numpy as np
from scipy.spatial.transform import Rotation

from colloc.system.errors import ProblemError

_SMALL = 1e-3  # sine of an angle, or part of the length, that counts as none
_OFF = 0.05  # distance of a link's mass from its middle that is spoken of, over its length
_ROLLS = 0.5  # friction along over that across, below which a contact is a wheel
_FOOT = "sprung slide"  # kind of joint of what presses on the floor
_LINE = 16  # Gauss points of a pad in MJCF
_RARE = "include replicate attach frame *[@xyaxes] *[@zaxis] *[@axisangle] *[@eulerseq]"


class Model(NamedTuple):
    """Links from tail to head, in SI units, with angles as colloc counts them."""

    lengths: list[float]
    masses: list[float]  # empty if the file lacks some
    limits: list[tuple[float, float]]
    max_speed: list[float]  # empty unless every joint has one
    max_torque: list[float]
    joints: str  # the file's angles by colloc's
    feet: list[str]  # as Python
    notes: list[str]


@dataclass(eq=False)
class _Part:
    """A rigid part in the axes of the world."""

    name: str
    parent: _Part | None = None
    joint: str = ""
    kind: str = "hinge"
    place: Any = 0.0  # of its joint
    axis: Any = 0.0
    turn: Any = 0.0
    limit: tuple[float, float] | None = None
    speed: float = 0.0
    torque: float = 0.0
    friction: Any = (1.0, 1.0)  # along its x and across
    mass: float = 0.0
    moment: Any = 0.0  # sum of mass times place
    solids: list[tuple[np.ndarray, np.ndarray, int]] = field(default_factory=list)
    """Middle, half axes as columns, and the norm that tells how far they reach: 1 of a box."""

    def weigh(self, mass: np.ndarray, place: np.ndarray) -> None:
        self.mass, self.moment = self.mass + float(mass[0]), self.moment + mass * place

    def solid(self, kind: str, size: np.ndarray, place: np.ndarray, turn: np.ndarray) -> None:
        """Take in a box of half its edges, or a radius and half a length along z."""
        if kind == "box":
            self.solids.append((place, turn * size, 1))
        elif kind in ("sphere", "cylinder", "capsule"):
            r, h = (*size, 0.0, 0.0)[:2]
            z = {"sphere": r, "cylinder": h}.get(kind, r + h)
            self.solids.append((place, turn * [r, r, z], 2))


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
        return _chain(_urdf(root) if root.tag == "robot" else _mjcf(root))
    except (ProblemError, ValueError) as error:
        raise ProblemError(f"{path}: {error}") from None


def _row(element: Element | None, name: str, default: str, of: str) -> np.ndarray:
    """The numbers of an attribute, as many as `default` has, if it has."""
    text = default if element is None else element.get(name, default)
    try:
        row = np.array(text.split(), dtype=float)
    except ValueError:
        row = np.array([np.nan])
    if not np.isfinite(row).all() or row.size != (len(default.split()) or row.size):
        raise ProblemError(f'{of}: {name}="{text}" must be finite numbers, as "{default or 1}".')
    return row


def _urdf(root: Element) -> list[_Part]:
    links = {link.get("name", ""): link for link in root.findall("link")}
    carried: dict[Any, list[tuple[Element, Any]]] = {name: [] for name in links}
    for joint in root.findall("joint"):
        ends = [getattr(joint.find(x), "attrib", {}).get("link") for x in ("parent", "child")]
        if not {*ends} <= {*links}:
            raise ProblemError(f'joint "{joint.get("name")}" names a link that is not there.')
        carried[ends[0]].append((joint, ends[1]))
    behind = [child for joints in carried.values() for _, child in joints]
    tops = [name for name in links if name not in behind]
    if len(tops) != 1 or len({*behind}) < len(behind):
        raise ProblemError("its joints must lead from one link to every other one, on one way.")
    parts = [_Part(tops[0])]

    def frame_of(element: Element, frame: Any, of: str) -> Any:
        (place, turn), origin = frame, element.find("origin")
        own = Rotation.from_euler("xyz", _row(origin, "rpy", "0 0 0", of)).as_matrix()
        return place + turn @ _row(origin, "xyz", "0 0 0", of), turn @ own

    def grow(name: str, part: _Part, frame: Any) -> None:
        link, of = links[name], f'link "{name}"'
        for each in link.findall("inertial"):
            part.weigh(_row(each.find("mass"), "value", "0", of), frame_of(each, frame, of)[0])
        kinds = []
        for use in ("visual", "collision"):
            shapes = [(x, y) for x in link.findall(use) for y in x.findall("geometry/*")]
            kinds.append({shape.tag for _, shape in shapes})
            for each, shape in shapes:
                size = 0.5 * _row(shape, "size", "0 0 0", of)
                if shape.tag != "box":
                    r, length = (_row(shape, x, "0", of) for x in ("radius", "length"))
                    size = np.append(r, 0.5 * length)
                part.solid(shape.tag, size, *frame_of(each, frame, of))
                if use == "collision" and kinds[1] == {"sphere"} < kinds[0] | {"sphere"}:
                    middle = frame_of(each, frame, of)[0]  # of a sphere under something else
                    parts.append(_Part("", part, "", _FOOT, middle, np.eye(3)[2]))
        for joint, child in carried[name]:
            kind, of = joint.get("type", ""), f'joint "{joint.get("name")}"'
            where, axes = own = frame_of(joint, frame, of)
            if kind == "fixed":
                grow(child, part, own)
                continue
            parts.append(other := _Part(child, part, joint.get("name", ""), kind, where))
            other.axis = axes @ _row(joint.find("axis"), "xyz", "1 0 0", of)
            low, high, other.speed, other.torque = (
                float(_row(joint.find("limit"), x, "0", of)[0])
                for x in ("lower", "upper", "velocity", "effort")
            )
            if kind in ("revolute", "continuous"):
                other.kind, other.limit = "hinge", (low, high) if kind == "revolute" else None
            grow(child, other, own)

    grow(tops[0], parts[0], (np.zeros(3), np.eye(3)))
    return parts


def _mjcf(root: Element) -> list[_Part]:
    for rare in _RARE.split():
        if root.find(f".//{rare}") is not None:
            raise ProblemError(
                f"{rare} is not read: load it in MuJoCo and save it with mj_saveLastXML first."
            )
    unit = math.pi / 180 if root.find("compiler[@angle='radian']") is None else 1.0
    classes: dict[str, dict[str, dict[str, str]]] = {}
    pairs = {x.get("geom2"): x for x in root.findall("contact/pair")}
    parts: list[_Part] = []

    def inherit(default: Element, above: dict[str, dict[str, str]]) -> None:
        own = above | {x.tag: above.get(x.tag, {}) | x.attrib for x in default}
        classes[default.get("class", "main")] = own
        for each in default.findall("default"):
            inherit(each, own)

    for default in root.findall("default"):
        inherit(default, {})

    def frame_of(element: Element, frame: Any, of: str) -> Any:
        place, turn = frame
        own = Rotation.from_quat(np.roll(_row(element, "quat", "1 0 0 0", of), -1))
        if element.get("euler"):
            own = Rotation.from_euler("XYZ", unit * _row(element, "euler", "0 0 0", of))
        return place + turn @ _row(element, "pos", "0 0 0", of), turn @ own.as_matrix()

    def grow(body: Element, part: _Part | None, usual: str, above: Any) -> None:
        usual, of = body.get("childclass", usual), f'body "{body.get("name")}"'
        place, turn = frame = frame_of(body, above, of)

        def elements(tag: str) -> list[Element]:
            table = [classes.get(x.get("class", usual), {}) for x in body.findall(tag)]
            both = zip(table, body.findall(tag), strict=True)
            return [Element(tag, names.get(tag, {}) | x.attrib) for names, x in both]

        joints = elements("joint") if part else []  # of the first body they place it in the world
        part = part or _Part(body.get("name", ""))
        for joint in joints:
            kind = joint.get("type", "hinge")
            kind = _FOOT if kind == "slide" and joint.get("stiffness") else kind
            part = _Part(body.get("name", ""), part, joint.get("name", ""), kind, turn=turn)
            part.place = place + turn @ _row(joint, "pos", "0 0 0", of)
            part.axis = turn @ _row(joint, "axis", "0 0 1", of)
            low, high = unit * _row(joint, "range", "0 0", of) - unit * _row(joint, "ref", "0", of)
            part.limit = (low, high) if low < high and joint.get("limited") != "false" else None
        if len(joints) > 1:
            raise ProblemError(f"{of} has {len(joints)} joints: a chain has one between two links.")
        if part not in parts:
            parts.append(part)
        for each in (inertial := elements("inertial")):
            part.weigh(_row(each, "mass", "0", of), frame_of(each, frame, of)[0])
        for geom in elements("geom"):
            size, (middle, axes) = _row(geom, "size", "", of), frame_of(geom, frame, of)
            if geom.get("fromto"):
                ends = _row(geom, "fromto", "0 0 0 0 0 1", of).reshape(2, 3) @ turn.T
                middle, half = place + ends.mean(axis=0), 0.5 * (ends[1] - ends[0])
                axes = Rotation.align_vectors([half], [[0, 0, 1]])[0].as_matrix()
                size = np.append(size[:1], np.linalg.norm(half))
            part.solid(geom.get("type", "sphere"), size, middle, axes)
            if not inertial:
                part.weigh(_row(geom, "mass", "0", of), middle)
            if (pair := pairs.get(geom.get("name"))) is not None:
                part.friction = np.resize(_row(pair, "friction", "", of)[:2], 2)
        for each in body.findall("body"):
            grow(each, part, usual, frame)

    bodies = [x for x in root.findall("worldbody/body") if x.find(".//body/joint") is not None]
    if len(bodies) != 1:
        raise ProblemError(f"{len(bodies)} bodies of its world have joints in them: one must.")
    grow(bodies[0], None, "main", (np.zeros(3), np.eye(3)))
    return parts


def _chain(parts: list[_Part]) -> Model:
    carried = {part: [x for x in parts if x.parent is part] for part in parts}
    # wheels have neither a limit nor something behind
    known = {x: (x.limit is not None) + bool(carried[x]) for x in parts[1:] if x.kind == "hinge"}
    if not known:
        raise ProblemError("no joint of it turns: a chain has hinges between its links.")
    first = max(known, key=lambda part: known[part])
    up = first.axis / (float(np.linalg.norm(first.axis)) or 1.0)
    up = -up if up[2] < -_SMALL else up
    stand = []
    for part in parts[1:]:
        cos = abs(float(part.axis @ up)) / (float(np.linalg.norm(part.axis)) or 1.0)
        what, cure = f'joint "{part.joint}"', "fix it in the file if the robot can hold it"
        if (part.kind == _FOOT and not carried[part]) or (known.get(part) == 0 and cos < _SMALL):
            stand.append(part)
        elif part not in known:
            raise ProblemError(f"{what} is {part.kind}: a chain has hinges alone; {cure}.")
        elif cos < 1 - _SMALL**2:
            raise ProblemError(
                f"{what} is {math.degrees(math.acos(cos)):.3g} degrees off the axis of "
                f'"{first.joint}": a planar chain turns about parallel axes; {cure}.'
            )
    carried = {part: [x for x in on if x not in stand] for part, on in carried.items()}
    for part, on in carried.items():
        if len(on) > 1 + (part is parts[0]):
            raise ProblemError(
                f'link "{part.name}" carries joints {", ".join(x.joint for x in on)}: a chain has '
                f"no branches; take all but one away, or fix them."
            )
    links = parts[:1]
    for each in carried[parts[0]]:
        arm = [each]
        while arm:
            links += arm
            arm = carried[arm[0]]
        links.reverse()  # an arm is followed from its end
    links = links if len(carried[parts[0]]) > 1 else links[::-1]
    ends = links[0].name.lower(), links[-1].name.lower()
    if any(x in ends[0] for x in ("head", "front")) or any(x in ends[1] for x in ("tail", "rear")):
        links.reverse()
    joints = [b if b.parent is a else a for a, b in pairwise(links)]
    signs = [
        math.copysign(1, x.axis @ up) * (1 if x is b else -1)
        for x, b in zip(joints, links[1:], strict=True)
    ]
    places = np.array([part.place for part in joints]) @ (np.eye(3) - np.outer(up, up))
    span = float(np.linalg.norm(places[-1] - places[0]))
    ahead = (places[-1] - places[0]) / (span or 1.0)
    left, at = np.cross(up, ahead), places @ ahead
    off = np.abs((places - places[0]) @ left).max()
    if not span or off > _SMALL * span or np.diff(at).min() <= _SMALL * span:
        raise ProblemError(
            "where all joints are at zero they must lie on a line, each before the next: write "
            "origins so that zero is the straight body."
        )
    notes = []
    for k, side in ((0, -1), (-1, 1)):
        part = links[k]
        tips = [side * float(x.place @ ahead) for x in stand if x.parent is part]
        for middle, axes, norm in part.solids:
            tips.append(float(side * middle @ ahead + np.linalg.norm(ahead @ axes, norm)))
        if not part.solids and part.mass:
            tips = [side * (2 * float(part.moment @ ahead) / part.mass - at[k])]
            notes.append(f"{part.name} is taken to be twice as long as its mass is from its joint")
        if not tips or max(tips) - side * at[k] <= _SMALL * span:
            raise ProblemError(
                f'nothing says where link "{part.name}" ends (meshes are not read): give it a box, '
                f"or the origin of its mass."
            )
        at = np.insert(at, 0 if k == 0 else at.size, side * max(tips))
    lengths, wheels = np.diff(at), [x for x in stand if x.kind == "hinge"]
    masses = [math.fsum(x.mass for x in (y, *wheels) if y in (x, x.parent)) for y in links]
    if min(masses) <= 0:
        masses = []
        notes.append("a link has no mass there, so all have weights in proportion to their lengths")
    for part, a, b in zip(links, at, at[1:], strict=False):
        if part.mass and abs(part.moment @ ahead / part.mass - 0.5 * (a + b)) > _OFF * (b - a):
            notes.append(f"the mass of {part.name} is taken to be in its middle, which it is not")
    limits = []
    for part, sign in zip(joints, signs, strict=True):
        low, high = sorted(sign * x for x in part.limit or (-math.pi, math.pi))
        if not low < 0 < high:
            raise ProblemError(
                f'joint "{part.joint}" goes from {low:.4g} to {high:.4g} rad: 0, straight, must be '
                f"between."
            )
        limits.append((max(low, -math.pi), min(high, math.pi)))
    feet, nodes = list[str](), np.polynomial.legendre.leggauss(_LINE)[0]
    for k, part in enumerate(links):
        rows = []
        for x in (y for y in stand if y.parent is part):
            kind, (along, across) = "Foot", x.friction
            offset = (x.place - places[0]) @ left / lengths.sum()
            more = f", offset={offset:.6g}" if abs(offset) > 1e-6 else ""
            if x in wheels or along < _ROLLS * across:
                kind, rolls = "Wheel", np.cross(x.axis, up) if x in wheels else x.turn[:, 0]
                angle = math.remainder(math.atan2(rolls @ left, rolls @ ahead), math.pi)
                more += f", angle={angle:.6g}" if abs(angle) > _SMALL else ""
                own = f"rolling={along:g}, sideways={across:g}"
                more += ", sideways={mu:g}" if x in wheels else f", {own}"
            place = (x.place @ ahead - at[k]) / lengths[k]
            rows.append((round(float(place), 6) + 0.0, kind, more))
        rows.sort()
        spots = np.array([row[0] for row in rows])
        if len(rows) == _LINE:
            middle, half = 0.5 * (spots[0] + spots[-1]), np.ptp(spots) / np.ptp(nodes)
            if np.allclose(spots, middle + half * nodes, rtol=0, atol=1e-4):
                rows = []
                feet.append(f"Pad({k}, {middle - half:.4f}, {middle + half:.4f})")
        elif not rows:
            feet.append(f"Pad({k}, {0:.4f}, {1:.4f})")
        feet += [f"{kind}({k}, {place:g}{more})" for place, kind, more in rows]
    if all(foot.endswith(", 0.0000, 1.0000)") for foot in feet):
        feet = []
    speeds, torques = ([getattr(x, name) for x in joints] for name in ("speed", "torque"))
    return Model(
        [round(float(x), 9) for x in lengths],
        [round(x, 9) for x in masses],
        limits,
        speeds if min(speeds) > 0 else [],
        torques if min(torques) > 0 else [],
        ", ".join(
            f"{part.joint} = {'-' * (sign < 0)}joint_{j}"
            for j, (part, sign) in enumerate(zip(joints, signs, strict=True), 1)
        ),
        feet,
        notes,
    )
