"""A problem of a smooth body with a few bending modes: what `colloc.gaits.problem` is for chains of links."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.mechanics.friction import Friction
from colloc.numerics.schemes import scheme
from colloc.smooth.modal_body import ModalBody
from colloc.system.errors import ProblemError

_PHASES, _PLACES = 400, 101


@dataclass(frozen=True)
class ModalProblem:
    """Maximise d/W of a smooth body over harmonic gaits of its modes.

    Parameters
    ----------
    name : str
    guess : Fourier
        Amplitudes of the modes; projected onto the class `gait`.
    body : ModalBody
    friction : Friction
    gait : Harmonic
        Symmetry "none" or "antipodal" (the second half period is the mirror image of the first).
    delta : float
        Regularisation speed at which the problem is finally solved, in body lengths per period. A smooth body has a
        point at rest at nearly every instant: the panels have to resolve ``delta / (rotation rate)``.
    delta_start : float
        Where the continuation in delta begins.
    largest_angle : float
        Largest |Theta| [rad], below pi/2: the body advances along its mean direction and cannot cross itself.
    smallest_shape_speed : float
        Lower bound on the root-mean-square rate of the amplitudes [rad per radian of phase].
    intervals : int
        Mesh intervals on the part of the period that is solved.
    scheme : str
    """

    name: str
    guess: Fourier
    body: ModalBody = ModalBody()
    friction: Friction = Friction()
    gait: Harmonic = Harmonic(1, "antipodal")
    delta: float = 1e-2
    delta_start: float = 0.3
    largest_angle: float = 1.5
    smallest_shape_speed: float = 0.3
    intervals: int = 16
    scheme: str = "gauss-3"

    def __post_init__(self) -> None:
        for field in ("delta", "delta_start", "largest_angle", "smallest_shape_speed"):
            value = getattr(self, field)
            if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not 0 < value < np.inf:
                raise ProblemError(f"{field} must be a positive finite number, not {value!r}.")
        if self.delta_start < self.delta:
            raise ProblemError(f"delta_start ({self.delta_start:g}) must not lie below delta ({self.delta:g}).")
        if self.largest_angle >= 0.5 * np.pi:
            raise ProblemError(f"largest_angle must lie below pi/2, not {self.largest_angle:g}: the body might cross itself.")
        if self.gait.symmetry == "bilateral":
            raise ProblemError("gaits of a smooth body have the symmetry 'none' or 'antipodal'.")
        collocation = scheme(self.scheme)
        fewest = max(2, -(-4 * self.gait.harmonics // (collocation.s - collocation.left)))
        if not isinstance(self.intervals, (int, np.integer)) or self.intervals < fewest:
            raise ProblemError(f"the mesh is too small: use at least {fewest} intervals, not {self.intervals!r}.")
        if self.guess.n_joint != self.body.modes:
            raise ProblemError(f"guess has amplitudes of {self.guess.n_joint} modes but the body has {self.body.modes}.")
        reached = self.steepest(self.member(self.gait.parameters(self.guess)))
        if reached > self.largest_angle + 1e-9:
            raise ProblemError(
                f"guess is inadmissible: its tangent angle reaches {reached:.4g} rad, beyond {self.largest_angle:.4g}; "
                "make its amplitude smaller."
            )

    def member(self, parameters: np.ndarray) -> Fourier:
        """The gait of a parameter vector."""
        return self.gait.fourier(parameters, self.body.modes)

    def steepest(self, gait: Fourier) -> float:
        """Largest |Theta| of a gait over the body and the period [rad]."""
        modes = self.body.modes_at(np.linspace(0.0, 1.0, _PLACES))
        return float(np.abs(modes @ gait.angles(np.arange(_PHASES) / _PHASES)).max())

    def with_(self, **changes: object) -> ModalProblem:
        """A copy with some fields changed, validated anew."""
        return dataclasses.replace(self, **changes)  # type: ignore[arg-type]
