"""What the joints of any gait have to do at least: limits that no gait can keep are told before a search.

Two statements about instants, with the shares of the limits (`colloc.mechanics.actuators.ActuatorLimits`):

- A gait moves at some instant at least as fast as its mean, in some direction of some shape. So it needs no less than the
  smallest share over all shapes and directions at the slowest pace allowed.
- Follow any combination w of the joint angles of a closed path. Where it is largest, the rates are across w. If the path has no
  cusp they do not vanish there, and under dry friction torques do not ask how fast they are. So the gait needs no less than the
  smallest share over all shapes and directions across w. What has cusps nevertheless, an ellipse without width, retraces its
  path, and goes nowhere if the friction is the same forwards and backwards.

The smallest shares are found by samples and climbs from the best of them, and not proved: so a limit is called hopeless only if
it is missed by a margin.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.limits import of_each
from colloc.gaits.problem import Problem
from colloc.mechanics.actuators import ActuatorLimits
from colloc.system.errors import ProblemError

_MARGIN = 0.05
"""Relative, by which the smallest share found may lie above the smallest there is."""
_SAMPLES, _KEPT, _ROUNDS = 2000, 50, 30
_STEP, _SHRINK = 0.4, 0.85
"""First steps of climbs [rad, and of unit directions], and how they shrink from round to round."""
_ANGLES = 16
_PHASES = np.arange(64) / 64


def check_actuators_suffice(problem: Problem) -> None:
    """A `ProblemError` if no gait of a problem keeps the limits on its joints' torques and powers, whatever its efficiency."""
    limits = problem.actuator_limits
    if not limits.names or problem.slope is not None or problem.friction.degree is None or _guess_keeps(problem):
        return
    stated = " and ".join(name for name in ("torque_limit", "power_limit") if getattr(problem, name) is not None)
    distance = max((least for aim, least in problem.at_least if aim.expression == "distance"), default=0.0)
    needed = problem.friction.smallest * distance
    if limits.power and problem.friction.degree == 0 and sum(limits.power) < needed:
        raise ProblemError(
            f"no gait keeps power_limit and goes as far as at_least asks: a distance of {distance:g} takes a power of "
            f"{needed:.3g} on average, and the joints together may deliver {sum(limits.power):.3g}."
        )
    share = least_share(problem)
    if share > 1 + _MARGIN:
        raise ProblemError(
            f"no gait keeps {stated}: whatever the body does, some joint needs about {share:.2g} times what it is allowed. "
            "Allow the joints more than that, or take other links."
        )
    across = least_share_without_cusps(problem)
    if across > 1 + _MARGIN:
        raise ProblemError(
            f"no gait that goes anywhere keeps {stated}: some joint needs about {across:.2g} times what it is allowed, unless "
            "the path is retraced. Allow the joints more than that, or take other links."
        )


def least_share(problem: Problem) -> float:
    """The smallest value that the largest share of the limits takes at instants as fast as the slowest gait on average.

    For laws whose friction does not fall with the speed.

    Examples
    --------
    >>> from colloc import Harmonic, Problem
    >>> round(least_share(Problem("weak", gait=Harmonic(1), torque_limit=0.01)), 1)
    2.1
    """
    return _smallest(problem, problem.actuator_limits, None, _ROUNDS)


def least_share_without_cusps(problem: Problem) -> float:
    """The same of torques, as every gait without cusps needs it somewhere; 0 where the class has others that go anywhere."""
    limits = ActuatorLimits(torque=problem.actuator_limits.torque)
    if not (limits.names and problem.gait.without_cusps and problem.friction.reversible and problem.friction.degree == 0):
        return 0.0
    ways = _combinations(problem.body.n_joint)
    roughly = np.array([_smallest(problem, limits, way, 0) for way in ways])
    most = 0.0
    for k in roughly.argsort()[::-1]:
        if roughly[k] <= most:  # climbs only lower it
            break
        most = max(most, _smallest(problem, limits, ways[k], _ROUNDS))
    return most


def _guess_keeps(problem: Problem) -> bool:
    """Whether the guess, which is a member of the class or near one, keeps the limits at some phases."""
    angles, rates = problem.guess(_PHASES)
    return bool(_largest(problem, problem.actuator_limits, angles, rates).max() <= 1.0)


def _combinations(n_joint: int) -> np.ndarray:
    """Unit vectors ``(n, n_joint)``: of two joints in all directions, else of single joints and of neighbours."""
    if n_joint == 2:
        angle = np.pi * np.arange(_ANGLES) / _ANGLES
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)
    unit = np.eye(n_joint)
    pairs = [(unit[i] + side * unit[i + 1]) / np.sqrt(2) for i in range(n_joint - 1) for side in (1, -1)]
    return np.array([*unit, *pairs])


def _largest(problem: Problem, limits: ActuatorLimits, angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """The largest share at instants, ``(n,)``; infinite at shapes that are forbidden."""
    body, law = problem.body, problem.friction
    delta = problem.delta * (np.linalg.norm(rates, axis=0).mean() if problem.gait.unit_speed else 1.0)
    shares = limits.shares_in_balance(body, law, angles, rates, body.solve(law, angles, rates, delta).z, delta)
    found = np.where(np.isfinite(limits.least)[:, None], np.abs(shares), shares).max(axis=0)
    return np.where(body.crossing_depth(angles) > 0, np.inf, found)


def _smallest(problem: Problem, limits: ActuatorLimits, across: np.ndarray | None, rounds: int) -> float:
    """Of the largest share, over shapes and directions, or directions across a vector ``(n_joint,)``; with so many rounds of
    climbs from the best samples."""
    n, rng = problem.body.n_joint, np.random.default_rng(0)
    most = np.array(of_each(problem.joint_limit, n))[:, None]
    pace = 2 * np.pi * problem.smallest_shape_speed

    def shares(angles: np.ndarray, ways: np.ndarray) -> np.ndarray:
        return _largest(problem, limits, angles, pace * ways)

    def directions(vectors: np.ndarray) -> np.ndarray:
        if across is not None:
            vectors = vectors - across[:, None] * (across @ vectors)
        return vectors / np.linalg.norm(vectors, axis=0)

    angles, ways = rng.uniform(-most, most, (n, _SAMPLES)), directions(rng.normal(size=(n, _SAMPLES)))
    found = shares(angles, ways)
    best = found.argsort()[:_KEPT]
    angles, ways, found, step = angles[:, best], ways[:, best], found[best], _STEP
    for _ in range(rounds):
        nearby = np.clip(angles + step * rng.normal(size=angles.shape), -most, most)
        turned = directions(ways + step * rng.normal(size=ways.shape))
        values = shares(nearby, turned)
        better = values < found
        angles[:, better], ways[:, better], found[better] = nearby[:, better], turned[:, better], values[better]
        step *= _SHRINK
    return float(found.min())
