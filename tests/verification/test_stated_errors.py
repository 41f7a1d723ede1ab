"""Errors that are stated with inertia and on slopes cover the true ones; each of these cases did
not once."""

import numpy as np
import pytest

from benchmarks.stated_errors import motion, random_case, slope
from colloc import Chain, Fourier, Friction, Harmonic, Problem
from colloc.dynamics.control_problem import control_problem
from colloc.gaits.objective import EFFICIENCY
from colloc.verification.adaptive_motion import to_tolerance
from colloc.verification.mesh_error import gait_motion

LEANING = Fourier(mean=[0.3, -0.5], cos=[[0.4], [0.9]], sin=[[1.1], [-0.2]])


@pytest.mark.parametrize(
    ("play", "seed", "number"),
    [(motion, 1, 17), (motion, 2, 6), (motion, 2, 18), (slope, 1, 45), (slope, 1, 57)],
)
def test_distance_work_rotation_and_efficiency_are_as_exact_as_is_said(play, seed, number):
    ran = play(random_case(seed, number))
    assert (np.abs(ran.values - ran.true) < ran.errors).all()


def test_runs_that_agree_by_accident_are_no_more_exact_than_their_steps():
    _, _, errors = to_tolerance(
        lambda aim: (None, {"distance": 1.0, "work": 2.0}), 1e-3, EFFICIENCY, 1e-4, ({}, {})
    )
    assert min(errors.values()) > 1e-5


@pytest.mark.parametrize("mu", [0.02, 0.05])
def test_meshes_are_held_against_a_motion_whose_error_is_known_where_friction_hardly_brakes(mu):
    asked = {
        "gait": Harmonic(1, "none"),
        "friction": Friction(mu, mu, mu),
        "rotation": None,
        "delta": 1e-3,
    }
    control = control_problem(
        Problem("w", LEANING, Chain(), froude=1.0, delta_start=1e-3, intervals=10, **asked)
    )
    mesh = control.mesh()
    rough, fine = (gait_motion(control, LEANING, 1e-3, mesh, aim) for aim in (1e-4, 1e-7))
    assert np.abs(rough.at(mesh.edges) - fine.at(mesh.edges)).max() < rough.error < 1e-5
