"""Joints of a chain that hang on fewer motors, or are stuck: ``q = gears @ m + rest``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from colloc.numerics.arrays import Array, namespace


@dataclass(frozen=True)
class JointMap:
    """From the angles of motors to those of joints.

    Parameters
    ----------
    gears : (n_joint, n_motor)
        How far each motor turns each joint.
    rest : (n_joint,)
        Joint angles with all motors at 0; no motor turns a joint that is not at 0 there.
    """

    gears: tuple[tuple[float, ...], ...]
    rest: tuple[float, ...]

    @cached_property
    def matrix(self) -> np.ndarray:
        return np.array(self.gears)

    @cached_property
    def inverse(self) -> np.ndarray:
        """``(n_motor, n_joint)``: the motor angles that come nearest to joint angles."""
        return np.linalg.pinv(self.matrix)

    @cached_property
    def offset(self) -> np.ndarray:
        """`rest` as a column."""
        return np.array(self.rest)[:, None]

    @property
    def n_motor(self) -> int:
        return len(self.gears[0])

    def joint_angles(self, motors: Array) -> Array:
        return namespace(motors).matmul(self.matrix, motors) + self.offset

    def joint_rates(self, motors: Array) -> Array:
        return namespace(motors).matmul(self.matrix, motors)

    def motor_angles(self, joints: Array) -> Array:
        return namespace(joints).matmul(self.inverse, joints - self.offset)

    def motor_rates(self, joints: Array) -> Array:
        return namespace(joints).matmul(self.inverse, joints)

    def motor_moments(self, joints: Array) -> Array:
        """Moments of the motors, each of which does the work of all joints that hang on it."""
        return namespace(joints).matmul(self.matrix.T, joints)
