"""The kind of a gait: its symmetry, and how its path runs around the plane of the first two joint
angles.

A wave of curvature travels along the body where the joints bend one after the other. With the
displacement along the body's axis that gives the classes of the paper's figure 1: *retrograde*
where the wave runs against the motion, *direct* where it runs with it, *standing* where the joints
bend together or in opposition.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.gaits.harmonic import Fourier
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.motion.collocated import CollocatedPose
from colloc.numerics.mesh import uniform_mesh
from colloc.numerics.schemes import scheme
from colloc.results.distinct_optima import phase_distance, reversed_in_time, swapped

RETROGRADE, DIRECT, STANDING = "retrograde", "direct", "standing"
_SAME, _STANDING = 0.02, 0.05
"""Relative distance of a gait to its image that counts as symmetric; |wave| below which it counts
as standing."""
_INSTANTS, _FINE = 200, 2000
_DELTA = 1e-3


@dataclass(frozen=True)
class GaitClass:
    """The kind of a gait."""

    bilateral: bool
    antipodal: bool
    """Symmetries it has (see `colloc.gaits.symmetry`), whatever class it was searched in."""
    retraced: bool
    """It goes back the way it came."""
    winding: int
    """Turns of the path (angle 1, angle 2) about its mean over a period, positive
    counter-clockwise."""
    wave: float
    """Direction in which bending travels (see `wave_direction`): 1 if every joint repeats the one
    behind it a quarter period later, which is a wave towards the head."""
    forward: float
    """Displacement per period along the mean direction of the body, tail to head, over the
    distance: 1 is head first."""

    @property
    def symmetry(self) -> str:
        """In the words of `colloc.gaits.symmetry`; "both" if it has both."""
        if self.bilateral and self.antipodal:
            return "both"
        return "bilateral" if self.bilateral else "antipodal" if self.antipodal else "none"

    @property
    def kind(self) -> str:
        """ "retrograde", "direct" or "standing"."""
        if self.retraced or abs(self.wave * self.forward) < _STANDING:
            return STANDING
        return DIRECT if self.wave * self.forward > 0 else RETROGRADE

    @property
    def label(self) -> str:
        """For tables and legends, for example "retrograde, bilateral"."""
        return f"{self.kind}{' (retraced)' if self.retraced else ''}, {self.symmetry}"


def winding(gait: Fourier) -> int:
    """Turns of the first two joint angles about their mean in a period."""
    angles = gait.angles(np.linspace(0.0, 1.0, _FINE + 1)) - gait.mean[:, None]
    turns = np.unwrap(np.arctan2(angles[1], angles[0]))
    return round((turns[-1] - turns[0]) / (2 * np.pi))


def wave_direction(gait: Fourier) -> float:
    """In [-1, 1]: how far bending travels from tail to head (positive) or from head to tail.

    With complex amplitudes a_jk of joint j and harmonic k, ``2 sum_jk k Im(conj(a_jk) a_(j+1)k)``
    over ``sum_jk k (|a_jk|^2 + |a_(j+1)k|^2)``.
    """
    a = gait.cos + 1j * gait.sin
    k = np.arange(1, gait.n_harmonic + 1)
    travel = 2 * np.sum(k * (np.conj(a[:-1]) * a[1:]).imag)
    size = np.sum(k * (np.abs(a[:-1]) ** 2 + np.abs(a[1:]) ** 2))
    return float(travel / size) if size > 0 else 0.0


def forward_share(gait: Fourier, body: Body, friction: Law) -> float:
    """Mean velocity of the centre of mass along the body's mean direction, over its mean velocity;
    1 is head first. Friction at a delta of 1e-3 is enough for a sign."""
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


def gait_class(gait: Fourier, body: Body, friction: Law) -> GaitClass:
    """The kind of a gait of a body with at least two joints or modes."""
    amplitude = float(np.sqrt(0.5 * np.sum(gait.cos**2 + gait.sin**2)))
    close = _SAME * max(amplitude, 1e-12)
    image = reversed_in_time(swapped(gait, body)) if body.symmetric else None
    even = np.concatenate([gait.mean, gait.cos[:, 1::2].ravel(), gait.sin[:, 1::2].ravel()])
    retraced = phase_distance(gait, reversed_in_time(gait)) < close
    return GaitClass(
        image is not None and phase_distance(gait, image) < close,
        bool(np.linalg.norm(even) < close),
        retraced,
        0 if retraced else winding(gait),
        wave_direction(gait.mapped(body.bending)),
        forward_share(gait, body, friction),
    )
