"""Sampled motion of a body, and its labelled columns for result files, xarray and pandas."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.system.lazy import optional

if TYPE_CHECKING:
    import pandas
    import xarray

SAMPLES = 401  # of a period in a result file, both ends included
PHASES = np.linspace(0.0, 1.0, 2001)  # the radius is accurate to 1e-7


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
        return (
            f"<SampledMotion at {self.t.size} instants, t = {self.t.min():g} to {self.t.max():g}>"
        )


def rotate(vectors: np.ndarray, theta: np.ndarray | float) -> np.ndarray:
    """Rotate vectors ``(2, ..., n_time)`` by angles theta, from body to lab axes."""
    (x, y), c, s = vectors, np.cos(theta), np.sin(theta)
    return np.stack([c * x - s * y, s * x + c * y])


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """Rotation about the origin [rad], then a shift x + iy: the effect of a period of a gait.

    >>> quarter = RigidMotion(np.pi / 2, 1.0 + 0.0j)
    >>> np.round(quarter.repeat(np.array([2, 4])).shift, 9) + 0.0
    array([1.+1.j, 0.+0.j])
    """

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
        """Image of points ``(2, ..., n)``."""
        x, y = rotate(points, self.rotation)
        return np.stack([x + np.real(self.shift), y + np.imag(self.shift)])


class Arc(NamedTuple):
    """Angle that a period turns, counter-clockwise [rad]; chord between its ends [body lengths]."""

    angle: float
    chord: float

    @property
    def radius(self) -> float:
        """Radius of the circle [body lengths], infinite without turning."""
        across = abs(2 * math.sin(0.5 * self.angle))
        return self.chord / across if across else math.inf

    @property
    def length(self) -> float:
        """Length along the circle, the shorter way round [body lengths]."""
        half = 0.5 * math.remainder(self.angle, 2 * math.pi)
        return self.chord if half == 0 else self.chord * half / math.sin(half)


def arc(angle: float, centre: np.ndarray) -> Arc:
    """Arc of a period with a turn [rad] and a path of the centre of mass ``(2, n)`` in equal steps.

    >>> import numpy as np
    >>> t = np.linspace(0, 1, 2001)
    >>> wriggle = (2 + 0.1 * np.exp(2j * np.pi * t)) * np.exp(0.5j * t)
    >>> round(arc(0.5, np.array([wriggle.real, wriggle.imag])).radius, 6)
    2.0
    """
    path = centre[0] + 1j * centre[1]
    t = np.linspace(0.0, 1.0, path.size)
    turn, displacement = np.exp(1j * angle) - 1, path[-1] - path[0]
    # integrated by parts, which needs no velocities; the integrand is periodic
    integrand = np.exp(-1j * angle * t) * (turn * (path - path[0]) + displacement)
    return Arc(angle, float(abs(np.trapezoid(integrand, t))))


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
    """A pandas DataFrame with the phase as index."""
    flat: dict[str, np.ndarray] = {}
    for name, column in columns.items():
        if column.dims == ("t",):
            flat[name] = column.values
        else:
            named = zip(_labels(columns)[column.dims[0]], column.values, strict=True)
            flat |= {f"{name}_{label}": row for label, row in named}
    return optional("pandas").DataFrame(flat).set_index("t")


def _labels(columns: dict[str, Column]) -> dict[str, list]:
    """Labels along dimensions other than time: names, or numbers from 1."""
    named: dict[str, list] = {"velocity": ["u", "v", "omega"], "axis": ["x", "y"]}
    sizes = {c.dims[0]: len(c.values) for c in columns.values() if len(c.dims) > 1}
    return {dim: named.get(dim, [*range(1, size + 1)]) for dim, size in sizes.items()}
