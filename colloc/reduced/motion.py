"""Distance, work and rotation of a collocated gait as functions of its parameters, with exact
gradients.

Every equation of the collocation fixes one unknown: the balance the tail velocity, its rotation
rate the orientation, both the displacement (`colloc.dynamics.collocated`) and the work ``W = sum_ki
h_k b_i P_ki``. What is left is a program of the gait's parameters alone. Gradients take one adjoint
sweep.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from colloc.dynamics.chain import of_torques
from colloc.dynamics.collocated import CollocatedPose, point_weights, stage_weights
from colloc.dynamics.compiled_period import CompiledPeriod
from colloc.dynamics.dynamics import (
    OMEGA,
    OUTPUTS,
    Inertial,
    PeriodTotals,
    QuasiStatic,
    Shapes,
    TotalGradient,
    Trajectory,
)
from colloc.gaits.gait import ANTIPODAL
from colloc.gaits.objective import chord_per_way
from colloc.mechanics.balance import load_wrench
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import Instants, JointMap, PathLimits, Quantity
from colloc.mechanics.inertia import STATES
from colloc.mechanics.law import Law
from colloc.mechanics.native_kernel import chain_parameters
from colloc.numerics.mesh import Mesh


@dataclass(eq=False)
class _State:
    v: np.ndarray
    delta: float
    mesh: Mesh
    shapes: Shapes
    heading: float
    """Initial orientation."""
    z: np.ndarray
    """Tail velocities, ``(3, n_point)``."""
    out: np.ndarray
    """Rotation rate, velocity of the centre and power over the pace, ``(4, n_point)``."""
    along: Trajectory | None
    """None if the compiled kernel differentiates the motion."""
    totals: PeriodTotals | None = None
    values: dict[str, float] = field(default_factory=dict)

    @cached_property
    def pose(self) -> CollocatedPose:
        omega, cx, cy, _ = self.out * self.shapes.pace
        return CollocatedPose.on_mesh(self.mesh, omega, np.array([cx, cy]), self.heading)

    @cached_property
    def cycle(self) -> PeriodTotals:
        if self.totals is not None:
            return self.totals
        assert self.along is not None
        pose, power = self.pose, (self.out[3] * self.shapes.pace)[self.mesh.points]
        work = float((stage_weights(self.mesh) * power).sum())
        rotation = float(pose.theta[-1]) - self.heading
        return PeriodTotals(complex(pose.place[-1]), rotation, work, self.along.static)

    @cached_property
    def slopes(self) -> tuple[np.ndarray, np.ndarray]:
        assert self.along is not None
        return self.along.slopes()


class ReducedMotion:
    """Totals of a period as functions of parameters; the mesh covers the solved part of it."""

    def __init__(
        self, kind: QuasiStatic, mesh: Mesh, space: Any, integrals: Sequence[Quantity] = ()
    ) -> None:
        """`space` is a `colloc.reduced.program.SearchSpace`, of which `at` and `vjp` are enough
        where no actuators are limited."""
        self.kind, self.mesh, self._space = kind, mesh, space
        self._n_static = len(kind.static_parameters)
        self._integrals = integrals
        self._point_weight = point_weights(mesh)
        self._compiled = CompiledPeriod.of(kind, mesh)
        self._last: _State | None = None
        self._differentiated: _State | None = None

    def at(self, v: np.ndarray, delta: float) -> _State:
        """The collocated motion; NaN where the balance cannot be solved."""
        last, mesh, kind = self._last, self.mesh, self.kind
        if last is not None and last.delta == delta and np.array_equal(last.v, v):
            return last
        angles, rates, pace = self._space.at(v)
        shapes, static = Shapes(angles, rates, delta, pace=pace), v[v.size - self._n_static :]
        of_v = v.copy(), delta, mesh, shapes, kind.initial_heading(static)
        begin, compiled = self._differentiated or last, self._compiled
        if compiled is not None and begin is not None and compiled.covers(shapes):
            solution = compiled.simulate(shapes, begin.z, begin.shapes)
            if solution is not None:
                z, out, totals = solution
                self._last = _State(*of_v, z, out, None, totals)
                return self._last
        along = kind.simulate(mesh, shapes, static, *self._start(shapes, static))
        now = along.now
        out = np.vstack([now.z[OMEGA] - self._even(pace), now.centre, now.power])
        out[:, ~along.exist] = np.nan
        state = _State(*of_v, now.z, out, along)
        if not kind.states or along.exist.all():  # a search goes on from states that there are
            self._last = state
        return state

    def kernel_fields(self, state: _State) -> dict[str, Any] | None:
        """Of the compiled kernel's search (`colloc.reduced.compiled_search`); None if the kernel
        does not know the motion, or there is none."""
        compiled, kind, mesh = self._compiled, self.kind, self.mesh
        if compiled is None or not compiled.covers(state.shapes) or np.isnan(state.out).any():
            return None
        n_link, length, mass, law = chain_parameters(kind.body, kind.law)
        arrays = {"A": mesh.scheme.A, "b": mesh.scheme.b, "h": mesh.h, "points": mesh.points}
        counts = {"n_time": mesh.n_point, "n_interval": mesh.n, "n_stage": mesh.scheme.s}
        totals = {"turn": kind.turn, "antipodal": kind.symmetry == ANTIPODAL}
        totals |= {"repeats": kind.periods, "chord": kind.periods * chord_per_way(kind.turn)}
        chain = {"n_link": n_link, "length": length, "mass": mass, "law": law}
        return chain | arrays | counts | totals

    def set(
        self, v: np.ndarray, delta: float, z: np.ndarray, out: np.ndarray, totals: np.ndarray
    ) -> None:
        """Take a motion that the compiled kernel has found as the last one."""
        angles, rates, pace = self._space.at(v)
        shapes, (x, y, rotation, work) = Shapes(angles, rates, delta, pace=pace), totals.tolist()
        cycle = PeriodTotals(complex(x, y), rotation, work)
        state = _State(v.copy(), delta, self.mesh, shapes, 0.0, z, out, None, cycle)
        self._last = self._differentiated = state

    def _even(self, pace: np.ndarray | float) -> float:
        """Rotation rate of axes that turn evenly, over the pace."""
        return self.kind.turn / float(self._point_weight @ pace) if self.kind.turn else 0.0

    def _start(
        self, shapes: Shapes, static: np.ndarray
    ) -> tuple[np.ndarray | None, np.ndarray | None]:
        kind, last, begin = self.kind, self._last, self._differentiated
        if kind.states and last is not None:
            is_near = begin is not None and begin.delta == shapes.delta
            known: Any = begin if is_near else last
            states, moved = known.along.states.copy(), static - known.along.static
            for each, change in zip(kind.static_parameters, moved, strict=True):
                states[[each.name == state for state in kind.states]] += change
            if not is_near:
                return states, None
            change = kind.first_order_change(self.mesh, known.shapes, known.slopes, shapes, moved)
            return states + change, known.z
        if begin is None or begin.along is None:
            begin = begin or last
            return None, None if begin is None else begin.z
        shape = [shapes.angles - begin.shapes.angles, shapes.rates - begin.shapes.rates]
        return None, begin.z + np.einsum("ijt,jt->it", begin.slopes[0][:3], np.concatenate(shape))

    def values(self, v: np.ndarray, delta: float) -> dict[str, float]:
        """Totals of a period and integrals by name; NaN where there is no motion."""
        s = self.at(v, delta)
        if not s.values:
            s.values = self.kind.totals(s.cycle)
            weight = self.kind.periods * s.shapes.pace * self._point_weight
            for each in self._integrals:
                s.values[each.name] = float(self._at_points(each, s)[0] @ weight)
        return s.values

    def shares(
        self, limits: PathLimits, v: np.ndarray, delta: float, t: np.ndarray | None = None
    ) -> np.ndarray:
        """Shares of actuator limits ``(n_share, n_time)`` at the points of the mesh, or at times of
        it."""
        kind = self.kind
        if t is None or self._of_torques(limits):
            return self._at_points(limits, self.at(v, delta), t)
        theta = np.zeros(t.size)  # where it is no state
        if "theta" in kind.states:
            theta = self.at(v, delta).pose.at(*self.mesh.locate(t))[0]
        angles, rates = self._space.at_times(v, t)
        shapes = Shapes(angles, rates, delta)
        return limits.at(kind.instants(shapes, theta))

    def share_slopes(
        self, limits: PathLimits, v: np.ndarray, delta: float, rows: np.ndarray
    ) -> np.ndarray:
        """Derivatives ``(n_row, n)`` of shares of actuator limits; `rows` ``(2, n_row)`` are their
        shares and points."""
        s, (share, point) = self.at(v, delta), rows
        n_row, n_point = share.size, self.mesh.n_point
        if inertial := self._of_torques(limits):
            y = self._torque_arguments(s)[:, point]
            slopes = inertial[1](y, delta)
        else:
            slopes = density_slopes(limits, self._instants(s).take(point))
        at_points = np.zeros((n_row, slopes.shape[1], n_point))
        at_points[np.arange(n_row), :, point] = slopes[share, :, np.arange(n_row)]
        if inertial:
            totals, on_points, *more = self._along_torque_arguments(s, at_points)
            return self._through(s, totals, on_points, np.zeros((n_row, 1)), *more)
        no_pace = np.zeros((n_row, n_point))
        if not at_points[:, -1].any():
            return self._space.vjp(v, at_points[:, :-1].transpose(0, 2, 1), no_pace)
        return self._through(s, [TotalGradient()] * n_row, at_points, no_pace)

    def _of_torques(self, formula: Any) -> Any:
        if formula.needs_forces and isinstance(self.kind, Inertial):
            return of_torques(self.kind.chain, self.kind.law, formula)
        return None

    def _at_points(self, formula: Any, s: _State, t: np.ndarray | None = None) -> np.ndarray:
        """Values of a formula ``(n_row, n_point)``; with torques also at times of the mesh."""
        if functions := self._of_torques(formula):
            return functions[0](self._torque_arguments(s, t), s.delta)
        return formula.at(self._instants(s))

    def _along_torque_arguments(
        self, s: _State, at_points: np.ndarray
    ) -> tuple[list[TotalGradient], np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives of m numbers along the static parameter, (angles, rates, orientation), states
        and accelerations, from those along `_torque_arguments` ``(m, n_argument, n_point)``."""
        kind: Any = self.kind
        m, n = len(at_points), len(s.shapes.angles)
        on_shape, on_accelerations, on_states, on_froude = np.split(
            at_points, [2 * n, 3 * n, 3 * n + len(STATES)], axis=1
        )
        by_states = np.zeros((m, len(kind.states), self.mesh.n_point))
        by_states[:, : len(STATES)] = on_states
        totals = [TotalGradient()] * m
        if kind.regime.free:  # Fr = exp(-2 log_period)
            froude = kind.froude_at(s.shapes, s.cycle.static)
            on_log_period = -2.0 * froude * on_froude.sum(axis=(1, 2))
            totals = [TotalGradient(static=value) for value in on_log_period]
        on_points = np.concatenate([on_shape, np.zeros((m, 1, self.mesh.n_point))], axis=1)
        return totals, on_points, by_states, on_accelerations

    def _torque_arguments(self, s: _State, t: np.ndarray | None = None) -> np.ndarray:
        """(angles, rates, accelerations, momenta, Froude number) that joint torques depend on."""
        kind: Any = self.kind
        mesh, (angles, rates, *_) = self.mesh, s.shapes
        assert s.along is not None
        momenta = s.along.states[: len(STATES)]
        if t is not None:
            angles, rates = self._space.at_times(s.v, t)
            k, tau = mesh.locate(t)
            nodes = [s.along.edges[:, :-1, None], momenta[:, mesh.points]]
            weights = mesh.scheme.lagrange(tau, begin=True)
            momenta = np.einsum("nj,anj->an", weights, np.concatenate(nodes, axis=2)[:, k])
        accelerations = self._space.accelerations(s.v, mesh.times if t is None else t)
        froude = np.full((1, angles.shape[1]), kind.froude_at(s.shapes, s.cycle.static))
        return np.concatenate([angles, rates, accelerations, momenta, froude])

    def _instants(self, s: _State) -> Instants:
        shapes = s.shapes._replace(pace=1.0)
        return self.kind.instants(shapes, s.pose.theta_on(self.mesh), s.z)

    def gradients(self, v: np.ndarray, delta: float) -> dict[str, np.ndarray]:
        """Derivatives of `values`, ``(n,)`` each."""
        s, kind = self.at(v, delta), self.kind
        totals, weight, pace = kind.total_gradients(s.cycle), self._point_weight, s.shapes.pace
        gradients = [*totals.values(), *[TotalGradient()] * len(self._integrals)]
        m, n_joint, n_point = len(gradients), len(s.shapes.rates), weight.size
        on_points, on_pace = np.zeros((m, 2 * n_joint + 1, n_point)), np.zeros((m, n_point))
        by_states = np.zeros((m, len(kind.states), n_point))
        on_accelerations = np.zeros((m, n_joint, n_point))
        for row, quantity in enumerate(self._integrals, len(totals)):
            if inertial := self._of_torques(quantity):
                slopes = inertial[1](self._torque_arguments(s), delta)
                along = self._along_torque_arguments(s, kind.periods * weight * slopes)
                (gradients[row],), on_points[row], by_states[row], on_accelerations[row] = along
            else:
                now = self._instants(s)
                on_points[row] = kind.periods * weight * pace * density_slopes(quantity, now)[0]
                on_pace[row] = kind.periods * weight * quantity.at(now)[0]
        rows = self._through(s, gradients, on_points, on_pace, by_states, on_accelerations)
        names = *totals, *(each.name for each in self._integrals)
        return dict(zip(names, rows, strict=True))

    def _through(
        self,
        s: _State,
        gradients: Sequence[TotalGradient],
        on_points: np.ndarray,
        on_pace: np.ndarray,
        by_states: np.ndarray | float = 0.0,
        on_accelerations: np.ndarray | None = None,
    ) -> np.ndarray:
        """Derivatives ``(m, n)`` of numbers that depend on totals of the period, on (angles, rates,
        orientation) at the points, ``(m, 2 n_joint + 1, n_point)``, the pace, states and
        accelerations."""
        mesh, kind, pace, compiled = self.mesh, self.kind, s.shapes.pace, self._compiled
        self._differentiated = s
        if compiled is not None and compiled.covers(s.shapes):
            on_shape, more = compiled.vjp(s.shapes, s.z, s.out, gradients)
            on_shape += on_points[:, :-1].transpose(0, 2, 1)
            return self._space.vjp(s.v, on_shape, on_pace + more)
        slopes, on_states = s.slopes
        by_theta = on_points[:, -1][:, mesh.points]
        rows, on_begin, _ = kind.vjp(mesh, s.pose, gradients, on_states * pace, by_theta, by_states)
        on_out = np.zeros((*rows.shape[:2], mesh.n_point))
        for stage, points in enumerate(mesh.points.T):  # neighbours may share a point
            on_out[:, :, points] += rows[..., stage]
        on_pace = on_pace + np.einsum("krt,rt->kt", on_out[:, : len(s.out)], s.out)
        if kind.turn:  # the axes turn less on what a longer path makes a smaller part of the period
            weight, even = self._point_weight, self._even(pace)
            on_pace += np.outer(on_out[:, 0] @ pace, even / (weight @ pace) * weight)
        on_shape = np.einsum("krt,rjt->ktj", on_out * pace, slopes[OUTPUTS])
        on_shape += on_points[:, :-1].transpose(0, 2, 1)
        on_v: np.ndarray = self._space.vjp(s.v, on_shape, on_pace)
        if self._n_static:
            on_v[:, -self._n_static :] += on_begin
            on_v[:, -self._n_static] += [each.static for each in gradients]
        if on_accelerations is not None and on_accelerations.any():
            on_v += self._space.accelerations_vjp(s.v, on_accelerations)
        return on_v


def density_slopes(of: Quantity | PathLimits, now: Instants) -> np.ndarray:
    """Total derivatives ``(n_row, 2 n_joint + 1, n_time)`` of densities, or of limited quantities,
    along (angles, rates, orientation) at balanced tail velocities."""
    pulled, n, n_time = now.load is not None, 2 * len(now.angles), now.angles.shape[1]
    y = np.concatenate([now.angles, now.rates, now.load if pulled else np.empty((0, n_time))])
    evaluate = _density_slopes(now.body, now.friction, now.joint_map, of, pulled=pulled)
    slope = evaluate(y, now.z, now.delta)
    on_theta = np.zeros((len(slope), n_time))
    if pulled:  # an outside force turns against the body
        on_theta = slope[:, n] * now.load[1] - slope[:, n + 1] * now.load[0]
    return np.concatenate([slope[:, :n], on_theta[:, None]], axis=1)


@lru_cache(maxsize=32)
def _density_slopes(
    body: Body,
    friction: Law,
    joint_map: JointMap | None,
    of: Quantity | PathLimits,
    *,
    pulled: bool,
) -> Any:
    """Along y = (angles, rates, outside force), at the tail velocity z that balances the body."""
    from colloc.numerics.repeated import implicit_derivatives  # loads CasADi

    n = body.n_joint

    def equations(y, z, delta):
        angles, rates, load = y[:n], y[n : 2 * n], y[2 * n :] if pulled else None
        more: Any = {"z": z, "load": load, "joint_map": joint_map}
        out = of.at(Instants(body, friction, angles, rates, delta, **more))
        if not of.needs_forces:
            return [out], z
        balance = body.sliding(friction, angles, rates, z, delta).force
        if pulled:
            balance += load_wrench(body, body.posture(angles), load)  # type: ignore[attr-defined]
        return [out], balance

    return implicit_derivatives(equations, 2 * n + 2 * pulled, 3, shared=True)
