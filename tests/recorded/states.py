"""Results in many states whose words and numbers are recorded, made in a tenth of a second each: a
gait that is measured, or a guess in balance with round numbers for a certificate."""

from dataclasses import replace

import numpy as np

import colloc
from colloc import Chain, Fourier, Friction, Harmonic, Problem, Robot, Solution, Viscous
from colloc.results.answer import Alternative
from colloc.results.checks import Certificate, Check
from tests.conftest import guess_in_balance

LOOP = colloc.ellipse(0.0, 1.2, 0.8)
SKEW = Fourier([0.3, -0.2], [[1.2], [0.3]], [[0.2], [1.0]])
LEANING = Fourier([0.1, -0.1], [[1.2], [0.1]], [[0.0], [-0.8]], theta=0.3)
SWUNG = Fourier([0.1, 0.2], [[0.0, 0.0], [0.5, 0.0]], [[1.0, 0.25], [0.4, 0.0]])
LAG = 0.4 * np.pi * np.arange(4)[:, None]
RUNNING = Fourier(np.zeros(4), 1.2 * np.cos(LAG), 1.2 * np.sin(LAG))
UNEQUAL = Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
STANDING = Chain(feet=(colloc.Foot(0), colloc.Pad(1, 0.1, 0.6), colloc.Wheel(2, 0.3, rolling=0.1)))
ONE = Robot(length=1, mass=2, period=50, max_speed=2, max_torque=(2.5, 1.5), idle_power=0.01)
STATED = {
    "loop": {},
    "flat": {"guess": LOOP.scaled(0.15)},
    "limited": {
        "joint_limit": (1.6, (-1.5, 2.0)),
        "speed_limit": 14.0,
        "torque_limit": (0.04, 0.06),
        "power_limit": 2.0,
    },
    "weak": {"joint_limit": 2.0, "speed_limit": (5.2, 40.0), "torque_limit": 1.5, "guess": SWUNG},
    "robot": {"robot": ONE, "at_least": (("distance", 0.1),), "joint_limit": 2.0},
    "small": {"robot": ONE, "joint_limit": 2.0, "guess": LOOP.scaled(0.7)},
    "turning": {"friction": UNEQUAL, "rotation": None, "guess": SKEW},
    "swimmer": {"friction": Viscous(normal=2, tangential=1), "objective": "towing"},
    "wrong": {"friction": Viscous(normal=2, tangential=1), "objective": "towing"},
    "brakes": {"gait": Harmonic(2), "froude": 0.5, "guess": SWUNG},
    "stuck": {
        "body": Chain((0.2, 0.3, 0.3, 0.2)),
        "gait": colloc.Coupled(Harmonic(1), stuck={1: 0.4}),
        "robot": replace(ONE, period=60, max_torque=1.5, backlash=1.5),
    },
    "feet": {"body": STANDING, "guess": SKEW, "friction": UNEQUAL},
    "slope": {
        "grade": 0.1,
        "towards": 0.5,
        "friction": Friction(mu_t=8.0),
        "robot": replace(ONE, period=5),
        "guess": LEANING,
    },
    "snake": {
        "body": Chain((0.2,) * 5, width=0.03),
        "friction": Friction(mu_t=10.0),
        "guess": RUNNING,
    },
    "climb": {
        "grade": 0.05,
        "guess": LEANING,
        "friction": colloc.Elliptic(mu_t=2.0, mu_f=1.0, mu_b=1.0),
    },
    "pace": {
        "froude": colloc.Free(0.01, 0.5),
        "objective": "distance / (work + 0.1 * period)",
        "guess": Fourier([0.1, 0.2], [[0.0], [0.5]], [[1.0], [0.4]], log_period=0.5 * np.log(100)),
    },
    "sought": {
        "robot": replace(ONE, period=(1.0, 20.0)),
        "guess": Fourier([0.1, 0.2], [[0.0], [0.5]], [[1.0], [0.4]], log_period=3.0),
    },
    "waves": {
        "body": colloc.ModalBody(2, panels=4),
        "friction": Friction(mu_t=3.0),
        "gait": Harmonic(1, "antipodal"),
        "guess": Fourier([0.0, 0.0], [[0.6], [0.0]], [[0.0], [0.5]]),
    },
}
GUESSES = {
    "brakes": 0.0256,
    "feet": 0.31,
    "slope": 0.18,
    "climb": 0.083,
    "snake": 0.4,
    "pace": 0.0135,
    "sought": 0.0132,
    "waves": 0.06,
}
"""Those that are not measured, and how far they go in a cycle, roughly."""


MADE: dict[str, Solution] = {}


def round_certificate(problem: Problem) -> Certificate:
    values = {each.name: 1.25 for each in problem.integrals}
    values |= {"distance": GUESSES[problem.name], "work": 1.07, "rotation": 0.0}
    checks = [Check("closure", -2e-10, 1e-9, "joint angles after one cycle [rad]")]
    if problem.name == "slope":
        checks.append(Check("direction", 3e-3, 1e-3, "direction of travel, off the requested one"))
    return Certificate(
        values=values, errors={"distance": 1e-3, "work": 2e-3}, others={}, checks=tuple(checks),
        instants=1600, efficiency_error=5e-3, efficiency_at_zero_delta=0.24,
        error_at_zero_delta=6e-3, value=0.21, value_error=3e-3, value_at_zero_delta=0.22,
        value_error_at_zero_delta=4e-3,
    )  # fmt: skip


def state(name: str) -> Solution:
    """The result of this name, made once."""
    if name not in MADE:
        MADE[name] = _made(name)
    return MADE[name]


def _made(name: str) -> Solution:
    how = {"gait": Harmonic(1), "delta": 1e-2} | STATED[name]
    gait = how.pop("guess", LOOP)
    if name not in GUESSES:
        measured = colloc.evaluate(Problem(name, **how), gait)
        known = measured.certificate
        farther = known.values | {"distance": known.distance * (1 + (name == "wrong"))}
        return replace(measured, certificate=replace(known, values=farther))
    guess = guess_in_balance(Problem(name, gait, **how))
    answer = replace(guess.answer, optimal=True, kkt_error=2e-9, violation=3e-10)
    known = {"certificate": round_certificate(guess.problem), "message": ""}
    if name == "feet":  # the best of some
        values = ((0.444, 4, False), (0.3, 2, False), (0.2, 1, True))
        others = (Alternative(x, 2e-3, n, small, guess.gait) for x, n, small in values)
        known |= {"starts": 7, "others": tuple(others)}
    return replace(guess, answer=answer, **known)
