r"""Efficiency and net rotation of a collocated gait as functions of the gait alone, with exact first and second derivatives.

Every equation of a transcription fixes one dependent variable: the balance fixes the tail velocity z, its rotation rate
the orientation theta, both the distance x and the work W. Eliminating them leaves

    v = (gait parameters, first orientation),      minimise  f(v) = -x(v)/W(v)   subject to   rotation(v) = 0, checks(v)

a program of a handful of variables on which every iterate satisfies all equations of the collocation. Derivatives are
those of the points' local functions, pulled back along d(locals)/dv; the second ones need one adjoint sweep for theta.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import splu

from colloc.collocation.layout import RADIANS
from colloc.collocation.newton_balance import balanced_near
from colloc.collocation.transcription import Transcription
from colloc.mechanics.fixed_point import solve_balance

_TOLERANCE = 1e-12
_ADVANCE, _POWER = 3, 4


@dataclass(eq=False)
class _State:
    """Everything at one v and delta: locals of the points, their outputs, and what is summed from them."""

    v: np.ndarray
    delta: float
    local: np.ndarray
    velocity: np.ndarray
    distance: float
    work: float
    rotation: float
    jacobian: np.ndarray | None = None
    slopes: np.ndarray | None = None


class Condensed:
    """A transcription of harmonic gaits with all its equations eliminated.

    Parameters
    ----------
    transcription : Transcription
        With the velocity map as its balance.

    Attributes
    ----------
    n : int
        Number of variables v: gait parameters, and the first orientation unless a symmetry fixes it.
    """

    def __init__(self, transcription: Transcription) -> None:
        self.transcription = transcription
        problem, mesh = transcription.problem, transcription.mesh
        self._body, self._friction = problem.body, problem.friction
        self._function = transcription.assembly.blocks[0].function
        n_joint = self._body.n_joint
        self._n_parameter = transcription.layout.parameters.shape[0]
        self._centred = problem.gait.symmetry == "antipodal"
        self.n = self._n_parameter + (0 if self._centred else 1)
        angles = problem.gait.angle_matrix(mesh.times, n_joint)
        rates = problem.gait.rate_matrix(mesh.times, n_joint) / RADIANS
        self._shape = np.concatenate([angles, rates], axis=1)
        """``(n_point, 2 n_joint, n_parameter)``: joint angles and rates per parameter."""
        state, self._rate = mesh.integration()
        self._sum = splu(state[:, 1:].tocsc())
        self._site = np.empty(mesh.n_point, dtype=int)
        self._site[mesh.points] = mesh.sites
        self._n_site = mesh.n_site
        self._weight = RADIANS * np.asarray(mesh.quadrature()[1].sum(axis=0)).ravel()
        n = mesh.n_point
        self._value = self._function.value.map(n)
        self._jacobian = self._function.jacobian.map(n)
        self._hessian = self._function.hessian.map(n)
        self._last: _State | None = None
        self._anchor: _State | None = None
        self._start: np.ndarray | None = None
        self.solves = 0

    def variables(self, x: np.ndarray) -> np.ndarray:
        """v of a vector x of all variables of the transcription, whose velocities become the next solve's start."""
        layout = self.transcription.layout
        own = x[layout.parameters[:, 0]]
        self._anchor = None
        self._start = x[layout.z]
        return own if self._centred else np.append(own, x[layout.theta[0, 0]])

    def _orientation(self, omega: np.ndarray) -> np.ndarray:
        """theta at the sites ``(n_site, ...)`` from its rate at the points ``(n_point, ...)``, with the first one 0."""
        inner = self._sum.solve(RADIANS * (self._rate @ omega))
        return np.concatenate([np.zeros_like(inner[:1]), inner])

    def _orientation_adjoint(self, weight: np.ndarray) -> np.ndarray:
        """Derivative with respect to omega at the points of ``weight . theta``, weights at the sites."""
        return RADIANS * (self._rate.T @ self._sum.solve(weight[1:], "T"))

    def at(self, v: np.ndarray, delta: float) -> _State:
        """The collocated motion of a gait; delta per radian of phase. NaN where the balance cannot be solved."""
        last = self._last
        if last is not None and last.delta == delta and np.array_equal(last.v, v):
            return last
        p = v[: self._n_parameter]
        y = self._shape @ p
        n_joint = self._body.n_joint
        angles, rates = y[:, :n_joint].T, y[:, n_joint:].T
        start = self._start
        if self._anchor is not None and self._anchor.slopes is not None:
            near = self._anchor
            start = near.velocity + (near.slopes @ (p - near.v[: self._n_parameter])).T
        z = self._balanced(angles, rates, delta, start)
        theta = self._orientation(z[2])
        rotation = float(theta[-1])
        theta = theta - 0.5 * theta[-1] if self._centred else theta + v[-1]
        local = np.concatenate([theta[None, self._site], angles, rates, z])
        out = self._value(local, z, np.full((1, z.shape[1]), delta)).full()
        work, distance = float(self._weight @ out[_POWER]), float(self._weight @ out[_ADVANCE])
        self._last = _State(v.copy(), delta, local, z, distance, work, rotation)
        return self._last

    def _balanced(self, angles: np.ndarray, rates: np.ndarray, delta: float, start: np.ndarray | None) -> np.ndarray:
        """Tail velocities in balance, NaN where there are none."""
        self.solves += 1
        z, converged = balanced_near(self._body, self._friction, angles, rates, delta, start, _TOLERANCE)
        return np.where(converged, z, np.nan)

    def _differentiated(self, v: np.ndarray, delta: float) -> tuple[_State, np.ndarray, np.ndarray]:
        """The state, with d(locals)/dv ``(n_point, n_local, n)`` and the outputs' derivatives ``(n_point, 5, n_local)``."""
        s = self.at(v, delta)
        f, n_point = self._function, s.velocity.shape[1]
        if s.jacobian is None:
            nonzeros = self._jacobian(s.local, s.velocity, np.full((1, n_point), delta)).full()
            s.jacobian = np.zeros((n_point, f.n_out, f.n_local))
            s.jacobian[:, f.jac_row, f.jac_col] = nonzeros.T
            n_y = self._shape.shape[1]
            s.slopes = -s.jacobian[:, :3, 1 : 1 + n_y] @ self._shape
            self._anchor = s
        assert s.slopes is not None
        frame = np.zeros((n_point, f.n_local, self.n))
        n_p = self._n_parameter
        theta = self._orientation(s.slopes[:, 2])
        frame[:, 0, :n_p] = theta[self._site]
        if self._centred:
            frame[:, 0] -= 0.5 * theta[-1]
        else:
            frame[:, 0, -1] = 1.0
        frame[:, 1:, :n_p] = np.concatenate([self._shape, s.slopes], axis=1)
        return s, frame, s.jacobian

    def values(self, v: np.ndarray, delta: float) -> tuple[float, float]:
        """-x/W and the net rotation over the part of the period that is solved."""
        s = self.at(v, delta)
        return -s.distance / s.work, s.rotation

    def gradients(self, v: np.ndarray, delta: float) -> np.ndarray:
        """Derivatives of `values`, ``(2, n)``."""
        s, frame, jacobian = self._differentiated(v, delta)
        distance, work = self._slopes(frame, jacobian)
        result = np.zeros((2, self.n))
        result[0] = (s.distance / s.work * work - distance) / s.work
        result[1, : self._n_parameter] = self._orientation(s.slopes[:, 2])[-1]  # type: ignore[index]
        return result

    def _slopes(self, frame: np.ndarray, jacobian: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        distance, work = (np.einsum("i,ia,iav->v", self._weight, jacobian[:, k], frame) for k in (_ADVANCE, _POWER))
        return distance, work

    def hessian(self, v: np.ndarray, delta: float, on_objective: float, on_rotation: float) -> np.ndarray:
        """Second derivatives of ``on_objective (-x/W) + on_rotation rotation``, ``(n, n)``."""
        s, frame, jacobian = self._differentiated(v, delta)
        advance = -on_objective / s.work * self._weight
        power = on_objective * s.distance / s.work**2 * self._weight
        # the Lagrangian's derivative with respect to each point's z: directly, and through all later theta
        n_z = self._function.n_local - 3
        on_z = advance[:, None] * jacobian[:, _ADVANCE, n_z:]
        on_theta = np.bincount(self._site, weights=advance * jacobian[:, _ADVANCE, 0], minlength=self._n_site)
        on_theta[-1] += on_rotation - (0.5 * on_theta.sum() if self._centred else 0.0)
        on_z[:, 2] += self._orientation_adjoint(on_theta)
        weights = np.vstack([-on_z.T, advance, power])
        f = self._function
        nonzeros = self._hessian(s.local, s.velocity, np.full((1, self._weight.size), delta), weights).full().T
        local = np.zeros((self._weight.size, f.n_local, f.n_local))
        local[:, f.hess_row, f.hess_col] = local[:, f.hess_col, f.hess_row] = nonzeros
        result = np.einsum("iav,iaw->vw", frame, local @ frame)
        distance, work = self._slopes(frame, jacobian)
        cross = np.outer(distance, work)
        result += on_objective / s.work**2 * (cross + cross.T - 2 * s.distance / s.work * np.outer(work, work))
        return result

    def lifted(self, v: np.ndarray, delta: float) -> np.ndarray:
        """All variables of the transcription at v: a point that satisfies every equation but net rotation.

        Its velocities are the damped solver's, which at very small delta are more accurate than Newton steps on the tail's.
        """
        s, layout, n_joint = self.at(v, delta), self.transcription.layout, self._body.n_joint
        angles, rates = s.local[1 : 1 + n_joint], s.local[1 + n_joint : -3]
        z = solve_balance(self._body, self._friction, angles, rates, delta, start=s.velocity, tolerance=_TOLERANCE).z
        theta = self._orientation(z[2])
        theta = theta - 0.5 * theta[-1] if self._centred else theta + v[-1]
        local = np.concatenate([theta[None, self._site], angles, rates, z])
        out = self._value(local, z, np.full((1, z.shape[1]), delta)).full()
        quadrature = RADIANS * self.transcription.mesh.quadrature()[1]
        x = np.zeros(layout.n)
        x[layout.parameters[:, 0]] = v[: self._n_parameter]
        x[layout.theta[0]] = theta
        x[layout.angles], x[layout.rates], x[layout.z] = angles, rates, z
        x[layout.distance[0, 1:]] = np.cumsum(quadrature @ out[_ADVANCE])
        x[layout.work[0, 1:]] = np.cumsum(quadrature @ out[_POWER])
        return x
