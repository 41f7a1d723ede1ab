"""NaN, infinity and nonsense, wherever numbers come in: one clear sentence, never a traceback or a
silent answer."""

import numpy as np
import pytest

from colloc import Chain, Friction, Harmonic, Problem, ProblemError, ellipse, replay, solve_balance
from colloc.gaits.harmonic import Fourier
from colloc.smooth.balance import solve_smooth
from colloc.smooth.motion import sine_wave
from scripts.models.velocity_map import velocity_map

BAD = [float("nan"), float("inf"), -float("inf")]
BODY, LAW, GAIT = Chain(), Friction(), ellipse(0.3, 1.0, 0.5)


def path_of(angles, rates):
    return lambda t: (np.full((2, t.size), angles), np.full((2, t.size), rates))


def with_one(value):
    array = np.ones((2, 4))
    array[1, 2] = value
    return array


ENTRIES = {
    "mu_t": lambda v: Friction(mu_t=v),
    "mu_f": lambda v: Friction(mu_f=v),
    "mu_b": lambda v: Friction(mu_b=v),
    "lengths": lambda v: Chain((v, 0.5, 0.5)),
    "mean": lambda v: ellipse(v, 1.0, 1.0),
    "cos": lambda v: ellipse(0.0, v, 1.0),
    "sin": lambda v: Fourier([0, 0], [[1], [1]], [[v], [1]]),
    **{
        field: (lambda v, field=field: Problem("p", GAIT, **{field: v}))
        for field in (
            "delta",
            "delta_start",
            "joint_limit",
            "smallest_shape_speed",
            "mesh_tolerance",
            "intervals",
        )
    },
    "harmonics": lambda v: Harmonic(v),
    "angles": lambda v: solve_balance(BODY, LAW, with_one(v), np.ones((2, 4)), 1e-3),
    "rates": lambda v: solve_balance(BODY, LAW, np.ones((2, 4)), with_one(v), 1e-3),
    "start": lambda v: solve_balance(
        BODY, LAW, np.ones((2, 4)), np.ones((2, 4)), 1e-3, start=np.full((3, 4), v)
    ),
    "delta of a balance": lambda v: solve_balance(BODY, LAW, np.ones((2, 4)), np.ones((2, 4)), v),
    "tolerance": lambda v: solve_balance(
        BODY, LAW, np.ones((2, 4)), np.ones((2, 4)), 1e-3, tolerance=v
    ),
    "angles of a path": lambda v: replay(BODY, LAW, path_of(v, 1.0), 1e-3),
    "rates of a path": lambda v: replay(BODY, LAW, path_of(1.0, v), 1e-3),
    "delta of a replay": lambda v: replay(BODY, LAW, path_of(1.0, 1.0), v),
    "delta of a map": lambda v: velocity_map(BODY, LAW, v, n_angle=4, n_ratio=3),
    "delta of a smooth body": lambda v: solve_smooth(sine_wave(), LAW, np.array([0.1]), v),
}


@pytest.mark.parametrize("value", BAD, ids=str)
@pytest.mark.parametrize("entry", ENTRIES)
def test_not_a_number_and_infinity_are_refused(entry, value):
    with pytest.raises(ProblemError) as caught:
        ENTRIES[entry](value)
    assert len(str(caught.value)) > 15


@pytest.mark.parametrize(
    "arguments",
    [
        {"angles": "bent"},
        {"angles": np.ones((2, 4)) * 1j},
        {"angles": [[1.0, 2.0], [3.0]]},
        {"rates": None},
        {"delta": "1e-3"},
        {"delta": None},
        {"tolerance": -1.0},
        {"tolerance": 0},
    ],
    ids=str,
)
def test_things_that_are_not_numbers_are_refused(arguments):
    given = {"angles": np.ones((2, 4)), "rates": np.ones((2, 4)), "delta": 1e-3, **arguments}
    with pytest.raises(ProblemError):
        solve_balance(BODY, LAW, **given)


def test_no_instants_give_no_answers():
    assert solve_balance(BODY, LAW, np.zeros((2, 0)), np.zeros((2, 0)), 1e-3).z.shape == (3, 0)


def test_a_gait_that_does_not_move_has_no_efficiency():
    with pytest.raises(ProblemError, match="does not move"):
        replay(BODY, LAW, path_of(0.7, 0.0), 1e-4)


@pytest.mark.parametrize("instants", [0, 3, 7, -2])
def test_a_grid_that_cannot_be_halved_is_refused(instants):
    with pytest.raises(ProblemError, match="even"):
        replay(BODY, LAW, path_of(0.7, 0.2), 1e-4, instants=instants)
