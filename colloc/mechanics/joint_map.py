"""Joints that share motors, or are stuck: ``q = gears @ m + rest``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from colloc.numerics.arrays import Array, namespace


@dataclass(frozen=True)
class JointMap:
    """Angles of joints from those of motors.

    gears: turn of each joint per motor, ``(n_joint, n_motor)``. rest: joint angles with all motors
    at 0, ``(n_joint,)``; no motor turns a joint that is not at 0 there.
    """

    gears: tuple[tuple[float, ...], ...]
    rest: tuple[float, ...]

    @cached_property
    def matrix(self) -> np.ndarray:
        return np.array(self.gears)

    @cached_property
    def inverse(self) -> np.ndarray:
        """Nearest motor angles to joint angles, ``(n_motor, n_joint)``."""
        return np.linalg.pinv(self.matrix)

    @cached_property
    def offset(self) -> np.ndarray:
        return np.array(self.rest)[:, None]

    @property
    def n_motor(self) -> int:
        return len(self.gears[0])

    def joint_angles(self, motors: Array) -> Array:
        return self.joint_rates(motors) + self.offset

    def joint_rates(self, motors: Array) -> Array:
        return namespace(motors).matmul(self.matrix, motors)

    def motor_angles(self, joints: Array) -> Array:
        return self.motor_rates(joints - self.offset)

    def motor_rates(self, joints: Array) -> Array:
        return namespace(joints).matmul(self.inverse, joints)

    def motor_moments(self, joints: Array) -> Array:
        """Moments of the motors: each does the work of all joints that hang on it."""
        return namespace(joints).matmul(self.matrix.T, joints)
