"""The full program says what the reduced one says, has the derivatives of its rows, grows with mesh
and links alone. Budgets of counts: that when written and a quarter; raised with a reason alone."""

import re
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import colloc
from colloc import Chain, Foot, Harmonic, ModalBody, Pad, Problem, Wheel, ellipse
from colloc.mechanics.balance import joint_moments
from colloc.mechanics.bodies import FORMULATIONS
from colloc.numerics.repeated import Program, least_squares_multipliers, quasi_definite_factors
from colloc.reduced.program import ReducedProgram
from colloc.search import confirm
from colloc.search.confirm import Solver, explanation
from colloc.search.iterate import space_near
from colloc.transcription.full_program import ACTUATORS, AT_LEAST, FullProgram
from colloc.transcription.layout import RADIANS
from tests.reduced.test_reduced import CASES as REDUCED
from tests.reduced.test_reduced import ROUGH
from tests.shared.cases import cases, slow_but
from tests.shared.mechanics import coulomb
from tests.shared.stages import program_of

LOOP = ellipse(0.2, 1.3, 0.8)
SKEW = Chain((0.3, 0.25, 0.45))
PARTS = (Foot(0, friction=colloc.PowerLaw(0.5)), Wheel(1, 0.3, rolling=0.1), Pad(2, 0.2, 0.6))
PARTS += tuple(Foot(2, 0.9, offset=y) for y in (0.05, -0.05))
CASES = """
lying: body=SKEW
symmetric: gait=Harmonic(2, "bilateral"), guess=ellipse(0.0, 1.3, 0.8)
antipodal: body=SKEW, gait=Harmonic(3, "antipodal"), guess=ellipse(0, 1.3, 0.8)
elliptic: friction=Elliptic(mu_t=1.7, mu_f=1.0, mu_b=1.3)
viscous: friction=Viscous(normal=2.0, tangential=1.0)
feet, wheels and pads: body=Chain(SKEW.lengths, feet=PARTS)
width: body=Chain(SKEW.lengths, width=0.05)
weights: body=Chain(SKEW.lengths, weights=(0.5, 0.2, 0.3))
polygon by the velocity map: gait=Polygon(4), formulation="implicit velocity"
coupled: body=Chain((0.25,) * 4), gait=Coupled(Harmonic(1), gears=GEARS), guess=None, torque_limit=0.05
stuck: body=Chain((0.25,) * 4), gait=Coupled(Harmonic(1), stuck={1: 0.4}), guess=None
slope: grade=0.1, towards=0.4, torque_limit=0.06
inertia: froude=0.3, body=SKEW
inertia on feet, wheels and pads: froude=0.3, body=Chain(SKEW.lengths, feet=PARTS, masses=(0.2, 0.3, 0.5))
driven uphill: objective="driven efficiency", grade=0.1
driven with inertia uphill: objective="driven efficiency", froude=0.3, grade=0.1
joint speeds: speed_limit=9.0
modes: body=ModalBody(3), gait=Harmonic(1, "antipodal"), guess=None
velocity map: formulation="implicit velocity", body=SKEW, at_least={"length": 1.0}
"""
GEARS = ((1, 0), (0.5, 0.5), (0, 1))
CASES = REDUCED | cases(CASES, globals())
USUAL = "symmetric|feet, wheels and pads|cubic splines|polygon|coupled|serpenoid|slope|turning|actuators"
USUAL += (
    "|inertia on feet, wheels and pads|free pace|expression|driven with inertia|actuated polygon"
)
USUAL += "|velocity map"
each_case = pytest.mark.parametrize("case", slow_but(USUAL.split("|"), CASES))


def stated(case, **changes):
    usual = {"guess": LOOP, "friction": ROUGH, "gait": Harmonic(1), "intervals": 10}
    return Problem("p", **usual | CASES[case] | changes)


def at_guess(problem, delta=0.1):
    """The full program near the member nearest to the guess, its variables there, and the reduced
    program with its parameters."""
    space, v = space_near(problem, problem.guess)
    reduced = ReducedProgram(space, delta)
    reduced.place_rows(v)
    full = FullProgram(space.control, space.full_parameters(v))
    return full, full.feasible(space.full_parameters(v), delta), reduced, v


def rows(full, x, delta=0.1):
    return np.array(full.nlp.functions["jac_g"](x, delta / full.delta_unit)[0]).ravel()


@each_case
def test_it_has_the_value_and_the_rows_of_the_reduced_program(case):
    """Every equation holds at a gait in balance, but those that the gait has to be found for."""
    full, x, reduced, v = at_guess(stated(case))
    value = float(full.nlp.functions["grad_f"](x, 0.1 / full.delta_unit)[0])
    assert value == pytest.approx(reduced.objective(v), rel=1e-9)
    g = rows(full, x)
    equations = full.row_lower == full.row_upper
    for name, group in full.groups.items():
        if name not in ("rotation", "across"):
            of_group = equations[group]
            off = (g[group] - full.row_lower[group])[of_group]
            assert np.abs(off).max(initial=0.0) < 1e-9, name
    if full.control.problem.grade and "rotation" in full.groups:
        turned = reduced.motion.values(v, 0.1)["rotation"]
        assert np.abs(g[full.groups["rotation"]]).max() == pytest.approx(abs(turned), abs=1e-9)
    if AT_LEAST in full.groups:
        of_period = reduced.rows(v)[[name == "period" for name, _ in reduced.row_names]]
        known = of_period[-len(full.control.aims.at_least) :]
        np.testing.assert_allclose(g[full.groups[AT_LEAST]], known, atol=1e-9)
    if ACTUATORS in full.groups:
        shares = g[full.groups[ACTUATORS]].reshape(-1, len(full.control.actuators.names)).T
        for at in ((), (full.mesh.times,)):  # on the mesh, or at any instants
            known = reduced.motion.shares(full.control.actuators, v, 0.1, *at)
            np.testing.assert_allclose(shares, known, atol=1e-9)
    on_rows = reduced.rows(v)[reduced.row_lower.size - reduced.constraints.lower.size :]
    start = 0
    for name, cells in reduced.constraints.kinds.items():
        np.testing.assert_allclose(
            g[full.groups[name]], on_rows[start : start + cells.size], atol=1e-9, err_msg=name
        )
        start += cells.size


@pytest.mark.parametrize("case", ["bilateral serpenoid", "antipodal serpenoid"])
def test_with_another_lag_a_gait_is_no_member(case):
    full, x, *_ = at_guess(stated(case))
    x[full.layout.parameters[0, 0]] += 0.1
    assert np.abs(rows(full, x)[full.groups["members"]]).max() > 1e-2


@each_case
def test_jacobian_and_hessian_are_differences_of_its_rows(case):
    full, x, *_ = at_guess(stated(case), 0.3)
    functions, p, rng, h = full.nlp.functions, 0.3 / full.delta_unit, np.random.default_rng(1), 1e-6
    x, direction = x + 1e-3 * rng.normal(size=x.size), rng.normal(size=x.size)
    lam = rng.normal(size=full.row_lower.size)
    upper = np.array(ca.DM(functions["hess_lag"](x, p, 1.3, lam)))
    hessian = upper + np.triu(upper, 1).T

    def gradient(at):
        on_value = np.array(functions["grad_f"](at, p)[1]).ravel()
        return 1.3 * on_value + np.array(functions["jac_g"](at, p)[1].T @ lam).ravel()

    jacobian = np.array(ca.DM(functions["jac_g"](x, p)[1]))
    for matrix, of in ((jacobian, lambda at: rows(full, at, 0.3)), (hessian, gradient)):
        difference = (of(x + h * direction) - of(x - h * direction)) / (2 * h)
        atol = 3e-5 * np.abs(difference).max()
        np.testing.assert_allclose(difference, matrix @ direction, atol=atol)


@pytest.mark.parametrize("name", ["radau-2", "trapezoid", "hermite-simpson"])
@pytest.mark.parametrize("case", ["symmetric", "antipodal", "velocity map"])
def test_a_gait_in_balance_satisfies_every_equation_on_any_scheme(case, name):
    full, x, *_ = at_guess(stated(case, scheme=name, intervals=12))
    g = rows(full, x)
    outside = np.maximum(full.row_lower - g, g - full.row_upper)
    rotation = full.groups.get("rotation", slice(0, 0))
    outside[rotation] = 0.0
    assert outside[full.row_lower == full.row_upper].max() < 1e-9


@pytest.mark.parametrize("case", ["lying", "feet, wheels and pads", "slope"])
def test_moments_at_the_joints_are_those_that_the_power_of_single_joints_says(case):
    """Two statements that share nothing: recursion along the chain, and virtual work."""
    full, x, *_ = at_guess(stated(case))
    dynamics = full.control.dynamics
    body, law = dynamics.body, dynamics.law
    gait, t = full.member(x), full.mesh.times
    q, r = gait.angles(t), gait.rates(t) / RADIANS
    law = law.in_speeds_of(RADIANS)
    z, theta = full.layout.tail_velocity(body, x), x[full.layout.directions[:1]]
    forces = body.forces(law, q, r, z, 0.1 / full.delta_unit)
    expected = joint_moments(body, q, forces, dynamics.regime.pull(theta))
    np.testing.assert_allclose(x[full.layout.moments], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "order"), [("trapezoid", 2), ("hermite-simpson", 4), ("gauss-2", 4), ("radau-2", 3)]
)
def test_schemes_converge_at_their_order_away_from_stick(name, order):
    def efficiency(scheme, n):
        gait = Harmonic(1, "bilateral")
        problem = Problem("p", ellipse(0.2, 1.1, 0.7), gait=gait, scheme=scheme, intervals=n)
        full, x, *_ = at_guess(problem, 5.0)
        return -float(full.nlp.functions["grad_f"](x, 5.0 / full.delta_unit)[0])

    reference = efficiency("gauss-6", 30)
    coarse, fine = (abs(efficiency(name, n) - reference) for n in (12, 24))
    assert abs(np.log2(coarse / fine) - order) < 0.5
    assert fine < 1e-3 * reference


@pytest.mark.parametrize("case", ["lying", "symmetric", "antipodal", "inertia", "slope", "modes"])
def test_no_equation_is_redundant(case):
    full, x, *_ = at_guess(stated(case, intervals=6))
    jacobian = np.array(ca.DM(full.nlp.functions["jac_g"](x, 0.1 / full.delta_unit)[1]))
    equations = jacobian[full.row_lower == full.row_upper][:, full.lower < full.upper]
    singular = np.linalg.svd(equations, compute_uv=False)
    assert singular.min() > 1e-6 * singular.max()


def test_functions_grow_neither_with_the_mesh_nor_with_the_links():
    """One function of a link, one of a contact, whatever their numbers: lengths are given."""

    def sizes(links, intervals):
        lengths = np.linspace(1.0, 2.0, links)
        parts = (*(lengths / lengths.sum())[:-1],)
        body = Chain((*parts, 1.0 - sum(parts)))
        zero = np.zeros((links - 1, 1))
        guess = colloc.Fourier(zero[:, 0], zero + 0.3, zero)
        full = program_of(Problem("p", guess, body, gait=Harmonic(1), intervals=intervals))
        return sorted(
            each.function.functions[0].n_instructions()
            for each in full.repeated
            if each.gather.shape[1] > 3 * intervals
        )

    assert sizes(3, 6) == sizes(3, 20) == sizes(9, 6)
    assert max(sizes(3, 6)) < 300


@pytest.mark.parametrize(
    ("links", "formulation", "jacobian", "hessian"),
    [(3, "full", 620, 300), (6, "full", 1300, 600), (3, "implicit velocity", 170, 85)],
)
def test_nonzeros_grow_by_so_many_for_every_interval(links, formulation, jacobian, hessian):
    """Half a period, three points an interval: sparsity keeps a solve linear in the mesh."""
    counts = []
    for intervals in (20, 40):
        stated = {"gait": Harmonic(1, "antipodal"), "formulation": formulation}
        problem = Problem("p", None, Chain((1 / links,) * links), intervals=intervals, **stated)
        functions = program_of(problem).nlp.functions
        counts.append((functions["jac_g"].nnz_out(1), functions["hess_lag"].nnz_out(0)))
    growth = np.diff(counts, axis=0)[0] / 20
    assert growth[0] <= jacobian
    assert growth[1] <= hessian


def test_ipopt_finds_from_the_guess_what_it_confirms():
    problem = stated("symmetric", gait=Harmonic(1, "bilateral"), intervals=12)
    full, x, *_ = at_guess(problem)
    full, first = confirm.solve_in_regions(full, x, 0.1, 0.5)
    assert first.optimal
    again = Solver(full).solve_within(first.x, 0.1, (first.lam_x, first.lam_g), 0.01)
    assert again.optimal
    assert again.objective == pytest.approx(first.objective, rel=1e-9)


@pytest.mark.parametrize("formulation", ["implicit velocity", "full"])
def test_multipliers_are_estimated_and_their_fill_grows_with_the_mesh_only(formulation):
    """No symmetry: the net rotation couples all intervals."""
    fill = []
    for intervals in (20, 40):
        problem = Problem("p", ellipse(0.3, 1, 0.5), intervals=intervals, formulation=formulation)
        program = program_of(problem)
        solver = Solver(program)
        x = program.feasible(problem.gait.parameters(problem.guess), 0.1)
        jacobian, _ = solver.equality_jacobian(x, 0.1)
        gradient = np.random.default_rng(1).normal(size=jacobian.shape[1])
        left = gradient + jacobian.T @ least_squares_multipliers(jacobian, gradient)
        # what is left is orthogonal to every equation
        assert np.abs(jacobian @ left).max() < 1e-8 * np.abs(gradient).max()
        fill.append(quasi_definite_factors(jacobian).L.nnz)
    assert fill[1] < 2.3 * fill[0]


@pytest.mark.parametrize(
    ("law", "delta", "mean", "largest"),
    [
        ((1, 1, 1), 1e-1, 5.5, 12),
        ((1, 1, 1), 1e-4, 9.7, 24),
        ((1, 1, 1), 1e-12, 13.5, 80),
        ((1.7, 1, 1.3), 1e-4, 10, 30),
        ((0.5, 1, 5), 1e-4, 11, 34),
        ((10, 1, 1), 1e-4, 10, 150),
        ((10, 1, 1), 1e-12, 12.5, 140),
    ],
)
def test_steps_of_the_balance_solver(law, delta, mean, largest):
    rng = np.random.default_rng(0)
    angles, rates = rng.uniform(-np.pi, np.pi, (2, 2000)), rng.normal(size=(2, 2000))
    solved = colloc.solve_balance(Chain(), coulomb(*law), angles, rates, delta).require()
    assert solved.iterations.mean() <= mean
    assert solved.iterations.max() <= largest


@pytest.mark.parametrize(
    ("name", "iterations", "levels"), [("three_link", 65, 10), ("three_link_offset", 65, 10)]
)
def test_effort_of_a_solve(solved, name, iterations, levels):
    solution, _ = solved(name)
    assert sum(level.iterations for level in solution.history) <= iterations
    assert len(solution.history) <= levels
    assert solution.mesh.n <= 40


def test_balance_solves_an_iteration_asks_for():
    """Value, Jacobian and Hessian at one point share one solve of the balance."""
    stated = {"gait": Harmonic(1, "bilateral"), "formulation": "implicit velocity"}
    problem = Problem("p", ellipse(0.3, 1, 0.5), intervals=12, **stated)
    program = program_of(problem)
    x = program.feasible(problem.gait.parameters(problem.guess), 0.1)
    result = Solver(program).solve_within(x, 0.1, None, 1.0)
    assert result.optimal
    assert program.velocity.solves <= 1.5 * result.iterations + 6


def plain(**changes):
    fields = {"guess": ellipse(0.1, 1.4, 0.8), "gait": Harmonic(1), "intervals": 8} | changes
    return Problem("p", **{name: value for name, value in fields.items() if value is not None})


@pytest.mark.parametrize(
    "changes",
    [
        *({"formulation": formulation} for formulation in FORMULATIONS),
        {"froude": 0.1, "grade": 0.1},
        {"power_limit": 0.3, "at_least": {"distance": 0.1}},
        {"body": ModalBody(3), "guess": None, "gait": Harmonic(1, "antipodal")},
    ],
    ids=str,
)
def test_every_row_has_a_meaning_and_a_phase(changes):
    program = program_of(plain(**changes))
    phases = []
    for row in range(program.row_lower.size):
        what, phase = confirm.row_meaning(program, row)
        assert what.startswith(("the ", "closure", "contact", "where ", "a value "))
        phases.append(phase)
    assert 0 <= min(phases) <= max(phases) <= 1


@pytest.mark.parametrize(
    ("formulation", "variable"), [("full", "spins"), ("implicit velocity", "z")]
)
def test_a_broken_balance_is_named_with_its_window(formulation, variable):
    program = program_of(plain(formulation=formulation))
    solver = Solver(program, {"max_iter": 0})
    x = program.feasible(plain().gait.parameters(plain().guess), 0.1)
    x[getattr(program.layout, variable)[-1, 10:13]] += 0.1
    result = solver.solve_within(x, 0.1, None, np.inf)
    text = explanation(program, result, 0.1)
    assert any(word in text for word in ("torque", "balance", "rotation", "rate", "friction"))
    said = re.search(r"between phases (.*) and (.*), worst at (0\.\d+)", text)
    first, last, worst = map(float, said.groups())
    assert first <= worst <= last < first + 0.3
    assert first < program.mesh.times[11] < last + 0.125
    assert "Try to" in text


def test_a_delta_that_rounding_hides_is_named():
    """At delta = 1e-10 the flagship's gradient is noise of 2e-6; at 1e-9 it is told from zero."""
    problem = plain()
    program = program_of(problem)
    x = program.feasible(problem.gait.parameters(problem.guess), 1e-10)
    result = Solver(program, {"max_iter": 0}).solve_within(x, 1e-10, None, np.inf)
    result = replace(result, excess=np.zeros_like(result.excess))
    assert "at least 1e-09, below which rounding" in explanation(program, result, 1e-10)
    assert "rounding" not in explanation(program, result, 1e-9)


def test_bounds_that_were_moved_stay_where_a_program_is_placed_anew():
    full, x, *_ = at_guess(stated("actuators", rotation=0.2))
    for name, by in ((ACTUATORS, -0.1), ("rotation", 0.3)):
        rows = full.groups[name]
        full = full.with_bounds(name, full.row_lower[rows] - by, full.row_upper[rows] + by)
    again, there = full.moved_to(x)
    np.testing.assert_allclose(there, x, atol=1e-12)
    bounds = [[each.row_lower, each.row_upper] for each in (again, full)]
    np.testing.assert_array_equal(*bounds)


def test_one_variable_in_two_places_of_a_function_has_both_mixed_derivatives():
    """Of x y, which is then x squared."""
    program = Program(2)
    product = program.repeat(lambda x, y: x * y, [np.array([0, 0]), np.array([0, 1])])
    program.objective = program.pick(product[0, :1])
    program.add("other", program.pick(product[0, 1:]))
    hessian = program.nlp.functions["hess_lag"]([3.0, 5.0], 1.0, 1.0, 10.0)
    np.testing.assert_array_equal(np.array(hessian), [[2.0, 10.0], [0.0, 0.0]])
