"""Gaits that are linear in their parameters, on a mesh, with their path constraints."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from colloc.dynamics.control_problem import ControlProblem
from colloc.dynamics.kinds import kind_of_motion
from colloc.gaits.gait_fields import AnyClass, AnyGait
from colloc.gaits.limits import widest
from colloc.mechanics.contact import Pairs
from colloc.numerics.sqp import keep_last
from colloc.reduced.constraints import Constraints, Function
from colloc.reduced.pointed import with_heading
from colloc.transcription.shape_constraints import (
    Placed,
    following_instants,
    moving,
    near_peaks,
    shape_checks,
)


class LinearSpace:
    """A `SearchSpace` of a linear class on a mesh (by default the first one), with pairs of links
    `far` kept from crossing."""

    def __init__(
        self,
        control: ControlProblem,
        edges: np.ndarray | None = None,
        scheme: str = "",
        far: Pairs = (),
    ) -> None:
        self.control, self.edges, self.scheme, self.far = control, edges, scheme, far
        self.mesh, self._admissible = control.mesh(edges, scheme), control.admissible
        gait, body, limit, speeds, _ = control.admissible
        self.checks = shape_checks(body, far, speeds, control.dynamics.joint_map)
        n_joint = body.n_joint
        self._offset = gait.offset(n_joint)
        angles = gait.angle_matrix(self.mesh.times, n_joint)
        rates = gait.rates_on(self.mesh, n_joint)
        self._matrix = np.concatenate([angles, rates], axis=1)
        self.n = self._matrix.shape[2]
        self._pace = np.ones(self.mesh.n_point)
        self._speed = (_MeanSpeed if gait.relative_delta else _RootMeanSquareSpeed)(gait, n_joint)
        self.lower, self.upper = gait.bounds(body, widest(limit))
        self.own = np.arange(self.n)
        self._peaks = keep_last(
            lambda v: near_peaks(self.trajectory(v), self.mesh, self.checks, limit)
        )

    def member(self, v: np.ndarray) -> AnyGait:
        return self._admissible.member(v)

    def trajectory(self, v: np.ndarray) -> AnyGait:
        """The gait in the time of the mesh."""
        return self._admissible.gait.trajectory(v, self._admissible.n_joint)

    def parameters(self, gait: AnyGait) -> np.ndarray:
        v = self._admissible.gait.parameters(self._admissible.gait.through(gait))
        return with_heading(self.control, self.mesh, self, v)

    def full_parameters(self, v: np.ndarray) -> np.ndarray:
        return v

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles, rates and the pace; where delta is relative to the shape speed, the pace is that
        speed and rates are those at unit speed."""
        shapes, n_joint = (self._matrix @ v).T, self._matrix.shape[1] // 2
        angles, rates = shapes[:n_joint] + self._offset, shapes[n_joint:]
        if not self._admissible.gait.relative_delta:
            return angles, rates, self._pace
        speed = np.linalg.norm(rates, axis=0)
        return angles, rates / speed, speed

    def at_times(self, v: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angles, rates = self.trajectory(v)(t)
        relative = self._admissible.gait.relative_delta
        return angles, rates / np.linalg.norm(rates, axis=0) if relative else rates

    def _acceleration_matrix(self, t: np.ndarray) -> np.ndarray:
        return self._admissible.gait.angle_matrix(t, self._admissible.n_joint, 2)

    def accelerations(self, v: np.ndarray, t: np.ndarray) -> np.ndarray:
        return (self._acceleration_matrix(t) @ v).T

    def accelerations_vjp(self, v: np.ndarray, on_points: np.ndarray) -> np.ndarray:
        return np.einsum("kjt,tjp->kp", on_points, self._acceleration_matrix(self.mesh.times))

    def vjp(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        if self._admissible.gait.relative_delta:
            _, unit, speed = self.at(v)
            on_angles, on_rates = np.split(on_shape, 2, axis=2)
            along = np.einsum("kpj,jp->kp", on_rates, unit)
            across = on_rates - along[..., None] * unit.T
            on_rates = across / speed[:, None] + on_pace[..., None] * unit.T
            on_shape = np.concatenate([on_angles, on_rates], axis=2)
        return np.asarray(
            on_shape.reshape(len(on_shape), -1) @ self._matrix.reshape(-1, self._matrix.shape[2])
        )

    def constraints(self, v: np.ndarray, later: float = 0.0) -> Constraints:
        """Shape constraints at their worst instants in cells where they might bind, then the square
        of the shape speed."""
        gait = self.trajectory(v)
        gaits, limit = self._admissible.gait, self._admissible.joint_limit
        placed = list[tuple[Placed, np.ndarray]]()
        kinds, low, high, excess = dict[str, np.ndarray](), [], [], -np.inf
        for check, (cells, times) in zip(self.checks, self._peaks(v), strict=True):
            kinds[check.name] = cells
            if not cells.size:
                continue
            times = times + later * self.mesh.h[cells]
            each = Placed.at(check, cells, times, gaits, gait)
            values = check.along(check.of(gait, times))
            placed.append((each, moving(each, values, limit, self.mesh)))
            excess = max(excess, float(check.excess(values, limit).max()))
            (lower, upper) = check.nearer_bounds(values, limit)
            low.append(lower)
            high.append(upper)
        kinds["shape speed"] = np.zeros(1, dtype=int)
        lower = np.concatenate([*low, [self._admissible.smallest_shape_speed**2]])
        upper = np.concatenate([*high, [np.inf]])
        at_worst = keep_last(partial(self._at_worst, placed))

        def moving_on() -> Constraints:
            return Constraints(kinds, lower, upper, excess, *self._rows(at_worst))

        at_once = self._rows(lambda v: [each for each, _ in placed])
        return Constraints(kinds, lower, upper, excess, *at_once, moving_on)

    def _rows(self, placed: Callable[[np.ndarray], list[Placed]]) -> tuple[Function, Function]:
        speed = self._speed
        return (
            lambda v: np.concatenate([*(each.value(v) for each in placed(v)), [speed.square(v)]]),
            lambda v: np.vstack([*(each.slope(v) for each in placed(v)), speed.slope(v)]),
        )

    def _at_worst(self, placed: list[tuple[Placed, np.ndarray]], v: np.ndarray) -> list[Placed]:
        """Constraints at the worst instants of v in the cells where they were placed."""
        gait, found = self.trajectory(v), []
        gaits, limit = self._admissible.gait, self._admissible.joint_limit
        for each, which in placed:
            if which.size:
                worst = following_instants(each, which, gait, self.mesh, limit)
                matrix = each.matrix.copy()
                matrix[which] = each.check.matrix(gaits, worst, self._admissible.n_joint)
                each = each._replace(matrix=matrix)
            found.append(each)
        return found


class _RootMeanSquareSpeed:
    """Square of the root-mean-square shape speed [rad per radian of phase]."""

    def __init__(self, gait: AnyClass, n_joint: int) -> None:
        self._form = gait.mean_square_rate(n_joint) / (2 * np.pi) ** 2

    def square(self, v: np.ndarray) -> float:
        return float(v @ self._form @ v)

    def slope(self, v: np.ndarray) -> np.ndarray:
        return 2 * self._form @ v


class _MeanSpeed:
    """Square of the mean shape speed: the length of the path over 2 pi."""

    def __init__(self, gait: AnyClass, n_joint: int) -> None:
        self._shares, rates = gait.side_rates(n_joint)
        self._rates = rates / (2 * np.pi)

    def square(self, v: np.ndarray) -> float:
        return float(self._shares @ np.linalg.norm(self._rates @ v, axis=1)) ** 2

    def slope(self, v: np.ndarray) -> np.ndarray:
        rates = self._rates @ v
        speeds = np.linalg.norm(rates, axis=1)
        unit = rates / speeds[:, None]
        return (
            2 * (self._shares @ speeds) * np.einsum("k,kj,kjp->p", self._shares, unit, self._rates)
        )


class SerpenoidSpace(LinearSpace):
    """The space of the class `colloc.gaits.serpenoid.Serpenoid`, by the chain rule through the
    Fourier coefficients."""

    def __init__(
        self,
        control: ControlProblem,
        edges: np.ndarray | None = None,
        scheme: str = "",
        far: Pairs = (),
    ) -> None:
        super().__init__(control, edges, scheme, far)
        self._n_own = n_own = control.admissible.gait.n_own
        n_static = len(kind_of_motion(control.dynamics).static_parameters)  # which come last
        self.own = np.concatenate([self.own[:n_own], self.own[self.own.size - n_static :]])
        self.n = n_own + n_static
        self.lower, self.upper = self.lower[self.own], self.upper[self.own]

    def full_parameters(self, v: np.ndarray) -> np.ndarray:
        own, static = np.split(v, [self._n_own])
        return np.concatenate([self._admissible.gait.full(own, self._admissible.n_joint), static])

    def _slopes(self, v: np.ndarray) -> np.ndarray:
        """Derivatives of the full parameters, ``(n_full, n)``."""
        n_own = self._n_own
        coefficients = self._admissible.gait.coefficient_slopes(
            v[: self._n_own], self._admissible.n_joint
        )
        slopes = np.eye(self.n + len(coefficients), self.n)
        slopes[n_own:, n_own:] = np.eye(
            self.n + len(coefficients) - n_own, self.n - n_own, -len(coefficients)
        )
        slopes[n_own : n_own + len(coefficients), :n_own] = coefficients
        return slopes

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return super().at(self.full_parameters(v))

    def vjp(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        return super().vjp(self.full_parameters(v), on_shape, on_pace) @ self._slopes(v)

    def accelerations(self, v: np.ndarray, t: np.ndarray) -> np.ndarray:
        return super().accelerations(self.full_parameters(v), t)

    def accelerations_vjp(self, v: np.ndarray, on_points: np.ndarray) -> np.ndarray:
        return super().accelerations_vjp(v, on_points) @ self._slopes(v)

    def constraints(self, v: np.ndarray, later: float = 0.0) -> Constraints:
        return super().constraints(v, later).through(self.full_parameters, self._slopes)
