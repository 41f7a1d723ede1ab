"""What the joints of any gait have to do at least: limits that no gait can keep are told before a
search.

Two statements about instants, with the shares of the limits
(`colloc.mechanics.densities.PathLimits`):

- A gait moves at some instant at least as fast as its mean, in some direction of some shape. So it
  needs no less than the smallest share over all shapes and directions at the slowest pace allowed.
- The tangent of a closed path of two joints that has no cusps takes every direction, and under dry
  friction torques do not ask how fast it is followed. So such a gait needs no less than the
  largest, over the directions, of the smallest share over the shapes. What has cusps nevertheless,
  an ellipse without width, retraces its path, and goes nowhere if the friction is the same forwards
  and backwards.

The smallest shares are found, not proved, so a limit is called hopeless only if it is missed by a
margin. That links must not cross is left out, which makes them no larger.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from colloc.gaits.limits import of_each, of_each_angle
from colloc.gaits.problem import Problem
from colloc.mechanics.densities import Instants, PathLimits, torque_and_power
from colloc.reduced.density_slopes import density_slopes
from colloc.system.errors import ProblemError

_MARGIN = 0.05
"""Relative, by which the smallest share found may lie above the smallest there is."""
_SAMPLES, _STARTS = 2000, 10
"""Instants at random, and of these the best, from which a smaller share is searched for by
SLSQP."""
_ITERATIONS, _ACCURACY = 100, 1e-4
_DIRECTIONS, _SHAPES = 16, 61
"""Directions of the tangent of a path of two joints, and shapes along each of these joints."""
_PHASES = np.arange(64) / 64


def check_actuators_suffice(problem: Problem) -> None:
    """A `ProblemError` if no gait of a problem keeps the limits on its joints' torques and powers,
    whatever its efficiency."""
    limits = _motors(problem)
    if (
        not limits.names
        or not problem.regime.slow_on_level
        or problem.law.degree is None
        or _guess_keeps(problem)
    ):
        return
    stated = " and ".join(
        name for name in ("torque_limit", "power_limit") if getattr(problem, name) is not None
    )
    distance = max(
        (least for aim, least in problem.at_least if aim.expression == "distance"), default=0.0
    )
    needed = problem.law.smallest * distance
    power = of_each(problem.power_limit, problem.body.n_joint)
    if power and problem.law.degree == 0 and sum(power) < needed:
        raise ProblemError(
            f"no gait keeps power_limit and goes as far as at_least asks: a distance of "
            f"{distance:g} takes a power of "
            f"{needed:.3g} on average, and the joints together may deliver {sum(power):.3g}."
        )
    share = least_share(problem, enough=1.0)
    if share > 1 + _MARGIN:
        raise ProblemError(
            f"no gait keeps {stated}: whatever the body does, some joint needs about {share:.2g} "
            f"times what it is allowed. "
            "Allow the joints more than that, or take other links."
        )
    share = least_share_without_cusps(problem)
    if share > 1 + _MARGIN:
        raise ProblemError(
            f"no gait that goes anywhere keeps torque_limit: some joint needs about {share:.2g} "
            f"times what it is allowed, "
            "unless the path is retraced. Allow the joints more than that, or take other links."
        )


def least_share(problem: Problem, enough: float = 0.0) -> float:
    """The smallest value that the largest share of the limits takes at instants as fast as the
    slowest gait on average.

    For laws whose friction does not fall with the speed. The search ends at a value that is small
    `enough`.

    Examples
    --------
    >>> from colloc import Harmonic, Problem
    >>> round(least_share(Problem("weak", gait=Harmonic(1), torque_limit=0.01)), 1)
    2.1
    """
    rng, n = np.random.default_rng(0), problem.body.n_joint
    y = rng.uniform(-0.5 * np.pi, 0.5 * np.pi, (n, _SAMPLES)) * rng.uniform(size=_SAMPLES)
    directions = rng.normal(size=(n, _SAMPLES))
    samples = np.concatenate([y, directions / np.linalg.norm(directions, axis=0)])
    found = _shares(problem, _motors(problem), *_instants(problem, samples)).max(axis=0)
    best = float(found.min())
    for k in found.argsort()[:_STARTS]:
        if best <= enough:
            break
        best = min(best, _descended(problem, samples[:, k], found[k]))
    return best


def least_share_without_cusps(problem: Problem) -> float:
    """The same of torques, as every gait without cusps needs it somewhere; 0 where the class has
    others that go anywhere."""
    limits, law = (
        PathLimits(tuple(each for each in _motors(problem).each if each.name == "torque")),
        problem.law,
    )
    if not (
        limits.names
        and problem.gait.without_cusps
        and problem.body.n_joint == 2
        and law.reversible
        and law.degree == 0
    ):
        return 0.0
    each = (np.linspace(-most, most, _SHAPES) for most in of_each_angle(problem.joint_limit, 2))
    shapes = np.stack(np.meshgrid(*each)).reshape(2, -1)
    turns = np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    ways = _slowest_pace(problem) * np.stack([np.cos(turns), np.sin(turns)])
    return max(
        float(_shares(problem, limits, shapes, way[:, None] + 0 * shapes).max(axis=0).min())
        for way in ways.T
    )


def _slowest_pace(problem: Problem) -> float:
    """Shape speed [rad per period] of the slowest gaits allowed, on average."""
    return 2 * np.pi * problem.smallest_shape_speed


def _guess_keeps(problem: Problem) -> bool:
    """Whether the guess, which is a member of the class or near one, keeps the limits at some
    phases."""
    return bool(_shares(problem, _motors(problem), *problem.guess(_PHASES)).max() <= 1.0)


def _instants(problem: Problem, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles and rates ``(n_joint, n)`` at the slowest pace of samples (y, direction) ``(2 n_joint,
    n)``: angles are ``limit sin y``, so that they need no bounds."""
    n = problem.body.n_joint
    most = np.array(of_each_angle(problem.joint_limit, n))[:, None]
    return most * np.sin(samples[:n]), _slowest_pace(problem) * samples[n:]


def _delta(problem: Problem, rates: np.ndarray) -> float:
    """Regularisation speed per period."""
    return problem.delta * (
        float(np.linalg.norm(rates, axis=0).mean()) if problem.gait.relative_delta else 1.0
    )


def _motors(problem: Problem) -> PathLimits:
    """Limits on torques and powers; what others there are need not grow with the pace."""
    n_joint = problem.body.n_joint
    return PathLimits(
        torque_and_power(
            of_each(problem.torque_limit, n_joint), of_each(problem.power_limit, n_joint)
        )
    )


def _senses(limits: PathLimits) -> np.ndarray:
    """``(n_row, n_share)``: shares to what must not exceed 1; moments count in both senses."""
    unit = np.eye(len(limits.names))
    return np.concatenate([unit, -unit[np.isfinite(limits.least)]])


def _shares(
    problem: Problem, limits: PathLimits, angles: np.ndarray, rates: np.ndarray
) -> np.ndarray:
    """In every sense that counts, ``(n_row, n)``."""
    return np.asarray(_senses(limits) @ limits.at(_balanced(problem, angles, rates)))


def _balanced(problem: Problem, angles: np.ndarray, rates: np.ndarray) -> Instants:
    body, law, delta = problem.body, problem.law, _delta(problem, rates)
    return Instants(body, law, angles, rates, delta, z=body.solve(law, angles, rates, delta).z)


def _descended(problem: Problem, start: np.ndarray, value: float) -> float:
    """The largest share where SLSQP ends that makes it small from a sample (y, direction) ``(2
    n_joint,)``; what it has there.

    Variables are (y, direction, s); s is what all shares are below, in units of the first value.
    """
    n, limits = problem.body.n_joint, _motors(problem)
    on_angles, on_rates = (
        np.array(of_each_angle(problem.joint_limit, n)),
        np.full(n, _slowest_pace(problem)),
    )

    def room(x: np.ndarray) -> np.ndarray:
        return x[-1] - _shares(problem, limits, *_instants(problem, x[:-1, None]))[:, 0] / value

    from scipy.optimize import minimize

    def room_slopes(x: np.ndarray) -> np.ndarray:
        slopes = (
            _senses(limits)
            @ density_slopes(limits, _balanced(problem, *_instants(problem, x[:-1, None])))[
                :, :-1, 0
            ]
            / value
        )
        on_x = slopes * np.concatenate([on_angles * np.cos(x[:n]), on_rates])
        return np.concatenate([-on_x, np.ones((len(on_x), 1))], axis=1)

    def on_direction(x: np.ndarray) -> np.ndarray:
        return np.concatenate([np.zeros(n), 2 * x[n:-1], [0.0]])

    kept: list[dict[str, Any]] = [
        {"type": "ineq", "fun": room, "jac": room_slopes},
        {"type": "eq", "fun": lambda x: x[n:-1] @ x[n:-1] - 1, "jac": on_direction},
    ]
    search = partial(
        minimize,
        constraints=kept,
        method="SLSQP",
        options={"maxiter": _ITERATIONS, "ftol": _ACCURACY},
    )
    x = search(lambda x: x[-1], np.append(start, 1.0), jac=lambda x: np.eye(2 * n + 1)[-1]).x[:-1]
    x[n:] /= np.linalg.norm(x[n:])
    ended = float(_shares(problem, limits, *_instants(problem, x[:, None])).max())
    return ended if ended < value else value  # also where it is not a number
