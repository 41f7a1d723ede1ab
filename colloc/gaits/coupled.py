"""Gaits of a chain some of whose joints hang on one motor or are stuck: a class of gaits m of the
motors, and a linear map to the joints, q = G m + q0."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from colloc.gaits.gait import BILATERAL, NONE
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.linear import LinearClass
from colloc.mechanics.densities import JointMap
from colloc.system.arguments import finite_array, is_number, is_whole, named_arguments
from colloc.system.errors import ProblemError


@named_arguments
@dataclass(frozen=True)
class Coupled(LinearClass):
    """The gaits of a chain some of whose joints hang on one motor, or are stuck.

    Parameters
    ----------
    gait : Harmonic, BSpline or Basis
        The class of gaits of the motors.
    gears : sequence of sequence of float, optional
        For each joint from the tail, how far each motor turns it; 0 where it does not. By default
        every joint that is not stuck has a motor of its own.
    stuck : mapping from int to float, optional
        Joints that do not move, counted from 0 at the tail, and the angles at which they are [rad].
        They hang on no motor.

    Raises
    ------
    ProblemError
        If a joint neither hangs on a motor nor is stuck, or two motors do the same.

    Examples
    --------
    Five links on two motors, and four links whose middle joint is broken:

    >>> from colloc import Coupled, Harmonic
    >>> belts = Coupled(Harmonic(1), gears=((1, 0), (0.5, 0), (0, 0.5), (0, 1)))
    >>> broken = Coupled(Harmonic(1), stuck={1: 0.4})
    >>> belts.describe()
    '1 harmonic, symmetry none, on 2 motors'
    >>> broken.joint_map(n_joint=3).n_motor
    2
    """

    gait: LinearClass = Harmonic()
    gears: tuple[tuple[float, ...], ...] = ()
    stuck: tuple[tuple[int, float], ...] = ()

    def __post_init__(self) -> None:
        kind, stuck, gears = self.gait, self.stuck, self.gears
        if not isinstance(kind, LinearClass) or isinstance(kind, Coupled) or not kind.linear:
            raise ProblemError(
                "Coupled takes the class of gaits of the motors, linear in its parameters: "
                "Problem(body=Chain(...), gait=Coupled(Harmonic(1), stuck={1: 0.4})), not a "
                f"{type(kind).__name__}."
            )
        try:
            pairs: Any = stuck.items() if isinstance(stuck, Mapping) else stuck
            pairs = sorted((joint, angle) for joint, angle in pairs)
            fits = all(is_whole(j, 0) and is_number(a) and abs(a) < np.pi for j, a in pairs)
        except (TypeError, ValueError):
            fits = False
        if not fits or len({joint for joint, _ in pairs}) < len(pairs):
            raise ProblemError(
                f"stuck gives joints and their angles, as {{1: 0.4}}: joints count from 0 at the "
                f"tail, each is named once, and its angle lies between -pi and pi [rad]; not "
                f"{stuck!r}."
            )
        object.__setattr__(self, "stuck", tuple((int(joint), float(a)) for joint, a in pairs))
        if not isinstance(gears, (tuple, list)) or gears:
            gears = tuple(map(tuple, finite_array("gears", gears, 2).tolist()))
        object.__setattr__(self, "gears", tuple(gears))

    def joint_map(self, n_joint: int) -> JointMap:
        return _joint_map(self, n_joint)

    def check_joints(self, n_joint: int) -> None:
        joints = self.joint_map(n_joint)
        gears = joints.matrix
        if self.symmetry != NONE and any(joints.rest):  # no mirror image of such a shape is one
            raise ProblemError(
                f"gaits with a joint that is stuck bent may have the symmetry none, not "
                f"{self.symmetry}."
            )
        if self.symmetry == BILATERAL and (gears != gears[::-1, ::-1]).any():
            raise ProblemError(
                "gaits of symmetry bilateral need gears that read the same from both ends; with "
                "these they may have the symmetry none or antipodal."
            )
        self.gait.check_joints(joints.n_motor)

    def with_symmetry(self, symmetry: str) -> Any:
        return replace(self, gait=self.gait.with_symmetry(symmetry))

    @property
    def symmetry(self) -> str:  # type: ignore[override]
        return self.gait.symmetry

    @property
    def harmonics(self) -> int:  # type: ignore[override]
        return self.gait.harmonics

    @property
    def instants(self) -> np.ndarray:
        return self.gait.instants

    def functions(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        return self.gait.functions(t, derivative)

    def series(self, harmonics: int) -> Any:
        return self.gait.series(harmonics)

    def describe(self) -> str:
        n_motor = len(self.gears[0]) if self.gears else 0
        motors = f", on {n_motor} motor{'s' * (n_motor > 1)}" if n_motor else ""
        stuck = "".join(f", joint {j + 1} stuck at {angle:.4g} rad" for j, angle in self.stuck)
        return f"{self.gait.describe()}{motors}{stuck}"

    def _basis(self, n_joint: int) -> np.ndarray:
        joints = self.joint_map(n_joint)
        motors = self.gait._basis(joints.n_motor)
        tables = motors.reshape(joints.n_motor, -1, motors.shape[1])
        return np.tensordot(joints.matrix, tables, 1).reshape(-1, motors.shape[1])

    def _motors(self, gait: Any) -> Any:
        joints = self.joint_map(gait.n_joint)
        if getattr(gait, "basis", None) == self:
            return self.gait.member(self.project(gait), joints.n_motor)
        return self.gait.through(gait.transform(joints.inverse))

    def motor_gait(self, gait: Any) -> Any:
        return self._motors(gait).with_coordinate("motor")

    def driven_by(self, motors: Any, n_joint: int) -> Any:
        """The member, of so many joints, that is nearest to a gait of the motors."""
        return self.member(self.gait.parameters(self.gait.through(motors)), n_joint)

    def parameters(self, gait: Any) -> np.ndarray:
        return self.gait.parameters(self._motors(gait))

    def sample_dimension(self, n_joint: int) -> int:
        return self.gait.sample_dimension(self.joint_map(n_joint).n_motor)

    def sample(self, unit: np.ndarray, n_joint: int) -> Any:
        return self.driven_by(self.gait.sample(unit, self.joint_map(n_joint).n_motor), n_joint)

    def perturb(self, gait: Any, step: float, fall: int, rng: np.random.Generator) -> Any:
        return self.driven_by(self.gait.perturb(self._motors(gait), step, fall, rng), gait.n_joint)


@lru_cache(maxsize=32)
def _joint_map(kind: Coupled, n_joint: int) -> JointMap:
    rest, broken = np.zeros(n_joint), [joint for joint, _ in kind.stuck]
    if broken and broken[-1] >= n_joint:
        raise ProblemError(
            f"stuck names joint {broken[-1]}: the chain has joints 0 to {n_joint - 1}, from the "
            f"tail."
        )
    if len(broken) == n_joint:
        raise ProblemError("all joints are stuck: nothing would move.")
    rest[broken] = [angle for _, angle in kind.stuck]
    gears = np.array(kind.gears) if kind.gears else np.delete(np.eye(n_joint), broken, axis=1)
    if len(gears) != n_joint:
        raise ProblemError(f"gears have {len(gears)} rows, and the chain has {n_joint} joints.")
    for joint, row in enumerate(gears):
        if row.any() == (joint in broken):
            hangs = "hangs on no motor: give its angle in stuck"
            what = "is stuck, and hangs on a motor" if row.any() else hangs
            raise ProblemError(f"joint {joint} (counted from 0 at the tail) {what}.")
    if np.linalg.matrix_rank(gears) < gears.shape[1]:
        raise ProblemError("two motors do the same, or one moves nothing: leave it out of gears.")
    return JointMap(tuple(map(tuple, gears.tolist())), tuple(rest.tolist()))
