"""Concertina crawlers: geometry of the shapes, the bound, scalings with epsilon, and what holds the
anchor."""

import runpy

import numpy as np
import pytest

from colloc.mechanics.friction import Friction
from colloc.smooth.prescribed_body import Concertina
from colloc.system.errors import ProblemError
from scripts.continue_epsilon import (
    Crawler,
    EpsilonPoint,
    delta_for,
    epsilon_point,
    fitted_order,
    fitted_orders,
)

SIDEWAYS = Crawler(
    Concertina(epsilon=0.02, amplitude=1.2, share=0.3, bumps=2),
    Friction(mu_t=1.0, mu_f=3.0, mu_b=3.0),
    delta=1e-6,
)
ONE = Crawler(Concertina(epsilon=0.05, amplitude=1.3), delta=1e-6)


@pytest.mark.parametrize("crawler", [ONE, SIDEWAYS, ONE.with_(backwards=True)])
def test_rate_is_the_derivative_of_the_angle(crawler):
    motion, h = crawler.body.prescribed(), 1e-6
    s = np.linspace(0, 1, 1501)[:, None] * np.ones((1, 4))
    t = (
        np.array([0.1, 0.2, 0.3, 0.45])
        if crawler.body.bumps == 1
        else np.array([0.1, 0.3, 0.6, 0.9])
    )
    numeric = (motion.angle(s, t + h) - motion.angle(s, t - h)) / (2 * h)
    scale = np.abs(motion.rate(s, t)).max()
    np.testing.assert_allclose(motion.rate(s, t), numeric, atol=1e-5 * scale)


def test_the_second_half_is_the_mirror_image():
    s, t = np.linspace(0, 1, 301)[:, None] * np.ones((1, 3)), np.array([0.1, 0.25, 0.4])
    motion = ONE.body.prescribed()
    np.testing.assert_allclose(motion.angle(s, t + 0.5), -motion.angle(s, t), atol=1e-12)


def test_two_bumps_are_antisymmetric_and_keep_their_length():
    """Theta(1 - s) = -Theta(s), and the chord along the body never changes, in all stages."""
    motion = SIDEWAYS.body.prescribed()
    t = np.linspace(0.0, 0.999, 41)
    s = np.linspace(0, 1, 20001)[:, None] * np.ones((1, t.size))
    angle = motion.angle(s, t)
    np.testing.assert_allclose(angle[::-1], -angle, atol=1e-9)
    chord = np.trapezoid(np.cos(angle), s[:, 0], axis=0)
    np.testing.assert_allclose(chord, chord[0], atol=1e-9)


@pytest.mark.parametrize("crawler", [ONE, SIDEWAYS])
def test_the_anchor_holds_and_the_stroke_is_the_geometry(crawler):
    """The distance is what the shape shortens or shifts, less a creep of order delta; nothing
    rotates."""
    p = crawler.period(intervals=2, quadrature_tolerance=1e-8)
    assert p.d == pytest.approx(crawler.body.stroke, rel=2e-4)
    assert p.d < crawler.body.stroke
    assert p.nodes.slowest.max() < 30 * crawler.delta
    assert abs(p.rotation) < 1e-12
    assert p.efficiency < crawler.bound


def test_isotropic_crawler_scales_as_the_paper_says():
    """d ~ epsilon, W_inner ~ epsilon^2, W_outer/d -> 1, 1 - efficiency ~ epsilon; above 0.99 at
    epsilon = 0.0025."""
    epsilons = (0.01, 0.005, 0.0025)
    periods = [
        ONE.with_(epsilon=e, delta=delta_for(e)).period(intervals=1, quadrature_tolerance=1e-8)
        for e in epsilons
    ]
    assert fitted_order(epsilons, [p.d for p in periods]) == pytest.approx(1.0, abs=0.01)
    assert fitted_order(epsilons, [p.W_inner for p in periods]) == pytest.approx(2.0, abs=0.02)
    assert fitted_order(epsilons, [1 - p.efficiency for p in periods]) == pytest.approx(
        1.0, abs=0.05
    )
    assert [abs(p.W_outer / p.d - 1) < 2.2 * e for p, e in zip(periods, epsilons, strict=True)] == [
        True
    ] * 3
    assert 0.99 < periods[-1].efficiency < 1.0


def test_two_bump_crawler_beats_nine_tenths_of_the_bound():
    p = SIDEWAYS.with_(epsilon=0.01, delta=2.5e-7).period(intervals=1, quadrature_tolerance=1e-8)
    assert 0.9 / SIDEWAYS.friction.mu_t < p.efficiency < SIDEWAYS.bound


def test_backwards_is_forwards_with_the_coefficients_exchanged():
    forwards = ONE.with_(friction=Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3))
    backwards = ONE.with_(friction=Friction(mu_t=1.7, mu_f=1.3, mu_b=1.0), backwards=True)
    a, b = (c.period(intervals=1, nodes=4) for c in (forwards, backwards))
    assert a.efficiency == pytest.approx(b.efficiency, rel=1e-8)


def test_a_bump_that_takes_half_its_region_tears_the_anchor_loose_on_very_rough_sideways_friction():
    """With mu_t = 10 the bump drags harder than the anchor's margin; a smaller share of the region
    mends it."""
    rough = ONE.with_(friction=Friction(mu_t=10.0, mu_f=1.0, mu_b=1.0), epsilon=0.02)
    loose, firm = (rough.with_(share=share).period(intervals=1, nodes=4) for share in (0.5, 0.15))
    assert loose.d < 0.8 * rough.body.stroke
    assert firm.d == pytest.approx(rough.with_(share=0.15).body.stroke, rel=1e-2)


def test_fitted_orders_of_exact_powers():
    points = [
        EpsilonPoint(e, 1e-6, 2 * e, 3 * e**2, e, 1 - e, {"efficiency": 0.0}, 0.0)
        for e in (0.1, 0.01)
    ]
    orders = fitted_orders(points, 1.0)
    assert orders["d"] == pytest.approx(1.0)
    assert orders["W_inner"] == pytest.approx(2.0)
    assert orders["1 - efficiency/bound"] == pytest.approx(1.0)


@pytest.mark.slow
def test_the_error_bar_covers_a_much_smaller_delta():
    crawler = ONE.with_(epsilon=0.01, delta=delta_for(0.01))
    point = epsilon_point(crawler)
    harder = crawler.with_(delta=crawler.delta / 100).period(intervals=2)
    assert abs(harder.efficiency - point.efficiency) < 1.1 * point.errors["efficiency"]


@pytest.mark.parametrize("name", ["concertina", "concertina_anisotropic"])
def test_problem_files_state_a_crawler(name):
    study = runpy.run_path(f"problems/{name}.py")
    assert isinstance(study["PROBLEM"].body, Concertina)
    assert min(study["EPSILONS"]) < 0.01


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"epsilon": 0.6}, "epsilon must lie between"),
        ({"epsilon": 0.3, "bumps": 2}, "for 2 bump"),
        ({"share": 1.0}, "share must lie"),
        ({"amplitude": 2.0}, "amplitude must lie"),
        ({"bumps": 3}, "bumps must be 1 or 2"),
    ],
)
def test_unusable_crawlers_are_refused(changes, message):
    with pytest.raises(ProblemError, match=message):
        ONE.with_(**changes)
