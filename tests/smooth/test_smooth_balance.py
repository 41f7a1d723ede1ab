"""The balance of smooth bodies: identities of the panels, limits, precision at stick; and every body
against plain sums over many points of the curve: nothing but its tangent angle and the law."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import cumulative_trapezoid

import colloc
from colloc import Chain, Concertina, CrawlerBody, Friction, ModalBody, Viscous, Wave
from colloc.mechanics.fixed_point import motion_and_derivatives, solve_balance
from colloc.results.motion import friction_arrows
from colloc.smooth.balance import Motion, PanelGrid, curve, node_velocity, solve_smooth
from colloc.smooth.smooth_body import LAP
from tests.shared.cases import slow

ANISOTROPIC = Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)


@pytest.mark.parametrize("reference", [0, 2, 4])
def test_a_stretch_that_rests_is_exactly_at_rest(reference):
    """Rates vanish on [0, 1/2]; a reference held there has no velocity, to the last bit."""
    edges = np.linspace(0, 1, 9)[:, None]
    panels = PanelGrid(edges)
    s = panels.nodes
    rate = np.where(s > 0.5, (s - 0.5) ** 3, 0.0)
    body = curve(panels, np.sin(7 * s), rate, reference, np.zeros((1, 1)))
    vs, vn = node_velocity(body, np.zeros((3, 1)))
    assert np.all(vs[s < 0.5] == 0.0)
    assert np.all(vn[s < 0.5] == 0.0)
    assert np.abs(vn[s > 0.5]).max() > 1e-3


@pytest.mark.parametrize(
    "motion",
    [Wave().prescribed(), Wave("standing").prescribed(), Wave("tanh", 1.3, 2.0, 4.0).prescribed()],
)
@pytest.mark.parametrize("friction", [slow(Friction()), ANISOTROPIC])
def test_many_starts_panels_and_methods_agree(motion, friction):
    t = np.array([0.02, 0.2, 0.41])
    base = solve_smooth(motion, friction, t, 1e-3).require()
    other = solve_smooth(motion, friction, t, 1e-3, panels=27, order=10).require()
    slowly = {"method": "fixed_point", "max_iterations": 20000, "panels": 24}
    slow = solve_smooth(motion, friction, t, 1e-3, **slowly).require()
    assert_allclose(other.z, base.z, atol=2e-8)
    assert_allclose(slow.z, base.z, atol=2e-8)
    assert_allclose(other.power, base.power, atol=2e-8)


def test_uniform_rotation_of_the_frame_is_undone():
    """A shape that only turns its frame rests: the frame turns back, without work."""
    turning = Motion(lambda s, t: 0.0 * s + 3.0 * t, lambda s, t: 0.0 * s + 3.0)
    solution = solve_smooth(turning, Friction(), np.array([0.0, 0.2]), 1e-6).require()
    assert_allclose(solution.z[2], -3.0, rtol=1e-14)
    assert_allclose(solution.z[:2], 0.0, atol=1e-14)
    assert_allclose(solution.power, 0.0, atol=1e-18)


@pytest.mark.parametrize("delta", [1e-4, 1e-8, 1e-12])
def test_panels_resolve_the_layer_where_a_body_pivots(delta):
    """Hinged in the middle, the front half turning: as two straight links in closed form."""
    width = 1e-6

    def step(s):
        return np.clip((s - 0.5 + width / 2) / width, 0.0, 1.0)

    hinge = Motion(
        lambda s, t: 0.9 * step(s),
        lambda s, t: 1.0 * step(s),
        breaks=lambda t: np.array([[0.5 - width / 2], [0.5 + width / 2]]) * np.ones((1, t.size)),
    )
    smooth = solve_smooth(hinge, Friction(), np.array([0.1]), delta).require()
    at = np.array([[0.9]]), np.array([[1.0]]), delta
    chain = solve_balance(Chain((0.5, 0.5)), Friction(), *at).require()
    assert_allclose(smooth.z[:, 0], chain.z[:, 0], atol=5e-6)


def test_what_does_not_balance_is_said():
    at = Wave().prescribed(), Friction(), np.array([0.1]), 1e-6
    with pytest.raises(colloc.NotConvergedError, match="did not balance at 1 of 1"):
        solve_smooth(*at, max_iterations=1, method="fixed_point").require()


POINTS = 9601
S = np.linspace(0.0, 1.0, POINTS)
PRESCRIBED = [Wave("sine", 1.2, 1.5), Wave("standing"), Wave("tanh", 1.3, 2.0, 4.0)]
PRESCRIBED += [Concertina(0.2, bumps=1), Concertina(0.2, share=0.6, bumps=2)]
BODIES = [ModalBody(4, basis, panels=12) for basis in ("legendre", "fourier")]
BODIES += [CrawlerBody(0.2, panels=24), *PRESCRIBED]
LAWS = [
    Friction(mu_t=1.7, mu_b=1.7),
    Viscous(normal=2, tangential=1),
    colloc.PowerLaw(0.5, mu_t=2.0),
]
each_body = pytest.mark.parametrize(
    "body", BODIES, ids=lambda body: body.describe()[:40].replace(" ", "_")
)


def shapes(body, n=3, seed=1):
    """Shapes, rates and any velocity of the tail."""
    rng = np.random.default_rng(seed)
    size = body.n_joint, n
    q, rates, z = 0.3 * rng.normal(size=size), rng.normal(size=size), rng.normal(size=(3, n))
    if body in PRESCRIBED:
        t = 2 * np.pi * np.array([0.07, 0.21, 0.43])[:n]
        q, rates = np.stack([np.cos(t), np.sin(t)]), 5.0 * np.stack([-np.sin(t), np.cos(t)])
    elif isinstance(body, CrawlerBody):
        q[0] = rng.uniform(-LAP, LAP, n)
    return q, rates, 0.5 * z


def plain(body, q, rates, z):
    """Places, velocities ``(2, n_point, n_time)`` in the axes of Theta; tangents and normals."""
    s = S[:, None] * np.ones(q.shape[1])
    theta, turning = body.tangent(s, q), body.turning(s, q, rates) + z[2]
    along = np.stack([np.cos(theta), np.sin(theta)])
    across = np.stack([-np.sin(theta), np.cos(theta)])
    place, moved = (
        cumulative_trapezoid(a, S, axis=1, initial=0) for a in (along, turning * across)
    )
    return place, moved + z[:2, None], along, across


def mean(a):
    return np.trapezoid(a, S, axis=-2)


def friction_on(law, velocity, along, across, delta):
    """Force per length, in the axes of Theta."""
    fs, fn = law.density(
        (velocity * along).sum(axis=0), (velocity * across).sum(axis=0), np.array([[delta]])
    )
    return fs * along + fn * across


@each_body
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_force_torque_power_and_centre_of_a_sliding_body_are_sums_over_its_points(body, law):
    (q, rates, z), delta = shapes(body), 0.3
    place, velocity, along, across = plain(body, q, rates, z)
    force = friction_on(law, velocity, along, across, delta)
    stated = body.sliding(law, q, rates, z, np.full((1, 3), delta))
    assert_allclose(stated.force[:2], mean(force), atol=1e-5)
    assert_allclose(stated.force[2], mean(place[0] * force[1] - place[1] * force[0]), atol=1e-5)
    assert_allclose(stated.power[0], -mean((force * velocity).sum(axis=0)), atol=1e-5)
    assert_allclose(stated.centre, mean(velocity), atol=1e-5)


@each_body
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_in_balance_these_sums_vanish_and_what_bends_the_body_does_the_work(body, law):
    (q, rates, _), delta = shapes(body), 0.1
    solved = body.solve(law, q, rates, delta)
    assert solved.converged.all()
    motion = body.motion(law, q, rates, delta, solved)
    place, velocity, along, across = plain(body, q, rates, solved.z)
    force = friction_on(law, velocity, along, across, delta)
    assert_allclose(mean(force), 0.0, atol=1e-4)
    assert_allclose(mean(place[0] * force[1] - place[1] * force[0]), 0.0, atol=1e-4)
    assert_allclose(motion.centre, mean(velocity), atol=1e-5)
    assert_allclose(motion.power, -mean((force * velocity).sum(axis=0)), rtol=1e-4, atol=1e-5)
    assert_allclose(motion.actuator_power, motion.power, rtol=1e-6, atol=1e-6)


@each_body
def test_what_is_drawn_lies_on_the_curve_and_moves_as_it_does_which_turns_as_its_tangent_does(body):
    (q, rates, z), delta, law = shapes(body), 0.3, LAWS[0]
    s, h = np.linspace(0, 1, 1501)[:, None] * np.ones(3), 1e-6
    moved = (body.tangent(s, q + h * rates) - body.tangent(s, q - h * rates)) / (2 * h)
    assert_allclose(body.turning(s, q, rates), moved, atol=1e-5 * max(np.abs(moved).max(), 1.0))
    place, velocity, along, across = plain(body, q, rates, z)
    assert_allclose(np.stack(body.outline(q)), place[:, :: (POINTS - 1) // 96], atol=1e-6)
    assert_allclose(body.centre(q), mean(place), atol=1e-6)
    # 96 chords show a sharp bump that sticks and slides to a tenth of the largest friction
    middles = (POINTS - 1) * np.arange(1, 192, 2) // 192
    where, drawn = friction_arrows(body, law, q, rates, delta, z, count=96)
    assert_allclose(where, place[:, middles], atol=1e-3)
    assert_allclose(drawn, friction_on(law, velocity, along, across, delta)[:, middles], atol=0.15)


@pytest.mark.parametrize("body", [*PRESCRIBED[3:], CrawlerBody(0.2)], ids=str)
def test_between_the_breaks_of_a_bump_its_curvature_does_not_jump(body):
    """At a break it jumps by up to six times the square of the bump's steepness."""
    (q, _, _), h = shapes(body), S[1]
    theta = body.tangent(S[:, None] * np.ones(3), q)
    jumps, breaks = np.abs(np.diff(theta, 4, axis=0)) / h**2, body.breaks(q)
    assert np.all(np.abs(np.diff(breaks, axis=0)) >= -1e-12)
    assert (breaks.min(), breaks.max()) >= (0.0, 0.0)
    for k in range(3):
        near = np.abs(S[2:-2, None] - breaks[:, k]).min(axis=1) < 4 * h
        assert (
            jumps[~near, k].max() < 0.05 * max(np.abs(np.diff(theta[:, k], 2)).max(), 1e-20) / h**2
        )


@pytest.mark.parametrize(
    "law",
    [slow(LAWS[0]), slow(Friction()), slow(Friction(mu_t=100.0)), Friction(mu_t=0.5, mu_b=3.0)],
)
@pytest.mark.parametrize("body", [ModalBody(3, panels=6), CrawlerBody(0.05, panels=16)], ids=str)
def test_slopes_of_the_motion_in_balance_are_those_of_differences(body, law):
    delta, n, steps = 0.1, body.n_joint, 1e-6 * np.eye(2 * body.n_joint)[:, :, None]
    at = np.concatenate(shapes(body)[:2])

    def motion(y):
        solved = body.solve(law, y[:n], y[n:], delta, tolerance=1e-13)
        now = body.motion(law, y[:n], y[n:], delta, solved)
        return solved, np.concatenate([now.z, now.centre, now.power[None]])

    numeric = np.stack([(motion(at + e)[1] - motion(at - e)[1]) / 2e-6 for e in steps], axis=1)
    _, slopes = motion_and_derivatives(body, law, at[:n], at[n:], delta, motion(at)[0])
    assert_allclose(slopes, numeric, atol=1e-6 * np.abs(numeric).max())
