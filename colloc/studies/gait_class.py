"""Classification of gaits by symmetry and by the wave of bending, as in the paper's figure 1:
*retrograde* against the motion, *direct* along it, *standing* where joints bend in phase."""

from __future__ import annotations

from typing import Any

import numpy as np

from colloc.dynamics.collocated import CollocatedPose
from colloc.gaits.harmonic import Fourier
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.results.comparison import phase_distance, reversed_in_time, swap_ends
from colloc.smooth.smooth_body import SmoothBody

_SAME, _STANDING = 0.02, 0.05  # relative distance of a symmetric gait to its image; standing |wave|
_INSTANTS, _FINE, _DELTA = 200, 2000, 1e-3


def winding(gait: Fourier) -> int:
    """Turns of the path (angle 1, angle 2) about its mean, counter-clockwise."""
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
    mesh = Mesh(scheme("gauss-1"), np.linspace(0.0, 1.0, _INSTANTS + 1))
    angles, rates = gait(mesh.times)
    z = body.solve(friction, angles, rates, _DELTA, tolerance=1e-8).z
    centre = body.sliding(friction, angles, rates, z, np.full((1, _INSTANTS), _DELTA)).centre
    pose = CollocatedPose.on_mesh(mesh, z[2], centre)
    head_x, head_y = (points[-1] for points in body.outline(angles))
    displacement = pose.place[-1]
    axis = np.mean(np.exp(1j * pose.stage_theta[:, 0]) * (head_x + 1j * head_y))
    size = abs(displacement) * abs(axis)
    return float((displacement * np.conj(axis)).real / size) if size > 0 else 0.0


def class_name(
    bilateral: bool, antipodal: bool, retraced: bool, wave: float, forward: float
) -> str:
    """The kind of wave and the symmetries in words, as "retrograde, both"."""
    moving = not retraced and abs(wave * forward) >= _STANDING
    kind = ("direct" if wave * forward > 0 else "retrograde") if moving else "standing"
    symmetries = ["bilateral"] * bilateral + ["antipodal"] * antipodal
    symmetry = "both" if len(symmetries) > 1 else "".join(symmetries) or "none"
    return f"{kind}{' (retraced)' * retraced}, {symmetry}"


def gait_class(gait: Fourier, body: Body, friction: Law) -> dict[str, Any]:
    """Columns of a study about a gait of a body with at least two joints or modes: symmetries
    (`colloc.gaits.gait`), whether it goes back the way it came, `winding`, `wave_direction`,
    `forward_share` and `class_name`."""
    amplitude = float(np.sqrt(0.5 * np.sum(gait.cos**2 + gait.sin**2)))
    close = _SAME * max(amplitude, 1e-12)
    image = reversed_in_time(swap_ends(gait, body)) if body.reversal is not None else None
    even = np.concatenate([gait.mean, gait.cos[:, 1::2].ravel(), gait.sin[:, 1::2].ravel()])
    # how far the body bends at places from tail to head, (n_place, n_joint)
    smooth = isinstance(body, SmoothBody)
    bending = np.diff(body.bounded_angles.rows, axis=0) if smooth else np.eye(body.n_joint)
    kind: dict[str, Any] = {
        "bilateral": image is not None and phase_distance(gait, image) < close,
        "antipodal": bool(np.linalg.norm(even) < close),
        "retraced": phase_distance(gait, reversed_in_time(gait)) < close,
        "wave": wave_direction(gait.transform(bending)),
        "forward": forward_share(gait, body, friction),
    }
    turns = 0 if kind["retraced"] else winding(gait)
    return kind | {"winding": turns, "gait_class": class_name(**kind)}
