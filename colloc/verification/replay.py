"""Independent replay of a gait: distance, work and rotation from the joint angles alone.

It shares nothing with collocation but the physics at an instant (docs/developers/error_control.md).
Where several velocities balance an instant, it follows one branch in time, and says how far the
others would lead (`colloc.mechanics.solution_branches`).

A kink of stick and slip may lie where halving its panel changes nothing, and halving that again
much. So a panel is also judged by what halving would change if it lay one or two instants earlier
or later, and the error follows from the falloff against the panel twice as wide.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from colloc.gaits.objective import EFFICIENCY, Objective, chord_per_way
from colloc.gaits.regime import LEVEL, Regime
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.densities import LENGTH, Instants, Limits, Quantity, limits_of, quantities_of
from colloc.mechanics.law import Law
from colloc.mechanics.solution_branches import FORWARDS, followed_motion
from colloc.smooth.smooth_body import accurate_motion
from colloc.system.arguments import check_count, check_finite
from colloc.system.errors import ProblemError
from colloc.verification.adaptive_motion import Path, Replay, lever, poses, whole_totals
from colloc.verification.differential_motion import ONE_SIDED, GaitOnSlope, GaitWithInertia

MOST_INSTANTS = 10_000_000
"""Of a first grid, which fill a gigabyte."""
_NARROWEST = 1e-10
HALF = np.array([[0.0, 0.0, 0.0], [5.0, 8.0, -1.0], [4.0, 16.0, 4.0]]) / 24
"""Integrals from the first of three instants to each of the parabola through them, over the
width."""
WHOLE = np.zeros((5, 5))
WHOLE[:3, :3] = 0.5 * HALF
WHOLE[3:] = WHOLE[2]
WHOLE[2:, 2:] += 0.5 * HALF
"""`HALF` for five instants, parabola by parabola."""
_SMOOTH = 1 / (2 * 16 * 15)
"""What a rule of fourth order leaves of the change on the panel twice as wide in smooth motion."""
_MARGIN = 1.25  # factor of safety where three grids tell the falloff (Roache, 1998)
_KINK = 0.25
"""What halving a panel with a kink leaves of its change: the width, and the lift of the
parabola."""
_BESIDE = 2
"""Instants by which panels are moved at most: half of a panel."""
_SLACK = 0.05
"""Of a panel, by which instants beside it may lie elsewhere."""
_REACH = 0.5 + _SLACK
"""Of a panel, within which the instants beside it lie."""
_CORNER = 1e-6  # relative jump between neighbouring panels, or ends [rad], that is none by rounding


class Panels(NamedTuple):
    """Panels in order of time, with values at five instants of each; k quantities."""

    left: np.ndarray  # (n,)
    width: np.ndarray
    z: np.ndarray  # tail velocity, (n, 5, 3)
    rates: np.ndarray
    """Rotation rate from evenly turning axes, velocity of the centre of mass in the body frame,
    power, densities: complex, ``(n, 5, 3 + k)``."""
    joint_power: np.ndarray  # (n, 5)
    apart: np.ndarray  # as of `followed_motion`, (n, 5, 3 + k)
    wider: np.ndarray  # `changes` of the panel that each is half of, (n, 3 + k)
    differences: np.ndarray  # of `_find_differences`, NaN where there are none yet, as the rates

    def take(self, index: np.ndarray) -> Panels:
        return Panels(*(a[index] for a in self))

    def join(self, other: Panels) -> Panels:
        both = Panels(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))
        return both.take(np.argsort(both.left))

    def halves(self, between: tuple[np.ndarray, ...], changes: np.ndarray) -> Panels:
        """Both halves of each, from values (z, rates, joint_power, apart) between the instants
        ``(n, 4)``, and `changes`."""
        fields = []
        for old, new in zip(self[2:6], between, strict=True):
            merged = np.empty((len(old), 9, *old.shape[2:]), dtype=old.dtype)
            merged[:, ::2], merged[:, 1::2] = old, new
            both = np.stack([merged[:, :5], merged[:, 4:]], axis=1)
            fields.append(both.reshape(2 * len(old), *old.shape[1:]))
        left, width = np.repeat(self.left, 2), 0.5 * np.repeat(self.width, 2)
        left[1::2] += width[1::2]
        wider, unknown = np.repeat(changes, 2, axis=0), np.full_like(fields[1], np.nan)
        return Panels(left, width, *[*fields, wider, unknown])


def first_panels(left: np.ndarray, width: np.ndarray, values: tuple[np.ndarray, ...]) -> Panels:
    """An even number of equal panels between any two corners."""
    paired = [np.concatenate([a[::2, ::2], a[1::2, 2::2]], axis=1) for a in values]
    unknown = np.full_like(values[1], np.nan)
    pairs = Panels(left[::2], 2 * width[::2], *[*paired, np.empty(0), unknown[::2]])
    wider = changes(pairs, *poses(*increments(pairs)[:2]))[0]
    return Panels(left, width, *[*values, np.repeat(wider, 2, axis=0), unknown])


def increments(panels: Panels, rule: np.ndarray = WHOLE) -> tuple[np.ndarray, ...]:
    """Rotation, displacement in the axes at the panel's begin (complex), work and integrals of
    panels."""
    every = 4 // (len(rule) - 1)
    return _integrals(rule, panels.width, np.moveaxis(panels.rates[:, ::every], -1, 0))


def _integrals(rule: np.ndarray, h: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, ...]:
    """`increments` from rates ``(3 + k, ..., n, m)`` at m instants."""
    # contiguous: NumPy 2.0 rounds products with strided complex numbers now one way, now another
    centre = np.ascontiguousarray(rates[1])
    omega, others, b = rates[0].real, rates[2:].real, rule[-1]
    turn = np.exp(1j * h[:, None] * (omega @ rule.T))
    return h * (omega @ b), h * ((turn * centre) @ b), *(h * (other @ b) for other in others)


def changes(
    panels: Panels, heading: np.ndarray, place: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Changes by halving each panel of the period's rotation, distance, work and integrals ``(n, 3
    + k)``, and the largest if the panel lay up to one, and up to two instants beside; magnitudes,
    from the `poses`."""
    _find_differences(panels)
    spin, move, *others = panels.differences.transpose(2, 1, 0)
    # what comes after the panel turns with it
    end = place[-1] - np.exp(1j * heading[:-1]) * move - 1j * spin * (place[-1] - place[1:])
    shorter = abs(place[-1]) - np.abs(end)
    sizes = np.abs(np.stack([spin.real, shorter, *(each.real for each in others)], axis=2))
    return sizes[_BESIDE], sizes[1:-1].max(axis=0), sizes.max(axis=0)


def _find_differences(panels: Panels) -> None:
    """Write to new panels, and those within reach of one, what halving them changes of `increments`
    if they lay from two instants earlier to two later; 0 where that is not known."""
    left, width = panels[:2]
    total = np.append(0, np.cumsum(np.isnan(panels.differences[:, 0, 0])))
    ends = left - _REACH * width, left + (1 + _REACH) * width
    first, last = (np.searchsorted(left, end % 1.0, side="right") - 1 for end in ends)
    within = total[last + 1] - total[first] + total[-1] * (last < first)
    some = np.flatnonzero(within)
    rates, (index, visible) = np.moveaxis(panels.rates, -1, 0), _beside(panels, some)
    more = rates[:, :, :4].reshape(len(rates), -1)[:, index]
    extended = np.concatenate([more[..., :_BESIDE], rates[:, some], more[..., _BESIDE:]], axis=2)
    mask = np.insert(visible, [_BESIDE] * 5, True, axis=1)
    offsets = range(2 * _BESIDE + 1)
    windows = np.stack([extended[..., k : k + 5] for k in offsets], axis=1)
    whole = _integrals(WHOLE, width[some], windows)
    once = _integrals(HALF, width[some], windows[..., ::2])
    there = np.stack([mask[:, k : k + 5].all(axis=1) for k in offsets])
    each = [(a - b) * there for a, b in zip(whole, once, strict=True)]
    panels.differences[some] = np.transpose(each, (2, 1, 0))


def _beside(panels: Panels, some: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices among all instants of the two before and after some panels, at their spacing ``(n,
    4)``; and whether there are such, with no corner between."""
    left, width = panels.left[:, None], panels.width[:, None]
    instants = (left + 0.25 * width * np.arange(4)).ravel()
    state = np.concatenate([panels.z, panels.rates[:, :, 2:3].real], axis=2)
    steps = np.abs(state[:, 4] - np.roll(state[:, 0], -1, axis=0))
    corners = (steps > _CORNER * np.abs(state).max(axis=(0, 1))).any(axis=1)
    stretch = np.concatenate([[0], np.cumsum(corners[:-1])])
    if not corners[-1]:
        stretch[stretch == stretch[-1]] = 0
    left, width, at = left[some], width[some], stretch[some, None]
    places = left + 0.25 * width * np.array([*range(-_BESIDE, 0), *range(5, 5 + _BESIDE)])
    slack = _SLACK * width
    index = np.searchsorted(instants, places % 1.0 - slack) % instants.size
    off = np.abs(instants[index] - places % 1.0)
    visible = (np.minimum(off, 1 - off) < slack) & (stretch[index // 4] == at)
    return index, visible & ~(corners[-1] & ((places < -slack) | (places > 1 - slack)))


def remaining_error(near: np.ndarray, far: np.ndarray, wider: np.ndarray) -> np.ndarray:
    """Error of the halves of panels from the changes up to one and two instants beside them, and
    from those of the panels twice as wide: the rest of a geometric series, which falls no faster
    than at a kink, but no less than smooth motion would leave."""
    falloff = np.minimum(2 * far / np.maximum(np.maximum(wider, far), 1e-300), _KINK)
    return np.maximum(near * falloff / (1 - falloff), _MARGIN * _SMOOTH * wider)


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
    guess: Replay | None = None,
    sense: int = FORWARDS,
    objective: Objective = EFFICIENCY,
    quantities: Iterable[Quantity | str] = (),
    limits: Limits = (),
    turn: float = 0.0,
    froude: float = 0.0,
    regime: Regime = LEVEL,
) -> Replay:
    """Distance, work, rotation and length of a path over one cycle, to a relative error in the
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
    guess : Replay, optional
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
        Froude number L/(g T^2) at which a chain is played, 0.0255 for 1 m in 2 s; what counts is
        its ratio to the friction. 0 is quasi-static motion. With inertia the period is one that
        leaves the momenta as they are (`Replay.stable`); instants and sense do not count.
    regime : Regime
        On a slope, as `problem.regime`: the gait says where it points, the distance is the way in
        the direction that counts, the work that of the joints; gaits may say their pace.

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
    check_finite(positive=True, tolerance=tolerance)
    ends = np.concatenate([[0.0], np.asarray(breaks, dtype=float), [1.0]])
    if not (np.diff(ends) > 0).all():
        raise ProblemError("breaks must rise, and lie between 0 and 1.")
    begin, end = path(np.array([0.0, 1.0]))[0].T
    if not np.allclose(begin, end, rtol=0, atol=_CORNER):
        raise ProblemError("the path is no cycle: it must end at the angles where it begins.")
    integrands = tuple(dict.fromkeys([LENGTH, *objective.integrals, *quantities_of(quantities)]))
    joint_map = getattr(path, "joint_map", None)
    limits = limits_of(limits, joint_map.n_motor if joint_map else body.n_joint)
    regime = replace(regime, froude=froude, free=None) if froude else regime.at(path)
    if not regime.slow_on_level:
        of, paths = (body, friction, path, delta), whole_totals(integrands, path)
        how: Any = {"breaks": breaks, "quantities": integrands}
        if not regime.froude:
            on = GaitOnSlope(*of, regime, **how)
            return on.replay(objective, tolerance, paths, limits, instants)
        moving = GaitWithInertia(*of, froude=regime.froude, turn=turn, regime=regime, **how)
        return moving.replay(objective, tolerance, paths, limits, guess)
    if "period" in objective.uses:
        raise ProblemError(
            f"the objective {objective.name!r} uses the period: give the froude at which it "
            f"is played."
        )
    check_count(MOST_INSTANTS, least=4, instants=instants)
    law = body.law(friction) if isinstance(body, Chain) else friction
    residual, shares = 0.0, np.full(len(limits.names), -np.inf)

    def state_at(t, start, *, whole=False):
        """`Panels` z, rates, joint_power and apart at instants t, from tail velocities ``(3,
        t.size)``; of several motions the nearest, or of a `whole` period the branch in time."""
        nonlocal residual, shares
        angles, rates = path(t.ravel())
        at = body, law, angles, rates, delta
        now, apart = Instants(*at, joint_map=joint_map), np.zeros((3 + len(integrands), t.size))
        if not law.associated and isinstance(body, Chain):
            before = None if whole else start
            start, apart = followed_motion(now, integrands, before=before, sense=sense)
            start = np.nan_to_num(start)
        motion, left_over = accurate_motion(*at, start)
        now = replace(now, z=motion.z)
        residual = float(np.maximum(residual, left_over.max()))
        if limits.names:
            shares = np.maximum(shares, limits.sizes(limits.at(now)).max(axis=1))
        centre = motion.centre[0] + 1j * motion.centre[1]
        densities = [quantity.at(now) for quantity in integrands]
        rows = np.vstack([motion.z[2] - turn, centre, motion.power, *densities])
        results = motion.z, rows, motion.actuator_power, apart
        return tuple(each.T.reshape(*t.shape, *each.shape[:-1]) for each in results)

    edges, t = _first_grid(ends, instants)
    once, place = np.unique(t, return_inverse=True)  # neighbours share an instant
    state = state_at(once, None if guess is None else guess.tail_velocity(once), whole=True)
    values_there = tuple(each[place.reshape(t.shape)] for each in state)
    panels = first_panels(edges[:-1], np.diff(edges), values_there)
    names = "rotation", "distance", "work", *(each.name for each in integrands)
    chord = chord_per_way(turn)
    while True:
        spin, move, *sums = increments(panels)
        heading, place = poses(spin, move)
        way = heading[-1] + turn, max(chord * abs(place[-1]), 1e-300)
        totals = (float(total) for total in (*way, *(part.sum() for part in sums)))
        values = dict(zip(names, totals, strict=True))
        if not values["work"] > 0:
            raise ProblemError(
                "the path does not move, or too little to do work against friction: it has no "
                "efficiency."
            )
        of_halves, one_beside, two_beside = changes(panels, heading, place)
        gaps = remaining_error(one_beside, two_beside, panels.wider).T
        gaps[1] *= chord
        errors = dict(zip(names, gaps, strict=True))
        gap = objective.relative_error(values, errors)
        # finer panels do not make up for what the balance leaves over
        left_over = tolerance - residual if residual < tolerance else np.inf
        halve = _largest(gap, panels.width, left_over)
        if halve.size == 0 or 4 * (panels.left.size + halve.size) > most_instants:
            break
        old = panels.take(halve)
        middles = old.left[:, None] + old.width[:, None] * (np.arange(4) + 0.5) / 4
        if law.associated:
            start = 0.5 * (old.z[:, :-1] + old.z[:, 1:])
        else:  # the branch on which the body is before
            start = old.z[:, :-1] if sense == FORWARDS else old.z[:, 1:]
        halves = old.halves(state_at(middles, start.reshape(-1, 3).T), of_halves[halve])
        panels = panels.take(np.delete(np.arange(gap.size), halve)).join(halves)
    others, several = _other_motions(panels, place)
    phases = panels.left[:, None] + panels.width[:, None] * np.linspace(0.0, 0.75, 4)
    phases[np.isin(panels.left, breaks), 0] += ONE_SIDED
    # what the balance leaves over counts in proportion to each
    sizes = {each.name: each.needs_forces * abs(values[each.name]) for each in integrands}
    sizes = values | {"rotation": 1.0} | sizes
    return Replay(
        values=values,
        errors={name: float(errors[name].sum() + residual * sizes[name]) for name in names},
        others=dict(zip(names, others, strict=True)),
        lever=lever(body, path(phases.ravel())[0]),
        actuator_work=float(((panels.joint_power @ WHOLE[-1]) * panels.width).sum()),
        residual=residual,
        error=float(gap.sum()) + residual,
        several=several,
        instants=4 * panels.left.size,
        tail=(phases.ravel(), panels.z[:, :4].reshape(-1, 3).T),
        shares=shares,
        objective=objective,
    )


def _first_grid(ends: np.ndarray, instants: int) -> tuple[np.ndarray, np.ndarray]:
    """Edges of equal panels between corners, and instants ``(n, 5)``, one-sided there."""
    pieces = [(a, b, 2 * max(1, round(instants * (b - a) / 8))) for a, b in pairwise(ends)]
    edges = np.append(np.concatenate([np.linspace(a, b, n + 1)[:-1] for a, b, n in pieces]), 1.0)
    t = edges[:-1, None] + np.diff(edges)[:, None] * np.linspace(0.0, 1.0, 5)
    t[:, 4] = edges[1:]
    t[np.isin(edges[:-1], ends[1:-1]), 0] += ONE_SIDED
    t[np.isin(edges[1:], ends[1:-1]), 4] -= ONE_SIDED
    return edges, t


def _largest(gap: np.ndarray, width: np.ndarray, tolerance: float) -> np.ndarray:
    """Panels of the largest errors, without which their sum is below the tolerance; and neighbours
    that are not narrower, as halves are judged with instants beside them."""
    order = np.argsort(gap)
    excess = (np.cumsum(gap[order]) > tolerance) & (width[order] > _NARROWEST)
    narrow = np.full(order.size, np.inf)
    narrow[order[excess]] = width[order[excess]]
    beside = np.minimum(np.roll(narrow, 1), np.roll(narrow, -1))
    return np.flatnonzero((width >= beside) | np.isfinite(narrow))


def _other_motions(panels: Panels, place: np.ndarray) -> tuple[list[float], float]:
    """How far others would lead, and the part of the time at which there are some. Of two
    neighbouring instants that counts at which they lead farther; a rotation moves all of the
    way."""
    worse = np.maximum(panels.apart[:, :-1], panels.apart[:, 1:])
    off = np.einsum("n,nki->i", 0.25 * panels.width, worse)
    off[0] += np.abs(place - place[-1]).max() * off[1]
    several = float(0.25 * panels.width @ worse.any(axis=2).sum(axis=1))
    return [off[1].item(), off[0].item(), *off[2:].tolist()], several


def replayer(regime: Regime) -> Callable[..., Replay]:
    """The replay of a regime, with the arguments of `replay`; a regime of one's own has it as
    ``replay``."""
    return getattr(regime, "replay", partial(replay, regime=regime))
