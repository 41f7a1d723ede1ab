r"""Orientation and place of a body along the intervals of a collocation scheme, with derivatives.

The scheme (A, b) integrates ``theta' = omega`` and ``x' = e^(i theta) c``, where omega is the
rotation rate and c the velocity of the centre of mass in the axes of the body, from their values at
the stages i of the intervals k of length h:

    theta_ki = theta_0 + sum_(l<k) h_l b.omega_l + h_k (A omega_k)_i,      x = sum_ki h_k b_i e^(i theta_ki) c_ki.

A bilateral gait repeats its displacement and travels along it. The second half of an antipodal gait
mirrors the first; together they travel along the bisector of the orientations at its ends.
"""  # noqa: E501

from __future__ import annotations

import numpy as np

from colloc.gaits.gait import ANTIPODAL, BILATERAL, NONE
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import Scheme


def stage_weights(mesh: Mesh) -> np.ndarray:
    """Quadrature weights ``(n, s)`` of the stages."""
    return mesh.h[:, None] * mesh.scheme.b


def point_weights(mesh: Mesh) -> np.ndarray:
    """Quadrature weights ``(n_point,)`` of the points; neighbours may share a point."""
    return np.bincount(mesh.points.ravel(), stage_weights(mesh).ravel())


def sums(increments: np.ndarray, start: float | complex = 0.0) -> np.ndarray:
    """Values at the edges, ``(n + 1,)``, from increments over the intervals."""
    return np.asarray(start + np.append(0.0, np.cumsum(increments)))


class CollocatedPose:
    """Pose along intervals of lengths h ``(n,)``, from rotation rates `omega` and complex
    velocities `centre` in body axes at the stages, ``(n, s)``."""

    rotations: np.ndarray
    """Rotation over each interval [rad], ``(n,)``."""
    theta: np.ndarray
    """Orientation at the edges, ``(n + 1,)``."""
    stage_theta: np.ndarray
    velocity: np.ndarray
    """Velocity in the plane at the stages, complex, ``(n, s)``."""
    place: np.ndarray
    """Centre of mass in the plane at the edges, complex, from 0, ``(n + 1,)``."""

    def __init__(
        self,
        scheme: Scheme,
        h: np.ndarray,
        omega: np.ndarray,
        centre: np.ndarray,
        theta_0: float = 0.0,
    ) -> None:
        self._scheme, self._h, self._omega, self._centre = scheme, h, omega, centre
        self._weight = h[:, None] * scheme.b
        # searches make one for every gait they try
        self._turned = h[:, None] * (omega @ scheme.A.T)
        self.rotations = (self._weight * omega).sum(axis=1)
        self.theta = sums(self.rotations, theta_0)
        self.stage_theta = self.theta[:-1, None] + self._turned
        self._turn = np.exp(1j * self.stage_theta)
        self.velocity = self._turn * centre
        self.place = sums((self._weight * self.velocity).sum(axis=1))

    @classmethod
    def on_mesh(
        cls, mesh: Mesh, omega: np.ndarray, centre: np.ndarray, theta_0: float = 0.0
    ) -> CollocatedPose:
        """Pose along a mesh, from rates ``(n_point,)`` at its points; `centre` has two rows."""
        c = centre[0] + 1j * centre[1]
        return cls(mesh.scheme, mesh.h, omega[mesh.points], c[mesh.points], theta_0)

    def theta_on(self, mesh: Mesh) -> np.ndarray:
        theta = np.empty(mesh.n_point)
        theta[mesh.points] = self.stage_theta
        return theta

    @property
    def displacements(self) -> np.ndarray:
        """Displacement over each interval in the body axes at its begin, complex, ``(n,)``."""
        return (self._weight * np.exp(1j * self._turned) * self._centre).sum(axis=1)

    def at(self, k: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Orientation and place at fractions tau of intervals k, ``(n_time,)``, by the scheme's
        polynomials."""
        weights = self._h[k][:, None] * self._scheme.integrals(tau)
        turned = (weights * self._omega[k]).sum(axis=1)
        moved = (weights * self.velocity[k]).sum(axis=1)
        return self.theta[k] + turned, self.place[k] + moved

    def on_pose(self, sides: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of displacements along directions `sides` ``(m,)`` (complex, size counts):
        along the orientation at the stages, ``(m, n, s)``, and the velocity in body axes, ``(m, 2,
        n, s)``."""
        on_theta = np.zeros((sides.size, *self._weight.shape))
        on_centre = np.zeros((sides.size, 2, *self._weight.shape))
        for row in np.flatnonzero(sides):
            back = self._weight * np.conj(sides[row])
            along = np.conj(self._turn * back)
            on_theta[row], on_centre[row] = -(back * self.velocity).imag, (along.real, along.imag)
        return on_theta, on_centre

    def on_rates(self, on_theta: np.ndarray) -> np.ndarray:
        """Derivatives along the rotation rate, from those along the orientation, ``(m, n, s)``."""
        # the rotation over an interval turns all that come later
        after = np.cumsum(on_theta.sum(axis=2)[:, ::-1], axis=1)[:, ::-1]
        later = np.concatenate([after[:, 1:], np.zeros((len(after), 1))], axis=1)
        return self._h[:, None] * (on_theta @ self._scheme.A + self._scheme.b * later[:, :, None])


def heading(symmetry: str, displacement: complex, rotation: float) -> float:
    """Direction of travel from the initial orientation [rad]."""
    if symmetry != ANTIPODAL:
        return float(np.angle(displacement))
    # it may travel either way along its axis
    along = (displacement * np.exp(-0.5j * rotation)).real >= 0
    return float(0.5 * rotation if along else 0.5 * rotation - np.pi)


def closing_sign(symmetry: str) -> float | None:
    """Sign s with which theta_end + s theta_0 = 0 (or whole turns) closes a period; None: nothing
    to close."""
    return {NONE: -1.0, ANTIPODAL: 1.0, BILATERAL: None}[symmetry]


def whole_turns(first: float, last: float) -> float:
    """Whole turns [rad] that the orientations at the ends of an antipodal half period add up to."""
    return float(2 * np.pi * np.round((first + last) / (2 * np.pi)))


def momenta_image(symmetry: str) -> np.ndarray | None:
    """Map ``(3, 3)`` of the momenta (Vx, Vy, H) in tail axes from the begin of the solved part to
    its end; None for the identity."""
    return {NONE: None, ANTIPODAL: np.diag([1.0, -1.0, -1.0])}[symmetry]
