r"""The program of a search on a slope: a gait's parameters and its heading; way and work of the joints, with exact gradients.

On a mesh the orientation at the points obeys ``theta = theta_0 + H omega(theta, v)``: H integrates from the start, and omega is
that of the balance under the weight's pull, which depends on theta (`colloc.verification.gait_on_slope`). Newton's method
solves for all points at once; with Omega the diagonal matrix of d omega/d theta it steps with ``I - H Omega``. So a number Phi
changes by

    d Phi = Phi_v dv + mu^T (d theta_0 + H omega_v dv),      (I - H Omega)^T mu = Phi_theta.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.gaits.symmetry import BILATERAL
from colloc.mechanics.chain_motion import chain_slopes
from colloc.mechanics.fixed_point import solve_balance
from colloc.reduced.harmonic_space import HarmonicSpace
from colloc.verification.slope import checked_chain

_TOLERANCE, _ACCEPTED = 1e-12, 1e-9
_CLOSED, _STEPS = 1e-12, 30
_OUTPUTS, _LOAD = slice(2, 6), slice(-2, None)
_ANY_HEADING = 1e2
_WORK, _TURN, _ACROSS = 1, 2, 3
"""Places in `SlopeProgram.values`."""


@dataclass(eq=False)
class _State:
    """The collocated motion of one point u at one delta: rotation rate, velocity of the centre in body axes ``(2, n)``, power
    of friction, and how they change with shapes, rates and load ``(4, k, n)``, and with theta ``(4, n)``."""

    u: np.ndarray
    delta: float
    theta: np.ndarray
    z: np.ndarray
    omega: np.ndarray
    centre: np.ndarray
    power: np.ndarray
    slopes: np.ndarray
    on_theta: np.ndarray


class SlopeProgram:
    """Maximise climb over work of the joints; the last variable is theta at phase 0, from straight uphill.

    Rows: the turn of a period, unless the class is one that keeps every heading; the way across a direction, if one is asked
    for, along which the way then counts instead of the climb; the space's.

    Parameters
    ----------
    space : HarmonicSpace
        Of a chain, on a mesh of the whole period.
    grade : float
    delta : float
    towards : float, optional
        Direction of the way, from straight uphill [rad].
    """

    def __init__(self, space: HarmonicSpace, grade: float, delta: float, towards: float | None = None) -> None:
        self.space, self.grade, self.delta, self.towards = space, grade, delta, towards
        self._body = checked_chain(space.problem.body, space.problem.friction, grade)
        mesh, rule = space.mesh, space.mesh.scheme
        self._weight = (mesh.h[:, None] * rule.b).ravel()
        self._integral = np.tril(np.ones((mesh.n, mesh.n)), -1).repeat(rule.s, 0).repeat(rule.s, 1) * self._weight
        for k in range(mesh.n):
            own = slice(k * rule.s, (k + 1) * rule.s)
            self._integral[own, own] = mesh.h[k] * rule.A
        self._held = np.array(
            [_TURN] * (space.problem.gait.symmetry != BILATERAL) + [_ACROSS] * (towards is not None), dtype=int
        )
        self.lower, self.upper = np.append(space.lower, -_ANY_HEADING), np.append(space.upper, _ANY_HEADING)
        self._last: _State | None = None

    @property
    def row_lower(self) -> np.ndarray:
        """Lower bounds of the rows; they change as the checks move."""
        return np.concatenate([np.zeros(self._held.size), self.space.row_lower])

    @property
    def row_upper(self) -> np.ndarray:
        """Upper bounds of the rows."""
        return np.concatenate([np.zeros(self._held.size), self.space.row_upper])

    def place_rows(self, u: np.ndarray) -> float:
        """Place the shape checks where the gait is worst; how far it exceeds any bound [rad]."""
        return self.space.move_checks(u[:-1])

    def _at(self, u: np.ndarray) -> _State:
        last = self._last
        if last is not None and last.delta == self.delta and np.array_equal(last.u, u):
            return last
        angles, rates, _ = self.space.at(u[:-1])
        theta = np.full(angles.shape[1], u[-1]) if last is None else last.theta + u[-1] - last.u[-1]
        z = np.zeros((3, theta.size)) if last is None else last.z
        at = self._body, self.space.problem.friction, angles, rates, self.delta
        for _ in range(_STEPS):
            pull = -self.grade * np.exp(-1j * theta)
            load, turned = np.stack([pull.real, pull.imag]), -1j * pull
            solved = solve_balance(*at, load=load, start=z, tolerance=_TOLERANCE)
            held = bool((solved.residual < _ACCEPTED).all())
            now, slopes = chain_slopes(*at, solved, load)
            z, slopes = solved.z, slopes[_OUTPUTS]
            on_theta = (slopes[:, _LOAD] * np.stack([turned.real, turned.imag])).sum(axis=1)
            left_over = theta - u[-1] - self._integral @ now.z[2]
            done = held and bool(np.abs(left_over).max() < _CLOSED)
            if done or not held:
                break
            theta = theta - np.linalg.solve(self._left(on_theta), left_over)
        omega = now.z[2] if done else np.full_like(theta, np.nan)
        found = _State(u.copy(), self.delta, theta, z, omega, now.centre, now.power, slopes, on_theta)
        if done:
            self._last = found
        return found

    def _left(self, on_theta: np.ndarray) -> np.ndarray:
        return np.eye(on_theta.shape[1]) - self._integral * on_theta[0]

    def values(self, u: np.ndarray) -> np.ndarray:
        """Way, work of the joints, turn and way across of a period, ``(4,)``; NaN where friction does not hold the body."""
        s = self._at(u)
        moved = self._weight @ (np.exp(1j * s.theta) * (s.centre[0] + 1j * s.centre[1]))
        way, turn = moved * np.exp(-1j * (self.towards or 0.0)), self._weight @ s.omega
        return np.array([way.real, self._weight @ s.power + self.grade * moved.real, turn, way.imag]) + 0.0 * turn

    def gradients(self, u: np.ndarray) -> np.ndarray:
        """Derivatives of `values`, ``(4, n)``."""
        s, w = self._at(u), self._weight
        none = np.zeros_like(w)
        ahead = np.exp(1j * (self.towards or 0.0))
        # what a velocity in the plane adds to each value: the real part of its product with the conjugate of these
        sides = np.array([ahead, self.grade, 0.0, 1j * ahead])
        along = w * np.exp(1j * s.theta) * np.conj(sides)[:, None]
        on_power, on_omega = ([w if k == own else none for k in range(4)] for own in (_WORK, _TURN))
        on_out = np.stack([on_omega, along.real, -along.imag, on_power], axis=1)
        on_theta = -(along * (s.centre[0] + 1j * s.centre[1])).imag + np.einsum("krt,rt->kt", on_out, s.on_theta)
        mu = np.linalg.solve(self._left(s.on_theta).T, on_theta.T)
        on_out[:, 0] += (self._integral.T @ mu).T
        on_shape = np.einsum("krt,rjt->ktj", on_out, s.slopes[:, : _LOAD.start])
        own = self.space.pulled_back(u[:-1], on_shape, np.zeros((4, w.size)))
        return np.column_stack([own, mu.sum(axis=0)])

    def objective(self, u: np.ndarray) -> float:
        """Minus way over work; NaN where the joints brake, as on the way down."""
        way, work, *_ = self.values(u)
        return float(-way / work) if work > 0 else np.nan

    def gradient(self, u: np.ndarray) -> np.ndarray:
        """Of the objective, ``(n,)``."""
        (way, work, *_), (on_way, on_work, *_) = self.values(u), self.gradients(u)
        return -(on_way - way / work * on_work) / work

    def rows(self, u: np.ndarray) -> np.ndarray:
        """Values of the rows."""
        return np.concatenate([self.values(u)[self._held], self.space.rows(u[:-1])])

    def row_slopes(self, u: np.ndarray) -> np.ndarray:
        """Derivatives of the rows, ``(n_row, n)``."""
        own = self.space.row_slopes(u[:-1])
        own = np.column_stack([own, np.zeros(len(own))])
        return np.vstack([self.gradients(u)[self._held], own])
