"""What an engine is asked to play: a chain on point feet that are pressed on the floor by weights
of their own, as a URDF.

Links move in the plane (slides x and y and the heading of the tail). Feet are spheres on vertical
slides, with half of the robot's mass between them and twice the gravity: so each presses with the
weight that the certificate knows, whatever the other feet do, and every engine gets the same normal
forces. The links' own mass and inertia make up what the feet lack.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from colloc import Chain, Elliptic, Foot, Friction, inertial_motion
from colloc.mechanics.inertia import GRAVITY, checked_mass
from colloc.mechanics.law import Law

POINTS = 5
"""Feet that a link which lies on the floor is stood on: Gauss points."""
RADIUS = 0.005
"""Of a foot [m]."""
SHARE = 0.5
"""Of the robot's mass that its feet have."""
_NOTHING = 1e-7
"""Mass [kg] and moments of inertia of what joins two joints."""
DELTAS = (1e-3, 1e-4)


def on_feet(body: Any, friction: Law) -> Chain:
    """The chain on points: its own feet, or Gauss points of its links; unequal coefficients as
    engines have them, elliptic."""

    def law(own: Any) -> Friction:
        return (
            own
            if own.smallest == own.largest
            else Elliptic(mu_t=own.mu_t, mu_f=own.mu_f, mu_b=own.mu_b)
        )

    nodes, shares = np.polynomial.legendre.leggauss(POINTS)
    weights = enumerate(body.weight_column()[:, 0])
    points = [
        Foot(k, 0.5 + 0.5 * x, weight=0.5 * w * weight)
        for k, weight in weights
        for x, w in zip(nodes, shares, strict=True)
    ]
    feet = body.standing_on or points
    return replace(
        body, feet=tuple(replace(foot, friction=law(foot.friction or friction)) for foot in feet)
    )


@dataclass(frozen=True)
class Task:
    """A gait on a robot of 1 m and 1 kg at a Froude number. The last of its periods counts: one
    forgets the start."""

    name: str
    body: Chain
    gait: Any
    froude: float
    periods: int = 2

    @property
    def seconds(self) -> float:
        """Of a period."""
        return float(np.sqrt(1.0 / (GRAVITY * self.froude)))

    gravity = GRAVITY / SHARE
    """That presses feet of half the mass with the whole weight [m/s^2]."""

    @property
    def joints(self) -> list[str]:
        return [f"joint_{j}" for j in range(1, self.body.n_joint + 1)]

    @property
    def feet(self) -> dict[str, Any]:
        """Links of the model that touch the floor, and their friction."""
        return {f"foot_{k}": foot.friction for k, foot in enumerate(self.body.standing_on, 1)}

    @property
    def directed(self) -> bool:
        """Whether friction differs along and across a link."""
        return any(law.smallest != law.largest for law in self.feet.values())

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Angles [rad] and speeds [rad/s] of the joints."""
        angles, rates = self.gait(np.array([time / self.seconds % 1.0]))[:2]
        return angles[:, 0], rates[:, 0] / self.seconds

    def steps(self, step: float) -> int:
        """A whole number in a period, of about so many seconds each."""
        return round(self.seconds / step)

    def came_to(self, played: np.ndarray) -> np.ndarray:
        """Distance [body lengths] of the centre of mass and work [weight x length] of the last
        period, of a player's rows."""
        start = self.body.centre(self.at(0.0)[0][:, None])[:, 0]
        place = played[:, 0] + 1j * played[:, 1] + np.exp(1j * played[:, 2]) * complex(*start)
        return np.array([abs(place[-1] - place[-2]), (played[-1, 3] - played[-2, 3]) / GRAVITY])

    @cached_property
    def certificate(self) -> tuple[np.ndarray, np.ndarray]:
        """The same of colloc's equations and integrator, for delta -> 0, and by how much it may
        err."""
        law = self.feet["foot_1"]
        found = [
            inertial_motion(self.body, law, self.gait, delta, self.froude, tolerance=1e-6)
            for delta in DELTAS
        ]
        before, now = (np.array([motion.distance, motion.work]) for motion in found)
        own = np.array([found[1].errors[name] for name in ("distance", "work")])
        return now, np.abs(now - before) + own

    @property
    def urdf(self) -> str:
        body, numbered = checked_mass(self.body), list(enumerate(self.body.standing_on, 1))
        lines = [
            f'<robot name="{self.name}">',
            '<link name="world"/>',
            _link("after_x"),
            _link("after_y"),
        ]
        lines += [_joint("x", "prismatic", ("world", "after_x"), "1 0 0", f"0 0 {RADIUS}")]
        lines += [_joint("y", "prismatic", ("after_x", "after_y"), "0 1 0")]
        before = "after_y", 0.0
        for k, (own, whole, inertia) in enumerate(
            zip(body.lengths, body.mass_column()[:, 0], body.inertia_column()[:, 0], strict=True)
        ):
            name, feet = f"link_{k + 1}", [(j, foot) for j, foot in numbered if foot.link == k]
            x, y = (
                np.array(at)
                for at in zip(*((foot.place * own, foot.offset) for _, foot in feet), strict=True)
            )
            loads = SHARE * np.array([foot.weight for _, foot in feet], dtype=float)
            mass = whole - loads.sum()
            middle = (0.5 * whole * own - loads @ x) / mass
            second = inertia + 0.25 * whole * own**2 - loads @ (x**2 + y**2 + 0.4 * RADIUS**2)
            lines.append(_link(name, mass, second - mass * middle**2, middle))
            lines.append(
                _joint(
                    self.joints[k - 1] if k else "heading",
                    "continuous",
                    (before[0], name),
                    "0 0 1",
                    f"{before[1]} 0 0",
                )
            )
            for (j, _), load, *at in zip(feet, loads, x, y, strict=True):
                ball = (
                    f'<collision name="foot_{j}"><geometry><sphere '
                    f'radius="{RADIUS}"/></geometry></collision>'
                )
                lines.append(_link(f"foot_{j}", load, 0.4 * load * RADIUS**2, shape=ball))
                lines.append(
                    _joint(
                        f"slide_{j}",
                        "prismatic",
                        (name, f"foot_{j}"),
                        "0 0 1",
                        "{} {} 0".format(*at),
                    )
                )
            before = name, own
        return "\n".join([*lines, "</robot>"])


def _link(
    name: str,
    mass: float = _NOTHING,
    inertia: float = _NOTHING,
    middle: float = 0.0,
    shape: str = "",
) -> str:
    turns = (
        f'ixx="{inertia:.12g}" iyy="{inertia:.12g}" izz="{inertia:.12g}" ixy="0" ixz="0" iyz="0"'
    )
    weighs = f'<origin xyz="{middle:.12g} 0 0"/><mass value="{mass:.12g}"/><inertia {turns}/>'
    return f'<link name="{name}"><inertial>{weighs}</inertial>{shape}</link>'


def _joint(name: str, kind: str, links: tuple[str, str], axis: str, place: str = "0 0 0") -> str:
    limit = (
        '<limit lower="-1000" upper="1000" effort="1000" velocity="1000"/>'
        if kind == "prismatic"
        else ""
    )
    ends = '<parent link="{}"/><child link="{}"/>'.format(*links)
    return (
        f'<joint name="{name}" type="{kind}">{ends}<origin xyz="{place}"/><axis '
        f'xyz="{axis}"/>{limit}</joint>'
    )
