"""What the library found when its results had been checked by other means, for inputs of many
kinds: it finds that still, through public names alone.

Not a proof of anything, but whatever changes a digit of these results is noticed: a fault, or a
change that was meant and has to be looked at. They are recorded anew by

    python -m tests.recorded.test_recorded_results
"""

import json
from pathlib import Path

import numpy as np
import pytest

import colloc
from colloc import Chain, Concertina, Foot, Fourier, Friction, ModalBody, Pad, Problem, Wave, Wheel
from colloc.mechanics.solution_branches import all_balanced_velocities
from colloc.smooth.balance import solve_smooth
from colloc.verification.trajectory import plan_trajectory
from tests.shared.cases import slow_but
from tests.shared.mechanics import numpy_instead, with_inertia

KNOWN = Path(__file__).with_name("known.json")
EQUAL, UNEQUAL = Friction(), Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
STEEP, ALONG = Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0), Friction(mu_t=4.0, mu_f=1.0, mu_b=1.0)
ODD = Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3))
FIVE = Chain((0.1, 0.3, 0.2, 0.25, 0.15))
FEET = Chain(feet=(Foot(0), Pad(1, 0.1, 0.6), Wheel(2, 0.3, rolling=0.1)))
SKEW = Fourier([0.3, -0.2], [[1.2], [0.3]], [[0.2], [1.0]])
MODES = Fourier(np.zeros(3), [[1.0], [0.0], [0.2]], [[0.0], [0.9], [0.1]])
FOUR = Fourier(
    [0.1, 0.0, -0.2], [[0.8, 0.1], [0.2, 0.0], [-0.7, 0.1]], [[0.1, 0.0], [0.9, 0.2], [0.2, -0.1]]
)
SQUARE = colloc.Corners(np.array([[0.9, -0.3, -0.9, 0.3], [0.2, 0.8, -0.2, -0.8]]))
OPEN = Fourier([-0.7, -0.4], [[0.3, -0.5], [-0.4, -0.2]], [[-1.6, -0.2], [-0.7, 2.7]])
"""Runs through shapes with several balanced motions where friction is `STEEP`."""
BALANCES = {
    "equal": (Chain(), EQUAL, 1e-3),
    "dry": (Chain(), UNEQUAL, 1e-8),
    "weights": (ODD, UNEQUAL, 1e-3),
    "five links": (FIVE, Friction(mu_t=0.5, mu_f=1.0, mu_b=5.0), 1e-3),
    "feet": (FEET, UNEQUAL, 1e-3),
    "elliptic": (Chain(), colloc.Elliptic(mu_t=1.7, mu_f=1.0, mu_b=1.3), 1e-2),
    "power law": (ODD, colloc.PowerLaw(0.5, mu_t=2.0, mu_f=1.0), 1e-2),
    "viscous": (FIVE, colloc.Viscous(normal=1.7, tangential=1.0), 1e-2),
}
REPLAYS = {
    "ellipse": (Chain(), EQUAL, colloc.ellipse(0.0, 2.8, 1.25), 1e-3),
    "weights": (ODD, UNEQUAL, SKEW, 1e-3),
    "four links": (Chain((0.2, 0.3, 0.3, 0.2)), UNEQUAL, FOUR, 1e-3),
    "several motions": (Chain(), STEEP, OPEN, 1e-4),
    "feet": (FEET, UNEQUAL, SKEW, 1e-2),
    "modes": (ModalBody(modes=3), ALONG, MODES, 1e-2),
    "Fourier modes": (ModalBody(modes=2, basis="fourier"), ALONG, SKEW.scaled(0.5), 1e-2),
}
PRESCRIBED = {
    "bump": Concertina(epsilon=0.1, amplitude=1.2, share=0.3, backwards=True),
    "two bumps": Concertina(0.08, 1.1, 0.6, bumps=2),
    "sine": Wave("sine", 0.8, 1.3),
    "tanh": Wave("tanh", 1.2, 2.0, 8.0),
}


def replayed(body, law, gait, delta, **settings):
    if isinstance(body, ModalBody):
        settings |= {"instants": 40, "tolerance": 1e-3}
    found = colloc.replay(body, law, gait, delta, **{"tolerance": 1e-4, **settings})
    return [found.distance, found.work, found.rotation]


def balance(name):
    body, law, delta = BALANCES[name]
    rng = np.random.default_rng(4)
    angles, rates = rng.uniform(-2, 2, (body.n_joint, 5)), rng.normal(size=(body.n_joint, 5))
    with numpy_instead():
        slow = colloc.solve_balance(body, law, angles, rates, delta).z
    found = colloc.solve_balance(body, law, angles, rates, delta).z
    np.testing.assert_allclose(found, slow, atol=1e-8)
    return found.ravel()


def every_motion():
    rng = np.random.default_rng(12)
    angles, rates = rng.uniform(-2.5, 2.5, (2, 30)), rng.normal(size=(2, 30))
    found = all_balanced_velocities(Chain(), STEEP, angles, rates, 1e-4)
    return [*found.number, *np.nansum(found.z, axis=(1, 2))]


def corners():
    body, law = Chain((0.25, 0.45, 0.3)), Friction(mu_t=3.0, mu_f=1.0, mu_b=1.0)
    return replayed(body, law, SQUARE, 1e-3, breaks=SQUARE.corner_phases)


def objectives_and_small_delta():
    numbers = []
    for objective in ("turning", "driven efficiency", "distance / length"):
        asked = {"objective": objective, "rotation": None, "delta": 1e-2, "mesh_tolerance": 1e-3}
        known = colloc.evaluate(Problem("x", None, Chain(), UNEQUAL, **asked), SKEW).certificate
        numbers += [known.value, known.value_at_zero_delta]
    return numbers


def slope_and_inertia():
    at = Chain(), UNEQUAL, SKEW, 0.1
    steep = colloc.slope_motion(*at, 0.2, heading=1.0, periods=2, tolerance=1e-6)
    fast = with_inertia(*at, 0.2, tolerance=1e-6)
    moved = [*steep.climb, *steep.aside, *steep.joint_work, *steep.friction_work]
    return [*moved, fast.distance, fast.work, fast.rotation]


def smooth(name):
    motion, t = PRESCRIBED[name].prescribed(), np.array([0.05, 0.22, 0.4])
    return solve_smooth(motion, UNEQUAL, t, 1e-2).require().z.ravel()


def crawler():
    body = colloc.CrawlerBody(epsilon=0.12, share=0.4, modes=3, panels=6, order=5)
    corners = colloc.Corners(body.concertina(amplitude=1.1, sides=9))
    return replayed(body, UNEQUAL, corners, 1e-2, breaks=corners.corner_phases)


def trajectories():
    fast, slow = (plan_trajectory(SKEW, 20.0, t, limits=(2.0, 1.5)) for t in (None, 9.0))
    return [fast.period, *fast.angles[:, ::9].ravel(), *slow.speeds[:, ::40].ravel()]


CASES = {
    **{f"balance, {name}": lambda name=name: balance(name) for name in BALANCES},
    **{f"replay, {name}": lambda name=name: replayed(*REPLAYS[name]) for name in REPLAYS},
    **{f"smooth, {name}": lambda name=name: smooth(name) for name in PRESCRIBED},
    "every motion": every_motion,
    "corners": corners,
    "objectives": objectives_and_small_delta,
    "slope and inertia": slope_and_inertia,
    "crawler": crawler,
    "trajectories": trajectories,
}


def assert_same(name, found, known):
    precision = 1e-4 if name in ("slope and inertia", "objectives") else 1e-6
    np.testing.assert_allclose(found, known, rtol=precision, atol=1e-7)


@pytest.mark.parametrize("name", slow_but([name for name in CASES if name != "crawler"], CASES))
def test_a_result_is_what_it_was(name):
    assert_same(name, CASES[name](), json.loads(KNOWN.read_text(encoding="utf-8"))[name])


if __name__ == "__main__":
    known = json.loads(KNOWN.read_text(encoding="utf-8")) if KNOWN.exists() else {}
    for name, case in CASES.items():
        found = [float(f"{x:.12g}") for x in case()]
        try:
            assert_same(name, found, known[name])
        except (KeyError, AssertionError) as error:
            print(f"new or changed: {name}: {error}")
            known[name] = found
    lines = (f"{json.dumps(name)}: {json.dumps(known[name])}" for name in CASES)
    KNOWN.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
