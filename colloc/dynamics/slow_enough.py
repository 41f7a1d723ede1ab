"""Pace at which a gait is quasi-static: the effect of inertia on its efficiency."""

from __future__ import annotations

import numpy as np

from colloc.dynamics.collocated import CollocatedPose, point_weights
from colloc.dynamics.dynamics import OMEGA, Inertial, QuasiStatic, Shapes
from colloc.gaits.objective import chord_per_way
from colloc.gaits.regime import Regime
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.inertia import Path, checked_mass
from colloc.mechanics.law import Law, rate_independent
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.system.arguments import check_finite
from colloc.system.errors import NotConvergedError, ProblemError

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
    near: np.ndarray | None = None,
) -> tuple[float, np.ndarray | None]:
    """Efficiency of a gait in the motion in which all cycles are alike, and its states at the
    points of a mesh whose neighbours share no stage, sought near others or those of the slow
    motion. The distance is the chord of the arc, which does not depend on the phase at which a
    period begins (`colloc.gaits.objective`). `NotConvergedError` if no motion is found."""
    kind = Inertial if froude else QuasiStatic
    angles, rates = gait(mesh.times)
    shapes = Shapes(angles, rates, delta)
    along = kind(body, friction, Regime(froude=froude)).simulate(mesh, shapes, np.empty(0), near)
    if not along.held.all():
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
    known = np.nan
    for intervals in _INTERVALS * 2 ** np.arange(_DOUBLED):
        edges = np.union1d(np.linspace(0.0, 1.0, intervals + 1), np.asarray(breaks, dtype=float))
        mesh = Mesh(scheme(SCHEME), edges)
        before, known = known, _froude(chain, law, gait, mesh, delta, loss)
        if abs(known - before) < _ACCURACY * known:
            return known
    raise NotConvergedError(
        "finer and finer meshes do not agree on what inertia does to this gait; try a larger delta."
    )


def _froude(body: Chain, friction: Law, gait: Path, mesh: Mesh, delta: float, loss: float) -> float:
    """Froude number at which inertia first changes the efficiency by the part `loss`."""
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
