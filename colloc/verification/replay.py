"""Independent replay of a gait: from the joint angles alone to distance, work and rotation, by the
NumPy solver.

It shares nothing with collocation but the friction law: no scheme, no mesh, no symmetry, no
interpolant. Velocities are solved for at five instants of every panel of the period and integrated
by Simpson's rule, once over the panel and once over its halves; panels are halved where the two
differ. `colloc.verification.panels` judges what that leaves of the difference. These errors add up
as magnitudes: kinks of stick and slip lie anywhere between the instants, so those of different
panels may well cancel by accident.

With unequal coefficients several velocities may balance an instant. The replay then follows one
branch in time, and says how far the others would lead (`colloc.motion.followed_motion`).
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from itertools import pairwise

import numpy as np

from colloc.gaits.inertia import Paced
from colloc.gaits.objective import EFFICIENCY, Objective
from colloc.gaits.period import chord_per_way
from colloc.mechanics.bodies import Body
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
from colloc.motion.follow import ONE_SIDED
from colloc.motion.followed_motion import FORWARDS, followed_motion
from colloc.system.errors import ProblemError
from colloc.verification.panels import (
    WHOLE,
    Panels,
    begun,
    changes,
    halves,
    increments,
    left_over,
    travelled,
)
from colloc.verification.played import Path, Replay, lever

MOST_INSTANTS = 10_000_000
"""Of a first grid, which fill a gigabyte."""
_NARROWEST = 1e-10


def _evaluated(
    body: Body,
    friction: Law,
    path: Path,
    delta: float,
    t: np.ndarray,
    near: np.ndarray | None,
    *,
    sense: int,
    whole: bool,
    quantities: tuple[Quantity, ...],
    limits: PathLimits,
    turn: float,
) -> tuple[np.ndarray, ...]:
    """`Panels` from z to apart at instants t ``(n, k)``; solves start from the tail velocities
    `near`, ``(3, n k)``.

    Where several motions may be balanced, that nearest to `near` is taken; or, of a `whole` period,
    the branch in time.
    """
    (angles, rates), start, apart = path(t.ravel()), near, np.zeros((3 + len(quantities), t.size))
    joint_map = getattr(path, "joint_map", None)
    if not friction.associated:
        before = None if whole else near
        followed = followed_motion(
            body, friction, angles, rates, delta, before=before, sense=sense,
            quantities=quantities, joint_map=joint_map,
        )  # fmt: skip
        if followed is not None:
            start, apart = np.nan_to_num(followed.z), followed.apart
    motion, residual = body.replayed(friction, angles, rates, delta, start)
    now, z, centre = (
        Instants(body, friction, angles, rates, delta, z=motion.z, joint_map=joint_map),
        motion.z,
        motion.centre,
    )
    densities = np.concatenate([quantity.at(now) for quantity in quantities])
    used = limits.sizes(limits.at(now)) if limits.names else np.empty((0, t.size))
    seen = (
        z,
        z[2] - turn,
        centre[0] + 1j * centre[1],
        motion.power,
        motion.actuator_power,
        densities,
    )
    values: tuple[np.ndarray, ...] = (*seen, residual, lever(body, angles), used, apart)
    return tuple(value.T.reshape(*t.shape, *value.shape[:-1]) for value in values)


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
        What is asked for besides, whatever the objective is, as ``["driven_work"]``.
    limits : iterable of PathLimit
        Of which the largest shares are asked for; with limits of 1 these are the largest values
        themselves.
    turn : float
        Net rotation that the path is asked for [rad]: the distance is the chord of an arc that
        turns by as much.
    froude : float
        Froude number L/(g T^2) at which the path is played; 0 is so slow that inertia does not
        matter. At another one only `tolerance`, `breaks`, `objective`, `quantities` and `turn`
        count (`colloc.verification.inertial_motion.inertial_replay`).

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
        from colloc.verification.inertial_motion import inertial_replay  # loads what integrates

        return inertial_replay(
            body, friction, path, delta, regime=Paced(froude), tolerance=tolerance, breaks=breaks,
            objective=objective, quantities=quantities, turn=turn,
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
    friction = body.law(friction)
    ends = np.concatenate([[0.0], np.asarray(breaks, dtype=float), [1.0]])
    counts = [2 * max(1, round(instants * (b - a) / 8)) for a, b in pairwise(ends)]
    edges = np.concatenate(
        [np.linspace(a, b, n + 1)[:-1] for (a, b), n in zip(pairwise(ends), counts, strict=True)]
        + [[1.0]]
    )
    left, width = edges[:-1], np.diff(edges)
    t = left[:, None] + width[:, None] * np.linspace(0.0, 1.0, 5)
    # one-sided limits at jumps
    t[np.isin(left, breaks), 0] += ONE_SIDED
    t[np.isin(edges[1:], breaks), 4] -= ONE_SIDED
    start = None if near is None else near.tail_velocity(t.ravel())
    asked = tuple(dict.fromkeys([LENGTH, *objective.integrals, *quantities_of(quantities)]))
    names = "rotation", "distance", "work", *(each.name for each in asked)
    joint_map = getattr(path, "joint_map", None)
    limits = limits_of(limits, joint_map.n_motor if joint_map else body.n_joint)
    at = partial(
        _evaluated,
        body,
        friction,
        path,
        delta,
        sense=sense,
        quantities=asked,
        limits=limits,
        turn=turn,
    )
    panels, chord = begun(left, width, at(t, start, whole=True)), chord_per_way(turn)
    while True:
        spin, move, spent, *sums = increments(WHOLE, panels, 1)
        heading, place = travelled(spin, move)
        distance = max(chord * float(abs(place[-1])), 1e-300)
        values = {
            "distance": distance,
            "work": float(spent.sum()),
            "rotation": float(heading[-1]) + turn,
        }
        values |= {each.name: float(part.sum()) for each, part in zip(asked, sums, strict=True)}
        if not values["work"] > 0:
            raise ProblemError(
                "the path does not move, or too little to do work against friction: it has no "
                "efficiency."
            )
        changed, near_by, far = changes(panels)
        missed = left_over(near_by, far, panels.wider).T
        missed[1] *= chord
        lost = dict(zip(names, missed, strict=True))
        gap = objective.relative_error(values, lost)
        residual = float(panels.residual.max())
        order = np.argsort(gap)
        # finer panels do not make up for what the balance leaves over
        excess = (np.cumsum(gap[order]) + residual > tolerance) & (residual < tolerance)
        chosen = _with_wider_neighbours(
            order[excess & (panels.width[order] > _NARROWEST)], panels.width
        )
        n = 4 * (panels.left.size + chosen.size)
        if chosen.size == 0 or n > most_instants:
            break
        old = panels.take(chosen)
        between = old.left[:, None] + old.width[:, None] * (np.arange(4) + 0.5) / 4
        start = _starts(old.z, friction, sense).reshape(-1, 3).T
        new = at(between, start, whole=False)
        panels = panels.take(np.setdiff1d(order, chosen)).joined(halves(old, new, changed[chosen]))
    several, apart = _others(panels, np.abs(place - place[-1]).max())
    known = panels.left[:, None] + panels.width[:, None] * np.linspace(0.0, 0.75, 4)
    known[np.isin(panels.left, breaks), 0] += ONE_SIDED
    balanced = [
        1.0,
        values["distance"],
        values["work"],
        *(each.needs_forces * abs(values[each.name]) for each in asked),
    ]
    return Replay(
        values=values,
        errors={
            name: float(lost[name].sum() + residual * size)
            for name, size in zip(names, balanced, strict=True)
        },
        others=dict(zip(names, apart, strict=True)),
        lever=float(panels.lever.max()),
        actuator_work=float(((panels.actuator @ WHOLE[-1]) * panels.width).sum()),
        residual=residual,
        error=float(gap.sum()) + residual,
        several=several,
        instants=4 * panels.left.size,
        tail=(known.ravel(), panels.z[:, :4].reshape(-1, 3).T),
        shares=panels.shares.max(axis=(0, 1)),
        objective=objective,
    )


def _with_wider_neighbours(chosen: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Panels to be halved, and those beside them that are not narrower: the halves are judged with
    instants beside them."""
    narrow = np.full(width.size, np.inf)
    narrow[chosen] = width[chosen]
    beside = np.minimum(np.roll(narrow, 1), np.roll(narrow, -1))
    return np.flatnonzero((width >= beside) | np.isfinite(narrow))


def _starts(z: np.ndarray, friction: Law, sense: int) -> np.ndarray:
    """Velocities ``(n, 4, 3)`` to solve from half way between instants with velocities z ``(n, 5,
    3)``: the mean, or where there may be several branches, that on which the body is before."""
    if friction.associated:
        return 0.5 * (z[:, :-1] + z[:, 1:])
    return z[:, :-1] if sense == FORWARDS else z[:, 1:]


def _others(panels: Panels, reach: float) -> tuple[float, list[float]]:
    """Part of the period with several motions, and how far any others would lead at most: rotation,
    distance, work, integrals.

    Between two instants they count as at the worse; a rotation moves what is within `reach`.
    """
    worse = np.maximum(panels.apart[:, :-1], panels.apart[:, 1:])
    speed, spin, *others = map(float, np.einsum("n,nki->i", 0.25 * panels.width, worse))
    several = 0.25 * panels.width @ worse.any(axis=2).sum(axis=1)
    return float(several), [spin, speed + reach * spin, *others]
