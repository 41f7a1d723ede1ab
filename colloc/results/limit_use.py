"""Utilisation of the limits of a problem by a gait, and limits that no gait could reach."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from colloc.gaits.harmonic import Harmonic
from colloc.gaits.limits import joint_ranges, of_each, under_one_limit
from colloc.gaits.problem import Problem
from colloc.gaits.robot import SPEED_OF_ROBOT
from colloc.mechanics.balance import largest_moments
from colloc.mechanics.chain import Chain
from colloc.mechanics.densities import Instants
from colloc.mechanics.law import rate_independent
from colloc.results.robot import joint_torques
from colloc.results.solution import Solution

_INSTANTS = np.arange(2000) / 2000
_BINDS, _MARGIN = 0.99, 1.01  # share of a limit at which it binds; of a bound at which it cannot
_FIELDS = {"joint speed": "speed_limit", "torque": "torque_limit", "power": "power_limit"}


class _Unit(NamedTuple):
    name: str  # of the limit as it was stated
    text: str
    size: float = 1.0  # of the problem's unit


def _units(problem: Problem) -> dict[str, _Unit]:
    units = {
        "speed_limit": _Unit("speed_limit", "rad per period"),
        "torque_limit": _Unit("torque_limit", "weight x body length"),
        "power_limit": _Unit("power_limit", "weight x body length per period"),
    }
    if (robot := problem.robot) is not None:
        for field, stated, text in (
            ("speed_limit", "max_speed", "rad/s"),
            ("torque_limit", "max_torque", "N m"),
        ):
            if (limit := getattr(robot, stated)) is not None:
                size = np.ravel(limit)[0] / np.ravel(getattr(problem, field))[0]
                units[field] = _Unit(stated, text, float(size))
    return units


def shares(solution: Solution) -> dict[str, float]:
    """Largest utilisation of every limit over a period, by name; empty for default limits."""
    problem, body, limits = solution.problem, solution.problem.body, solution.problem.path_limits
    limited = problem.joint_limit != body.defaults.limit or limits.each or problem.largest_speeds
    if not (problem.gait.free and limited):
        return {}
    motion = solution.sample(_INSTANTS)
    stretched, limit = under_one_limit(motion.angles, problem.joint_limit)
    name = body.defaults.limit_name.replace("limits", "angles")
    used = {name: float(body.bounded_angles.largest(stretched).max()) / limit}
    if problem.largest_speeds:
        fastest = np.abs(solution.gait.motor_gait.rates(_INSTANTS)).max(axis=1)
        used["joint speed"] = float((fastest / problem.largest_speeds).max())
    if limits.each:
        forces = limits.needs_forces
        z, load = (motion.z, problem.regime.pull(motion.theta[None])) if forces else (None, None)
        at = (body, problem.law, motion.angles, motion.rates, solution.delta_per_period)
        now = Instants(*at, z, load=load, joint_map=problem.joint_map)
        if forces and problem.froude:
            moments = joint_torques(solution, _INSTANTS, motion)
            now = Instants(*at, moments=moments, froude=solution.froude)
        each_used = iter(limits.sizes(limits.at(now)).max(axis=1))
        used |= {x.name: max(float(next(each_used)) for _ in x.names) for x in limits.each}
    return used


def lines(solution: Solution) -> list[str]:
    """Utilisations in a line, and a line for each limit that seems to be in other units."""
    used, texts, units = shares(solution), [], _units(solution.problem)
    for name, share in used.items():
        text = f"{name} {100 * share:.{0 if share >= 0.01 else 2}f} %"
        field = _FIELDS.get(name, "")
        limit, unit = getattr(solution.problem, field, None), units.get(field)
        robot = solution.problem.robot
        if robot is not None and name == SPEED_OF_ROBOT:
            limit, unit = robot.max_speed, _Unit("max_speed", "rad/s")
        if unit and limit and not isinstance(limit, tuple):
            text += f" of {limit * unit.size:g} {unit.text}"
        texts.append(text)
    if not used:
        return []
    if solution.problem.joint_map is not None:  # motors share what their joints need
        return [", ".join(texts)]
    return [", ".join(texts), *_hints(solution.problem, used.get("joint speed", 0.0))]


def _hints(problem: Problem, speed_used: float) -> Iterator[str]:
    """Limits that cannot bind: torques by statics where no link is accelerated, speeds of a Fourier
    series by Bernstein's inequality, powers by both. Binding speed limits: in a period a joint
    swings to and fro by half of what it can cover."""
    n, gait, limit = problem.body.n_joint, problem.gait, problem.joint_limit
    half = 0.5 * np.ptp(joint_ranges(limit, n), axis=1)
    torque, speed = np.full(n, np.inf), np.full(n, np.inf)
    if not problem.froude and isinstance(problem.body, Chain) and rate_independent(problem.law):
        torque = largest_moments(problem.body, problem.friction, problem.grade)
    if isinstance(gait, Harmonic) and problem.body.bounded_angles.rows.shape == (n, n):
        speed = 2 * math.pi * gait.harmonics * half
    power = torque * np.minimum(speed, problem.largest_speeds or np.inf)
    units = _units(problem)
    for (field, unit), bound in zip(units.items(), (speed, torque, power), strict=True):
        limit = getattr(problem, field)
        if not isinstance(limit, tuple):  # of all joints: it matters if it does to one of them
            bound = bound.max(keepdims=True)
        stated = of_each(limit, bound.size)
        if stated and (np.array(stated) > _MARGIN * bound).any():
            joint = int(np.argmax(stated / bound))
            of = f" of joint {joint + 1}" * isinstance(limit, tuple)
            yield (
                f"{unit.name} {unit.size * stated[joint]:g}{of} cannot matter: no gait needs more "
                f"than {unit.size * bound[joint]:.3g} {unit.text}, its unit"
            )
    if speed_used > _BINDS:
        most = np.array(problem.largest_speeds) / 2
        joint = int(np.argmin(most / half))
        if most[joint] < 2 * half[joint]:
            swing, largest = np.degrees([most[joint], 2 * half[joint]])
            unit = units["speed_limit"]
            yield (
                f"{unit.name} {2 * unit.size * most[joint]:g} {unit.text}, its unit, lets a joint "
                f"swing by {swing:.3g} of {largest:.3g} degrees at most"
            )
