"""The robot of a result as a model for simulators, MJCF (MuJoCo) and URDF, in SI units.

Links have the problem's lengths, masses and inertias; joints are hinges about the vertical.

MJCF: each foot is a small body on a vertical slide with a spring that presses with its weight; pads
and links stand on Gauss points. A contact `<pair>` has two coefficients, the first along the axis
of a capsule, so a foot with directed friction is a very short capsule. MuJoCo's friction is that of
`colloc.Elliptic`, also for other laws (`floor_of`). Its sliding contacts are lifted the more the
slower they respond: hence short steps, constraints of two steps, and an impedance that begins at 0.

URDF has no friction, springs or motors.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from colloc.gaits.limits import range_of
from colloc.laws.elliptic import Elliptic
from colloc.mechanics.chain import Chain
from colloc.mechanics.floor_contact import whole_links
from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law, rate_independent
from colloc.pictures.templates import render
from colloc.results.robot import Robot
from colloc.system.errors import ProblemError

_THIN = 0.02  # width and height of links that have none [body lengths]
_POINTS = 16  # on which a pad or a link stands
_STEPS, _LONGEST = 8000, 1e-3  # time steps of a period, and the longest one [s]
_AXIS, _MASS = 1e-4, 1e-6  # half length of a capsule, and mass of a foot, in those of the body
_STIFF = 5000.0  # gain of the position servos per rad, over the largest torque of the gait
_LEAST = 1e-5  # smallest coefficient of friction in MuJoCo
_RESERVE = 1.5  # effort and speed that a URDF allows a joint, over the largest of the gait


class _Parts(NamedTuple):
    chain: Chain
    lengths: np.ndarray  # of links
    masses: np.ndarray
    inertias: np.ndarray  # about their own axes, (n_link, 3)
    width: float
    height: float
    ranges: list[tuple[float, float]]  # of joints


def _parts(robot: Robot) -> _Parts:
    """Links and joints in SI units; the inertia about a link's length is that of its box."""
    problem = robot.solution.problem
    chain, limit = problem.body, problem.joint_limit
    if problem.joint_map is not None:
        raise ProblemError(
            "models for simulators are of a Chain with a motor in every joint: leave gears and "
            "stuck joints out."
        )
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


def _xml(template: str, /, **values: Any) -> str:
    root = ElementTree.fromstring(render(template, **values))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def mjcf(robot: Robot, *, contacts: bool = True) -> str:
    """The robot as MJCF with position servos and the keyframe "start"; without `contacts`, and
    under laws that are not dry, it touches no floor. `ProblemError` for other bodies than such
    chains."""
    parts, problem, gait = _parts(robot), robot.solution.problem, robot.solution.gait
    pull = problem.regime.pull(np.array([[getattr(gait, "theta", None) or 0.0]]))
    leaning = (0.0, 0.0) if pull is None else pull[:, 0]  # gravity leans, not the floor
    floor = contacts and rate_independent(problem.law)
    feet = _feet(robot, parts) if floor else []
    start = gait.angles(np.zeros(1))[:, 0]
    posture = [0.0, 0.0, 0.0]  # the tail, joints, and feet on their slides, link by link
    for k in range(parts.chain.n_link):
        posture += [*start[max(k - 1, 0) : k], *(0.0 for foot in feet if foot["link"] == k)]
    return _xml(
        "robot.xml",
        name=problem.name,
        parts=parts,
        length=robot.length,
        pressing=robot.pressing,
        step=robot.period / max(_STEPS, np.ceil(robot.period / _LONGEST)),
        gravity=robot.pressing * np.append(leaning, -1.0) + 0.0,  # no -0
        floor=floor,
        feet=feet,
        foot_mass=_MASS * robot.mass,
        axis=_AXIS * robot.length,
        stiff=_STIFF,
        peaks=robot.facts["peak_torque_N_m"],
        posture=posture,
        start=start,
    )


def _feet(robot: Robot, parts: _Parts) -> list[dict[str, Any]]:
    """Points on which it stands, each pressed on the floor with its share of the weight."""
    chain, feet = parts.chain, list[dict[str, Any]]()
    for foot in chain.standing_on or whole_links(chain.weight_column()[:, 0]):
        law: Any = _elliptic(foot.friction or robot.solution.problem.friction)
        rule = np.polynomial.legendre.leggauss(_POINTS) if foot.extent else ([0.0], [2.0])
        for node, share in zip(*rule, strict=True):
            along = (foot.place + 0.5 * node * foot.extent) * parts.lengths[foot.link]
            about = {
                "number": len(feet) + 1,
                "link": foot.link,
                "place": (along, foot.offset * robot.length, 0),
                "angle": foot.angle,
                "borne": robot.mass * (0.5 * share * float(foot.weight or 0.0)),
                "friction": (law.mu_f, law.mu_t, 0, 0, 0),  # a contact has no other resistance
                "directed": f"{law.mu_f:.9g}" != f"{law.mu_t:.9g}",
            }
            feet.append(about)
    return feet


def urdf(robot: Robot) -> str:
    """The robot as a URDF; link_1 is its tail. Efforts and speeds are 1.5 times the gait's."""
    parts = _parts(robot)
    return _xml(
        "robot.urdf",
        name=robot.solution.problem.name,
        parts=parts,
        robot_length=robot.length,
        efforts=_RESERVE * np.array(robot.facts["peak_torque_N_m"]),
        speeds=_RESERVE * np.array(robot.facts["peak_speed_rad_per_s"]),
    )


FORMATS = {".xml": mjcf, ".urdf": urdf}


def floor_of(robot: Robot) -> tuple[Chain, Law]:
    """Body and law of friction as the contacts of the MJCF have them."""
    chain, law = _parts(robot).chain, robot.solution.problem.friction
    feet = tuple(
        replace(foot, friction=foot.friction and _elliptic(foot.friction))
        for foot in chain.standing_on
    )
    return (replace(chain, feet=feet) if chain.feet else chain), _elliptic(law)


def note_of(robot: Robot) -> str:
    """Difference of friction in the MJCF from the problem's, or ""."""
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
    """The law of MuJoCo that is nearest to a dry one."""
    if _is_exact(law):
        return law
    one, none = np.ones((1, 1)), np.zeros((1, 1))
    ahead, back, aside = (
        max(float(np.hypot(*(force[0, 0] for force in law.density(*way, none)))), _LEAST)
        for way in ((one, none), (-one, none), (none, one))
    )
    along = float(np.sqrt(ahead * back))
    return Elliptic(mu_t=aside, mu_f=along, mu_b=along)
