r"""A collocated gait on a slope as a function of its parameters and of where the body points, with exact gradients.

On the mesh ``theta = theta_0 + H omega(theta, v)`` (`colloc.verification.collocated_slope`). So a number Phi changes by

    d Phi = Phi_v dv + mu^T (d theta_0 + H omega_v dv),      (I - H Omega)^T mu = Phi_theta.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.sloped import Slope
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.numerics.mesh import Mesh
from colloc.numerics.orientation import Orientation
from colloc.reduced.harmonic_space import HarmonicSpace
from colloc.reduced.motion import ReducedMotion, Shapes
from colloc.verification.collocated_slope import PointsOnSlope, points_on_slope

_NAMES = ("distance", "work", "rotation", "across")


@dataclass(frozen=True, eq=False)
class _State:
    """The collocated motion of one v at one delta."""

    v: np.ndarray
    delta: float
    rates: np.ndarray
    points: PointsOnSlope


class SlopedMotion(ReducedMotion):
    """What a period on a slope comes to; arguments as of a `ReducedMotion`, and the slope. The last of v is where it points."""

    def __init__(
        self, body: Body, friction: Law, symmetry: str, mesh: Mesh, shapes: Shapes, besides: Sequence[str], slope: Slope
    ) -> None:
        super().__init__(body, friction, symmetry, mesh, shapes, besides)
        self._slope, self._orientation = slope, Orientation(mesh)
        self._known: _State | None = None

    def _moved(self, v: np.ndarray, delta: float) -> _State:
        last = self._known
        if last is not None and last.delta == delta and np.array_equal(last.v, v):
            return last
        angles, rates, _ = self.shapes.at(v)
        near = None if last is None else (last.points.theta + v[-1] - last.v[-1], last.points.z)
        at = self.body, self.friction, self._slope, self._orientation, angles, rates, delta, float(v[-1])
        found = _State(v.copy(), delta, rates, points_on_slope(*at, near))
        if found.points.held:
            self._known = found
        self.solves += 1
        return found

    def values(self, v: np.ndarray, delta: float) -> dict[str, float]:
        """Way ahead, work of the joints, rotation and way across of a period, and length if asked for; NaN where friction does
        not hold the body, or its joints brake."""
        s, weight = self._moved(v, delta), self._orientation.weight
        moved = weight @ s.points.travelled()
        way, work = moved * np.exp(-1j * self._slope.ahead), weight @ s.points.power + self._slope.grade * moved.real
        numbers = np.array([way.real, work, weight @ s.points.z[2], way.imag])
        found = dict(zip(_NAMES, (numbers if s.points.held and work > 0 else np.full(4, np.nan)).tolist(), strict=True))
        return found | {name: float(weight @ np.linalg.norm(s.rates, axis=0)) for name in self._besides}

    def gradients(self, v: np.ndarray, delta: float) -> dict[str, np.ndarray]:
        s, w = self._moved(v, delta), self._orientation.weight
        p, none, ahead = s.points, np.zeros_like(w), np.exp(1j * self._slope.ahead)
        # what a velocity in the plane adds to each value: the real part of its product with the conjugate of these
        sides = np.array([ahead, self._slope.grade, 0.0, 1j * ahead])
        along = w * np.exp(1j * p.theta) * np.conj(sides)[:, None]
        on_omega, on_power = (np.stack([w if name == own else none for name in _NAMES]) for own in ("rotation", "work"))
        on_out = np.stack([on_omega, along.real, -along.imag, on_power], axis=1)
        on_theta = -(along * (p.centre[0] + 1j * p.centre[1])).imag + np.einsum("krt,rt->kt", on_out, p.on_theta)
        on_theta_0, on_rates = self._orientation.pulled_back(p.on_theta[0], on_theta)
        on_out[:, 0] += on_rates
        on_shape = np.einsum("krt,rjt->ktj", on_out, p.on_shape)
        for _ in self._besides:
            size = np.maximum(np.linalg.norm(s.rates, axis=0), 1e-300)
            own = np.concatenate([np.zeros_like(s.rates), w * s.rates / size]).T
            on_shape, on_theta_0 = np.concatenate([on_shape, own[None]]), np.append(on_theta_0, 0.0)
        slopes = self.shapes.pulled_back(v, on_shape, np.zeros(on_shape.shape[:2]))
        slopes[:, -1] += on_theta_0
        return dict(zip((*_NAMES, *self._besides), slopes, strict=True))


class SlopeSpace(HarmonicSpace):
    """Members of a class of harmonics on a slope; a gait that does not say where it points is pointed to where it would go,
    on the level, in the direction that counts."""

    def parameters(self, gait: AnyGait) -> np.ndarray:
        v = super().parameters(gait)
        if np.isnan(v[-1]):
            problem, v[-1] = self.problem, 0.0
            level = ReducedMotion(problem.body, problem.friction, problem.gait.motion_symmetry, self.mesh, self)
            v[-1] = (problem.towards or 0.0) - np.angle(level.at(v, problem.delta_start).displacement)
        return v

    laid = parameters
