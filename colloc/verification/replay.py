"""Independent replay of a gait: distance, work and rotation from the joint angles alone.

It shares nothing with collocation but the friction law: velocities by the NumPy solver at five
instants of panels (`colloc.verification.panels`). Where several balance an instant, it follows one
branch in time, and says how far the others would lead (`colloc.dynamics.branches`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from colloc.dynamics.branches import FORWARDS, followed_motion
from colloc.dynamics.follow import ONE_SIDED
from colloc.gaits.objective import EFFICIENCY, Objective
from colloc.gaits.period import chord_per_way
from colloc.gaits.regime import Regime
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.densities import (
    LENGTH,
    Instants,
    PathLimit,
    PathLimits,
    Quantity,
    limits_of,
    quantities_of,
)
from colloc.mechanics.law import Law
from colloc.smooth.smooth_body import accurate_motion
from colloc.system.errors import ProblemError
from colloc.verification.panels import (
    WHOLE,
    Panels,
    changes,
    first_panels,
    increments,
    poses,
    remaining_error,
)
from colloc.verification.replay_record import Path, Replay, lever

MOST_INSTANTS = 10_000_000
"""Of a first grid, which fill a gigabyte."""
_NARROWEST = 1e-10


class _Solver:
    """Values of panels at instants, with the largest residual, lever and shares so far."""

    def __init__(
        self,
        body: Body,
        friction: Law,
        path: Path,
        delta: float,
        sense: int,
        quantities: tuple[Quantity, ...],
        limits: PathLimits,
        turn: float,
    ) -> None:
        self.body, self.friction, self.path, self.delta = body, friction, path, delta
        self.sense, self.quantities, self.limits, self.turn = sense, quantities, limits, turn
        self.joint_map = getattr(path, "joint_map", None)
        self.residual = self.lever = 0.0
        self.shares = np.full(len(limits.names), -np.inf)

    def values(
        self, t: np.ndarray, near: np.ndarray | None, *, whole: bool = False
    ) -> tuple[np.ndarray, ...]:
        """`Panels` z, rates, joint_power and apart at instants t ``(n, k)``, from the tail
        velocities `near` ``(3, n k)``; of several motions the nearest, or of a `whole` period the
        branch in time."""
        angles, rates = self.path(t.ravel())
        at = self.body, self.friction, angles, rates, self.delta
        given: Any = {"quantities": self.quantities, "joint_map": self.joint_map}
        start, apart = near, np.zeros((3 + len(self.quantities), t.size))
        if not self.friction.associated:
            before = None if whole else near
            followed = followed_motion(*at, before=before, sense=self.sense, **given)
            if followed is not None:
                start, apart = np.nan_to_num(followed.z), followed.apart
        motion, residual = accurate_motion(*at, start)
        now = Instants(*at, z=motion.z, joint_map=self.joint_map)
        self.residual = float(np.maximum(self.residual, residual.max()))
        self.lever = max(self.lever, float(lever(self.body, angles).max()))
        if self.limits.names:
            used = self.limits.sizes(self.limits.at(now)).max(axis=1)
            self.shares = np.maximum(self.shares, used)
        densities = [quantity.at(now) for quantity in self.quantities]
        centre = motion.centre[0] + 1j * motion.centre[1]
        rows = np.vstack([motion.z[2] - self.turn, centre, motion.power, *densities])
        found = motion.z, rows, motion.actuator_power, apart
        return tuple(each.T.reshape(*t.shape, *each.shape[:-1]) for each in found)


def replay(
    body: Body,
    friction: Law,
    path: Path,
    delta: float,
    *,
    instants: int = 1600,
    tolerance: float = 1e-6,
    most_instants: int = 100_000,
    breaks: np.ndarray | tuple[float, ...] = (),
    near: Replay | None = None,
    sense: int = FORWARDS,
    objective: Objective = EFFICIENCY,
    quantities: Iterable[Quantity | str] = (),
    limits: Iterable[PathLimit] | PathLimits = (),
    turn: float = 0.0,
    froude: float = 0.0,
) -> Replay:
    """Distance, work, rotation and length of a path over one period, to a relative error in the
    efficiency, or an objective.

    Parameters
    ----------
    body, friction
    path : callable
        Joint angles and rates at phases in [0, 1].
    delta : float
        Regularisation speed, per period.
    instants : int
        Uniform instants to begin with, about; panels are halved until the error is below
        `tolerance`.
    tolerance : float
        Relative error of the objective.
    most_instants : int
        No panel is halved once there are so many.
    breaks : (n,), optional
        Phases in (0, 1) where the rates jump (corners); they are integrated up to and from there.
    near : Replay, optional
        Of the same path or one like it: where the motion is unique, solves start from its
        velocities, which saves time and changes nothing else.
    sense : {FORWARDS, BACKWARDS}
        Whether branches are followed with or against time, where several motions are balanced.
    objective : Objective
    quantities : iterable of Quantity or str
        Further quantities, as ``["driven_work"]``.
    limits : iterable of PathLimit
        Their largest shares are measured; with limits of 1 these are the largest values.
    turn : float
        Net rotation that the path is asked for [rad]: the distance is the chord of an arc that
        turns by as much.
    froude : float
        Froude number L/(g T^2) at which the path is played; 0 is quasi-static motion. At another
        one only `tolerance`, `breaks`, `objective`, `quantities` and `turn` count.

    Raises
    ------
    ProblemError
        If the path does not move, or the grid is too small.
    NotConvergedError
        If the balance cannot be solved at some instant.

    Examples
    --------
    >>> import colloc
    >>> gait = colloc.ellipse(A0=0, A1=2.859, B1=1.302)
    >>> measured = colloc.replay(colloc.Chain(), colloc.Friction(), gait, delta=1e-4)
    >>> round(measured.efficiency, 4)
    0.26
    """
    if froude:
        return replayer(Regime(froude=froude))(
            body, friction, path, delta, tolerance=tolerance, breaks=breaks, objective=objective,
            quantities=quantities, turn=turn,
        )  # fmt: skip
    if "period" in objective.uses:
        raise ProblemError(
            f"the objective {objective.name!r} speaks of the period: give the froude at which it "
            f"is played."
        )
    if not 4 <= instants <= MOST_INSTANTS or instants % 2:
        raise ProblemError(
            f"instants must be an even number of at least 4, and at most {MOST_INSTANTS}, not "
            f"{instants!r}."
        )
    law = body.law(friction) if isinstance(body, Chain) else friction
    asked = tuple(dict.fromkeys([LENGTH, *objective.integrals, *quantities_of(quantities)]))
    joint_map = getattr(path, "joint_map", None)
    limits = limits_of(limits, joint_map.n_motor if joint_map else body.n_joint)
    solver = _Solver(body, law, path, delta, sense, asked, limits, turn)
    panels = _grid(solver, instants, breaks, near)
    names = "rotation", "distance", "work", *(each.name for each in asked)
    chord = chord_per_way(turn)
    while True:
        spin, move, *sums = increments(panels)
        heading, place = poses(spin, move)
        distance = max(chord * float(abs(place[-1])), 1e-300)
        work, *totals = (float(part.sum()) for part in sums)
        values = {"distance": distance, "work": work, "rotation": float(heading[-1]) + turn}
        values |= dict(zip(names[3:], totals, strict=True))
        if not values["work"] > 0:
            raise ProblemError(
                "the path does not move, or too little to do work against friction: it has no "
                "efficiency."
            )
        changed, one_beside, two_beside = changes(panels)
        missed = remaining_error(one_beside, two_beside, panels.wider).T
        missed[1] *= chord
        lost = dict(zip(names, missed, strict=True))
        gap = objective.relative_error(values, lost)
        order, residual = np.argsort(gap), solver.residual
        # finer panels do not make up for what the balance leaves over
        excess = (np.cumsum(gap[order]) + residual > tolerance) & (residual < tolerance)
        excess &= panels.width[order] > _NARROWEST
        chosen = _with_wider_neighbours(order[excess], panels.width)
        if chosen.size == 0 or 4 * (panels.left.size + chosen.size) > most_instants:
            break
        old = panels.take(chosen)
        middles = old.left[:, None] + old.width[:, None] * (np.arange(4) + 0.5) / 4
        if law.associated:
            start = 0.5 * (old.z[:, :-1] + old.z[:, 1:])
        else:  # the branch on which the body is before
            start = old.z[:, :-1] if sense == FORWARDS else old.z[:, 1:]
        halves = old.halves(solver.values(middles, start.reshape(-1, 3).T), changed[chosen])
        panels = panels.take(np.setdiff1d(order, chosen)).join(halves)
    several, others = _others(panels, float(np.abs(place - place[-1]).max()))
    known = panels.left[:, None] + panels.width[:, None] * np.linspace(0.0, 0.75, 4)
    known[np.isin(panels.left, breaks), 0] += ONE_SIDED
    # what the balance leaves over counts in proportion to each
    forces = [each.needs_forces * abs(values[each.name]) for each in asked]
    off = [1.0, values["distance"], values["work"], *forces]
    return Replay(
        values=values,
        errors={
            name: float(lost[name].sum() + residual * size)
            for name, size in zip(names, off, strict=True)
        },
        others=dict(zip(names, others, strict=True)),
        lever=solver.lever,
        actuator_work=float(((panels.joint_power @ WHOLE[-1]) * panels.width).sum()),
        residual=residual,
        error=float(gap.sum()) + residual,
        several=several,
        instants=4 * panels.left.size,
        tail=(known.ravel(), panels.z[:, :4].reshape(-1, 3).T),
        shares=solver.shares,
        objective=objective,
    )


def _grid(
    solver: _Solver, instants: int, breaks: np.ndarray | tuple[float, ...], near: Replay | None
) -> Panels:
    """Equal panels between any two corners, where rates are one-sided."""
    ends = np.concatenate([[0.0], np.asarray(breaks, dtype=float), [1.0]])
    counts = [2 * max(1, round(instants * (b - a) / 8)) for a, b in pairwise(ends)]
    pieces = zip(pairwise(ends), counts, strict=True)
    edges = np.concatenate([*(np.linspace(a, b, n + 1)[:-1] for (a, b), n in pieces), [1.0]])
    left, width = edges[:-1], np.diff(edges)
    t = left[:, None] + width[:, None] * np.linspace(0.0, 1.0, 5)
    t[np.isin(left, breaks), 0] += ONE_SIDED
    t[np.isin(edges[1:], breaks), 4] -= ONE_SIDED
    start = None if near is None else near.tail_velocity(t.ravel())
    return first_panels(left, width, solver.values(t, start, whole=True))


def _with_wider_neighbours(chosen: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Add neighbours that are not narrower: halves are judged with instants beside them."""
    narrow = np.full(width.size, np.inf)
    narrow[chosen] = width[chosen]
    beside = np.minimum(np.roll(narrow, 1), np.roll(narrow, -1))
    return np.flatnonzero((width >= beside) | np.isfinite(narrow))


def _others(panels: Panels, reach: float) -> tuple[float, list[float]]:
    """Part of the period with several motions, and how far any others would lead at most: rotation,
    distance, work, integrals; a rotation moves what is within `reach`."""
    worse = np.maximum(panels.apart[:, :-1], panels.apart[:, 1:])
    speed, spin, *others = map(float, np.einsum("n,nki->i", 0.25 * panels.width, worse))
    several = 0.25 * panels.width @ worse.any(axis=2).sum(axis=1)
    return float(several), [spin, speed + reach * spin, *others]


def replayer(regime: Regime) -> Callable[..., Replay]:
    """The replay of a regime, with the arguments of `replay`; a regime of one's own has it as
    ``replay``."""
    own = getattr(regime, "replay", None)
    if own is not None:
        return own
    if regime.froude:
        from colloc.verification.inertial_motion import inertial_replay  # loads what integrates

        return partial(inertial_replay, regime=regime)
    if regime.slides:
        from colloc.verification.slope import slope_replay

        return partial(slope_replay, slope=regime)
    return replay
