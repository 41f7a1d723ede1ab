"""The reduced program: gait parameters are the variables; net rotation, required values, limits of
actuators and path constraints are rows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from colloc.dynamics.control_problem import ControlProblem
from colloc.gaits.gait import NONE
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.objective import Objective
from colloc.mechanics.contact import Pairs
from colloc.mechanics.densities import PathLimits
from colloc.numerics.expression import Formula, formula
from colloc.numerics.peaks import SAMPLES, curvature_of_moving, peaks
from colloc.numerics.sqp import keep_last
from colloc.reduced.motion import ReducedMotion

_EMPTY = np.empty(0)
_INSIDE = np.linspace(1e-9, 1 - 1e-9, SAMPLES + 1)
"""Samples of an interval; rates may jump at its ends."""
_NEAR = 0.3
"""Distance from the bound, over the limit, from which a value is no row."""
_ZOOMS, _CLOSE = 1, 0.02
"""Values this close to their limit are zoomed into between the samples."""
_SHIFT, _STEP = 1e-2, 1e-5
"""Shift of a peak in its interval, and step of parameters for differences."""
_EXACT = 3e-5
"""Relative excess that counts as none, less than a certificate allows."""


class Constraints(NamedTuple):
    """``lower <= values(v) <= upper``: shape constraints at the worst instants of one gait.

    kinds: name to the full program's rows of that name that are among these, in order. excess: how
    far the gait exceeds any bound [rad, body lengths, or relative to a largest speed]. values,
    slopes: parameters ``(n,)`` to the rows ``(n_row,)`` and their derivatives ``(n_row, n)``.
    following: makes the same rows at the worst instants of whatever gait they are evaluated at.
    kernel_rows: the same for the compiled kernel (`colloc.reduced.compiled_search`), if it can.
    """

    kinds: dict[str, np.ndarray]
    lower: np.ndarray
    upper: np.ndarray
    excess: float
    values: Callable[[np.ndarray], np.ndarray]
    slopes: Callable[[np.ndarray], np.ndarray]
    following: Callable[[], Constraints] | None = None
    kernel_rows: dict[str, Any] | None = None


class SearchSpace:
    """Gaits of a class on a mesh by parameters v, with their path constraints: here one gait, the
    only member of a class or that of parameters `full`.

    indices: of v ``(n,)`` among the full program's gait parameters. far: pairs of links more
    than two apart that are kept apart.
    """

    lower = upper = _EMPTY
    indices = np.arange(0)
    motion: ReducedMotion | None = None
    """Of the last search there."""

    def __init__(
        self,
        control: ControlProblem,
        edges: np.ndarray | None = None,
        scheme: str = "",
        far: Pairs = (),
        full: np.ndarray = _EMPTY,
    ) -> None:
        self.control, self.edges, self.scheme, self.far = control, edges, scheme, far
        self.mesh, self._full = control.mesh(edges, scheme), full
        gait, n_joint = control.admissible.gait, control.admissible.n_joint
        self._second_derivatives = keep_last(lambda t: gait.angle_matrix(t, n_joint, 2))

    @property
    def n(self) -> int:
        return self.lower.size

    def member(self, v: np.ndarray) -> AnyGait:
        return self.control.admissible.member(self.full_parameters(v))

    def trajectory(self, v: np.ndarray) -> AnyGait:
        """The gait in the time of the mesh."""
        return self.member(v)

    def parameters(self, gait: AnyGait) -> np.ndarray:
        """Parameters of the member nearest to a gait."""
        return _EMPTY

    def full_parameters(self, v: np.ndarray) -> np.ndarray:
        """Gait parameters of the full program (`colloc.transcription.layout`)."""
        return self._full

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles, rates ``(n_joint, n_point)``, and the pace ``(n_point,)`` that multiplies
        velocities."""
        return *self.trajectory(v)(self.mesh.times), np.ones(self.mesh.n_point)

    def vjp(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        """Derivatives ``(k, n)`` of k numbers, from those along ``(angles, rates)``, ``(k, n_point,
        2 n_joint)``, and along the pace, ``(k, n_point)``."""
        return np.empty((len(on_shape), 0))

    def at_times(self, v: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles and rates ``(n_joint, n_time)`` at times of the mesh."""
        return tuple(self.trajectory(v)(t))

    def accelerations(self, v: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Second derivatives of the angles, ``(n_joint, n_time)``."""
        shape = self.full_parameters(v)[: self.control.admissible.n_shape]
        return (self._second_derivatives(t) @ shape).T

    def accelerations_vjp(self, v: np.ndarray, on_points: np.ndarray) -> np.ndarray:
        """Derivatives ``(k, n)`` of k numbers, from those along the accelerations at the points,
        ``(k, n_joint, n_point)``."""
        return np.empty((len(on_points), 0))

    def constraints(self, v: np.ndarray, later: float = 0.0, reach: float = 0.0) -> Constraints:
        """Path constraints at the worst instants of v, or later by a part of the mesh cell, with
        those that bind after changes of `reach`."""
        none = np.empty((0, 0))
        return Constraints({}, _EMPTY, _EMPTY, -np.inf, lambda v: _EMPTY, lambda v: none)


class ActuatorRows:
    """Shares of the actuators' limits at the points of a mesh, as functions of a gait's parameters.

    By as much as the largest value in an interval exceeds that at its points, less is allowed
    there; measured again whenever the rows are placed, this leaves no excess once the gait settles.
    lower, upper: ``(n_share, n_point)``. placed: share and point of each row, ``(2, n_row)``.
    """

    def __init__(self, motion: ReducedMotion, limits: PathLimits) -> None:
        self._motion, self._limits = motion, limits
        self.placed = np.empty((2, 0), dtype=int)
        shape = len(limits.names), motion.mesh.n_point
        self.lower, self.upper = np.tile(limits.least[:, None], shape[1]), np.ones(shape)

    def place(self, v: np.ndarray, delta: float) -> float:
        """Choose the rows for the gait v; return how far it exceeds any limit, relative."""
        points = self._motion.mesh.points
        here = self._limits.sizes(self._motion.shares(self._limits, v, delta))
        largest = self._largest(v, delta)
        between = np.maximum(largest - here[:, points].max(axis=2), 0.0)
        lowered = np.zeros_like(here)
        for stage in points.T:  # neighbours may share a point
            lowered[:, stage] = np.maximum(lowered[:, stage], between)
        # a gait may do several times what is allowed, between points alone
        self.upper = np.maximum(1.0 - lowered, 0.0)
        self.lower = np.where(np.isfinite(self.lower), -self.upper, self.lower)
        self.placed = np.stack(np.nonzero(here > self.upper - _NEAR))
        excess = float(largest.max()) - 1.0
        return excess if excess > _EXACT or np.isnan(excess) else 0.0

    def _sizes(self, v: np.ndarray, delta: float, t: np.ndarray) -> np.ndarray:
        shares = self._motion.shares(self._limits, v, delta, t.ravel())
        return self._limits.sizes(shares).reshape(-1, *t.shape)

    def _largest(self, v: np.ndarray, delta: float) -> np.ndarray:
        mesh = self._motion.mesh
        t = mesh.edges[:-1, None] + mesh.h[:, None] * _INSIDE
        sizes = self._sizes(v, delta, t)
        largest: np.ndarray = sizes.max(axis=2)
        share, interval = np.nonzero(largest > 1.0 - _CLOSE)
        if share.size:
            each = np.arange(share.size)
            worst = np.clip(sizes[share, interval].argmax(axis=1), 1, SAMPLES - 1)
            left, right = t[interval, worst - 1], t[interval, worst + 1]
            at = left, right - left, _ZOOMS
            zoomed = peaks(lambda t: self._sizes(v, delta, t)[share, each], *at)[1]
            largest[share, interval] = np.maximum(largest[share, interval], zoomed)
        return largest

    def of_moving_peaks(self, v: np.ndarray, delta: float, on_rows: np.ndarray) -> np.ndarray:
        """Part ``(n, n)`` of the Lagrangian's second derivatives that is due to peaks between the
        points which move with the gait (`colloc.reduced.second_order`)."""
        active = np.flatnonzero(on_rows)
        if active.size == 0:
            return np.zeros((v.size, v.size))
        (share, point), on_rows = self.placed[:, active], on_rows[active]
        mesh = self._motion.mesh
        interval = (mesh.points[:, :, None] == point).any(axis=1).argmax(axis=0)
        each, left, width = np.arange(active.size), mesh.edges[interval], mesh.h[interval]
        edge = _INSIDE[0] * width

        def shares(at, t):
            every = self._motion.shares(self._limits, at, delta, t.ravel())
            return every.reshape(-1, *t.shape)[share, each]

        peak, _ = peaks(lambda t: np.abs(shares(v, t)), left + edge, width - 2 * edge)
        t = peak[:, None] + _SHIFT * width[:, None] * np.array([-1.0, 0.0, 1.0])
        slopes = np.array(
            [shares(v + step, t) - shares(v - step, t) for step in _STEP * np.eye(v.size)]
        )
        slopes = slopes.transpose(2, 1, 0) / (2 * _STEP)
        return curvature_of_moving(on_rows, shares(v, t).T, slopes)

    def values(self, v: np.ndarray, delta: float) -> np.ndarray:
        return self._motion.shares(self._limits, v, delta)[tuple(self.placed)]

    def slopes(self, v: np.ndarray, delta: float) -> np.ndarray:
        """Derivatives of the rows, ``(n_row, n)``."""
        if not self.placed.size:
            return np.empty((0, v.size))
        return self._motion.share_slopes(self._limits, v, delta, self.placed)

    def multipliers(self, on_rows: np.ndarray) -> np.ndarray:
        """Multipliers of the full program's rows, from those of these."""
        rows = np.zeros(self.upper.shape)
        rows[tuple(self.placed)] = on_rows
        return rows.T.ravel()


class ReducedProgram:
    """Maximise an objective over a class of gaits on a mesh, at one delta.

    Rows: net rotation where it is prescribed and no symmetry closes it, on a slope the way across a
    prescribed direction, required values, limits of actuators, path constraints.
    """

    constraints: Constraints

    def __init__(self, space: SearchSpace, delta: float) -> None:
        self.space, self.delta = space, delta
        control, aims = space.control, space.control.aims
        self.motion = ReducedMotion(control.dynamics, space.mesh, space, aims.integrals)
        totals = {"rotation": aims.rotation} if aims.closing == NONE else {}
        totals |= {"across": 0.0} if aims.no_way_across else {}
        equal = {name: value for name, value in totals.items() if value is not None}
        self._equalities, least = [*equal], [value for _, value in aims.at_least]
        self._total_lower = np.array([*equal.values(), *least])
        self._total_upper = np.array([*equal.values(), *np.full(len(least), np.inf)])
        limits = control.actuators
        self.actuators = ActuatorRows(self.motion, limits) if limits.names else None
        self.lower, self.upper = space.lower, space.upper
        self._slopes = keep_last(lambda v: self.motion.gradients(v, delta))

    @property
    def formulas(self) -> list[Formula]:
        """The objective, and rows that depend on totals alone."""
        aims = self.space.control.aims
        rows = [formula(name, (name,)) for name in self._equalities]
        return [aims.objective.formula, *rows, *(aim.formula for aim, _ in aims.at_least)]

    def place_rows(self, v: np.ndarray, reach: float = 0.0) -> float:
        """Move all rows to the worst instants of v, with those that bind after changes of `reach`;
        return how far it exceeds any bound."""
        excess = self.move_checks(v, reach=reach)
        return excess if not self.actuators else max(excess, self.actuators.place(v, self.delta))

    @property
    def row_lower(self) -> np.ndarray:
        limits = self.actuators
        done = limits.lower[tuple(limits.placed)] if limits else _EMPTY
        return np.concatenate([self._total_lower, done, self.constraints.lower])

    @property
    def row_upper(self) -> np.ndarray:
        limits = self.actuators
        done = limits.upper[tuple(limits.placed)] if limits else _EMPTY
        return np.concatenate([self._total_upper, done, self.constraints.upper])

    @property
    def row_names(self) -> list[tuple[str, int]]:
        """Kind of each row, and index among the full program's rows of that kind."""
        names = [("period", k) for k in range(self._total_lower.size)]
        placed = self.actuators.placed.T if self.actuators else ()
        names += [(f"actuators, share {share}", int(point)) for share, point in placed]
        kinds = self.constraints.kinds.items()
        return names + [(kind, int(cell)) for kind, cells in kinds for cell in cells]

    def move_checks(self, v: np.ndarray, later: float = 0.0, reach: float = 0.0) -> float:
        """Move the path constraints to the worst instants of v, or later by a part of a mesh cell;
        return the excess."""
        self.constraints = self.space.constraints(v, later, reach)
        return self.constraints.excess

    def follow_worst(self) -> None:
        """Until they are placed again, let path constraints follow the worst instants."""
        if self.constraints.following is not None:
            self.constraints = self.constraints.following()

    def of_moving_peaks(self, v: np.ndarray, on_rows: np.ndarray) -> np.ndarray:
        """Part ``(n, n)`` of the Lagrangian's second derivatives due to moving peaks of the
        actuators."""
        if self.actuators is None:
            return np.zeros((v.size, v.size))
        first = self._total_lower.size
        mine = on_rows[first : first + self.actuators.placed.shape[1]]
        return self.actuators.of_moving_peaks(v, self.delta, mine)

    def objective(self, v: np.ndarray) -> float:
        return -float(self.space.control.aims.objective(self.motion.values(v, self.delta)))

    def value(self, objective: float) -> float:
        """Value of the problem's objective."""
        return self.space.control.unscale(-objective)

    def period(self, v: np.ndarray) -> dict[str, float]:
        """Totals of a period in the units of the problem."""
        control = self.space.control
        degrees = {each.name: each.friction_degree or 0.0 for each in control.aims.integrals}
        degrees["work"] = 1.0
        totals = self.motion.values(v, self.delta)
        return {x: value * control.unit ** degrees.get(x, 0.0) for x, value in totals.items()}

    def gradient(self, v: np.ndarray) -> np.ndarray:
        return -self._slope(self.space.control.aims.objective, v)

    def _slope(self, aim: Objective, v: np.ndarray) -> np.ndarray:
        return aim.gradient(self.motion.values(v, self.delta), self._slopes(v)) + np.zeros_like(v)

    def rows(self, v: np.ndarray) -> np.ndarray:
        values = self.motion.values(v, self.delta) if self._total_lower.size else {}
        rows = [values[name] for name in self._equalities]
        rows += [aim(values) for aim, _ in self.space.control.aims.at_least]
        done = self.actuators.values(v, self.delta) if self.actuators else _EMPTY
        return np.concatenate([rows, done, self.constraints.values(v)])

    def row_slopes(self, v: np.ndarray) -> np.ndarray:
        slopes = [self._slopes(v)[name] for name in self._equalities]
        slopes += [self._slope(aim, v) for aim, _ in self.space.control.aims.at_least]
        done = self.actuators.slopes(v, self.delta) if self.actuators else ()
        return np.vstack([*slopes, *done, self.constraints.slopes(v)])
