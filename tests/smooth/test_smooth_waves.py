"""Waves of smooth bodies: references, symmetries, chains of links against them; and prescribed
motions as problems with nothing free, certified and kept like gaits that were searched."""

import numpy as np
import pytest

from colloc import Chain, Concertina, Friction, Problem, Wave, load, save, solve_balance
from colloc.commands.results import export
from colloc.gaits.gait_fields import BODIES as KINDS
from colloc.gaits.gait_fields import CLASSES, fields, part_from
from colloc.gaits.prescribed import Prescribed
from colloc.mechanics.bodies import Body
from colloc.mechanics.fixed_point import chain_motion
from colloc.pictures.movie import frames
from colloc.pictures.report_page import report_page
from colloc.results.motion import friction_arrows
from colloc.results.solution import SOLVED
from colloc.search.explore import first_optimum
from colloc.search.solve import solve
from colloc.smooth.balance import Motion
from colloc.smooth.prescribed_body import schedule
from scripts.models.period import measured_period, period

ALONG = Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0)


def test_wave_B_to_eight_digits():
    """Two unrelated discretisations in time and arc length agree to 8 digits, and with the design
    notes' 0.737066."""
    p = measured_period(Wave().prescribed(), ALONG, 1e-4, intervals=8)
    q = period(Wave().prescribed(), ALONG, 1e-4, intervals=3, nodes=7, panels=11, order=11)
    assert p.efficiency == pytest.approx(q.efficiency, abs=2e-9)
    assert p.errors["efficiency"] < 1e-9
    assert p.efficiency == pytest.approx(0.737066, abs=1e-6)


def chain_period(friction, n_link, delta=1e-4, instants=16):
    """Distance and work of a chain whose links have wave B's tangent angles at their midpoints, by
    equal steps in time over half a period, spectrally accurate for travelling waves."""
    motion, t = Wave().prescribed(), (np.arange(instants) + 0.5) / (2 * instants)
    middle = ((np.arange(n_link) + 0.5) / n_link)[:, None] * np.ones((1, instants))
    phi, rate = motion.angle(middle, t), motion.rate(middle, t)
    at = (
        Chain((1.0 / n_link,) * n_link),
        friction,
        np.diff(phi, axis=0),
        np.diff(rate, axis=0),
        delta,
    )
    moved = chain_motion(*at, solve_balance(*at).require())
    # the tail link turns with z[2]; the motion's frame with what its own angle does not explain
    omega = moved.z[2] - rate[0]
    spectrum = np.fft.rfft(np.concatenate([omega, -omega]))
    spectrum[0] = 0.0
    k = np.maximum(np.arange(spectrum.size), 1) * 2j * np.pi
    theta = np.fft.irfft(spectrum / k, 2 * instants)[:instants]
    along = np.mean([1, 1j] @ moved.centre * np.exp(1j * (theta + phi[0])))
    return abs(along.real), moved.power.mean()


def test_wave_B_by_a_chain_of_links_extrapolated():
    """Independent of all panels: links have closed-form friction; their quadratic error is
    extrapolated away."""
    coarse, fine = (np.array(chain_period(ALONG, n)) for n in (160, 320))
    d, W = (4 * fine - coarse) / 3
    smooth = period(Wave().prescribed(), ALONG, 1e-4, intervals=2)
    assert d / W == pytest.approx(smooth.efficiency, abs=2e-5)


def test_a_chain_overestimates_the_work_in_proportion_to_the_anisotropy():
    """A link on a track of curvature kappa cannot slide along its tangent everywhere: its normal
    velocity is kappa sigma V at sigma from its middle, for which transverse friction charges mu_t
    kappa^2 sigma^2 V. Over a link of length 1/n, a part (mu_t/mu_f) <kappa^2> / (12 n^2) too much.
    """
    n = 80
    for mu in (10.0, 100.0):
        friction = Friction(mu_t=mu, mu_f=1.0, mu_b=1.0)
        smooth = period(Wave().prescribed(), friction, 1e-4, intervals=2)
        _, W = chain_period(friction, n)
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
    law, finely = Friction(mu_t=10, mu_f=1, mu_b=1), {"quadrature_tolerance": 1e-8}
    a, b = (period(m, law, 1e-3, intervals=3, **finely) for m in (wave, whole))
    assert a.d == pytest.approx(b.d, abs=1e-8)
    assert pytest.approx(b.W, abs=1e-8) == a.W
    assert abs(b.rotation) < 1e-10


@pytest.mark.parametrize("friction", [Friction(), Friction(mu_t=0.5, mu_f=1.0, mu_b=2.0), ALONG])
def test_no_wave_beats_the_bound(friction):
    for wave in (Wave("sine", 0.5, 2.0).prescribed(), Wave("sine", 1.2, 1.0).prescribed()):
        assert period(wave, friction, 1e-4, intervals=1).efficiency < 1 / friction.smallest


BODIES = [Wave(), Wave("tanh", 1.3, 2.0), Wave("standing")]
BODIES += [Concertina(0.2), Concertina(0.1, bumps=2)]


@pytest.fixture(scope="module")
def wave():
    return solve(Problem("wave", body=Wave(), friction=ALONG, delta=1e-3))


def test_the_paper_s_wave_is_certified_and_agrees_with_its_own_period(wave):
    assert wave.status == SOLVED, wave.message
    reference = measured_period(Wave().prescribed(), ALONG, 1e-3)
    assert wave.certificate.efficiency == pytest.approx(reference.efficiency, abs=1e-9)
    assert wave.certificate.distance == pytest.approx(reference.d, abs=1e-9)
    assert wave.answer.program == "prescribed"


@pytest.mark.parametrize("body", BODIES[:3], ids=str)
def test_the_largest_angle_at_an_instant_is_that_of_the_steepest_point(body):
    phases = np.linspace(0, 1, 7)
    angles = np.stack([np.cos(2 * np.pi * phases), np.sin(2 * np.pi * phases)])
    places = np.linspace(0, 1, 4001)[:, None]
    steepest = [np.abs(body.tangent(places, angles[:, [k]])).max() for k in range(7)]
    np.testing.assert_allclose(body.bounded_angles.largest(angles), steepest, rtol=1e-3, atol=1e-3)


def test_it_is_read_as_it_was_written(wave, tmp_path):
    read = load(save(wave, tmp_path / "wave.h5"))
    assert (read.problem.hash, read.problem.body) == (wave.problem.hash, Wave())
    assert read.problem.gait == wave.problem.gait
    np.testing.assert_array_equal(read.sample(0.7).tail, wave.sample(0.7).tail)
    assert frames(read, count=5).ends.shape == (2, 97, 5)
    assert export([str(tmp_path / "wave.h5"), "--period", "1"]) == 2


def test_the_friction_that_is_drawn_has_no_resultant():
    """The body is in balance, and its arrows stand in the middles of 96 parts of its outline, which
    show a part at stick as one arrow: the mean of so many is off by a percent."""
    body, t = Wave(), np.linspace(0.0, 0.4, 5)
    gait = Prescribed(schedule(body), "antipodal").member(np.empty(0), 2)
    at = (ALONG, gait.angles(t), gait.rates(t), 1e-2)
    _, force = friction_arrows(body, *at, body.solve(*at).z, count=96)
    np.testing.assert_allclose(force.mean(axis=1), 0.0, atol=2e-2 * np.abs(force).max())


@pytest.mark.parametrize("body", BODIES, ids=lambda body: body.describe()[:24])
def test_the_work_on_the_mesh_is_that_of_the_general_solver(body):
    friction, same = Friction(mu_t=2.0, mu_f=1.0, mu_b=1.0), {"mesh_tolerance": 0}
    problem = Problem("any", None, body, friction, delta=1e-2, scheme="gauss-2", **same)
    # the same quadrature in time
    reference = period(body.prescribed(), friction, 1e-2, intervals=4, nodes=2)
    optimum = first_optimum(problem, problem.guess)
    assert optimum.step.work == pytest.approx(reference.W, rel=1e-6)


@pytest.mark.parametrize("body", BODIES, ids=lambda body: body.describe()[:24])
def test_bodies_answer_every_question_and_can_be_kept(body):
    assert isinstance(body, Body)
    assert part_from(KINDS, fields(body)) == body
    gait, stages = Problem("any", body=body).gait, body.prescribed().stages
    assert gait == part_from(CLASSES, fields(gait)) == Prescribed(stages, body.symmetries[0])


@pytest.mark.slow
def test_it_gets_a_report_and_a_figure(wave):
    assert "a sine wave of amplitude 1 rad" in report_page(wave)
    assert len(wave.plot().axes) == 5
