"""The condensed program: derivatives, agreement with the full one, and what predicts the next level."""

import numpy as np
import pytest

from colloc.collocation.layout import RADIANS
from colloc.collocation.reduced_space import Condensed
from colloc.collocation.transcription import transcribe
from colloc.collocation.warm_start import feasible_point
from colloc.gaits.harmonic import Harmonic, ellipse
from colloc.gaits.problem import FORMULATIONS, Problem
from colloc.gaits.sampling import LATIN_HYPERCUBE, start_gait
from colloc.mechanics.balance import instant, net_force
from colloc.mechanics.friction import Friction
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.search.continuation import continue_delta
from colloc.search.nlp import Solver
from colloc.search.prediction import Track
from colloc.verification.mesh_error import mesh_error
from colloc.verification.refinement import planned_mesh
from colloc.verification.replay import replay

DELTA = 0.05 / RADIANS


def problem(symmetry, friction=Friction(1.7, 1, 1.3), **changes):
    fields = {"gait": Harmonic(1, symmetry), "delta": 0.1, "intervals": 10, "mesh_tolerance": 0.0}
    guess = ellipse(0.0 if symmetry == "antipodal" else 0.3, 1.0, 0.5)
    return Problem(**{"name": "quick", "guess": guess, "friction": friction, **fields, **changes})


def at_start(stated, start=3):
    condensed = Condensed(transcribe(stated))
    parameters = stated.gait.parameters(start_gait(stated, LATIN_HYPERCUBE, 0, start))
    return condensed, condensed.variables(feasible_point(condensed.transcription, parameters, 0.05))


@pytest.mark.parametrize("symmetry", ["none", "bilateral", "antipodal"])
@pytest.mark.parametrize("friction", [Friction(), Friction(0.5, 1, 5)])
def test_first_and_second_derivatives_are_those_of_finite_differences(symmetry, friction):
    condensed, v = at_start(problem(symmetry, friction))
    step, weights = 1e-5, np.array([1.3, -0.7])
    shifts = step * np.eye(condensed.n)
    slopes = [(np.array(condensed.values(v + e, DELTA)) - condensed.values(v - e, DELTA)) / (2 * step) for e in shifts]
    np.testing.assert_allclose(condensed.gradients(v, DELTA), np.transpose(slopes), atol=1e-8)
    curvatures = [
        weights @ (condensed.gradients(v + e, DELTA) - condensed.gradients(v - e, DELTA)) / (2 * step) for e in shifts
    ]
    hessian = condensed.hessian(v, DELTA, *weights)
    np.testing.assert_allclose(hessian, curvatures, atol=1e-6 * np.abs(hessian).max())


@pytest.mark.parametrize("symmetry", ["none", "bilateral", "antipodal"])
def test_lifted_points_satisfy_every_equation_but_net_rotation(symmetry):
    stated = problem(symmetry)
    condensed, v = at_start(stated)
    solver = Solver(condensed.transcription)
    x = condensed.lifted(v, DELTA)
    t = condensed.transcription
    parameters = solver.oracles.parameter_vector(DELTA, t.block_parameters(x[t.layout.parameters[:, 0]]))
    g = np.array(solver.oracles.options["jac_g"](x, parameters)[0]).ravel()
    equality = t.constraint_lower == t.constraint_upper
    if symmetry == "none":
        equality[t.groups["rotation"]] = False
        rotation = g[t.groups["rotation"]][0]
        assert rotation == pytest.approx(condensed.values(v, DELTA)[1], abs=1e-12)
    assert np.abs((g - t.constraint_lower)[equality]).max() < 1e-11


def test_the_condensed_velocities_balance_the_body_by_the_numpy_law():
    stated = problem("none", Friction(1, 1, 3))
    condensed, v = at_start(stated)
    for delta in (DELTA, 1e-6 / RADIANS):
        condensed.gradients(v, delta)
        moved = v + 0.01
        x, layout = condensed.lifted(moved, delta), condensed.transcription.layout
        now = instant(stated.body, stated.friction, x[layout.angles], x[layout.rates], x[layout.z], delta)
        assert np.abs(net_force(now.posture, now.force)).max() < 1e-8


def test_all_formulations_find_the_same_optimum_with_the_same_multipliers():
    results = {}
    for formulation in FORMULATIONS:
        stated = problem("none", Friction(3, 1, 1), formulation=formulation, delta=0.03, guess=ellipse(1.0, 0.7, 1.0))
        results[formulation] = continue_delta(stated).last
        assert results[formulation].optimal
        assert results[formulation].kkt_error < 1e-6
    one = results["map"]
    for formulation in ("condensed", "lifted"):
        assert results[formulation].efficiency == pytest.approx(one.efficiency, rel=1e-8)
    np.testing.assert_allclose(results["condensed"].lam_g, one.lam_g, atol=1e-5)


def test_trust_regions_widen_when_the_optimum_is_far_and_it_is_the_one_found_in_one_step():
    stated = problem("bilateral", Friction(), guess=ellipse(0.0, 1.6, 1.0))
    transcription = transcribe(stated)
    solver, own = Solver(transcription), transcription.layout.parameters[:, 0]
    x = feasible_point(transcription, stated.gait.parameters(stated.guess), stated.delta)
    free = solver.solve(x, stated.delta)
    small = solver.solve(x, stated.delta, radius=0.02)
    assert free.optimal
    assert small.optimal, "20 regions of one radius would end 0.4 rad away"
    moved = np.abs(small.x[own] - x[own]).max()
    assert moved > 1.0
    # contact is constrained at instants that are worst where each solve, or region, begins
    np.testing.assert_allclose(small.x[own], free.x[own], atol=0.03)
    assert small.objective == pytest.approx(free.objective, rel=0.01)


def test_a_gait_that_moves_linearly_in_delta_is_predicted_exactly():
    track, at = Track(), lambda d, shift=0.0: np.array([1.0 + 2 * d, -3 * d]) + shift
    assert not track
    assert track.move(0.01) == 0.0
    track.record(0.1, at(0.1))
    assert track.move(0.01) == 0.0
    track.record(0.02, at(0.02))
    np.testing.assert_allclose(at(0.02) + track.move(0.01), at(0.01))
    np.testing.assert_array_equal(track.move(0.05), 0.0)  # back up: nothing to extrapolate
    track.remeshed()
    track.record(0.1, at(0.1, shift=0.3))
    np.testing.assert_allclose(at(0.1, 0.3) + track.move(0.04), at(0.04, 0.3))


def test_a_refined_mesh_meets_its_tolerance_against_a_replay():
    stated = problem("bilateral", Friction(1, 1, 3), delta=1e-3, intervals=12)
    gait, mesh = stated.guess, transcribe(stated).mesh
    plan = planned_mesh(stated, mesh, gait, 1e-3, 1e-4)
    assert plan is not None
    assert plan.reached
    refined, edges = Mesh(scheme(plan.scheme), plan.edges), plan.edges
    assert mesh_error(stated, refined, gait, 1e-3, 1e-4).estimate < 1e-4
    assert planned_mesh(stated, refined, gait, 1e-3, 1e-4) is None
    stated = stated.with_(scheme=plan.scheme)
    fine = replay(stated.body, stated.friction, lambda t: (gait.angles(t), gait.rates(t)), 1e-3, instants=6400)
    x = feasible_point(transcribe(stated, edges), stated.gait.parameters(gait), 1e-3)
    layout = transcribe(stated, edges).layout
    assert x[layout.distance[0, -1]] / x[layout.work[0, -1]] == pytest.approx(fine.efficiency, rel=1e-4)


@pytest.mark.parametrize("symmetry", ["none", "bilateral"])
def test_levels_down_to_a_very_small_delta_take_a_few_steps_each(symmetry):
    stated = problem(symmetry, Friction(), delta=1e-6, intervals=30, mesh_tolerance=1e-4, guess=ellipse(1.0, 0.7, 1.1))
    solution = continue_delta(stated)
    assert solution.last.optimal
    assert solution.last.delta == 1e-6
    assert solution.last.efficiency == pytest.approx(0.2076, abs=1e-4)
    late = [level.iterations for level in solution.levels if level.delta < 1e-3]
    assert np.median(late) <= 8
