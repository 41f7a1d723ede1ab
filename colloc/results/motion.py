"""Sampled motion of a body: its columns for result files, xarray and pandas, and what pictures show
of it: outline, feet, speeds and friction."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.floor_contact import FOOT
from colloc.mechanics.inertia import tail_velocity
from colloc.mechanics.law import Law
from colloc.system.environment import optional

if TYPE_CHECKING:
    import pandas
    import xarray

SAMPLES = 401  # of a cycle in a result file, both ends included
PHASES = np.linspace(0.0, 1.0, 2001)  # the radius is accurate to 1e-7
_PARTS, _STEP = 5, 1e-6  # parts whose speeds are drawn, and the time of a difference quotient
_WHEEL = 0.25  # drawn length of a wheel over that of its link


@dataclass(frozen=True, eq=False)
class SampledMotion:
    """Motion of a body at ``n_time`` instants.

    Attributes
    ----------
    t : (n_time,)
        Phase.
    angles, rates : (n_joint, n_time)
    z : (3, n_time)
        Tail velocity (u, v, omega) in the body frame.
    theta : (n_time,)
        Lab angle of the tail link.
    centre, tail : (2, n_time)
        Lab positions of the centre of mass and of the tail.
    """

    t: np.ndarray
    angles: np.ndarray
    rates: np.ndarray
    z: np.ndarray
    theta: np.ndarray
    centre: np.ndarray
    tail: np.ndarray

    def __repr__(self) -> str:
        ends = " to ".join(f"{t:g}" for t in self.t[:: max(1, self.t.size - 1)])
        return f"<SampledMotion at {self.t.size} instants, t = {ends}>"


def motion_with_inertia(
    chain: Chain, gait: Callable[..., Any], t: np.ndarray, states: np.ndarray
) -> SampledMotion:
    """Sample a motion from momenta, theta and the place of the centre of mass at phases t."""
    (angles, rates), theta, centre = gait(t % 1.0), states[3], states[4:6]
    z = tail_velocity(chain, angles, rates, states[:3])
    tail = centre - rotate(np.array(chain.centre(angles)), theta)
    return SampledMotion(t, angles, rates, z, theta, centre, tail)


def rotate(vectors: np.ndarray, theta: np.ndarray | float) -> np.ndarray:
    """Rotate vectors ``(2, ..., n_time)`` by angles theta, from body to lab axes."""
    (x, y), c, s = vectors, np.cos(theta), np.sin(theta)
    return np.stack([c * x - s * y, s * x + c * y])


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """Rotation about the origin [rad], then a shift x + iy: the effect of a cycle of a gait."""

    rotation: float | np.ndarray
    shift: complex | np.ndarray

    def repeat(self, times: np.ndarray | int) -> RigidMotion:
        """Power of the motion; negative ones are inverse."""
        angle = math.remainder(self.rotation, 2 * np.pi)
        # sum_k<n e^(i k angle) = e^(i (n - 1) angle / 2) sin(n angle / 2) / sin(angle / 2)
        chords = times * np.sinc(0.5 * times * angle / np.pi) / np.sinc(0.5 * angle / np.pi)
        return RigidMotion(
            times * self.rotation, chords * np.exp(0.5j * (times - 1) * angle) * self.shift
        )

    def of(self, points: np.ndarray) -> np.ndarray:
        x, y = rotate(points, self.rotation)
        return np.stack([x + np.real(self.shift), y + np.imag(self.shift)])


class Arc(NamedTuple):
    """Angle that a cycle turns, counter-clockwise [rad]; chord between its ends [body lengths]."""

    angle: float
    chord: float

    @property
    def radius(self) -> float:
        """Radius of the circle [body lengths], infinite without turning."""
        across = abs(2 * math.sin(0.5 * self.angle))
        return self.chord / across if across else math.inf


def arc(angle: float, centre: np.ndarray) -> Arc:
    """Arc of a cycle with a turn [rad] and a path of the centre of mass ``(2, n)`` in equal
    steps."""
    return Arc(angle, abs(way_on_circle(angle, centre)))


def way_on_circle(angle: float, centre: np.ndarray) -> complex:
    """Displacement of a cycle on its mean circle, with the arguments of `arc`."""
    path = centre[0] + 1j * centre[1]
    t = np.linspace(0.0, 1.0, path.size)
    turn, displacement = np.exp(1j * angle) - 1, path[-1] - path[0]
    # integrated by parts, which needs no velocities; the integrand is periodic
    integrand = np.exp(-1j * angle * t) * (turn * (path - path[0]) + displacement)
    return complex(np.trapezoid(integrand, t))


class Column(NamedTuple):
    """Values, units, and names of dimensions, time last."""

    values: np.ndarray
    units: str
    dims: tuple[str, ...]


def motion_columns(motion: SampledMotion, power: np.ndarray, body: Body) -> dict[str, Column]:
    """Columns by name, with the power against friction ``(n_time,)``."""
    shape = body.defaults.coordinate, "t"
    velocity_units = "length/period, length/period, rad/period"
    return {
        "t": Column(motion.t, "period", ("t",)),
        f"{body.defaults.quantity.replace(' ', '_')}s": Column(motion.angles, "rad", shape),
        f"{body.defaults.coordinate}_rates": Column(motion.rates, "rad/period", shape),
        "tail_velocity": Column(motion.z, velocity_units, ("velocity", "t")),
        "theta": Column(motion.theta, "rad", ("t",)),
        "centre": Column(motion.centre, "length", ("axis", "t")),
        "tail": Column(motion.tail, "length", ("axis", "t")),
        "power": Column(power, "weight length/period", ("t",)),
    }


def motion_dataset(columns: dict[str, Column], about: dict[str, Any]) -> xarray.Dataset:
    arrays = {name: (c.dims, c.values, {"units": c.units}) for name, c in columns.items()}
    return optional("xarray").Dataset(arrays, _labels(columns), about)


def motion_frame(columns: dict[str, Column]) -> pandas.DataFrame:
    flat: dict[str, np.ndarray] = {}
    for name, column in columns.items():
        if column.dims == ("t",):
            flat[name] = column.values
        else:
            labels = zip(_labels(columns)[column.dims[0]], column.values, strict=True)
            flat |= {f"{name}_{label}": row for label, row in labels}
    return optional("pandas").DataFrame(flat).set_index("t")


def _labels(columns: dict[str, Column]) -> dict[str, list]:
    labels: dict[str, list] = {"velocity": ["u", "v", "omega"], "axis": ["x", "y"]}
    sizes = {c.dims[0]: len(c.values) for c in columns.values() if len(c.dims) > 1}
    return {dim: labels.get(dim, [*range(1, size + 1)]) for dim, size in sizes.items()}


def hinges(body: Body) -> slice:
    return slice(1, -1) if isinstance(body, Chain) else slice(0, 0)


def foot_kinds(body: Body) -> tuple[str, ...]:
    """Kinds of feet (`colloc.mechanics.floor_contact.Foot.kind`); none if it lies on the floor."""
    return tuple(foot.kind for foot in body.standing_on) if isinstance(body, Chain) else ()


def lab_outline(body: Body, motion: SampledMotion) -> np.ndarray:
    """Outline in the lab, tail first, ``(2, n_point, n_time)``."""
    return motion.tail[:, None] + rotate(np.stack(body.outline(motion.angles)), motion.theta)


def lab_feet(body: Body, motion: SampledMotion) -> np.ndarray:
    """Both ends of the feet in the lab, ``(2, 2, n_foot, n_time)``."""
    feet = np.zeros((2, 2, 0, motion.t.size))
    if isinstance(body, Chain) and body.feet:
        feet = body.footprints(motion.angles, _WHEEL)
    return motion.tail[:, None, None] + rotate(feet, motion.theta)


def part_speeds(body: Body, motion: SampledMotion) -> tuple[str, np.ndarray]:
    """What parts are called, and their speeds ``(n_part, n_time)``: of the midpoints of links, of
    feet, and of pads where they are fastest."""
    angles, rates, z = motion.angles, motion.rates, motion.z
    if not isinstance(body, Chain):
        return "part", np.hypot(*_parts(body, angles, rates, z, _PARTS)[2])
    contact = body.contact
    parts = contact.velocities(body.velocity(body.posture(angles), rates, z))
    vs, vn, w = map(np.abs, parts)
    turns = 0.5 * contact.length * w if contact.called == FOOT else 0.0
    return contact.called, np.hypot(vs, vn + turns)


def friction_arrows(
    body: Body,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    z: np.ndarray,
    count: int = 12,
) -> tuple[np.ndarray, np.ndarray]:
    """About `count` points along the body and the force per length there, ``(2, n_point, n_time)``
    each; every foot has one, with all of its force, and pads beside feet have theirs as if all of
    them moved alike."""
    if not isinstance(body, Chain):
        (x, y), (dx, dy), (vx, vy) = _parts(body, angles, rates, z, count)
        fs, fn = friction.density(vx * dx + vy * dy, vy * dx - vx * dy, delta)
        return np.stack([x, y]), np.stack([fs * dx - fn * dy, fs * dy + fn * dx])
    contact, laws = body.contact, body.contact.laws(friction)
    many = max(2, count // max(len(contact.pads), 1))
    share = np.repeat((np.arange(many) + 0.5) / many - 0.5, len(contact.pads))
    feet = [k for k in range(len(contact.parts)) if k not in contact.pads]
    part = np.array([*feet, *np.tile(contact.pads, many).astype(int)])
    along = np.concatenate([np.zeros(len(feet)), share])[:, None] * contact.length[part]
    vs, vn, w = contact.velocities(body.velocity(body.posture(angles), rates, z))
    vs, vn = vs[part], vn[part] + along * w[part]
    forces = [laws[k].density(vs[[i]], vn[[i]], delta) for i, k in enumerate(part)]
    fs, fn = (np.concatenate([force[side] for force in forces]) for side in (0, 1))
    pressed = (contact.weight if contact.called == FOOT else contact.pressure)[part]
    # from the axes of the part to those of its link, and of the body
    cos, sin, x, y = (row[np.array(contact.links)[part]] for row in body.posture(angles))
    turn = pressed * (contact.cos + 1j * contact.sin)[part] * (cos + 1j * sin)
    force = turn * (fs + 1j * fn)
    on_link = contact.along[part] + along + 1j * contact.offset[part]
    place = x + 1j * y + on_link * (cos + 1j * sin)
    return np.stack([place.real, place.imag]), np.stack([force.real, force.imag])


def _parts(
    body: Body, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, count: int
) -> tuple[np.ndarray, ...]:
    """Middles of about `count` parts of the outline, their directions and velocities, ``(2, n_part,
    n_time)`` each."""
    ahead, now, behind = (
        np.stack(body.outline(angles + step * rates)) for step in (_STEP, 0.0, -_STEP)
    )
    moved = (ahead - behind) / (2 * _STEP) + z[:2, None] + z[2] * np.stack([-now[1], now[0]])
    n = now.shape[1] - 1
    parts = ((np.arange(min(count, n)) + 0.5) * n / min(count, n)).astype(int)
    place, velocity = (0.5 * (a[:, 1:] + a[:, :-1])[:, parts] for a in (now, moved))
    along = np.diff(now, axis=1)[:, parts]
    return place, along / np.hypot(*along), velocity
