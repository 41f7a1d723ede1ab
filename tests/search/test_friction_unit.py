"""Only the ratios of friction coefficients matter: their size is a unit, for solves and
certificates alike."""

import numpy as np
import pytest

from colloc import Friction, Harmonic, PathLimit, Problem, ellipse
from colloc.dynamics.control_problem import control_problem
from colloc.reduced.program import ReducedProgram
from colloc.search.iterate import space_near
from colloc.search.solve import solve
from tests.shared.laws import coulomb


def stated(*mu, **changes):
    coarsely = {"intervals": 24, "delta": 1e-2, "mesh_tolerance": 1e-4}
    usual = {"gait": Harmonic(1, "bilateral"), "friction": coulomb(*mu), **coarsely}
    return Problem("unit", ellipse(0.3, 1.0, 0.5), **usual | changes)


def test_every_limit_follows_friction_by_its_own_power():
    def limits(mu):
        heat = PathLimit("heat", "sum(moment**2)", 0.04 * mu**2)
        problem = stated(mu, mu, mu, torque_limit=0.2 * mu, power_limit=0.9 * mu, limits=[heat])
        return control_problem(problem).actuators

    for light, usual in zip(limits(1e-3).each, limits(1.0).each, strict=True):
        assert light.name == usual.name
        np.testing.assert_allclose(light.most, usual.most, rtol=1e-12)


@pytest.fixture(scope="module")
def usual():
    return solve(stated(1.0, 1.0, 1.0), 1)


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_coefficients_of_any_size_are_solved_and_certified(usual, size):
    """Work is proportional to the coefficients, efficiency inversely; the gait is the same."""
    seen = []
    solution = solve(stated(size, size, size), 1, progress=seen.append)
    assert solution.status == "solved"
    assert solution.efficiency * size == pytest.approx(usual.efficiency, rel=1e-9)
    assert solution.certificate.efficiency * size == pytest.approx(
        usual.certificate.efficiency, rel=1e-6
    )
    assert solution.work / size == pytest.approx(usual.work, rel=1e-9)
    np.testing.assert_allclose(solution.gait.cos, usual.gait.cos, rtol=1e-6)
    assert seen[-1].best.value == pytest.approx(solution.value, rel=1e-4)
    assert all(step.work / size < 10 for step in solution.history)
    assert solution.answer.kkt_error < 1e-6


def test_what_must_be_reached_is_stated_in_units_of_friction_too():
    least = {"efficiency": 150.0, "distance": 0.2}
    light = Problem("light", friction=Friction(1e-3, 1e-3, 1e-3), at_least=least)
    scaled = control_problem(light)
    assert (scaled.unit, scaled.dynamics.law.mu_t) == (1e-3, 1.0)
    assert [value for _, value in scaled.aims.at_least] == pytest.approx([0.15, 0.2])
    # what is proportional to no power of friction is left as it is
    mixed = light.with_(objective="distance / (work + length)")
    assert control_problem(mixed).unit == 1.0


def test_a_pace_counts_by_its_ratio_to_friction():
    """Friction drives the momenta: with a tenth of it, at a tenth of the Froude number, a gait
    moves as it did."""
    periods = []
    for size in (1.0, 0.1):
        space, v = space_near(
            stated(size, size, size, froude=0.05 * size, gait=Harmonic(1)), ellipse(0.3, 1.0, 0.5)
        )
        periods.append(ReducedProgram(space, 1e-2).period(v))
    usual, light = periods
    assert usual["distance"] > 1e-3
    assert light["distance"] == pytest.approx(usual["distance"], rel=1e-9)
    assert light["work"] == pytest.approx(0.1 * usual["work"], rel=1e-9)
