"""The balance of smooth bodies: identities of the panels, limits, an independent quadrature,
precision at stick."""

import numpy as np
import pytest
from scipy import integrate

from colloc.mechanics.chain import Chain
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction, line_integrals
from colloc.smooth.balance import Motion, PanelGrid, curve, node_velocity, resultant, solve_smooth
from colloc.smooth.prescribed_body import Wave
from colloc.system.errors import NotConvergedError, ProblemError

ANISOTROPIC = Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)


def straight(rate: float) -> Motion:
    """A straight body whose frame turns: Theta_t is uniform."""
    return Motion(lambda s, t: 0.0 * s + rate * t, lambda s, t: 0.0 * s + rate)


@pytest.mark.parametrize("reference", [0, 3, 5])
def test_path_integrals_are_exact_for_polynomials(reference):
    edges = np.array([0.0, 0.1, 0.35, 0.4, 0.8, 1.0])[:, None]
    panels = PanelGrid(edges, order=5)
    s, origin = panels.nodes, edges[reference, 0]
    got = panels.integrate(panels.widths * 5 * s**4, reference)
    np.testing.assert_allclose(got, s**5 - origin**5, atol=2e-15)
    ends = panels.edge_path(reference) @ (panels.widths * 5 * s**4)
    np.testing.assert_allclose(ends, edges**5 - origin**5, atol=2e-15)


@pytest.mark.parametrize("reference", [0, 2, 4])
def test_a_stretch_that_rests_is_exactly_at_rest(reference):
    """Rates vanish on [0, 1/2]; with the reference held there, so does its velocity, to the last
    bit."""
    edges = np.linspace(0, 1, 9)[:, None]
    panels = PanelGrid(edges)
    s = panels.nodes
    rate = np.where(s > 0.5, (s - 0.5) ** 3, 0.0)
    body = curve(panels, np.sin(7 * s), rate, reference, np.zeros((1, 1)))
    vs, vn = node_velocity(body, np.zeros((3, 1)))
    assert np.all(vs[s < 0.5] == 0.0)
    assert np.all(vn[s < 0.5] == 0.0)
    assert np.abs(vn[s > 0.5]).max() > 1e-3


def test_straight_rotating_body_agrees_with_the_closed_form_of_a_link():
    panels = PanelGrid(np.linspace(0, 1, 41)[:, None], order=10)
    zero = np.zeros_like(panels.nodes)
    body = curve(panels, zero, zero, 20, np.zeros((1, 1)))
    z = np.array([[0.3], [0.2], [-1.1]])
    vs, vn = node_velocity(body, z)
    got = resultant(body, *ANISOTROPIC.density(vs, vn, 0.05))
    link = line_integrals(ANISOTROPIC).force(z[:1], z[1:2], z[2:], np.ones((1, 1)), 0.05)
    np.testing.assert_allclose(got, np.concatenate(link), atol=1e-13)


def naive_resultant(motion, friction, t, delta, z):
    """Force and torque about the tail by nested adaptive quadrature, straight from the paper's
    equations."""

    def position_and_velocity(s):
        def integrand(q, index):
            th = motion.angle(np.array([[q]]), np.array([t]))[0, 0]
            w = z[2] + motion.rate(np.array([[q]]), np.array([t]))[0, 0]
            return (np.cos(th), np.sin(th), -w * np.sin(th), w * np.cos(th))[index]

        return [integrate.quad(integrand, 0, s, args=(i,), epsabs=1e-11)[0] for i in range(4)]

    nodes, weights = np.polynomial.legendre.leggauss(24)
    total = np.zeros(3)
    for a, b in zip(np.linspace(0, 1, 5)[:-1], np.linspace(0, 1, 5)[1:], strict=True):
        for node, weight in zip(nodes, weights, strict=True):
            s = 0.5 * (a + b + (b - a) * node)
            x, y, vx, vy = position_and_velocity(s)
            vx, vy = vx + z[0], vy + z[1]
            th = motion.angle(np.array([[s]]), np.array([t]))[0, 0]
            vs, vn = vx * np.cos(th) + vy * np.sin(th), vy * np.cos(th) - vx * np.sin(th)
            r = np.sqrt(vx**2 + vy**2 + delta**2)
            mu_s = friction.mu_f if vs > 0 else friction.mu_b
            fs, fn = -mu_s * vs / r, -friction.mu_t * vn / r
            fx, fy = fs * np.cos(th) - fn * np.sin(th), fs * np.sin(th) + fn * np.cos(th)
            total += 0.5 * (b - a) * weight * np.array([fx, fy, x * fy - y * fx])
    return total


@pytest.mark.parametrize("friction", [Friction(), Friction(mu_t=10.0, mu_f=1.0, mu_b=1.0)])
def test_solution_balances_by_independent_quadrature(friction):
    motion, t, delta = Wave("sine", 0.8, 1.0).prescribed(), 0.13, 0.3
    solution = solve_smooth(motion, friction, np.array([t]), delta).require()
    assert np.abs(naive_resultant(motion, friction, t, delta, solution.z[:, 0])).max() < 1e-8


@pytest.mark.parametrize(
    "motion",
    [Wave().prescribed(), Wave("standing").prescribed(), Wave("tanh", 1.3, 2.0, 4.0).prescribed()],
)
@pytest.mark.parametrize("friction", [Friction(), ANISOTROPIC])
def test_many_starts_panels_and_methods_agree(motion, friction):
    t = np.array([0.02, 0.2, 0.41])
    base = solve_smooth(motion, friction, t, 1e-3).require()
    other = solve_smooth(motion, friction, t, 1e-3, panels=27, order=10).require()
    slow = solve_smooth(
        motion, friction, t, 1e-3, method="fixed_point", max_iterations=20000, panels=24
    ).require()
    np.testing.assert_allclose(other.z, base.z, atol=2e-8)
    np.testing.assert_allclose(slow.z, base.z, atol=2e-8)
    np.testing.assert_allclose(other.power, base.power, atol=2e-8)


def test_scaling_of_rates_and_delta():
    """z is homogeneous of degree one in (rates, delta)."""
    motion = Wave("standing").prescribed()
    twice = Motion(motion.angle, lambda s, t: 2 * motion.rate(s, t))
    t = np.array([0.03, 0.4])
    one, two = solve_smooth(motion, ANISOTROPIC, t, 1e-4), solve_smooth(twice, ANISOTROPIC, t, 2e-4)
    np.testing.assert_allclose(two.z, 2 * one.z, atol=1e-9)


def test_uniform_rotation_of_the_frame_is_undone():
    """A shape that only turns its frame does not move: the frame turns back, and no work is
    done."""
    solution = solve_smooth(straight(3.0), Friction(), np.array([0.0, 0.2]), 1e-6).require()
    np.testing.assert_allclose(solution.z[2], -3.0, rtol=1e-14)
    np.testing.assert_allclose(solution.z[:2], 0.0, atol=1e-14)
    np.testing.assert_allclose(solution.power, 0.0, atol=1e-18)


@pytest.mark.parametrize("delta", [1e-4, 1e-8, 1e-12])
def test_panels_resolve_the_layer_where_a_body_pivots(delta):
    """A body hinged in the middle, its front half turning: compare with two straight links,
    integrated in closed form."""
    width = 1e-6

    def step(s):
        return np.clip((s - 0.5 + width / 2) / width, 0.0, 1.0)

    hinge = Motion(
        lambda s, t: 0.9 * step(s),
        lambda s, t: 1.0 * step(s),
        breaks=lambda t: np.array([[0.5 - width / 2], [0.5 + width / 2]]) * np.ones((1, t.size)),
    )
    smooth = solve_smooth(hinge, Friction(), np.array([0.1]), delta).require()
    chain = solve_balance(
        Chain((0.5, 0.5)), Friction(), np.array([[0.9]]), np.array([[1.0]]), delta
    ).require()
    np.testing.assert_allclose(smooth.z[:, 0], chain.z[:, 0], atol=5e-6)
    assert smooth.quadrature_error.max() < 1e-10


def test_unusable_input_is_named():
    with pytest.raises(ProblemError, match="delta must be a positive"):
        solve_smooth(Wave().prescribed(), Friction(), np.array([0.1]), 0.0)
    with pytest.raises(ProblemError, match="finite"):
        solve_smooth(
            Motion(lambda s, t: s * np.nan, lambda s, t: s), Friction(), np.array([0.1]), 1e-3
        )
    with pytest.raises(ProblemError, match="stages must ascend"):
        Motion(lambda s, t: s, lambda s, t: s, stages=(0.0, 0.4))
    with pytest.raises(NotConvergedError, match="did not balance at 1 of 1"):
        solve_smooth(
            Wave().prescribed(),
            Friction(),
            np.array([0.1]),
            1e-6,
            max_iterations=1,
            method="fixed_point",
        ).require()
