"""Where do infinitesimal gaits beat large ones? The best small gait of three equal links over shape
space.

At a shape q a small gait spends times w_i in directions r_i of the joint rates, with sum w_i r_i =
0 (the path closes) and sum w_i omega_i = 0 (so does the rotation). Dry friction is homogeneous of
degree 1 but not linear, so such a gait moves in first order of its size: d/W = sum w_i e.v_i / sum
w_i P_i, a linear program (`bounds.motions`, docs/bound.md section 4).

`PROBLEM` gives a search with three harmonics the best of them as its guess: the triangle about (c,
-c), whose efficiency tends to 2/5 as it shrinks. The best of its starts is another gait, a large
loop of efficiency 0.394: with three harmonics a small triangle is too blunt to win.
"""

import numpy as np

from colloc import Fourier, Friction, Harmonic, Problem

SIZE = 0.6
_CORNERS = np.array([[2.2 + SIZE, 2.2, 2.2], [-2.2, -2.2, -2.2 - SIZE]])


def _triangle(harmonics: int) -> Fourier:
    """Fourier series of the triangle at constant pace on each side."""
    part = np.arange(64) / 64
    sides = np.roll(_CORNERS, -1, axis=1) - _CORNERS
    angles = (_CORNERS[:, :, None] + sides[:, :, None] * part).reshape(2, -1)
    wave = np.fft.rfft(angles, axis=1)[:, : harmonics + 1] * 2 / angles.shape[1]
    return Fourier(0.5 * wave[:, 0].real, wave[:, 1:].real, -wave[:, 1:].imag)


PROBLEM = Problem(
    name="small_gaits",
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=3, symmetry="bilateral"),
    guess=_triangle(3),
    delta=1e-3,
)
