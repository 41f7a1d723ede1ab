"""Waves of smooth bodies: references, symmetries, and chains of links against them."""

import numpy as np
import pytest

from colloc.mechanics.friction import Friction
from colloc.smooth.balance import Motion
from colloc.smooth.prescribed_body import Wave
from colloc.system.errors import ProblemError
from scripts.models.period import measured_period, period
from tests.shared.chain_period import chain_period

ALONG = Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0)


def test_wave_B_to_eight_digits():
    """Two unrelated discretisations in time and arc length agree to 8 digits, and with the design
    notes' 0.737066."""
    p = measured_period(Wave().prescribed(), ALONG, 1e-4, intervals=8)
    q = period(Wave().prescribed(), ALONG, 1e-4, intervals=3, nodes=7, panels=11, order=11)
    assert p.efficiency == pytest.approx(q.efficiency, abs=2e-9)
    assert p.errors["efficiency"] < 1e-9
    assert p.efficiency == pytest.approx(0.737066, abs=1e-6)


def test_wave_B_by_a_chain_of_links_extrapolated():
    """Independent of all panels: links have closed-form friction; their quadratic error is
    extrapolated away."""
    coarse, fine = (
        np.array(chain_period(Wave().prescribed(), ALONG, 1e-4, n, 16)) for n in (160, 320)
    )
    d, W = (4 * fine - coarse) / 3
    assert d / W == pytest.approx(
        period(Wave().prescribed(), ALONG, 1e-4, intervals=2).efficiency, abs=2e-5
    )


def test_a_chain_overestimates_the_work_in_proportion_to_the_anisotropy():
    """Relative excess (mu_t/mu_f) <kappa^2> / (12 n^2), derived in tests/shared/chain_period.py."""
    n = 80
    for mu in (10.0, 100.0):
        friction = Friction(mu_t=mu, mu_f=1.0, mu_b=1.0)
        smooth = period(Wave().prescribed(), friction, 1e-4, intervals=2)
        _, W = chain_period(Wave().prescribed(), friction, 1e-4, n, 16)
        predicted = mu * (2 * np.pi) ** 2 / 2 / (12 * n**2)
        assert pytest.approx(predicted, rel=0.15) == W / smooth.W - 1


def test_standing_wave_does_not_travel():
    """Theta(1 - s) = -Theta(s) in shape and rate: by symmetry nothing moves the body."""
    p = period(Wave("standing").prescribed(), Friction(), 1e-4, intervals=2)
    assert p.d < 1e-12
    assert 0.4 < p.W < 0.5


def test_isotropic_waves_are_ineffective():
    """The paper's figure 6: work 0.4 to 0.5 (B: 0.505), distance below 0.005."""
    for wave in (Wave().prescribed(), Wave("tanh", 1.3, 2.0).prescribed()):
        p = period(wave, Friction(), 1e-4, intervals=6, quadrature_tolerance=1e-6)
        assert 0.4 < p.W < 0.51
        assert p.d < 0.005


def test_the_half_period_and_the_whole_agree():
    """The mirror-image second half, computed instead of inferred."""
    wave = Wave().prescribed()
    whole = Motion(wave.angle, wave.rate, stages=(0.0, 0.5, 1.0))
    a, b = (
        period(
            m, Friction(mu_t=10.0, mu_f=1.0, mu_b=1.0), 1e-3, intervals=3, quadrature_tolerance=1e-8
        )
        for m in (wave, whole)
    )
    assert a.d == pytest.approx(b.d, abs=1e-8)
    assert pytest.approx(b.W, abs=1e-8) == a.W
    assert abs(b.rotation) < 1e-10


@pytest.mark.parametrize("friction", [Friction(), Friction(mu_t=0.5, mu_f=1.0, mu_b=2.0), ALONG])
def test_no_wave_beats_the_bound(friction):
    for wave in (Wave("sine", 0.5, 2.0).prescribed(), Wave("sine", 1.2, 1.0).prescribed()):
        assert period(wave, friction, 1e-4, intervals=1).efficiency < 1 / friction.smallest


def test_unusable_studies_are_refused():
    with pytest.raises(ProblemError, match="intervals must be at least 1"):
        period(Wave().prescribed(), Friction(), 1e-3, intervals=0)
    with pytest.raises(ProblemError, match="antipodal"):
        chain_period(Motion(lambda s, t: s, lambda s, t: s), Friction(), 1e-3, 5)
