"""What every law of friction has to be: dissipative, the same in any frame, and along links; and
Purcell's swimmer, whose pace matters: against another integration, and certified."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import colloc
from benchmarks.peers import drag
from colloc import Axle, Chain, Elliptic, Friction, OwnLaw, PowerLaw, Viscous, replay, save
from colloc.bounds.optimality_gap import gap_line
from colloc.commands.solve import summary_lines
from colloc.gaits.gait_fields import LAWS, fields, part_from
from colloc.mechanics.balance import balance_jacobian, instant
from colloc.mechanics.fixed_point import motion_and_derivatives
from colloc.mechanics.friction import line_integrals
from colloc.mechanics.law import Law
from colloc.mechanics.solution_branches import all_balanced_velocities
from colloc.pictures.report_page import report_page
from colloc.search.solve import solve
from colloc.smooth.smooth_body import accurate_motion

LENGTHS = Chain().length_column()
WEAKER = "/speed * (1 + 0.5*exp(-speed))"
OWN = OwnLaw(f"-where(vs > 0, 1, 1.5)*vs{WEAKER}", f"-2*vn{WEAKER}")
EVERY = [
    Friction(mu_t=2.0, mu_f=1.0, mu_b=1.5),
    Elliptic(mu_t=2.0, mu_f=1.0, mu_b=1.5),
    Axle(rolling=0.2, sideways=1.5),
    Viscous(normal=1.8, tangential=1.0),
    PowerLaw(0.4, mu_t=2.0, mu_f=1.0, mu_b=1.5),
    OWN,
]
ASSOCIATED = [
    Friction(),
    Elliptic(mu_t=0.3, mu_f=1.0, mu_b=4.0),
    Axle(rolling=0.2, sideways=1.5),
    Viscous(normal=1.8, tangential=1.0),
    PowerLaw(0.4, 1.5, 1.5, 1.5),
]
each = pytest.mark.parametrize("law", EVERY, ids=lambda law: type(law).__name__)
each_associated = pytest.mark.parametrize("law", ASSOCIATED, ids=lambda law: type(law).__name__)


def moving_links(seed, count=40):
    rng = np.random.default_rng(seed)
    return 10 ** rng.uniform(-3, 1, (3, 3, count)) * rng.choice([-1, 1], (3, 3, count))


def instants(seed, count=12):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.5, 1.5, (2, count)), rng.normal(size=(2, count))


@each
def test_friction_opposes_the_motion_and_does_not_tell_left_from_right(law):
    vs, vn, _ = moving_links(1)
    fs, fn = law.density(vs, vn, 1e-3)
    assert (fs * vs + fn * vn < 0).all()
    np.testing.assert_array_equal(law.density(vs, -vn, 1e-3), [fs, -fn])
    if law is not OWN:  # whose friction falls with the speed
        c, s = np.cos(ways := np.linspace(0.0, 2 * np.pi, 721)[None]), np.sin(ways)
        fs, fn = law.density(c, s, 1e-9)
        assert np.hypot(fs, fn).max() == pytest.approx(law.largest, rel=1e-4)
        assert -(fs * c + fn * s).max() == pytest.approx(law.smallest, rel=1e-4)


@pytest.mark.parametrize("law", [*EVERY, Friction()], ids=lambda law: type(law).__name__)
def test_a_law_in_other_units_or_in_a_file_is_the_same_law(law):
    assert isinstance(law, Law)
    assert part_from(LAWS, fields(law)) == law
    vs, vn, _ = moving_links(2)
    force = np.array(law.density(vs, vn, 1e-2))
    slower = law.in_speeds_of(4.0).density(vs / 4, vn / 4, 1e-2 / 4)
    np.testing.assert_allclose(slower, force, rtol=1e-13)
    slopes = law.in_speeds_of(4.0).density_jacobian(vs / 4, vn / 4, 1e-2 / 4)
    np.testing.assert_allclose(slopes, 4 * np.array(law.density_jacobian(vs, vn, 1e-2)), rtol=1e-9)
    np.testing.assert_allclose(law.in_units_of(3.0).density(vs, vn, 1e-2), force / 3, rtol=1e-13)
    if law.degree is not None:
        faster = law.density(2 * vs, 2 * vn, 2e-2)
        np.testing.assert_allclose(faster, 2**law.degree * force, rtol=1e-13)
    if law.reversible:
        np.testing.assert_allclose(law.density(-vs, -vn, 1e-2), -force, rtol=1e-13)


@pytest.mark.parametrize("power", [0.0, 0.5, 1.0, 1.5, 2.0])
def test_the_secant_of_a_power_law_is_no_less_than_its_slope(power):
    """Steps by the secant then never go too far, above degree 1 as below it."""
    law, (vs, vn, _) = PowerLaw(power, 1.5, 1.5, 1.5), moving_links(4)
    secant = np.array(law.density_secant(vs, vn, 1e-2))
    gap = np.moveaxis(secant - np.array(law.density_jacobian(vs, vn, 1e-2)), (0, 1), (-2, -1))
    size = np.abs(secant).max(axis=(0, 1))
    assert (np.linalg.eigvalsh(gap).min(axis=-1) > -1e-12 * size).all()


def test_the_secant_of_formulas_that_are_dry_in_each_direction_does_not_vanish():
    """Far from both axes the slopes do, and fixed-point steps ran off."""
    law = OwnLaw("-0.3*vs/sqrt(vs**2 + 1e-4)", "-vn/sqrt(vn**2 + 1e-4)")
    vs, vn = np.array([[1e-2, 1e-1, 3.0, 20.0]]), np.array([[5.0, 1e-2, 2.0, 1e-1]])
    secant, force = law.density_secant(vs, vn, 1e-4), law.density(vs, vn, 1e-4)
    for k, v in enumerate((vs, vn)):
        assert (secant[k][k] * v > -0.7 * force[k]).all()


@each
def test_forces_on_links_are_integrals_of_the_force_on_points(law):
    velocity = moving_links(3, 4)
    force = line_integrals(law).force(*velocity, LENGTHS, 1e-3)
    for link, t in np.ndindex(3, 4):
        vs, vn, w = velocity[:, link, t]
        half = 0.5 * LENGTHS[link, 0]
        scale = max(abs(part[link, t]) for part in force)
        how = {"points": [-vn / w] if abs(vn / w) < half else None, "limit": 400}
        how |= {"epsabs": 1e-12 * scale, "full_output": 1}

        def at(sigma, k, vs=vs, vn=vn, w=w):
            fs, fn = law.density(np.array([[vs]]), np.array([[vn + w * sigma]]), 1e-3)
            return (fs[0, 0], fn[0, 0], sigma * fn[0, 0])[k]

        for k, whole in enumerate(force):
            expected = quad(at, -half, half, (k,), **how)[0]
            assert abs(whole[link, t] - expected) < 1e-8 * scale


@each
def test_jacobians_are_the_derivatives(law):
    velocity, step, on_links = moving_links(4), 1e-6, line_integrals(law)
    for slopes, force, known, at in (
        (law.density_jacobian, law.density, velocity[:2], (0.05,)),
        (on_links.jacobian, on_links.force, velocity, (LENGTHS, 0.05)),
    ):
        steps = step * np.eye(len(known))[:, :, None, None] * np.abs(known).max(axis=0)
        for j, shift in enumerate(steps):
            ahead, behind = (np.array(force(*(known + sign * shift), *at)) for sign in (1, -1))
            rows = slopes(*known, *at)
            found = np.array([np.broadcast_to(row[j], known[0].shape) for row in rows])
            numeric = (behind - ahead) / (2 * np.abs(shift[j]))
            np.testing.assert_allclose(found, numeric, atol=1e-6 * max(1.0, np.abs(found).max()))


@each
def test_a_full_program_s_rows_vanish_where_forces_obey_the_law(law):
    names, on_links = [ca.SX.sym(name, 3) for name in ("vs", "vn", "w")], line_integrals(law)
    force = on_links.force(*names, LENGTHS, 1e-3)
    rows = ca.Function("rows", names, on_links.scaled_laws(*names, LENGTHS, 1e-3, force))
    values = [row.full() for row in rows(*map(ca.DM, moving_links(5, 1)))]
    assert np.abs(values).max() < 1e-9


@each
def test_joints_pay_what_friction_takes_whatever_end_a_balanced_body_is_named_from(law):
    body, (angles, rates) = Chain(), instants(6)

    def moved(angles, rates):
        solved = body.solve(law, angles, rates, 1e-3).require()
        return body.motion(law, angles, rates, 1e-3, solved)

    now = moved(angles, rates)
    np.testing.assert_allclose(now.actuator_power, now.power, rtol=1e-8)
    assert (now.power > 0).all()
    mirrored = moved(-angles, -rates)
    np.testing.assert_allclose(mirrored.power, now.power, rtol=1e-7)
    if law.reversible:
        swapped = moved(-angles[::-1], -rates[::-1])
        np.testing.assert_allclose(swapped.power, now.power, rtol=1e-7)
        np.testing.assert_allclose(
            *(np.linalg.norm(each.centre, axis=0) for each in (swapped, now)), rtol=1e-7
        )


@each_associated
def test_an_associated_law_is_the_gradient_of_a_convex_function(law):
    velocity, h, on_links = moving_links(8), 1e-6, line_integrals(law)
    rows = on_links.jacobian(*velocity, LENGTHS, 0.1)
    jacobian = np.array([[np.broadcast_to(e, velocity[0].shape) for e in row] for row in rows])
    atol = 1e-12 * np.abs(jacobian).max()
    np.testing.assert_allclose(jacobian, jacobian.swapaxes(0, 1), atol=atol)
    assert np.linalg.eigvalsh(np.moveaxis(jacobian, (0, 1), (-2, -1))).min() > 0
    force = on_links.force(*velocity, LENGTHS, 0.1)
    for j, shift in enumerate(h * np.eye(3)[:, :, None, None] * np.abs(velocity).max(axis=0)):
        ahead, behind = (on_links.potential(*(velocity + s * shift), LENGTHS, 0.1) for s in (1, -1))
        slope, atol = (ahead - behind) / (2 * np.abs(shift[j])), 1e-6 * np.abs(force[j]).max()
        np.testing.assert_allclose(slope, -force[j], atol=atol)


def test_where_coulomb_friction_leaves_three_motions_the_elliptic_law_leaves_one():
    body, angles, rates = Chain(), np.array([[0.78302927], [1.74481885]]), np.array([[-3.0], [0.0]])
    steep, law = (law(mu_t=1, mu_f=0.01, mu_b=100) for law in (Friction, Elliptic))
    several = all_balanced_velocities(body, steep, angles, rates, 1e-4)
    assert several.number.tolist() == [3]
    found = [body.solve(law, angles, rates, 1e-4, start=z).require() for z in several.z]
    for one in found:
        np.testing.assert_allclose(one.z, found[0].z, atol=1e-6)
    at = instant(body, law, angles, rates, found[0].z, 1e-4)
    matrix = balance_jacobian(body, law, at.posture, at.velocity, np.full((1, 1), 1e-4))
    assert np.linalg.eigvalsh(matrix).min() > 0


@pytest.mark.parametrize("mu", [1.0, 0.7])
def test_the_elliptic_law_with_equal_coefficients_is_isotropic_friction_to_the_last_digit(mu):
    found = []
    for law in (Friction(mu, mu, mu), Elliptic(mu, mu, mu)):
        at = Chain(), law, *instants(9, 40), 1e-6
        solved = colloc.solve_balance(*at).require()
        motion, slopes = motion_and_derivatives(*at, solved)
        found.append((motion.z, motion.power, slopes))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    "law", [Viscous(), PowerLaw(0.5, mu_t=2.0), OWN], ids=lambda law: type(law).__name__
)
def test_smooth_bodies_obey_any_law_whatever_solver_they_are_asked_by(law):
    body, rng = colloc.ModalBody(), np.random.default_rng(14)
    angles, rates = np.array([[[0.3]], [[5.0]]]) * rng.normal(size=(2, body.n_joint, 2))
    at = law, angles, rates, 0.1
    solved = body.motion(*at, body.solve(*at).require())
    replayed = accurate_motion(body, *at, None)[0]
    # fixed panels resolve an instant like these to some 1e-3, whatever the law
    np.testing.assert_allclose(replayed.power, solved.power, rtol=5e-3)
    for motion in (solved, replayed):
        np.testing.assert_allclose(motion.actuator_power, motion.power, rtol=1e-6)


def test_viscous_motion_is_linear_in_the_rates():
    body, law, (angles, rates) = Chain(), Viscous(), instants(11)
    other = np.random.default_rng(12).normal(size=rates.shape)
    one, two, both = (body.solve(law, angles, r, 1e-4) for r in (rates, other, rates - 3 * other))
    np.testing.assert_allclose(both.z, one.z - 3 * two.z, atol=1e-13)
    assert both.iterations.max() == 1


def test_the_power_law_ends_in_drag_and_in_coulomb_friction():
    body, (angles, rates) = Chain(), instants(13)
    mu = {"mu_t": 2.0, "mu_f": 1.0, "mu_b": 1.0}

    def power(law, delta=1e-6):
        z = body.solve(law, angles, rates, delta).require()
        return body.motion(law, angles, rates, delta, z).power

    drag, dry = power(Viscous(normal=2.0, tangential=1.0)), power(Friction(**mu))
    np.testing.assert_allclose(power(PowerLaw(1.0, **mu)), drag, rtol=1e-12)
    np.testing.assert_allclose(power(PowerLaw(0.0, **mu)), dry, rtol=1e-9)
    # smooth across 1: differences on both sides are equal and opposite to first order
    above, below = (power(PowerLaw(1.0 + h, **mu)) - drag for h in (1e-4, -1e-4))
    np.testing.assert_allclose(above, -below, atol=1e-3 * np.abs(above).max())
    ratio = (power(PowerLaw(2e-3, **mu)) - dry) / (power(PowerLaw(1e-3, **mu)) - dry)
    np.testing.assert_allclose(ratio, 2.0, atol=0.05)


ROOT = Path(__file__).resolve().parents[2]
LAW, CORNERS = Viscous(normal=drag.NORMAL, tangential=drag.TANGENTIAL), (0.25, 0.5, 0.75)


def square(amplitude):
    """Purcell's stroke: the joints take turns, so that the angles run round a square."""

    def path(t):
        side = np.minimum((np.asarray(t) * 4).astype(int), 3)
        s = np.asarray(t) * 4 - side
        start = amplitude * np.array([[-1, 1, 1, -1], [1, 1, -1, -1]])[:, side]
        step = 2 * amplitude * np.array([[1, 0, -1, 0], [0, -1, 0, 1]])[:, side]
        return start + step * s, 4 * step

    return path


@pytest.mark.parametrize("amplitude", [0.3, 0.9])
def test_purcells_square_stroke_goes_as_far_as_an_independent_integration_says(amplitude):
    path = square(amplitude)
    measured = replay(Chain(), LAW, path, 1e-4, breaks=CORNERS, instants=160, tolerance=1e-9)

    def rates(t, state):
        angles, turning = (a[:, 0] for a in path(np.array([t])))
        R = drag.resistance(state[2], angles)
        rigid = -np.linalg.solve(R[:3, :3], R[:3, 3:] @ turning)
        whole = np.concatenate([rigid, turning])
        return [*rigid, whole @ R @ whole]

    def centre(state, t):
        angles, theta = path(np.array([t]))[0][:, 0], state[2]
        ahead = np.exp(1j * (theta + angles[1])) - np.exp(1j * (theta - angles[0]))
        return complex(*state[:2]) + ahead / 18

    state = np.zeros(4)
    begin = centre(state, 0.0)
    for a, b in zip((0.0, *CORNERS), (*CORNERS, 1.0), strict=True):
        inside = lambda t, y, a=a, b=b: rates(min(max(t, a), b - 1e-12), y)  # noqa: E731
        state = solve_ivp(inside, (a, b), state, rtol=1e-10, atol=1e-12).y[:, -1]
    assert abs(centre(state, 0.0) - begin) == pytest.approx(measured.distance, rel=1e-7)
    assert state[3] == pytest.approx(measured.work, rel=1e-7)
    assert state[2] == pytest.approx(measured.rotation, abs=1e-8)


@pytest.fixture(scope="module")
def purcell():
    return solve(colloc.load_problem(ROOT / "problems/purcell.py"), 1)


def test_purcells_swimmer_is_solved_certified_kept_and_read(purcell, tmp_path):
    solution = purcell
    assert solution.status == "solved"
    assert solution.measured.value == pytest.approx(0.0115705, abs=1e-7)
    read = colloc.load(save(solution, tmp_path / "purcell.h5"))
    assert read.problem.hash == solution.problem.hash
    assert read.problem.friction == LAW
    assert "as work depends on the pace under drag (2, 1)" in "\n".join(
        summary_lines(solution, None, verbose=True)
    )
    assert "the work depends on the pace" in report_page(solution)
    assert "no upper bound" in gap_line(solution.problem.with_(objective="efficiency"), 0.1, None)


def test_with_more_harmonics_the_pace_comes_closer_to_the_best_one_constant_power(purcell):
    more = solve(purcell.problem.with_(gait=colloc.Harmonic(3, "antipodal")), 1)
    assert more.status == "solved"
    assert more.measured.value == pytest.approx(0.0123108, abs=1e-7)
    spread = []
    for solution in (purcell, more):
        power = solution.power(solution.sample(np.arange(64) / 64))
        spread.append(power.std() / power.mean())
    assert spread[1] < 0.5 * spread[0]
