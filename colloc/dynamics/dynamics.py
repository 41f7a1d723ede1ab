r"""Dynamics of a gait: states of a period besides the shape, their rates, and period totals.

| dynamics | states solved for | integrated |
|---|---|---|
| quasi-static on level ground | none: balanced at every time | orientation, place, work |
| quasi-static on a slope | orientation theta, on which the pull depends | place, work |
| inertial on level ground | momenta Vx, Vy, H, periodic | orientation, place, work |
| inertial on a slope | momenta and orientation | place, work |

Static parameters, such as the initial heading on a slope and the log period at a free pace, are the
last entries of the vector of decisions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from colloc.dynamics.chain import balance_on_slope, momenta_at
from colloc.dynamics.collocated import (
    CollocatedPose,
    heading,
    momenta_image,
    point_weights,
    stage_weights,
)
from colloc.dynamics.states import CollocatedStates, Rates
from colloc.gaits.gait import ANTIPODAL, NONE, fraction
from colloc.gaits.objective import chord_per_way
from colloc.gaits.regime import LEVEL, Regime, checked_chain
from colloc.mechanics.balance import Moving
from colloc.mechanics.bodies import BalancedMotion, Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.densities import Instants, JointMap
from colloc.mechanics.fixed_point import motion_and_derivatives, solve_balance
from colloc.mechanics.inertia import STATES, Path, checked_mass, momenta, turning
from colloc.mechanics.law import Law, rate_independent
from colloc.mechanics.native_kernel import kernel_repeating, native_kernel
from colloc.mechanics.solution_branches import on_one_branch
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.system.arguments import check_finite
from colloc.system.errors import NotConvergedError, ProblemError

_MOMENTA, _MORE = slice(len(STATES)), slice(-len(STATES), None)
_VISCOUS, _WETTER, _LEAST_RATIO = 3.0, 10**0.5, 1.02
"""Delta at which friction is as good as viscous; largest and smallest factor between deltas."""
_TOLERANCE, _BALANCED = 1e-12, 1e-9
"""Residual at which balances are solved, and where rounding may stop the solver."""
OMEGA, OUTPUTS = 2, slice(2, None)
"""Rows of `Trajectory.slopes`: rotation rate; all after the tail's velocity."""


class StaticParameter(NamedTuple):
    """A number of a gait besides its angles; a guess of NaN is made by the search."""

    name: str
    lower: float
    upper: float
    guess: float


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

    static: np.ndarray
    """Static parameters, ``(n_static,)``."""
    now: BalancedMotion
    """Per time over the shapes' unit."""
    exist: np.ndarray
    """Points where the equations hold, ``(n_point,)``."""
    slopes: Callable[[], tuple[np.ndarray, np.ndarray]]
    """Derivatives of (tail velocity, velocity of the centre, power, rates of states) along (angles,
    rates), ``(6 + k, 2 n_joint, n_point)``, and along the states, ``(6 + k, n_state, n_point)``."""
    states: np.ndarray = np.empty((0, 0))
    """``(n_state, n_point)``."""
    edges: np.ndarray = np.empty((0, 0))
    """Momenta at the edges of the mesh, ``(3, n + 1)``."""


class PeriodTotals(NamedTuple):
    """Totals of the solved part of a period: displacement (from orientation 0, or in the plane
    where that is a state), rotation, work, static parameters; seen from axes that turn evenly."""

    displacement: complex
    rotation: float
    work: float
    static: np.ndarray = np.empty(0)


class TotalGradient(NamedTuple):
    """Gradient of a period total: along a displacement, rotation, work, and the first static
    parameter."""

    side: complex = 0.0
    rotation: float = 0.0
    work: float = 0.0
    static: float = 0.0


@dataclass(frozen=True, eq=False)
class QuasiStatic:
    """Slow motion on level ground: no states, distance along the direction of travel. Base of all
    dynamics."""

    body: Body
    law: Law
    regime: Regime = LEVEL
    symmetry: str = NONE
    """Symmetry of the motion (`colloc.gaits.gait`)."""
    turn: float = 0.0
    """Prescribed rotation over a period [rad]."""
    joint_map: JointMap | None = None

    states: ClassVar[tuple[str, ...]] = ()
    followed = False
    """Whether mesh errors come from a differential equation
    (`colloc.verification.mesh_error`)."""
    lack = "no velocity balances the body; give another guess"
    """What may be wrong where a gait has no motion, and what to try."""

    @property
    def static_parameters(self) -> tuple[StaticParameter, ...]:
        return ()

    @property
    def periods(self) -> float:
        """Solved parts of a period."""
        return 1.0 / fraction(self.symmetry)

    def in_speeds_of(self, unit: float) -> Self:
        return replace(self, law=self.law.in_speeds_of(unit))

    def simulate(
        self,
        mesh: Mesh,
        shapes: Shapes,
        static: np.ndarray,
        states_guess: np.ndarray | None = None,
        z_guess: np.ndarray | None = None,
    ) -> Trajectory:
        """Motion along a mesh, from states and tail velocities to start from."""
        body, at = self.body, (self.law, shapes.angles, shapes.rates, shapes.delta)
        solved = body.solve(*at, start=z_guess, tolerance=_TOLERANCE)
        if z_guess is None and solved.converged.all():
            followed = on_one_branch(body, *at, solved.z)
            if followed is not solved.z:
                solved = body.solve(*at, start=followed, tolerance=_TOLERANCE)

        def slopes() -> tuple[np.ndarray, np.ndarray]:
            rows = motion_and_derivatives(body, *at, solved)[1]
            return rows, rows[:, :0]

        exist = solved.residual < _BALANCED
        return Trajectory(static, body.motion(*at, solved), exist, slopes)

    def instants(self, shapes: Shapes, theta: np.ndarray, z: np.ndarray | None = None) -> Instants:
        """Instants for formulas, at orientations ``(n,)`` and tail velocities ``(3, n)``, by
        default balanced ones."""
        at = self.law, shapes.angles, shapes.rates, shapes.delta
        body, load = self.body, self.regime.pull(theta[None])
        if z is None:
            balance: Any = body.solve if load is None else partial(solve_balance, body, load=load)
            z = balance(*at).z
        joints = self.joint_map
        return Instants(body, *at, z=z, unit=shapes.unit, load=load, joint_map=joints)

    def totals(self, cycle: PeriodTotals) -> dict[str, float]:
        """Totals of a whole period; those but the rotation are linear but for the direction of
        travel."""
        gradients = self.total_gradients(cycle).items()
        totals = {
            name: float((np.conj(each.side) * cycle.displacement).real + each.work * cycle.work)
            for name, each in gradients
        }
        return totals | {"rotation": cycle.rotation + self.turn}

    def total_gradients(self, cycle: PeriodTotals) -> dict[str, TotalGradient]:
        """Gradients of `totals`."""
        along = np.exp(1j * heading(self.symmetry, cycle.displacement, cycle.rotation))
        side = self.periods * chord_per_way(self.turn) * along
        # the axis turns with the solved part
        turns = 0.5 if self.symmetry == ANTIPODAL else 0.0
        return {
            "distance": TotalGradient(side, turns * (cycle.displacement * np.conj(side)).imag),
            "work": TotalGradient(work=self.periods),
            "rotation": TotalGradient(rotation=1.0),
        }

    def initial_heading(self, static: np.ndarray) -> float:
        """Initial orientation; 0 where it is no state."""
        return float(static[-1]) if "theta" in self.states else 0.0

    def equations(self, mesh: Mesh, unit: float = 1.0) -> CollocatedStates:
        return _equations(mesh, self.states, self.symmetry, unit)

    @property
    def _grow(self) -> list[int]:
        """Rows of `Trajectory.slopes` that are the rates of the states."""
        return [OMEGA if name == "theta" else 6 + STATES.index(name) for name in self.states]

    def first_order_change(
        self,
        mesh: Mesh,
        begin: Shapes,
        slopes: tuple[np.ndarray, np.ndarray],
        end: Shapes,
        static: np.ndarray,
    ) -> np.ndarray:
        """Change of the states ``(n_state, n_point)`` from shapes with such `Trajectory.slopes` to
        others near them, and with static parameters that change by so much."""
        k, grow = len(self.states), self._grow
        on_shape, on_states = (each[grow] * begin.pace for each in slopes)
        change = np.concatenate([end.angles - begin.angles, end.rates - begin.rates])
        rates = np.einsum("rjt,jt->rt", on_shape, change)
        rates += np.einsum("rkt,k->rt", on_states[:, k:], static[: on_states.shape[1] - k])
        return self.equations(mesh, begin.unit).first_order_change(on_states[:, :k], rates)

    def vjp(
        self,
        mesh: Mesh,
        pose: CollocatedPose,
        gradients: Iterable[TotalGradient],
        on_states: np.ndarray,
        by_theta: np.ndarray | float = 0.0,
        by_states: np.ndarray | float = 0.0,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Adjoint of a period.

        Derivatives of m numbers along (rotation rate, velocity of the centre, power, rates of
        states) at the stages, ``(m, 4 + k, n, s)``, along the static parameters that are initial
        values ``(m, n_static)``, and along the states at the ends of intervals ``(m, n_state, n)``;
        `by_theta` ``(m, n, s)`` and `by_states` are direct derivatives along orientation and
        states, `on_states` those of `Trajectory.slopes`.
        """
        side, rotation, work, _ = (np.array(column) for column in zip(*gradients, strict=True))
        m, k, weight = side.size, len(self.states), stage_weights(mesh)
        on_theta, on_centre = pose.on_pose(side)
        on_theta = on_theta + by_theta
        rows = np.zeros((m, len(on_states[OUTPUTS]), *weight.shape))
        rows[:, 0], rows[:, 3] = (part[:, None, None] * weight for part in (rotation, work))
        rows[:, 1:3] = on_centre
        turns = [name == "theta" for name in self.states]
        if not any(turns):
            rows[:, 0] += pose.on_rates(on_theta)
        if not k:
            return rows, np.empty((m, 0)), np.empty((m, 0, mesh.n))
        of_states = np.einsum(
            "mrt,rkt->mkt", rows[:, :4].reshape(m, 4, -1), on_states[OUTPUTS, :k][:4]
        )
        of_states += by_states
        of_states[:, turns] += on_theta.reshape(m, 1, -1)
        on_begin, on_rates, on_ends = self.equations(mesh).vjp(on_states[self._grow, :k], of_states)
        rows[:, np.array(self._grow) - OMEGA] += on_rates.reshape(m, k, *weight.shape)
        on_more = np.einsum("mrt,rkt->mk", on_rates, on_states[self._grow, k:])
        return rows, np.concatenate([on_more, on_begin[:, turns]], axis=1), on_ends


@lru_cache(maxsize=8)  # they know what is linear at the last states
def _equations(mesh: Mesh, states: tuple[str, ...], symmetry: str, unit: float) -> CollocatedStates:
    free = np.array([name in STATES for name in states])
    return CollocatedStates(mesh, free, momenta_image(symmetry), unit)


class OnSlope(QuasiStatic):
    """Slow motion on a slope: the orientation is a state, from straight uphill."""

    states = ("theta",)
    followed = True
    lack = (
        "friction does not hold the body on the slope all the way, or its joints brake; "
        "take a gentler one"
    )

    @property
    def static_parameters(self) -> tuple[StaticParameter, ...]:
        return (StaticParameter("theta", -100.0, 100.0, np.nan),)  # any heading

    @cached_property
    def chain(self) -> Chain:
        return checked_chain(self.body, self.law, self.regime.grade)

    def simulate(
        self,
        mesh: Mesh,
        shapes: Shapes,
        static: np.ndarray,
        states_guess: np.ndarray | None = None,
        z_guess: np.ndarray | None = None,
    ) -> Trajectory:
        z = np.zeros((3, mesh.n_point)) if z_guess is None else z_guess
        at = shapes.angles, shapes.rates, shapes.delta
        now: Any = None

        def rates(states: np.ndarray) -> Rates:
            nonlocal now, z
            now = balance_on_slope(
                self.chain, self.law, self.regime, at, states[0], start=z, tolerance=_TOLERANCE
            )
            z, balanced = now.solved.z, bool((now.solved.residual < _BALANCED).all())
            turns = shapes.pace * z[None, OMEGA]
            return Rates(turns, shapes.pace * now.on_theta[None, None, OMEGA], balanced)

        solve = self.equations(mesh, shapes.unit).solve
        states, _, exist = solve(rates, static, states_guess, monotone=True)
        slopes = now.on_shape, now.on_theta[:, None]
        return Trajectory(static, now.now, np.full(mesh.n_point, exist), lambda: slopes, states)

    def totals(self, cycle: PeriodTotals) -> dict[str, float]:
        """Totals; NaN where the joints brake."""
        totals = super().totals(cycle)
        return totals if totals["work"] > 0 else dict.fromkeys(totals, np.nan)

    def total_gradients(self, cycle: PeriodTotals) -> dict[str, TotalGradient]:
        ahead = np.exp(1j * self.regime.ahead)
        return {
            "distance": TotalGradient(ahead),
            "work": TotalGradient(self.regime.grade, work=1.0),
            "rotation": TotalGradient(rotation=1.0),
            "across": TotalGradient(1j * ahead),
        }


class Inertial(QuasiStatic):
    """Momenta (and on a slope the orientation) as states, periodic over a period; in the axes of
    the tail link (`colloc.mechanics.inertia`)."""

    followed = True
    lack = (
        "no motion with inertia was found in which all cycles are alike; try another guess or a "
        "smaller froude"
    )

    @cached_property
    def slow(self) -> QuasiStatic:
        """The dynamics in the limit of zero mass."""
        kind = OnSlope if self.regime.slides else QuasiStatic
        return kind(self.body, self.law, self.regime, self.symmetry, self.turn)

    @cached_property
    def chain(self) -> Chain:
        return checked_mass(self.body)

    @property
    def states(self) -> tuple[str, ...]:  # type: ignore[override]
        return STATES + self.slow.states

    @property
    def static_parameters(self) -> tuple[StaticParameter, ...]:
        if self.regime.free is None:
            return self.slow.static_parameters
        longest, shortest = -0.5 * np.log(self.regime.free)
        middle = float(np.mean([shortest, longest]))
        period = StaticParameter("log_period", shortest, longest, middle)
        return (period, *self.slow.static_parameters)

    @property
    def _n_period(self) -> int:
        return int(self.regime.free is not None)

    def totals(self, cycle: PeriodTotals) -> dict[str, float]:
        timed = {"period": float(np.exp(cycle.static[0]))} if self._n_period else {}
        return self.slow.totals(cycle) | timed

    def total_gradients(self, cycle: PeriodTotals) -> dict[str, TotalGradient]:
        gradients = self.slow.total_gradients(cycle)
        if self._n_period:
            gradients["period"] = TotalGradient(static=float(np.exp(cycle.static[0])))
        return gradients

    def simulate(
        self,
        mesh: Mesh,
        shapes: Shapes,
        static: np.ndarray,
        states_guess: np.ndarray | None = None,
        z_guess: np.ndarray | None = None,
    ) -> Trajectory:
        if states_guess is None:
            slow = self.slow.simulate(mesh, shapes, static[self._n_period :])
            posture = self.chain.posture(shapes.angles)
            link = self.chain.velocity(posture, shapes.rates, slow.now.z)
            at_first = momenta(self.chain, posture, link)
            states_guess = np.concatenate([at_first, slow.states]) if slow.states.size else at_first
        solve = self._periodic_states if z_guess is None else self._newton
        states, out, exist = solve(mesh, shapes, states_guess, static)
        z, centre, power, rates = np.split(out, [3, 5, 6])
        now = BalancedMotion(z, centre, power[0], power[0])
        increments, edges = self.equations(mesh, shapes.unit).integrals(rates)
        edges = edges + (states[_MOMENTA, :1] - increments[:, :1])

        def slopes() -> tuple[np.ndarray, np.ndarray]:
            """A free pace has a column after the momenta: a longer period changes them by more."""
            froude, k = self.froude_at(shapes, static), 2 * self.chain.n_joint
            outputs = momenta_at(self.chain, self.law, shapes[:3], states[_MOMENTA], froude)
            out, slopes = self._with_pull(*outputs, states, froude)
            on_pace = np.zeros((len(out), self._n_period, out.shape[1]))
            on_pace[_MORE] = 2.0 * (out[_MORE] - turning(z, states[_MOMENTA]))[:, None]
            return slopes[:, :k], np.concatenate([slopes[:, k:], on_pace], axis=1)

        return Trajectory(static, now, np.full(mesh.n_point, exist), slopes, states, edges)

    def _periodic_states(
        self, mesh: Mesh, shapes: Shapes, guess: np.ndarray, static: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        """Periodic states, outputs, and whether they exist. Where Newton's method fails from
        `guess`, by continuation through more viscous friction, in steps that shrink where it fails
        again, as where wheel after wheel slips."""
        solution, delta, ratio = self._newton(mesh, shapes, guess, static), shapes.delta, _WETTER
        while not solution[-1] and delta * shapes.unit <= _VISCOUS:
            delta *= _WETTER
            solution = self._newton(mesh, shapes._replace(delta=delta), guess, static)
        while solution[-1] and delta > shapes.delta:
            drier = max(delta / ratio, shapes.delta)
            further = self._newton(mesh, shapes._replace(delta=drier), solution[0], static)
            if not further[-1] and ratio > _LEAST_RATIO:
                ratio **= 0.5
            else:
                solution, delta, ratio = further, drier, min(ratio**2, _WETTER)
        return solution

    def _newton(
        self, mesh: Mesh, shapes: Shapes, guess: np.ndarray, static: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        out, first = guess, np.append(guess[_MOMENTA, 0], static[self._n_period :])
        froude, equations = self.froude_at(shapes, static), self.equations(mesh, shapes.unit)
        library = None if self.slow.states else native_kernel(self.chain, self.law)
        if library is not None:
            moving = Moving(self.chain, self.law, *shapes[:3], None)
            begun = np.column_stack([guess, first])
            return kernel_repeating(library, moving, begun, froude, equations.scheme)

        def rates(states: np.ndarray) -> Rates:
            nonlocal out
            out, now = self._rates(shapes, states, froude)
            return now

        states, _, exist = equations.solve(rates, first, guess)
        return states, out, exist

    def solve_intervals(
        self, mesh: Mesh, shapes: Shapes, along: Trajectory, begins: np.ndarray, guess: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Outputs and final states of every interval from initial states ``(n_state, n)``, sought
        near states at the points; and whether they exist, ``(n,)``."""
        equations, froude = self.equations(mesh, shapes.unit), self.froude_at(shapes, along.static)

        def rates(states: np.ndarray, of: np.ndarray) -> Rates:
            some = shapes._replace(angles=shapes.angles[:, of], rates=shapes.rates[:, of])
            return self._rates(some, states, froude)[1]

        states, ends, exist = equations.solve_intervals(rates, begins, guess)
        return self._rates(shapes, states, froude)[0], ends, exist

    def _rates(self, shapes: Shapes, states: np.ndarray, froude: float) -> tuple[np.ndarray, Rates]:
        at = self.chain, self.law, shapes[:3], states[_MOMENTA], froude
        out, slopes = self._with_pull(*momenta_at(*at, along_states=True), states, froude)
        return out, Rates(out[self._grow], slopes[self._grow], bool(np.isfinite(out).all()))

    def _with_pull(
        self, out: np.ndarray, slopes: np.ndarray, states: np.ndarray, froude: float
    ) -> tuple[np.ndarray, np.ndarray]:
        for theta in states[len(STATES) :]:
            pull: Any = self.regime.pull(theta[None]) / froude  # type: ignore[operator]
            out[_MORE][:2] += pull
            on_theta = np.zeros((len(out), 1, theta.size))
            on_theta[_MORE][:2, 0] = pull[1], -pull[0]  # the pull turns against theta
            slopes = np.concatenate([slopes, on_theta], axis=1)
        return out, slopes

    def froude_at(self, shapes: Shapes, static: np.ndarray) -> float:
        froude = float(np.exp(-2.0 * static[0])) if self._n_period else self.regime.froude
        return froude * shapes.unit**2


def dynamics_of(body: Body, law: Law, regime: Regime, *more: Any) -> Any:
    """The dynamics of a body in a regime; more fields are those of `QuasiStatic`."""
    usual = Inertial if regime.froude else OnSlope if regime.slides else QuasiStatic
    return getattr(regime, "dynamics", usual)(body, law, regime, *more)


SCHEME = "gauss-3"
_INTERVALS, _DOUBLED = 50, 6
"""Of the first mesh, and how many there are, each of twice as many."""
_ACCURACY = 0.02
"""Relative, of a loss, and of what a finer mesh may change in the Froude number for it."""
_POWER = 1.5
"""Of the Froude number, to which the change of the efficiency is in proportion; between 1 and 2
where it is small."""
_FIRST, _FASTEST, _FARTHEST = 0.3, 10.0, np.log(5.0)
"""The first Froude number tried, over loss times friction; the largest, over friction, beyond which
nobody is slow; and the farthest step between the logarithms of two."""


def efficiency_at(
    body: Chain,
    friction: Law,
    gait: Path,
    mesh: Mesh,
    delta: float,
    froude: float = 0.0,
    guess: np.ndarray | None = None,
) -> tuple[float, np.ndarray | None]:
    """Efficiency of a gait in the motion in which all cycles are alike, and its states at the
    points of a mesh whose neighbours share no stage, sought near others or those of the slow
    motion. The distance is the chord of the arc, which does not depend on the phase at which a
    period begins (`colloc.gaits.objective`). `NotConvergedError` if no motion is found."""
    kind = Inertial if froude else QuasiStatic
    angles, rates = gait(mesh.times)
    shapes = Shapes(angles, rates, delta)
    along = kind(body, friction, Regime(froude=froude)).simulate(mesh, shapes, np.empty(0), guess)
    if not along.exist.all():
        raise NotConvergedError(
            f"at a Froude number of {froude:g} no motion was found in which all cycles are alike."
        )
    turn, work = point_weights(mesh) @ np.array([along.now.z[OMEGA], along.now.power]).T
    pose = CollocatedPose.on_mesh(mesh, along.now.z[OMEGA] - turn, along.now.centre)
    efficiency = chord_per_way(turn) * float(abs(pose.place[-1]) / work)
    return efficiency, along.states if froude else None


def slow_enough(
    body: Body,
    friction: Law,
    gait: Path,
    delta: float,
    loss: float = 0.01,
    *,
    breaks: np.ndarray | tuple[float, ...] = (),
) -> float:
    """The Froude number L/(g T^2) up to which inertia changes the efficiency of a gait by no more
    than the part `loss`.

    A body of length L [m] that takes T [s] per cycle has the Froude number L / (9.81 T^2); so T
    must be sqrt(L / (9.81 Fr)) or more. Played faster a gait may be better or worse: either is a
    change. Paces are tried from slow to fast, each at most five times the one before in Fr, so a
    change that comes and goes between two of them is not seen.

    Parameters
    ----------
    body : Chain
        With the masses of its links.
    friction : Law
    gait : callable
        Joint angles and rates at phases in [0, 1]; any gait of colloc.
    delta : float
        Regularisation speed, per period.
    loss : float
        In (0, 0.5]; the answer is right to 2 % of it.
    breaks : (n,), optional
        Phases in (0, 1) where the rates jump, as `gait.corner_phases`.

    Raises
    ------
    ProblemError
        If the body is no chain, or numbers are out of range.
    NotConvergedError
        If the motion is not found, or the gait can be played as fast as one likes.

    Examples
    --------
    >>> import colloc
    >>> gait = colloc.ellipse(A0=0, A1=2.859, B1=1.302)
    >>> round(colloc.slow_enough(colloc.Chain(), colloc.Friction(), gait, delta=1e-4), 4)
    0.0031
    """
    check_finite(positive=True, loss=loss, delta=delta)
    if loss > 0.5:
        raise ProblemError(f"loss must be at most 0.5, not {loss!r}.")
    chain = checked_mass(body)
    law = chain.law(friction)
    if not rate_independent(law):
        raise ProblemError(
            f"under {law.label} the pace is part of every gait: how slow is slow enough has no one "
            f"answer."
        )
    froude = np.nan
    for intervals in _INTERVALS * 2 ** np.arange(_DOUBLED):
        edges = np.union1d(np.linspace(0.0, 1.0, intervals + 1), np.asarray(breaks, dtype=float))
        mesh = Mesh(scheme(SCHEME), edges)
        before, froude = froude, _froude(chain, law, gait, mesh, delta, loss)
        if abs(froude - before) < _ACCURACY * froude:
            return froude
    raise NotConvergedError(
        "finer and finer meshes do not agree on what inertia does to this gait; try a larger delta."
    )


def _froude(body: Chain, friction: Law, gait: Path, mesh: Mesh, delta: float, loss: float) -> float:
    at_pace = body, friction, gait, mesh, delta
    slow, states = efficiency_at(*at_pace)
    # the change is a power of the Froude number where both are small
    low = -np.inf
    high = np.log(_FASTEST * friction.largest)
    at = np.log(_FIRST * loss * friction.largest)
    fastest, power = high, _POWER
    tried: list[tuple[float, float]] = []
    while high - low > _ACCURACY / _POWER:
        efficiency, states = efficiency_at(*at_pace, float(np.exp(at)), states)
        more = float(np.log(max(abs(1.0 - efficiency / slow), 1e-12) / loss))
        if abs(more) < _ACCURACY:
            return float(np.exp(at))
        low, high = (at, high) if more < 0.0 else (low, at)
        tried.append((at, more))
        if len(tried) > 1:
            (a, x), (b, y) = tried[-2:]
            power = (y - x) / (b - a) if (y - x) * (b - a) > 0.0 else _POWER
        nearer = at - np.clip(more / power, -_FARTHEST, _FARTHEST)
        at = nearer if low < nearer < high else 0.5 * (max(low, at - _FARTHEST) + high)
    if high < fastest:
        return float(np.exp(low))
    raise NotConvergedError(
        f"inertia changes the efficiency by less than {loss:g} up to a Froude number of "
        f"{np.exp(fastest):g}."
    )
