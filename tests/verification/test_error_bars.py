"""Stated errors against a program that has nothing of colloc; false statements are noticed."""

import json

import numpy as np
import pytest

from benchmarks import stated_errors
from benchmarks.audit import compared, crossing, path_of, random_gait, stated, wrong
from benchmarks.independent_replay import Crawler, Gait, Played, played, played_together
from benchmarks.reference import net_force
from colloc import Chain, Fourier, Friction, Harmonic, Problem, ellipse
from colloc.dynamics.control_problem import control_problem
from colloc.gaits.objective import EFFICIENCY
from colloc.mechanics.contact import crossing_depth
from colloc.verification.adaptive_motion import to_tolerance
from colloc.verification.mesh_error import gait_motion, mesh_error
from tests.conftest import ROOT
from tests.shared.cases import slow, slow_but

RECORDED = [
    json.loads(line)
    for line in (ROOT / "results/curated/error_bars.jsonl").read_text(encoding="utf-8").splitlines()
]
QUANTITIES = "efficiency", "distance", "work", "limit"
FIXED = [entry for entry in RECORDED if entry["row"] is not None][:4]
LEANING = Fourier(mean=[0.3, -0.5], cos=[[0.4], [0.9]], sin=[[1.1], [-0.2]])


ONCE = [("motion", 2, 6), ("slope", 1, 45), ("motion", 1, 17), ("motion", 2, 18), ("slope", 1, 57)]
ELLIPSE = [[0.0, 0.0], [[2.0], [-2.0]], [[1.0], [1.0]]]
TRUE = Played(0.05, 0.1, 2.0, 0.0, 100, 1e-9)
ROW = {"number": 0, "gait": ELLIPSE, "claimed": 0.05, "ambiguity": 0.0}
ROW |= {"efficiency": [0.05, 1e-7], "distance": [0.1, 1e-7], "work": [2.0, 1e-7]}


def test_the_other_program_has_the_forces_of_the_integral_table_in_sixty_digits():
    body, rng = Crawler((0.2, 0.5, 0.3), (1.7, 1.0, 1.3)), np.random.default_rng(1)
    cases = (1.0, 1.0, 1e-2), (1e-6, 1.0, 1e-4), (1.0, 1e-4, 1e-6), (1e-3, 1e-3, 1e-4)
    for spin, speed, delta in cases:
        angles, rates = rng.uniform(-2, 2, (2, 1)), spin * rng.normal(size=(2, 1))
        z = speed * rng.normal(size=(3, 1)) * np.array([[1.0], [1.0], [spin]])
        forces = body.forces(angles, rates, z, np.full(1, delta))[0][:, 0]
        # the reference counts torque about the midpoint of the first link, and takes its velocity
        at = body.lengths, body.coefficients, angles[:, 0], rates[:, 0]
        middle = z[0, 0], z[1, 0] + 0.1 * z[2, 0], z[2, 0]
        fx, fy, torque = map(float, net_force(*at, middle, delta, 0))
        np.testing.assert_allclose(forces, [fx, fy, torque + 0.1 * fy], atol=1e-11)


def test_the_other_program_knows_the_best_ellipse_of_the_paper():
    best = ellipse(0.0, 2.8593, 1.3015)
    done = played(Crawler((1 / 3,) * 3, (1.0, 1.0, 1.0)), best, 1e-2, 1e-3, panels=20)
    assert done.efficiency == pytest.approx(0.26, abs=1e-3)
    assert abs(done.rotation) < 1e-4


@pytest.mark.parametrize("entry", FIXED, ids=lambda entry: entry["name"])
def test_stated_errors_cover_what_the_other_program_found(entry):
    known = stated(*random_gait(int(entry["name"].split("-")[1])))
    for name, (value, error) in known.items():
        assert abs(value - entry["row"][name][2]) <= error, name


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1])
def test_what_is_recorded_is_what_the_other_program_finds(number):
    entry = FIXED[number]
    found = compared(int(entry["name"].split("-")[1]))
    for name in QUANTITIES:
        assert found[name][2] == pytest.approx(entry["row"][name][2], rel=1e-7)


@pytest.mark.parametrize(("play", "seed", "number"), slow_but(ONCE[:2], ONCE))
def test_distance_work_rotation_and_efficiency_are_as_exact_as_is_said(play, seed, number):
    """Each of these cases was not, once."""
    ran = getattr(stated_errors, play)(stated_errors.random_case(seed, number))
    assert (np.abs(ran.values - ran.true) < ran.errors).all()


def test_runs_that_agree_by_accident_are_no_more_exact_than_their_steps():
    ran, known = {"distance": 1.0, "work": 2.0}, ({"length": 3.0}, {"length": 7e-5})
    *_, errors = to_tolerance(lambda aim: (None, ran), 1e-3, EFFICIENCY, 1e-4, known)
    assert min(errors.values()) > 1e-5
    assert errors["length"] == 7e-5


@pytest.mark.parametrize("mu", [slow(0.02), 0.05])
def test_meshes_are_held_against_a_motion_whose_error_is_known_where_friction_hardly_brakes(mu):
    asked = {"gait": Harmonic(1), "rotation": None, "froude": 1.0, "delta": 1e-3, "intervals": 10}
    control = control_problem(
        Problem("w", LEANING, Chain(), Friction(mu, mu, mu), delta_start=1e-3, **asked)
    )
    mesh = control.mesh()
    rough, fine = (gait_motion(control, LEANING, 1e-3, mesh, aim) for aim in (1e-4, 1e-7))
    assert np.abs(rough.at(mesh.edges) - fine.at(mesh.edges)).max() < rough.error < 1e-5
    *_, x, y, work = np.diff(rough.at(np.array([0.0, 1.0])))[:, 0]
    found = mesh_error(control, mesh, LEANING, 1e-3, fine=rough)
    assert found.unresolved == pytest.approx(rough.error * (1 / np.hypot(x, y) + 1 / work))


@pytest.mark.slow
def test_gaits_played_together_are_those_played_alone():
    bodies = [Crawler((0.3, 0.4, 0.3), (1.0, 1.0, 1.0)), Crawler((0.2, 0.3, 0.5), (3.0, 1.0, 2.0))]
    path = path_of(ELLIPSE)
    together = played_together([Gait(body, path, 1e-2) for body in bodies], 1e-3, panels=10)
    for body, found in zip(bodies, together, strict=True):
        alone = played(body, path, 1e-2, 1e-3, panels=10)
        np.testing.assert_allclose(found, alone, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("lengths", [(1 / 3, 1 / 3, 1 / 3), (0.45, 0.2, 0.35)])
def test_links_cross_where_collocs_own_test_says_so(lengths):
    angles = np.random.default_rng(0).uniform(-np.pi, np.pi, (2, 4000))
    depth = crossing_depth(Chain(lengths), angles)
    crossed = crossing(lengths, angles)
    assert 0.02 < crossed.mean() < 0.3
    np.testing.assert_array_equal(crossed, depth > 0)


@pytest.mark.parametrize(
    ("change", "noticed"),
    [
        ({}, set()),
        ({"efficiency": [0.0501, 1e-7], "claimed": 0.0501}, {"error of efficiency", "efficiency"}),
        ({"efficiency": [0.0501, 1e-3], "claimed": 0.0501, "ambiguity": 3e-3}, set()),
        ({"distance": [0.1, 1e-9]}, set()),
        ({"work": [2.1, 1e-3]}, {"error of work"}),
        ({"gait": [[0.0, 0.0], [[3.2], [-3.2]], [[0.0], [0.0]]]}, {"joint limit"}),
        ({"gait": [[2.9, 2.9], [[0.0], [0.0]], [[0.0], [0.0]]]}, {"joint limit", "self-contact"}),
    ],
)
def test_a_false_statement_is_noticed(change, noticed):
    assert set(wrong(ROW | change, TRUE)) == noticed


def test_a_turning_body_and_more_than_the_bound_are_noticed():
    assert set(wrong(dict(ROW), TRUE._replace(rotation=1e-3))) & {"rotation"}
    assert "1/min(mu)" in wrong(ROW | {"claimed": 50.0}, TRUE._replace(efficiency=50.0))
