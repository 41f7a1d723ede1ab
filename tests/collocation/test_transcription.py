"""The nonlinear program: derivatives, feasibility of the warm start, symmetry reductions, size of
the build."""

import casadi as ca
import numpy as np
import pytest
from shared.differences import assert_derivatives_are_differences

from colloc.collocation.layout import RADIANS
from colloc.collocation.transcription import transcribe
from colloc.collocation.warm_start import feasible_point
from colloc.gaits.control_problem import control_problem
from colloc.gaits.harmonic import Fourier, Harmonic, ellipse
from colloc.gaits.problem import Problem
from colloc.mechanics.friction import Friction
from colloc.numerics.blocks import oracles

SCHEMES = ["gauss-3", "radau-2", "trapezoid", "hermite-simpson"]


def program(problem, delta):
    """Transcription, oracles, a feasible point, NLP parameters, and the function (x, p) -> (f,
    g)."""
    transcription = transcribe(control_problem(problem))
    found = oracles(transcription.assembly)
    parameters = problem.gait.parameters(problem.guess)
    x = feasible_point(transcription, parameters, delta)
    p = found.parameter_vector(delta / RADIANS, transcription.block_parameters(parameters))
    function = ca.Function("fg", [found.nlp["x"], found.nlp["p"]], [found.nlp["f"], found.nlp["g"]])

    def fg(at, parameters, alive=transcription):
        return function(at, parameters)

    return transcription, found, x, p, fg


@pytest.mark.parametrize("formulation", ["implicit velocity", "full"])
@pytest.mark.parametrize("friction", [Friction(), Friction(mu_t=1.7, mu_f=1, mu_b=1.3)])
def test_jacobian_and_hessian_against_differences(formulation, friction):
    problem = Problem(
        "p",
        ellipse(0.2, 1.3, 0.8),
        friction=friction,
        gait=Harmonic(1, "none"),
        intervals=6,
        formulation=formulation,
    )
    _, found, x, p, _ = program(problem, 0.3)
    assert_derivatives_are_differences(found, x, p, 3e-5)


@pytest.mark.parametrize("formulation", ["implicit velocity", "full"])
@pytest.mark.parametrize("name", SCHEMES)
def test_the_warm_start_satisfies_every_equation(formulation, name):
    for symmetry in ("none", "bilateral", "antipodal"):
        problem = Problem(
            "p",
            ellipse(0.0, 1.5, 0.8),
            gait=Harmonic(1, symmetry),
            scheme=name,
            intervals=8,
            formulation=formulation,
        )
        transcription, _, x, p, fg = program(problem, 0.1)
        g = np.array(fg(x, p)[1]).ravel()
        for group, rows in transcription.groups.items():
            if group != "rotation" or symmetry != "none":
                low, high = (
                    transcription.constraint_lower[rows],
                    transcription.constraint_upper[rows],
                )
                assert np.maximum(low - g[rows], g[rows] - high).max() < 1e-9, group


def test_half_a_period_with_a_symmetry_gives_the_same_efficiency_as_the_whole():
    values = []
    for symmetry, intervals in (("none", 80), ("bilateral", 40), ("antipodal", 40)):
        problem = Problem(
            "p", ellipse(0.0, 1.5, 0.8), gait=Harmonic(1, symmetry), intervals=intervals
        )
        _, _, x, p, fg = program(problem, 0.05)
        values.append(-float(fg(x, p)[0]))
    np.testing.assert_allclose(values, values[0], rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "order"), [("trapezoid", 2), ("hermite-simpson", 4), ("gauss-2", 4), ("radau-2", 3)]
)
def test_schemes_converge_at_their_order_away_from_stick(name, order):
    def efficiency(scheme, intervals):
        problem = Problem(
            "p",
            ellipse(0.2, 1.1, 0.7),
            gait=Harmonic(1, "bilateral"),
            scheme=scheme,
            intervals=intervals,
        )
        _, _, x, p, fg = program(problem, 5.0)
        return -float(fg(x, p)[0])

    reference = efficiency("gauss-6", 30)
    coarse, fine = (abs(efficiency(name, n) - reference) for n in (12, 24))
    assert abs(np.log2(coarse / fine) - order) < 0.5
    assert fine < 1e-3 * reference


def test_the_program_without_symmetry_closes_its_rotation_and_with_one_has_no_such_row():
    groups = {
        symmetry: transcribe(
            control_problem(
                Problem("p", ellipse(0, 1, 0.5), gait=Harmonic(1, symmetry), intervals=6)
            )
        ).groups
        for symmetry in ("none", "bilateral", "antipodal")
    }
    assert "rotation" in groups["none"]
    assert "rotation" not in groups["bilateral"]
    assert "force law" in groups["none"]


def test_no_equation_is_redundant():
    for symmetry in ("none", "bilateral", "antipodal"):
        problem = Problem("p", ellipse(0.0, 1.5, 0.8), gait=Harmonic(1, symmetry), intervals=6)
        transcription, found, x, p, _ = program(problem, 0.1)
        jacobian = np.array(ca.DM(found.options["jac_g"](x, p)[1]))
        equality = transcription.constraint_lower == transcription.constraint_upper
        rows = jacobian[equality][:, transcription.lower < transcription.upper]
        singular = np.linalg.svd(rows, compute_uv=False)
        assert singular.min() > 1e-6 * singular.max()


def test_local_functions_do_not_grow_with_the_mesh():
    def nodes(intervals):
        problem = Problem(
            "p", ellipse(0, 1, 0.5), gait=Harmonic(1, "bilateral"), intervals=intervals
        )
        point = transcribe(control_problem(problem)).assembly.blocks[0].function
        return point.hessian.n_instructions()

    assert nodes(6) == nodes(60)
    assert nodes(6) < 12000


def test_a_gait_with_more_joints_transcribes():
    from colloc.mechanics.chain import Chain

    guess = Fourier(np.zeros(3), np.array([[0.5], [0.2], [-0.4]]), np.array([[0.0], [0.6], [0.3]]))
    problem = Problem(
        "p", guess, body=Chain((0.25,) * 4), friction=Friction(mu_t=3, mu_f=1, mu_b=1), intervals=8
    )
    transcription, _, x, p, fg = program(problem, 0.1)
    assert np.isfinite(np.array(fg(x, p)[1])).all()
    assert transcription.layout.angles.shape[0] == 3
