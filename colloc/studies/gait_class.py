"""Classification of gaits by symmetry and by the wave of bending, as in the paper's figure 1:
*retrograde* against the motion, *direct* along it, *standing* where joints bend in phase."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.dynamics.collocated import CollocatedPose
from colloc.gaits.harmonic import Fourier
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.numerics.mesh import uniform_mesh
from colloc.numerics.schemes import scheme
from colloc.results.distinct_optima import phase_distance, reversed_in_time, swap_ends
from colloc.smooth.smooth_body import SmoothBody

RETROGRADE, DIRECT, STANDING = "retrograde", "direct", "standing"
_SAME, _STANDING = 0.02, 0.05  # relative distance of a symmetric gait to its image; standing |wave|
_INSTANTS, _FINE = 200, 2000
_DELTA = 1e-3


@dataclass(frozen=True)
class GaitClass:
    """Symmetries of a gait (`colloc.gaits.symmetry`) and its wave."""

    bilateral: bool
    antipodal: bool
    retraced: bool  # it goes back the way it came
    winding: int  # turns of the path (angle 1, angle 2) about its mean, counter-clockwise
    wave: float  # `wave_direction`
    forward: float  # displacement along the mean body axis over the distance: 1 is head first

    @property
    def symmetry(self) -> str:
        if self.bilateral and self.antipodal:
            return "both"
        return "bilateral" if self.bilateral else "antipodal" if self.antipodal else "none"

    @property
    def kind(self) -> str:
        if self.retraced or abs(self.wave * self.forward) < _STANDING:
            return STANDING
        return DIRECT if self.wave * self.forward > 0 else RETROGRADE

    @property
    def label(self) -> str:
        return f"{self.kind}{' (retraced)' if self.retraced else ''}, {self.symmetry}"


def winding(gait: Fourier) -> int:
    """Turns of the first two joint angles about their mean."""
    angles = gait.angles(np.linspace(0.0, 1.0, _FINE + 1)) - gait.mean[:, None]
    turns = np.unwrap(np.arctan2(angles[1], angles[0]))
    return round((turns[-1] - turns[0]) / (2 * np.pi))


def wave_direction(gait: Fourier) -> float:
    """``2 sum_jk k Im(conj(a_jk) a_(j+1)k) / sum_jk k (|a_jk|^2 + |a_(j+1)k|^2)`` of the complex
    amplitudes of joints j and harmonics k: 1 for a wave to the head, -1 to the tail."""
    a = gait.cos + 1j * gait.sin
    k = np.arange(1, gait.n_harmonic + 1)
    travel = 2 * np.sum(k * (np.conj(a[:-1]) * a[1:]).imag)
    size = np.sum(k * (np.abs(a[:-1]) ** 2 + np.abs(a[1:]) ** 2))
    return float(travel / size) if size > 0 else 0.0


def forward_share(gait: Fourier, body: Body, friction: Law) -> float:
    """Cosine between mean velocity and mean body axis: 1 is head first."""
    mesh = uniform_mesh(scheme("gauss-1"), _INSTANTS, 1.0)
    angles, rates = gait(mesh.times)
    z = body.solve(friction, angles, rates, _DELTA, tolerance=1e-8).z
    centre = body.sliding(friction, angles, rates, z, np.full((1, _INSTANTS), _DELTA)).centre
    pose = CollocatedPose.on_mesh(mesh, z[2], centre)
    head_x, head_y = (points[-1] for points in body.outline(angles))
    displacement = pose.place[-1]
    axis = np.mean(np.exp(1j * pose.stage_theta[:, 0]) * (head_x + 1j * head_y))
    size = abs(displacement) * abs(axis)
    return float((displacement * np.conj(axis)).real / size) if size > 0 else 0.0


def _bending(body: Body) -> np.ndarray:
    """How far the body bends at places from tail to head, ``(n_place, n_joint)``."""
    if isinstance(body, SmoothBody):
        return np.diff(body.bounded_angles.rows, axis=0)
    return np.eye(body.n_joint)


def gait_class(gait: Fourier, body: Body, friction: Law) -> GaitClass:
    """Classify a gait of a body with at least two joints or modes."""
    amplitude = float(np.sqrt(0.5 * np.sum(gait.cos**2 + gait.sin**2)))
    close = _SAME * max(amplitude, 1e-12)
    image = reversed_in_time(swap_ends(gait, body)) if body.reversal is not None else None
    even = np.concatenate([gait.mean, gait.cos[:, 1::2].ravel(), gait.sin[:, 1::2].ravel()])
    retraced = phase_distance(gait, reversed_in_time(gait)) < close
    return GaitClass(
        image is not None and phase_distance(gait, image) < close,
        bool(np.linalg.norm(even) < close),
        retraced,
        0 if retraced else winding(gait),
        wave_direction(gait.mapped(_bending(body))),
        forward_share(gait, body, friction),
    )
