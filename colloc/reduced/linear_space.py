"""Gaits that are linear in their parameters, on a mesh, with their path constraints."""

from functools import cached_property
from typing import Any

import numpy as np

from colloc.dynamics.control_problem import ControlProblem
from colloc.dynamics.dynamics import QuasiStatic
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.regime import LEVEL
from colloc.mechanics.contact import Pairs
from colloc.numerics.sqp import keep_last
from colloc.reduced.motion import ReducedMotion
from colloc.reduced.program import Constraints, SearchSpace
from colloc.transcription.shape_constraints import CheckTimes, near_peaks, shape_checks

_TURNS = 0.25 * np.pi * np.array([0, 1, -1, 2, -2, 3, -3])
"""Turns [rad] of the initial heading tried where the body slides down."""


class LinearSpace(SearchSpace):
    """The space of a class on a mesh (by default the first one), with pairs of links `far` kept
    from crossing."""

    def __init__(
        self,
        control: ControlProblem,
        edges: np.ndarray | None = None,
        scheme: str = "",
        far: Pairs = (),
    ) -> None:
        super().__init__(control, edges, scheme, far)
        self._gaits, self._limit = control.admissible.gait, control.admissible.joint_limit
        self._relative, n_joint = self._gaits.relative_delta, control.admissible.n_joint
        speeds, joint_map = control.admissible.largest_speeds, control.dynamics.joint_map
        self.checks = shape_checks(control.dynamics.body, far, speeds, joint_map)
        self._offset = self._gaits.offset(n_joint)
        angles = self._gaits.angle_matrix(self.mesh.times, n_joint)
        self._matrix = np.concatenate([angles, self._gaits.rates_on(self.mesh, n_joint)], axis=1)
        self._pace = np.ones(self.mesh.n_point)
        if self._relative:
            self._sides, rates = self._gaits.side_rates(n_joint)
            self._side_rates = rates / (2 * np.pi)
        else:
            self._square = self._gaits.mean_square_rate(n_joint) / (2 * np.pi) ** 2
        self._n_static = len(control.admissible.static)
        lower, upper = control.admissible.bounds()
        self.indices = np.arange(lower.size)
        if not self._gaits.linear:
            series = slice(self._gaits.n_wave, lower.size - self._n_static)
            self.indices = np.delete(self.indices, series)
        self.lower, self.upper = lower[self.indices], upper[self.indices]
        self._at_worst = keep_last(self._constraints)

    def shape(self, v: np.ndarray) -> np.ndarray:
        """Parameters of the class, of serpenoid gaits with their Fourier coefficients."""
        p = v[: self.n - self._n_static]
        return p if self._gaits.linear else self._gaits.full(p, self._matrix.shape[1] // 2)

    def shape_vjp(self, v: np.ndarray, on_shape: np.ndarray) -> np.ndarray:
        """Derivatives ``(k, n)`` along v from those along `shape`."""
        p = v[: self.n - self._n_static]
        if not self._gaits.linear:
            slopes = self._gaits.coefficient_slopes(p, self._matrix.shape[1] // 2)
            on_shape = on_shape @ np.vstack([np.eye(p.size), slopes])
        none = np.zeros((len(on_shape), self._n_static))
        return np.concatenate([on_shape, none], axis=1) if self._n_static else on_shape

    def _table(self, v: np.ndarray) -> np.ndarray:
        return self._gaits.table(self.shape(v), len(self._offset))

    def full_parameters(self, v: np.ndarray) -> np.ndarray:
        return np.append(self.shape(v), v[self.n - self._n_static :])

    def trajectory(self, v: np.ndarray) -> AnyGait:
        return self._gaits.trajectory(self.shape(v), self.control.admissible.n_joint)

    def parameters(self, gait: AnyGait) -> np.ndarray:
        """Parameters of the member nearest to a gait; if it states no heading, with the one that
        travels as asked on the level, or the nearest at which the body does not slide down."""
        v = self.control.admissible.parameters(gait)
        if not np.isnan(v[-1:]).any():
            return v
        dynamics, delta, v[-1] = self.control.dynamics, self.control.delta_start, 0.0
        flat = QuasiStatic(dynamics.body, dynamics.law, LEVEL, dynamics.symmetry, dynamics.turn)
        level, here = (ReducedMotion(each, self.mesh, self) for each in (flat, dynamics))
        v[-1] = dynamics.regime.ahead - np.angle(level.at(v, delta).pose.place[-1])
        beside = (np.append(v[:-1], v[-1] + turn) for turn in _TURNS)
        return next((each for each in beside if np.isfinite(here.values(each, delta)["work"])), v)

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles, rates and the pace; where delta is relative to the shape speed, the pace is that
        speed and rates are those at unit speed."""
        shapes, n_joint = (self._matrix @ self.shape(v)).T, self._matrix.shape[1] // 2
        angles, rates = shapes[:n_joint] + self._offset, shapes[n_joint:]
        if not self._relative:
            return angles, rates, self._pace
        speed = np.linalg.norm(rates, axis=0)
        return angles, rates / speed, speed

    def at_times(self, v: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angles, rates = self.trajectory(v)(t)
        return angles, rates / np.linalg.norm(rates, axis=0) if self._relative else rates

    def accelerations_vjp(self, v: np.ndarray, on_points: np.ndarray) -> np.ndarray:
        matrix = self._second_derivatives(self.mesh.times)
        return self.shape_vjp(v, np.einsum("kjt,tjp->kp", on_points, matrix))

    def vjp(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        if self._relative:
            _, unit, speed = self.at(v)
            on_angles, on_rates = np.split(on_shape, 2, axis=2)
            along = np.einsum("kpj,jp->kp", on_rates, unit)
            across = on_rates - along[..., None] * unit.T
            on_rates = across / speed[:, None] + on_pace[..., None] * unit.T
            on_shape = np.concatenate([on_angles, on_rates], axis=2)
        matrix = self._matrix.reshape(-1, self._matrix.shape[2])
        return self.shape_vjp(v, on_shape.reshape(len(on_shape), -1) @ matrix)

    def constraints(self, v: np.ndarray, later: float = 0.0, reach: float = 0.0) -> Constraints:
        """Shape constraints at their worst instants in cells where they might bind, or would by
        changes of `reach`, then the square of the shape speed."""
        return self._constraints(v, later, reach) if later or reach else self._at_worst(v)

    def _constraints(self, v: np.ndarray, later: float = 0.0, reach: float = 0.0) -> Constraints:
        gaits, checks, mesh, table = self._gaits, self.checks, self.mesh, self._table(v)
        which, cells, times = near_peaks(gaits, table, mesh, checks, self._limit, reach)
        times = times + later * mesh.h[cells]
        shapes = checks.shapes(gaits, table, which, times)
        checks_at = CheckTimes(checks, which, cells, times, checks.shares(which, shapes))
        values = checks.values(which, shapes)
        lower, upper = (each[which] for each in checks.bounds(self._limit))
        above, below = values - upper, lower - values
        excess, is_below = np.maximum(above, below), below > above
        lower, upper = np.where(is_below, lower, -np.inf), np.where(is_below, np.inf, upper)
        lower = np.append(lower, self.control.admissible.smallest_shape_speed**2)
        kinds = checks_at.cells_of | {"shape speed": np.zeros(1, dtype=int)}
        moving = checks_at.moving(excess, mesh)
        rest = self._offset * (which < checks.n_shape)
        functions = checks.functions(gaits, which, times)

        @keep_last
        def at_worst(v):
            there = functions.copy()
            worst = checks_at.follow(moving, gaits, self._table(v), mesh, self._limit)
            there[:, moving] = checks.functions(gaits, which[moving], worst)
            return there

        def rows(functions_at):
            def shapes(v):
                return self._table(v) @ functions_at(v) + rest

            def values(v):
                values = checks.values(which, shapes(v), checks_at.shares)
                return np.append(values, self._square_of_speed(v)[0])

            def slopes(v):
                on_shapes = checks.slopes(which, shapes(v), checks_at.shares)
                slopes = gaits.pull_back(on_shapes, functions_at(v))
                return self.shape_vjp(v, np.vstack([slopes, self._square_of_speed(v)[1]]))

            most = float(excess.max(initial=-np.inf))
            return Constraints(kinds, lower, np.append(upper, np.inf), most, values, slopes)

        def kernel_rows(moving):
            if not gaits.linear or self._n_static or (moving.size and type(gaits) is not Harmonic):
                return None
            low, high = (each[which[moving]] for each in checks.bounds(self._limit))
            at = {"which": which, "shares": checks_at.shares, "functions": functions.T}
            counts = {"n_shape_row": which.size, "n_moving": moving.size, "moving": moving}
            follow = {"left": mesh.edges[cells[moving]], "width": mesh.h[cells[moving]]}
            follow |= {"instants": times[moving], "watched_low": low, "watched_high": high}
            return self._kernel_fields | at | counts | follow

        fixed = rows(lambda v: functions)._replace(kernel_rows=kernel_rows(moving[:0]))
        return fixed._replace(
            following=lambda: rows(at_worst)._replace(kernel_rows=kernel_rows(moving))
        )

    @cached_property
    def _kernel_fields(self) -> dict[str, Any]:
        tables = np.array([self._table(unit).ravel() for unit in np.eye(self.n)]).T
        function, parameter = np.nonzero(tables)
        numbers, first = self.checks.kernel_numbers
        speed = {"n_side": self._sides.size if self._relative else 0}
        if self._relative:
            speed |= {"side": self._sides, "side_rates": self._side_rates}
        else:
            speed["square"] = self._square
        return speed | {
            "matrix": self._matrix,
            "offset": self._offset,
            "basis": tables[function, parameter],
            "basis_first": np.searchsorted(function, np.arange(len(tables) + 1)),
            "basis_column": parameter,
            "n_function": len(tables) // len(self._offset),
            "n_shape": self.checks.n_shape,
            "shape_numbers": numbers,
            "shape_first": first,
        }

    def _square_of_speed(self, v: np.ndarray) -> tuple[float, np.ndarray]:
        """Square of the root-mean-square shape speed [rad per radian of phase], or of the mean one
        where delta is relative to it, and its derivatives."""
        p = self.shape(v)
        if not self._relative:
            return float(p @ self._square @ p), 2 * self._square @ p
        rates = self._side_rates @ p
        speeds = np.linalg.norm(rates, axis=1)
        mean, unit = float(self._sides @ speeds), rates / speeds[:, None]
        slope = np.einsum("k,kj,kjp->p", self._sides, unit, self._side_rates)
        return mean**2, 2 * mean * slope
