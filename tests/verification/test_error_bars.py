"""Stated errors of efficiency, distance, work and the limit of small delta, against a program of
nothing that colloc has."""

import json

import numpy as np
import pytest

from benchmarks.audit import compared, random_gait, stated
from benchmarks.independent_replay import Crawler, played
from benchmarks.reference import net_force
from colloc.gaits.harmonic import ellipse
from tests.conftest import ROOT

RECORDED = [
    json.loads(line)
    for line in (ROOT / "results/curated/error_bars.jsonl").read_text(encoding="utf-8").splitlines()
]
QUANTITIES = "efficiency", "distance", "work", "limit"
FIXED = [entry for entry in RECORDED if entry["row"] is not None][:8]


def test_the_other_program_has_the_forces_of_the_integral_table_in_sixty_digits():
    """Also at links that hardly turn, and nearly at rest."""
    body, rng = Crawler((0.2, 0.5, 0.3), (1.7, 1.0, 1.3)), np.random.default_rng(1)
    for spin, speed, delta in (
        (1.0, 1.0, 1e-2),
        (1e-6, 1.0, 1e-4),
        (1.0, 1e-4, 1e-6),
        (1e-3, 1e-3, 1e-4),
    ):
        angles, rates = rng.uniform(-2, 2, (2, 1)), spin * rng.normal(size=(2, 1))
        z = speed * rng.normal(size=(3, 1)) * np.array([[1.0], [1.0], [spin]])
        forces = body.forces(angles, rates, z, np.full(1, delta))[0][:, 0]
        # the reference counts torque about the midpoint of the first link, and takes its velocity
        at = (body.lengths, body.coefficients, angles[:, 0], rates[:, 0])
        fx, fy, torque = (
            float(f) for f in net_force(*at, (z[0, 0], z[1, 0] + 0.1 * z[2, 0], z[2, 0]), delta, 0)
        )
        np.testing.assert_allclose(forces, [fx, fy, torque + 0.1 * fy], atol=1e-11)


def test_the_other_program_knows_the_best_ellipse_of_the_paper():
    """Efficiency 0.26, without rotation."""
    best = ellipse(0.0, 2.8593, 1.3015)
    done = played(
        Crawler((1 / 3,) * 3, (1.0, 1.0, 1.0)),
        lambda t: (best.angles(t), best.rates(t)),
        1e-2,
        1e-3,
        panels=20,
    )
    assert done.efficiency == pytest.approx(0.26, abs=1e-3)
    assert abs(done.rotation) < 1e-4


@pytest.mark.parametrize("entry", FIXED, ids=lambda entry: entry["name"])
def test_stated_errors_cover_what_the_other_program_found(entry):
    known = stated(*random_gait(int(entry["name"].split("-")[1])))
    for name, (value, error) in known.items():
        assert abs(value - entry["row"][name][2]) <= error, name


def test_stated_errors_are_not_much_too_large():
    for name in QUANTITIES:
        value, stated, true = np.array(
            [entry["row"][name] for entry in RECORDED if entry["row"] is not None]
        ).T
        assert np.median(stated / np.abs(value - true)) < 20, name


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1])
def test_what_is_recorded_is_what_the_other_program_finds(number):
    entry = FIXED[number]
    found = compared(int(entry["name"].split("-")[1]))
    for name in QUANTITIES:
        assert found[name][2] == pytest.approx(entry["row"][name][2], rel=1e-7)
