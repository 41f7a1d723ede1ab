"""A chain with fewer motors than joints, as a `colloc.mechanics.bodies.Body`: joint angles = gears
@ motor angles + stuck ones.

Its mechanics is that of the chain, asked at the joint angles; derivatives come back through the
gears.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from colloc.mechanics.balance_results import BalanceSolution
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import Contact
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.system.arguments import is_number, is_whole, named_arguments
from colloc.system.errors import ProblemError

JointPath = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Angles and rates ``(n, n_time)`` at phases."""


def _of_chain(name: str) -> Any:
    """What the chain answers, whatever its shape."""
    return property(lambda self: getattr(self.chain, name))


def _at_shapes(name: str) -> Callable[..., Any]:
    """What the chain answers at the joint angles."""
    return lambda self, angles, *more: getattr(self.chain, name)(self.joint_angles(angles), *more)


def _in_motion(name: str) -> Callable[..., Any]:
    """What the chain answers at the joint angles and their rates."""
    return lambda self, angles, rates, *more: getattr(self.chain, name)(
        self.joint_angles(angles), self.joint_rates(rates), *more
    )


def _under_friction(name: str) -> Callable[..., Any]:
    """What the chain answers under a law of friction at the joint angles and their rates."""
    return lambda self, friction, angles, rates, *more, **settings: getattr(self.chain, name)(
        friction, self.joint_angles(angles), self.joint_rates(rates), *more, **settings
    )


@named_arguments
@dataclass(frozen=True)
class Coupled(Body):
    """A chain some of whose joints hang on one motor, or are stuck; its shape coordinates are the
    angles of the motors.

    Parameters
    ----------
    chain : Chain
    gears : sequence of sequence of float, optional
        For each joint from the tail, how far each motor turns it; 0 where it does not. By default
        every joint that is not stuck has a motor of its own.
    stuck : mapping from int to float, optional
        Joints that do not move, counted from 0 at the tail, and the angles at which they are [rad].
        They hang on no motor.

    Raises
    ------
    ProblemError
        If a joint neither hangs on a motor nor is stuck, two motors do the same, or links cross at
        the stuck angles.

    Examples
    --------
    Five links on two motors, and four links whose middle joint is broken:

    >>> from colloc import Chain, Coupled
    >>> belts = Coupled(Chain((0.2,) * 5), gears=((1, 0), (0.5, 0), (0, 0.5), (0, 1)))
    >>> broken = Coupled(Chain((0.25,) * 4), stuck={1: 0.4})
    >>> belts.n_joint, broken.n_joint
    (2, 2)
    """

    chain: Chain
    gears: tuple[tuple[float, ...], ...] = ()
    stuck: tuple[tuple[int, float], ...] = field(default=())

    coordinate = "motor"
    looks_for_all_velocities = True

    def __post_init__(self) -> None:
        if type(self.chain) is not Chain:
            raise ProblemError(
                f"Coupled is for the joints of a Chain, not of a {type(self.chain).__name__}."
            )
        count = self.chain.n_joint
        object.__setattr__(self, "stuck", _checked_stuck(self.stuck, count))
        broken = {joint for joint, _ in self.stuck}
        own_motors = self.gears == () if isinstance(self.gears, tuple) else False
        gears = np.delete(np.eye(count), sorted(broken), axis=1) if own_motors else self.gears
        object.__setattr__(self, "gears", _checked_gears(gears, count))
        for joint, row in enumerate(self.gears):
            if any(row) == (joint in broken):
                what = (
                    "is stuck, and hangs on a motor"
                    if any(row)
                    else "hangs on no motor: give its angle in stuck"
                )
                raise ProblemError(f"joint {joint} (counted from 0 at the tail) {what}.")
        if np.linalg.matrix_rank(self._gears) < self.n_joint:
            raise ProblemError(
                "two motors do the same, or one moves nothing: leave it out of gears."
            )
        if self.chain.crossing_depth(self._rest).any():
            raise ProblemError("links cross where joints are stuck.")

    force_names, law, largest_forces = map(_of_chain, ("force_names", "law", "largest_forces"))
    drawn_width, hinges, far_pairs = map(_of_chain, ("drawn_width", "hinges", "far_pairs"))

    sliding, with_forces, forces, solve = map(
        _under_friction, ("sliding", "with_forces", "forces", "solve")
    )
    motion, replayed, all_velocities = map(
        _under_friction, ("motion", "replayed", "all_velocities")
    )
    slowness, rubbing = map(_under_friction, ("slowness", "rubbing"))
    speeds, seen_from_head = map(_in_motion, ("speeds", "seen_from_head"))
    crossing_depth, passing_depth = map(_at_shapes, ("crossing_depth", "passing_depth"))
    outline, centre, footprints, imbalance = map(
        _at_shapes, ("outline", "centre", "footprints", "imbalance")
    )

    @property
    def _gears(self) -> np.ndarray:
        """``(n_joint of the chain, n_motor)``."""
        return np.array(self.gears)

    @property
    def _rest(self) -> np.ndarray:
        """Joint angles with all motors at 0, ``(n_joint of the chain, 1)``."""
        rest = np.zeros((self.chain.n_joint, 1))
        for joint, angle in self.stuck:
            rest[joint] = angle
        return rest

    @property
    def n_joint(self) -> int:
        return len(self.gears[0])

    def joint_angles(self, angles: Array) -> Array:
        """Those of the chain, ``(n_joint of the chain, n_time)``, from the motors'."""
        return namespace(angles).matmul(self._gears, angles) + self._rest

    def joint_rates(self, rates: Array) -> Array:
        """Those of the chain from the motors'."""
        return namespace(rates).matmul(self._gears, rates)

    def joint_path(self, path: Callable[..., Any]) -> JointPath:
        """The angles and rates of the chain's joints at phases, from those of the motors."""

        def joints(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            angles, rates = path(t)
            return self.joint_angles(angles), self.joint_rates(rates)

        return joints

    @property
    def symmetric(self) -> bool:
        same = bool((self._gears == self._gears[::-1, ::-1]).all())
        return self.chain.symmetric and same and not self._rest.any()

    @property
    def symmetries(self) -> tuple[str, ...]:
        if self._rest.any():  # no mirror image of such a shape is one
            return ("none",)
        return super().symmetries

    def describe(self) -> str:
        broken = "".join(
            f", joint {joint + 1} stuck at {angle:.4g} rad" for joint, angle in self.stuck
        )
        many = f"{self.n_joint} motor{'s' * (self.n_joint > 1)}"
        return f"{self.chain.describe()}, on {many}{broken}"

    def slopes(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        solved: BalanceSolution,
    ) -> np.ndarray:
        slopes = self.chain.slopes(
            friction, self.joint_angles(angles), self.joint_rates(rates), delta, solved
        )
        return np.einsum("ijt,jk->ikt", slopes, np.kron(np.eye(2), self._gears))

    @property
    def _moved(self) -> np.ndarray:
        """Which joints are."""
        return np.asarray(self._gears.any(axis=1))

    @property
    def limited(self) -> np.ndarray:
        return self._gears[self._moved]

    @property
    def limit_names(self) -> tuple[str, ...]:
        return tuple(
            name for name, moves in zip(self.chain.limit_names, self._moved, strict=True) if moves
        )

    def contacts(self, far: Sequence[tuple[int, int]] = ()) -> list[Contact]:
        return [contact.after(self.joint_angles) for contact in self.chain.contacts(far)]

    def wave(self, waves: float) -> tuple[np.ndarray, np.ndarray]:
        back = np.linalg.pinv(self._gears)
        cos, sin = self.chain.wave(waves)
        return back @ cos, back @ sin

    @property
    def bending(self) -> np.ndarray:
        return self._gears

    def laid(self, lengths: np.ndarray) -> np.ndarray:
        return np.linalg.pinv(self._gears) @ self.chain.laid(lengths)


def _checked_stuck(
    stuck: Mapping[int, float] | Sequence[Sequence[float]], count: int
) -> tuple[tuple[int, float], ...]:
    try:
        found = [
            (joint, angle)
            for joint, angle in (stuck.items() if isinstance(stuck, Mapping) else stuck)
        ]
    except (TypeError, ValueError):
        raise ProblemError(
            f"stuck gives joints and their angles, as {{1: 0.4}}, not {stuck!r}."
        ) from None
    for joint, angle in found:
        if not is_whole(joint, 0, count - 1):
            raise ProblemError(
                f"stuck names joint {joint!r}: the chain has joints 0 to {count - 1}, from "
                f"the tail."
            )
        if not (is_number(angle) and abs(angle) < np.pi):
            raise ProblemError(
                f"joint {joint} is stuck at {angle!r}: give an angle between -pi and pi [rad]."
            )
    if len({joint for joint, _ in found}) < len(found):
        raise ProblemError("stuck names a joint twice.")
    if len(found) == count:
        raise ProblemError("all joints are stuck: nothing would move.")
    return tuple(sorted((int(joint), float(angle)) for joint, angle in found))


def _checked_gears(gears: Any, count: int) -> tuple[tuple[float, ...], ...]:
    try:
        table = np.array(gears, dtype=float)
    except (TypeError, ValueError, OverflowError):
        table = np.empty(0)
    if table.ndim != 2 or not table.shape[1] or not np.isfinite(table).all():
        raise ProblemError("gears must be a row of numbers for each joint, one for each motor.")
    if len(table) != count:
        raise ProblemError(f"gears have {len(table)} rows, and the chain has {count} joints.")
    return tuple(tuple(row) for row in table.tolist())
