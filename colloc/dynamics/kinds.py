r"""Dynamics of a gait: states of a period besides the shape, their rates, and period totals.

| dynamics | states solved for | integrated |
|---|---|---|
| quasi-static on level ground | none: balanced at every time | orientation, place, work |
| quasi-static on a slope | orientation theta, on which the pull depends | place, work |
| inertial on level ground | momenta Vx, Vy, H, periodic | orientation, place, work |
| inertial on a slope | momenta and orientation | place, work |
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import singledispatch
from typing import Any, NamedTuple, Protocol

import numpy as np

from colloc.dynamics.collocated import CollocatedPose, stage_weights, sums
from colloc.dynamics.compiled_momenta import momenta_along_states, momenta_at
from colloc.dynamics.control_problem import Dynamics
from colloc.dynamics.followed_motion import on_one_branch
from colloc.dynamics.heading import heading, momenta_image
from colloc.dynamics.on_slope import balance_on_slope
from colloc.dynamics.states import CollocatedStates, Rates
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.inertia import Paced, PacedOnSlope
from colloc.gaits.period import chord_per_way
from colloc.gaits.regime import Regime
from colloc.gaits.sloped import Slope, checked_chain
from colloc.gaits.symmetry import ANTIPODAL, fraction
from colloc.mechanics.balance import Moving
from colloc.mechanics.bodies import BalancedMotion, BalanceSolution, Body
from colloc.mechanics.chain_motion import motion_and_derivatives
from colloc.mechanics.densities import Instants
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.inertia import STATES, checked_mass, momenta, turning
from colloc.mechanics.joint_map import JointMap
from colloc.mechanics.law import Law
from colloc.mechanics.native_kernel import kernel_repeating, native_kernel
from colloc.numerics.mesh import Mesh

_MORE = slice(-len(STATES), None)
_VISCOUS, _WETTER = 3.0, 10**0.5
"""Delta at which friction is as good as viscous, and the factor between deltas."""
Near = tuple[np.ndarray | None, np.ndarray | None]
"""States and tail velocities to start from."""
NOWHERE: Near = (None, None)
TOLERANCE = 1e-12
_ACCEPTED = 1e3
"""Factor on the tolerance where rounding stops the solver."""
OMEGA, OUTPUTS = 2, slice(2, None)
"""Rows of `Kind.slopes`: rotation rate; all after the tail's velocity."""


class Shapes(NamedTuple):
    """Angles and rates ``(n_joint, n_point)`` per time over `unit`, delta in that unit, and the
    pace ``(n_point,)`` that multiplies velocities."""

    angles: np.ndarray
    rates: np.ndarray
    delta: float
    unit: float = 1.0
    pace: np.ndarray | float = 1.0


class Trajectory(NamedTuple):
    """A motion at the points of a mesh."""

    begin: np.ndarray
    """Initial values of static parameters, ``(n_static,)``."""
    states: np.ndarray
    """``(n_state, n_point)``."""
    z: np.ndarray
    now: BalancedMotion
    """Per time over the shapes' unit."""
    held: np.ndarray
    """Points where the equations hold, ``(n_point,)``."""
    slopes: tuple[np.ndarray, np.ndarray] | None = None
    """Cached `Kind.slopes`."""
    solved: BalanceSolution | None = None
    edges: np.ndarray = np.empty((0, 0))
    """States at the edges of the mesh, ``(n_state, n + 1)``."""


class PeriodTotals(NamedTuple):
    """Totals of the solved part of a period: displacement (from orientation 0, or in the plane
    where that is a state), rotation, work, static parameters; seen from axes that turn evenly."""

    displacement: complex
    rotation: float
    work: float
    static_parameters: np.ndarray = np.empty(0)


class TotalGradient(NamedTuple):
    """Gradient of a period total: along a displacement, rotation, work, and the first static
    parameter."""

    side: complex = 0.0
    rotation: float = 0.0
    work: float = 0.0
    static: float = 0.0


class Kind(Protocol):
    """Dynamics of a body."""

    body: Body
    friction: Law
    states: tuple[str, ...]
    static_parameters: tuple[str, ...]
    """Static parameters, the last gait parameters: initial values of states, log period."""
    periods: float
    lack: str
    """What may be wrong where a gait has no motion, and what to try."""
    turn: float
    """Prescribed rotation over a period [rad]."""
    followed: bool
    """Whether mesh errors come from a differential equation
    (`colloc.verification.reference_motion`)."""

    def along(
        self,
        mesh: Mesh,
        shapes: Shapes,
        begin: np.ndarray,
        near: Near = NOWHERE,
        tolerance: float = TOLERANCE,
    ) -> Trajectory:
        """Motion along a mesh from the begin of its states."""

    def instants(self, shapes: Shapes, theta: np.ndarray, z: np.ndarray | None = None) -> Instants:
        """Instants for formulas, at orientations ``(n,)`` and tail velocities ``(3, n)``, by
        default balanced ones."""

    def slopes(self, shapes: Shapes, along: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of (tail velocity, velocity of the centre, power, rates of states) along
        (angles, rates), ``(6 + k, 2 n_joint, n_point)``, and along the states, ``(6 + k, n_state,
        n_point)``."""

    def pose_vjp(
        self,
        mesh: Mesh,
        pose: CollocatedPose,
        on_theta: np.ndarray,
        on_out: np.ndarray,
        on_states: np.ndarray,
        by_states: np.ndarray | float = 0.0,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Adjoint of the orientation: add its part to `on_out` ``(m, 4 + more, n, s)``, derivatives
        of m numbers along (rotation rate, velocity of the centre, power, rates of states) at the
        stages; return derivatives along static parameters, ``(m, n_static)``, and along the states
        at the ends of intervals, ``(m, n_state, n)``."""

    def totals(self, passed: PeriodTotals) -> dict[str, float]:
        """Totals of a whole period."""

    def total_gradients(self, passed: PeriodTotals) -> dict[str, TotalGradient]:
        """Gradients of `totals`."""


class QuasiStatic:
    """Quasi-static on level ground: no states, distance along the direction of travel."""

    states: tuple[str, ...] = ()
    static_parameters: tuple[str, ...] = ()
    followed: bool = False
    lack: str = "no velocity balances the body; give another guess"

    def __init__(
        self,
        body: Body,
        friction: Law,
        symmetry: str,
        turn: float = 0.0,
        joint_map: JointMap | None = None,
    ) -> None:
        self.body, self.friction, self._symmetry, self.turn = body, friction, symmetry, turn
        self._joint_map = joint_map
        self.periods = 1.0 / fraction(symmetry)
        self._chords = self.periods * chord_per_way(turn)

    def along(
        self,
        mesh: Mesh,
        shapes: Shapes,
        begin: np.ndarray,
        near: Near = NOWHERE,
        tolerance: float = TOLERANCE,
    ) -> Trajectory:
        at = self.friction, shapes.angles, shapes.rates, shapes.delta
        solved = self.body.solve(*at, start=near[1], tolerance=tolerance)
        if near[1] is None and solved.converged.all():
            followed = on_one_branch(self.body, *at, solved.z)
            solved = (
                solved
                if followed is solved.z
                else self.body.solve(*at, start=followed, tolerance=tolerance)
            )
        held = solved.residual < _ACCEPTED * tolerance
        return Trajectory(
            begin,
            np.empty((0, held.size)),
            solved.z,
            self.body.motion(*at, solved),
            held,
            solved=solved,
        )

    def instants(self, shapes: Shapes, theta: np.ndarray, z: np.ndarray | None = None) -> Instants:
        at = self.friction, shapes.angles, shapes.rates, shapes.delta
        return Instants(
            self.body, *at, z=self.body.solve(*at).z if z is None else z, unit=shapes.unit,
            joint_map=self._joint_map,
        )  # fmt: skip

    def slopes(self, shapes: Shapes, along: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        assert along.solved is not None
        _, found = motion_and_derivatives(
            self.body, self.friction, shapes.angles, shapes.rates, shapes.delta, along.solved
        )
        return found, found[:, :0]

    def pose_vjp(
        self,
        mesh: Mesh,
        pose: CollocatedPose,
        on_theta: np.ndarray,
        on_out: np.ndarray,
        on_states: np.ndarray,
        by_states: np.ndarray | float = 0.0,
    ) -> tuple[np.ndarray, np.ndarray]:
        on_out[:, 0] += pose.on_rates(on_theta)
        return np.empty((len(on_out), 0)), np.empty((len(on_out), 0, mesh.n))

    def _axis(self, passed: PeriodTotals) -> complex:
        return complex(np.exp(1j * heading(self._symmetry, passed.displacement, passed.rotation)))

    def totals(self, passed: PeriodTotals) -> dict[str, float]:
        ahead = float((passed.displacement * np.conj(self._axis(passed))).real)
        work, rotation = self.periods * passed.work, passed.rotation + self.turn
        return {"distance": self._chords * ahead, "work": work, "rotation": rotation}

    def total_gradients(self, passed: PeriodTotals) -> dict[str, TotalGradient]:
        axis = self._axis(passed)
        aside = self._chords * (passed.displacement * np.conj(axis)).imag
        # how far the axis turns with the solved part
        turns = 0.5 if self._symmetry == ANTIPODAL else 0.0
        distance = TotalGradient(self._chords * axis, turns * aside)
        return {
            "distance": distance,
            "work": TotalGradient(work=self.periods),
            "rotation": TotalGradient(rotation=1.0),
        }


class _WithStates:
    """Adjoint of states that are solved for together."""

    states: tuple[str, ...]
    static_parameters: tuple[str, ...]
    followed: bool = True
    _grow: np.ndarray
    """Rows of `Kind.slopes` that are the rates of the states."""

    def _equations(self, mesh: Mesh, unit: float = 1.0) -> CollocatedStates:
        return CollocatedStates(mesh, unit=unit)

    def pose_vjp(
        self,
        mesh: Mesh,
        pose: CollocatedPose,
        on_theta: np.ndarray,
        on_out: np.ndarray,
        on_states: np.ndarray,
        by_states: np.ndarray | float = 0.0,
    ) -> tuple[np.ndarray, np.ndarray]:
        m, k, turns = len(on_out), len(self.states), [name == "theta" for name in self.states]
        if not any(turns):
            on_out[:, 0] += pose.on_rates(on_theta)
        of_states = np.einsum(
            "mrt,rkt->mkt", on_out[:, :4].reshape(m, 4, -1), on_states[OUTPUTS, :k][:4]
        )
        of_states += by_states
        of_states[:, turns] += on_theta.reshape(m, 1, -1)
        on_begin, on_rates, on_ends = self._equations(mesh).vjp(
            on_states[self._grow, :k], of_states
        )
        on_out[:, self._grow - OMEGA] += on_rates.reshape(m, k, *on_theta.shape[1:])
        on_more = np.einsum("mrt,rkt->mk", on_rates, on_states[self._grow, k:])
        return np.concatenate([on_more, on_begin[:, turns]], axis=1), on_ends


class QuasiStaticOnSlope(_WithStates):
    """Quasi-static on a slope: the orientation is a state, from straight uphill."""

    states: tuple[str, ...] = ("theta",)
    static_parameters: tuple[str, ...] = ("theta",)
    lack: str = (
        "friction does not hold the body on the slope all the way, or its joints brake; "
        "take a gentler one"
    )
    periods: float = 1.0
    turn: float = 0.0
    _grow = np.array([OMEGA])

    def __init__(self, body: Body, friction: Law, slope: Slope) -> None:
        self.body, self.friction, self._slope = body, friction, slope
        self._chain = checked_chain(body, friction, slope.grade)

    def along(
        self,
        mesh: Mesh,
        shapes: Shapes,
        begin: np.ndarray,
        near: Near = NOWHERE,
        tolerance: float = TOLERANCE,
    ) -> Trajectory:
        states, z = near
        z = np.zeros((3, mesh.n_point)) if z is None else z
        at = shapes.angles, shapes.rates, shapes.delta
        now: Any = None

        def rates(states: np.ndarray) -> Rates:
            nonlocal now, z
            now = balance_on_slope(
                self._chain, self.friction, self._slope, at, states[0], start=z, tolerance=tolerance
            )
            z = now.solved.z
            balanced = bool((now.solved.residual < _ACCEPTED * tolerance).all())
            return Rates(
                shapes.pace * z[None, OMEGA],
                shapes.pace * now.on_theta[None, None, OMEGA],
                balanced,
            )

        states, _, held = self._equations(mesh, shapes.unit).solve(rates, begin, states)
        slopes = now.on_shape, now.on_theta[:, None]
        return Trajectory(begin, states, now.solved.z, now.now, np.full(mesh.n_point, held), slopes)

    def instants(self, shapes: Shapes, theta: np.ndarray, z: np.ndarray | None = None) -> Instants:
        at = (self.friction, shapes.angles, shapes.rates, shapes.delta)
        load = self._slope.pull(theta[None])
        z = solve_balance(self._chain, *at, load=load).z if z is None else z
        return Instants(self.body, *at, z=z, unit=shapes.unit, load=load)

    def slopes(self, shapes: Shapes, along: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        assert along.slopes is not None
        return along.slopes

    def totals(self, passed: PeriodTotals) -> dict[str, float]:
        """Totals; NaN where the joints brake."""
        way = self._slope.travel_along(passed.displacement)
        work = passed.work + self._slope.grade * passed.displacement.real
        found = {
            "distance": way.real,
            "work": work,
            "rotation": passed.rotation,
            "across": way.imag,
        }
        return {name: float(value) if work > 0 else np.nan for name, value in found.items()}

    def total_gradients(self, passed: PeriodTotals) -> dict[str, TotalGradient]:
        ahead = np.exp(1j * self._slope.ahead)
        across, turned = TotalGradient(1j * ahead), TotalGradient(rotation=1.0)
        return {
            "distance": TotalGradient(ahead),
            "work": TotalGradient(self._slope.grade, work=1.0),
            "rotation": turned,
            "across": across,
        }


class Inertial(_WithStates):
    """Momenta (and on a slope the orientation) as states, periodic over a period; in the axes of
    the tail link (`colloc.mechanics.inertia`)."""

    lack: str = (
        "no period with inertia was found that repeats itself; give another guess, or a "
        "smaller froude"
    )

    def __init__(
        self,
        slow: QuasiStatic | QuasiStaticOnSlope,
        regime: Regime,
        image: np.ndarray | None = None,
    ) -> None:
        """Wraps the quasi-static dynamics in the limit of zero mass; `image` is that of
        `momenta_image`."""
        self.body = slow.body
        self.friction = slow.friction
        self.turn = slow.turn
        self.periods = slow.periods
        self._slow = slow
        self._regime = regime
        self._image = image
        self.chain = checked_mass(slow.body)
        self._timed = ("period",) if regime.free_pace else ()
        self.states = STATES + slow.states
        self.static_parameters = ("log_period",) * regime.free_pace + slow.static_parameters
        self._grow = np.array([6, 7, 8] + [OMEGA] * len(slow.states))
        self.instants = slow.instants

    def totals(self, passed: PeriodTotals) -> dict[str, float]:
        return self._slow.totals(passed) | {
            name: float(np.exp(passed.static_parameters[0])) for name in self._timed
        }

    def total_gradients(self, passed: PeriodTotals) -> dict[str, TotalGradient]:
        return self._slow.total_gradients(passed) | {
            name: TotalGradient(static=float(np.exp(passed.static_parameters[0])))
            for name in self._timed
        }

    def along(
        self,
        mesh: Mesh,
        shapes: Shapes,
        begin: np.ndarray,
        near: Near = NOWHERE,
        tolerance: float = TOLERANCE,
    ) -> Trajectory:
        near_states = self._slow_states(mesh, shapes, begin) if near[0] is None else near[0]
        states, out, held = self._periodic_states(mesh, shapes, near_states, begin)
        z, centre, power, rates = np.split(out, [3, 5, 6])
        now = BalancedMotion(z, centre, power[0], power[0])
        gained = shapes.unit * (stage_weights(mesh) * rates[:, mesh.points]).sum(axis=2)
        first = (
            states[: len(STATES), 0]
            - CollocatedStates(mesh, unit=shapes.unit).integrals(rates)[0][:, 0]
        )
        edges = np.stack([sums(row, start) for row, start in zip(gained, first, strict=True)])
        return Trajectory(begin, states, z, now, np.full(mesh.n_point, held), edges=edges)

    def _slow_states(self, mesh: Mesh, shapes: Shapes, begin: np.ndarray) -> np.ndarray:
        body, slow = self.chain, self._slow.along(mesh, shapes, begin[len(self._timed) :])
        posture = body.posture(shapes.angles)
        return np.concatenate(
            [momenta(body, posture, body.velocity(posture, shapes.rates, slow.z)), slow.states]
        )

    def _periodic_states(
        self, mesh: Mesh, shapes: Shapes, near: np.ndarray, begin: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        """Periodic states, outputs, and whether they exist. Where Newton's method fails from
        `near`, as on sticking feet, by continuation through more viscous friction."""
        found = self._newton(mesh, shapes, near, begin)
        if found[-1] or shapes.delta * shapes.unit > _VISCOUS:
            return found
        wetter = self._periodic_states(
            mesh, shapes._replace(delta=_WETTER * shapes.delta), near, begin
        )
        return self._newton(mesh, shapes, wetter[0], begin) if wetter[-1] else wetter

    def _newton(
        self, mesh: Mesh, shapes: Shapes, near: np.ndarray, begin: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        out, first = near, np.append(near[: len(STATES), 0], begin[len(self._timed) :])
        froude, equations = self.froude_at(shapes, begin), self._equations(mesh, shapes.unit)
        library = None if self._slow.states else native_kernel(self.chain, self.friction)
        if library is not None:
            moving = Moving(self.chain, self.friction, *shapes[:3], None)
            begun = np.column_stack([near, first])
            return kernel_repeating(library, moving, begun, froude, equations.scheme)

        def rates(states: np.ndarray) -> Rates:
            nonlocal out
            out, found = self._rates(shapes, states, froude)
            return found

        states, _, held = equations.solve_natural(rates, first, near)
        return states, out, held

    def alone(
        self, mesh: Mesh, shapes: Shapes, along: Trajectory, begins: np.ndarray, near: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Outputs and final states of every interval from initial states ``(n_state, n)``, sought
        near states at the points; and whether they exist, ``(n,)``."""
        equations, froude = self._equations(mesh, shapes.unit), self.froude_at(shapes, along.begin)
        states, ends, found = equations.alone(
            lambda states: self._rates(shapes, states, froude)[1], begins, near
        )
        return self._rates(shapes, states, froude)[0], ends, found

    def _rates(self, shapes: Shapes, states: np.ndarray, froude: float) -> tuple[np.ndarray, Rates]:
        at = self.chain, self.friction, shapes[:3], states[: len(STATES)], froude
        out, slopes = self._with_pull(*momenta_along_states(*at), states, froude)
        return out, Rates(out[self._grow], slopes[self._grow], bool(np.isfinite(out).all()))

    def _with_pull(
        self, out: np.ndarray, slopes: np.ndarray, states: np.ndarray, froude: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Outputs with the weight's pull, and derivatives along the orientation after the
        momenta."""
        for theta in states[len(STATES) :]:
            pull: Any = self._regime.pull(theta[None]) / froude  # type: ignore[operator]
            out[_MORE][:2] += pull
            on_theta = np.zeros((len(out), 1, theta.size))
            on_theta[_MORE][:2, 0] = pull[1], -pull[0]  # the pull turns against theta
            slopes = np.concatenate([slopes, on_theta], axis=1)
        return out, slopes

    def _equations(self, mesh: Mesh, unit: float = 1.0) -> CollocatedStates:
        return CollocatedStates(
            mesh, np.array([name in STATES for name in self.states]), self._image, unit
        )

    def froude_at(self, shapes: Shapes, begin: np.ndarray) -> float:
        froude = float(np.exp(-2.0 * begin[0])) if self._timed else self._regime.froude
        return froude * shapes.unit**2

    def slopes(self, shapes: Shapes, along: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """A free pace has a column after the momenta: a longer period changes them by more."""
        froude = self.froude_at(shapes, along.begin)
        momenta = along.states[: len(STATES)]
        k = 2 * self.chain.n_joint
        now = momenta_at(self.chain, self.friction, shapes[:3], momenta, froude)
        out, slopes = self._with_pull(*now, along.states, froude)
        on_pace = np.zeros((len(out), len(self._timed), out.shape[1]))
        on_pace[_MORE] = 2.0 * (out[_MORE] - turning(along.z, momenta))[:, None]
        return slopes[:, :k], np.concatenate([slopes[:, k:], on_pace], axis=1)


def motion_vjp(
    kind: Kind,
    mesh: Mesh,
    pose: CollocatedPose,
    shares: Iterable[TotalGradient],
    on_states: np.ndarray,
    by_theta: np.ndarray | float = 0.0,
    by_states: np.ndarray | float = 0.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives of m period totals along (rotation rate, velocity of the centre, power, rates of
    states) at the stages, ``(m, 4 + more, n, s)``, and those of `Kind.pose_vjp`; `by_theta`
    ``(m, n, s)`` are direct derivatives along the orientation."""
    side, rotation, work, _ = (np.array(column) for column in zip(*shares, strict=True))
    weight = stage_weights(mesh)
    on_theta, on_centre = pose.on_pose(side)
    rows = np.zeros((side.size, len(on_states[OUTPUTS]), *weight.shape))
    rows[:, 0], rows[:, 3] = (part[:, None, None] * weight for part in (rotation, work))
    rows[:, 1:3] = on_centre
    return rows, *kind.pose_vjp(mesh, pose, on_theta + by_theta, rows, on_states, by_states)


@singledispatch
def kind_in(regime: Regime, of: Dynamics) -> Kind:
    """Dynamics of a regime; ``kind_in.register`` adds one."""
    return QuasiStatic(of.body, of.law, of.symmetry, of.turn, of.joint_map)


@kind_in.register
def _on_slope(regime: Slope, of: Dynamics) -> Kind:
    return QuasiStaticOnSlope(of.body, of.law, regime)


@kind_in.register
def _with_inertia(regime: Paced, of: Dynamics) -> Kind:
    return Inertial(
        QuasiStatic(of.body, of.law, of.symmetry, of.turn), regime, momenta_image(of.symmetry)
    )


@kind_in.register
def _with_inertia_on_slope(regime: PacedOnSlope, of: Dynamics) -> Kind:
    return Inertial(QuasiStaticOnSlope(of.body, of.law, regime), regime)


def kind_of_motion(dynamics: Dynamics) -> Kind:
    return kind_in(dynamics.regime, dynamics)


def static_parameters_of(kind: Kind, gait: AnyGait) -> np.ndarray:
    """Static parameters of a gait, ``(n_static,)``."""
    return np.array([getattr(gait, name) for name in kind.static_parameters])


def initial_heading(kind: Kind, begin: np.ndarray) -> float:
    """Initial orientation; 0 where it is no state."""
    return (
        float(begin[kind.static_parameters.index("theta")])
        if "theta" in kind.static_parameters
        else 0.0
    )
