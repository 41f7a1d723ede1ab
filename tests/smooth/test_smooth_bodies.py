"""Every smooth body against plain sums over many points of the curve: nothing but its tangent angle
and the law."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from colloc.laws.resistance import PowerLaw, Viscous
from colloc.mechanics.friction import Friction
from colloc.results.motion import friction_arrows
from colloc.smooth.crawler_body import LAP, CrawlerBody
from colloc.smooth.modal_body import ModalBody
from colloc.smooth.prescribed_body import Concertina, Wave

POINTS = 9601
S = np.linspace(0.0, 1.0, POINTS)
PRESCRIBED = [
    Wave("sine", 1.2, 1.5),
    Wave("standing"),
    Concertina(0.2, bumps=1),
    Concertina(0.2, share=0.6, bumps=2),
]
BODIES = [
    ModalBody(4, panels=12),
    ModalBody(4, "fourier", panels=12),
    CrawlerBody(0.2, panels=24),
    *PRESCRIBED,
]
LAWS = [
    Friction(mu_t=1.7, mu_f=1.0, mu_b=1.7),
    Viscous(normal=2.0, tangential=1.0),
    PowerLaw(0.5, mu_t=2.0, mu_f=1.0, mu_b=1.0),
]
each_body = pytest.mark.parametrize(
    "body", BODIES, ids=lambda body: body.describe()[:40].replace(" ", "_")
)


def shapes(body, n=3, seed=1):
    """Shapes, rates and any velocity of the tail."""
    rng = np.random.default_rng(seed)
    q, rates, z = (
        0.3 * rng.normal(size=(body.n_joint, n)),
        rng.normal(size=(body.n_joint, n)),
        rng.normal(size=(3, n)),
    )
    if body in PRESCRIBED:
        t = 2 * np.pi * np.array([0.07, 0.21, 0.43])[:n]
        q, rates = np.stack([np.cos(t), np.sin(t)]), 5.0 * np.stack([-np.sin(t), np.cos(t)])
    elif isinstance(body, CrawlerBody):
        q[0] = rng.uniform(-LAP, LAP, n)
    return q, rates, 0.5 * z


def plain(body, q, rates, z):
    """Places and velocities ``(2, n_point, n_time)`` in the axes of Theta, and the tangents
    there."""
    s = S[:, None] * np.ones(q.shape[1])
    theta, turning = body.tangent(s, q), body.turning(s, q, rates) + z[2]
    along, across = (
        np.stack([np.cos(theta), np.sin(theta)]),
        np.stack([-np.sin(theta), np.cos(theta)]),
    )
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
    np.testing.assert_allclose(stated.force[:2], mean(force), atol=1e-5)
    np.testing.assert_allclose(
        stated.force[2], mean(place[0] * force[1] - place[1] * force[0]), atol=1e-5
    )
    np.testing.assert_allclose(stated.power[0], -mean((force * velocity).sum(axis=0)), atol=1e-5)
    np.testing.assert_allclose(stated.centre, mean(velocity), atol=1e-5)


@each_body
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_in_balance_these_sums_vanish_and_what_bends_the_body_does_the_work(body, law):
    (q, rates, _), delta = shapes(body), 0.1
    solved = body.solve(law, q, rates, delta)
    assert solved.converged.all()
    motion = body.motion(law, q, rates, delta, solved)
    place, velocity, along, across = plain(body, q, rates, solved.z)
    force = friction_on(law, velocity, along, across, delta)
    np.testing.assert_allclose(mean(force), 0.0, atol=1e-4)
    np.testing.assert_allclose(mean(place[0] * force[1] - place[1] * force[0]), 0.0, atol=1e-4)
    np.testing.assert_allclose(motion.centre, mean(velocity), atol=1e-5)
    np.testing.assert_allclose(
        motion.power, -mean((force * velocity).sum(axis=0)), rtol=1e-4, atol=1e-5
    )
    np.testing.assert_allclose(motion.actuator_power, motion.power, rtol=1e-6, atol=1e-6)


@each_body
def test_what_is_drawn_lies_on_the_curve_and_moves_as_it_does(body):
    (q, rates, z), delta, law = shapes(body), 0.3, LAWS[0]
    place, velocity, along, across = plain(body, q, rates, z)
    np.testing.assert_allclose(
        np.stack(body.outline(q)), place[:, :: (POINTS - 1) // 96], atol=1e-6
    )
    np.testing.assert_allclose(body.centre(q), mean(place), atol=1e-6)
    # 96 chords show a sharp bump that sticks and slides to a tenth of the largest friction
    middles = (POINTS - 1) * np.arange(1, 192, 2) // 192
    where, drawn = friction_arrows(body, law, q, rates, delta, z, count=96)
    np.testing.assert_allclose(where, place[:, middles], atol=1e-3)
    np.testing.assert_allclose(
        drawn, friction_on(law, velocity, along, across, delta)[:, middles], atol=0.15
    )


@pytest.mark.parametrize(
    "body",
    [body for body in PRESCRIBED if isinstance(body, Concertina)] + [CrawlerBody(0.2)],
    ids=str,
)
def test_between_the_breaks_of_a_bump_its_curvature_does_not_jump(body):
    """Theta'' jumps by as much as six times the square of the bump's steepness; a few points from a
    break it is continuous."""
    (q, _, _), h = shapes(body), S[1]
    theta = body.tangent(S[:, None] * np.ones(3), q)
    jumps, breaks = np.abs(np.diff(theta, 4, axis=0)) / h**2, body.breaks(q)
    assert np.all(np.abs(np.diff(breaks, axis=0)) >= -1e-12)
    assert (breaks.min(), breaks.max()) >= (0.0, 0.0)
    for k in range(3):
        near = np.abs(S[2:-2, None] - breaks[:, k]).min(axis=1) < 4 * h
        assert jumps[~near, k].max() < 0.05 * max(
            np.abs(np.diff(theta[:, k], 2)).max() / h**2, 1e-12
        )


@pytest.mark.parametrize("name", ["modes", "panels", "order"])
def test_limits_of_a_modal_body_are_those_that_it_names(name):
    least, most = {"modes": (1, 20), "panels": (1, 200), "order": (2, 12)}[name]
    for allowed in (least, most):
        assert getattr(ModalBody(**{name: allowed}), name) == allowed
    for refused in (least - 1, most + 1):
        with pytest.raises(
            ValueError, match=f"{name} must be a whole number from {least} to {most}"
        ):
            ModalBody(**{name: refused})
