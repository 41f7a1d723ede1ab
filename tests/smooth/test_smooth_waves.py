"""Waves and crawlers: references, symmetries, chains of links against them; prescribed motions as
problems with nothing free; crawlers that an optimiser may choose from, the bound, scalings with
epsilon, and what holds the anchor."""

import runpy

import numpy as np
import pytest

import colloc
from colloc import Concertina, Corners, CrawlerBody, Friction, Polygon, Problem, Wave, load, save
from colloc.commands.main import main as colloc_main
from colloc.commands.results import export
from colloc.gaits.gait_fields import BODIES as KINDS
from colloc.gaits.gait_fields import CLASSES, fields, part_from
from colloc.gaits.harmonic import Prescribed
from colloc.mechanics.bodies import Body
from colloc.mechanics.fixed_point import chain_motion
from colloc.pictures.movie import frames
from colloc.pictures.report_page import report_page
from colloc.reduced.program import ReducedProgram
from colloc.results.solution import SOLVED
from colloc.search.confirm import answer_of_iterate
from colloc.search.explore import first_optimum
from colloc.search.iterate import evaluate_at, space_near
from colloc.search.optimise import optimise
from colloc.search.options import COARSE
from colloc.search.solve import solve
from colloc.smooth.smooth_body import LAP
from scripts.continue_epsilon import Crawler, delta_for, epsilon_point, fitted_order
from scripts.models.period import measured_period, period
from tests.shared.cases import slow

ALONG = Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0)


def chain_period(friction, n_link, delta=1e-4, instants=16):
    """Distance and work of a chain whose links have wave B's tangent angles at their midpoints, by
    equal steps in time over half a period, spectrally accurate for travelling waves."""
    motion, t = Wave().prescribed(), (np.arange(instants) + 0.5) / (2 * instants)
    middle = ((np.arange(n_link) + 0.5) / n_link)[:, None] * np.ones((1, instants))
    phi, rate = motion.angle(middle, t), motion.rate(middle, t)
    body, bends = colloc.Chain((1 / n_link,) * n_link), (np.diff(x, axis=0) for x in (phi, rate))
    at = body, friction, *bends, delta
    moved = chain_motion(*at, colloc.solve_balance(*at).require())
    # the tail link turns with z[2]; the motion's frame with what its own angle does not explain
    omega = moved.z[2] - rate[0]
    spectrum = np.fft.rfft(np.concatenate([omega, -omega]))
    spectrum[0] = 0.0
    k = np.maximum(np.arange(spectrum.size), 1) * 2j * np.pi
    theta = np.fft.irfft(spectrum / k, 2 * instants)[:instants]
    along = np.mean([1, 1j] @ moved.centre * np.exp(1j * (theta + phi[0])))
    return abs(along.real), moved.power.mean()


def test_wave_B_to_eight_digits_and_by_a_chain_of_links_extrapolated():
    """Two unrelated discretisations agree to 8 digits, and with the design notes' 0.737066. Links have
    closed-form friction, no panels; their quadratic error is extrapolated away."""
    p = measured_period(Wave().prescribed(), ALONG, 1e-4, intervals=8)
    q = period(Wave().prescribed(), ALONG, 1e-4, intervals=3, nodes=7, panels=11, order=11)
    assert p.efficiency == pytest.approx(q.efficiency, abs=2e-9)
    assert p.errors["efficiency"] < 1e-9
    assert p.efficiency == pytest.approx(0.737066, abs=1e-6)
    coarse, fine = (np.array(chain_period(ALONG, n)) for n in (160, 320))
    d, W = (4 * fine - coarse) / 3
    smooth = period(Wave().prescribed(), ALONG, 1e-4, intervals=2)
    assert d / W == pytest.approx(smooth.efficiency, abs=2e-5)


def test_standing_wave_does_not_travel():
    """Theta(1 - s) = -Theta(s) in shape and rate: by symmetry nothing moves the body."""
    p = period(Wave("standing").prescribed(), Friction(), 1e-4, intervals=2)
    assert p.d < 1e-12
    assert 0.4 < p.W < 0.5


BODIES = [Wave(), Wave("tanh", 1.3, 2.0), Wave("standing")]
BODIES += [Concertina(0.2), Concertina(0.1, bumps=2)]


@pytest.fixture(scope="module")
def wave():
    return solve(Problem("wave", body=Wave(), friction=ALONG, delta=1e-3))


def test_the_paper_s_wave_is_certified_agrees_with_its_own_period_and_is_kept(wave, tmp_path):
    assert wave.status == SOLVED, wave.message
    reference = measured_period(Wave().prescribed(), ALONG, 1e-3)
    assert wave.certificate.efficiency == pytest.approx(reference.efficiency, abs=1e-9)
    assert wave.certificate.distance == pytest.approx(reference.d, abs=1e-9)
    assert wave.answer.program == "prescribed"
    read = load(save(wave, tmp_path / "wave.h5"))
    assert (read.problem.hash, read.problem.body) == (wave.problem.hash, Wave())
    assert read.problem.gait == wave.problem.gait
    np.testing.assert_array_equal(read.sample(0.7).tail, wave.sample(0.7).tail)
    assert frames(read, count=5).ends.shape == (2, 97, 5)
    assert export([str(tmp_path / "wave.h5"), "--period", "1"]) == 2


@pytest.mark.parametrize("body", BODIES[:3], ids=str)
def test_the_largest_angle_at_an_instant_is_that_of_the_steepest_point(body):
    phases = np.linspace(0, 1, 7)
    angles = np.stack([np.cos(2 * np.pi * phases), np.sin(2 * np.pi * phases)])
    places = np.linspace(0, 1, 4001)[:, None]
    steepest = [np.abs(body.tangent(places, angles[:, [k]])).max() for k in range(7)]
    np.testing.assert_allclose(body.bounded_angles.largest(angles), steepest, rtol=1e-3, atol=1e-3)


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


BODY = CrawlerBody(0.05, panels=16)


def test_the_paper_s_crawler_is_one_of_them():
    crawler, corners = Concertina(epsilon=0.05, amplitude=1.3), BODY.concertina(1.3, sides=6)
    s = np.linspace(0.4, 0.6, 201)[:, None] * np.ones((1, 3))
    # no corner of nine lies on the way back
    np.testing.assert_allclose(BODY.concertina(1.3, sides=9)[:, -2:], corners[:, -2:])
    phases = np.array([1 / 12, 1 / 6, 1 / 3])  # half grown, grown, at the front
    shown = np.array([[p, 0.0, a, 0.0, 0.0] for p, a in ((LAP, 0.65), (LAP, 1.3), (0.0, 1.3))]).T
    assert {tuple(shape) for shape in shown.T} <= {tuple(vertex) for vertex in corners.T}
    known = crawler.prescribed().angle(s, phases)
    np.testing.assert_allclose(BODY.tangent(s, shown), known, atol=1e-12)


def test_a_wave_takes_a_bump_to_the_front_and_a_chain_s_bends_are_pressed_into_one_there():
    for waves in (1.0, -1.0):
        shapes = np.stack(BODY.wave(waves), axis=1)  # at phase 0 and a quarter later
        ends = BODY.breaks(shapes)[1:-1]
        assert (ends[0, 0], ends[-1, 1]) == pytest.approx((0.45, 0.55))
        assert BODY.tangent(ends[2:3], shapes)[0] == pytest.approx([0.0, waves], abs=1e-12)
    laid = BODY.from_chain(np.full(3, 1 / 3)) @ [[0.4], [-0.3]]
    assert BODY.breaks(laid)[-2, 0] == pytest.approx(0.55)
    links = BODY.tangent(0.55 - BODY.width * np.array([[5], [3], [1]]) / 6, laid)
    assert np.sign(links[:, 0]).tolist() == [-1, 1, -1]
    np.testing.assert_allclose(Body.wave(colloc.Chain(), -1.0), colloc.Chain().wave(-1.0))


def test_the_mirrored_half_is_the_negative_shape():
    s, t = np.linspace(0, 1, 301)[:, None] * np.ones((1, 3)), np.array([0.1, 0.25, 0.4])
    motion = Concertina(epsilon=0.05, amplitude=1.3).prescribed()
    np.testing.assert_allclose(motion.angle(s, t + 0.5), -motion.angle(s, t), atol=1e-12)
    rng, s = np.random.default_rng(5), np.linspace(0.44, 0.56, 60)[:, None]
    q = np.stack([rng.uniform(-LAP, LAP, 4), *rng.normal(scale=0.4, size=(BODY.modes, 4))])
    np.testing.assert_allclose(BODY.tangent(s, -q), -BODY.tangent(s, q), atol=1e-13)
    assert np.abs(BODY.tangent(np.array([[0.1], [0.449], [0.551]]), q)).max() == 0.0


def test_optimising_beats_the_paper_s_crawler():
    body = CrawlerBody(0.1, modes=2, panels=4)
    guess = Corners(body.concertina(1.499), "antipodal")
    space, v = space_near(
        Problem("crawler", guess, body, gait=Polygon(8, "antipodal"), intervals=8), guess
    )
    paper = -ReducedProgram(space, 1e-3).objective(v)
    found = optimise(space, v, 1e-3, COARSE)
    assert 0.5 < paper + 0.005 < -found.objective < 1.0


@pytest.mark.slow
def test_the_problem_file_is_certified_beats_the_paper_s_crawler_and_is_kept(tmp_path):
    found = solve(runpy.run_path("problems/crawler.py")["PROBLEM"], 1)
    assert found.status == "solved", found.message
    assert found.certificate.efficiency_at_zero_delta > 0.9069  # what equal sides of the path allow
    panels = found.answer.problem.body.panels
    assert panels > found.problem.body.panels
    read = load(save(found, tmp_path / "crawler.h5"))
    assert (read.problem.hash, read.answer.problem.body.panels) == (found.problem.hash, panels)
    np.testing.assert_array_equal(read.sample(0.3).tail, found.sample(0.3).tail)


@pytest.mark.slow
def test_every_command_that_reads_results_takes_a_crawler(tmp_path, capsys):
    """The paper's crawler as it is, collocated but not searched nor certified."""
    body = CrawlerBody(epsilon=0.2, modes=2, panels=4)
    guess = Corners(body.concertina(1.2), "antipodal")
    gait, at = Polygon(8, "antipodal"), {"delta": 1e-3, "delta_start": 1e-3}
    problem = Problem("paper", guess, body=body, gait=gait, **at)
    found = evaluate_at(*space_near(problem, guess), 1e-3)
    solution = colloc.Solution(problem, answer_of_iterate(found))
    file = str(save(solution, tmp_path / "paper.h5"))
    for command, more in (
        ("report", ""),
        ("export", "--max-speed 2"),
        ("animate", "--seconds 0.4 --fps 5 --periods 1"),
        ("verify", f"--compare {file}"),
    ):
        assert colloc_main([command, file, *more.split()]) == 0
    assert "bump coordinate" in (tmp_path / "paper.html").read_text()
    assert (tmp_path / "paper.csv").read_text().count("coordinate_3_rad") == 2
    assert "the same optimum" in capsys.readouterr().out
    dataset = solution.to_xarray()
    assert dict(dataset.sizes) == {"t": 401, "coordinate": 3, "velocity": 3, "axis": 2}
    ahead = dataset.centre.isel(t=-1) - dataset.centre.isel(t=0)
    assert float(ahead.sel(axis="x")) == pytest.approx(solution.distance, rel=1e-9)


@pytest.mark.parametrize("share", [0.3, 0.5, 0.8])
def test_a_bump_grows_and_is_flattened_at_the_ends_of_its_region_never_beyond(share):
    body = CrawlerBody(0.1, share=share)
    ends = body.breaks(np.array([[LAP, -LAP, 0.0, 0.4], *[[1.0] * 4] * body.modes]))[1:-1]
    np.testing.assert_allclose(ends[0, :2], 0.4, atol=1e-15)
    np.testing.assert_allclose(ends[-1, 2], 0.6, atol=1e-15)
    np.testing.assert_allclose(ends[-1] - ends[0], body.width, atol=1e-15)
    assert 0.4 < ends[0, 3] < ends[-1, 3] < 0.6


SIDEWAYS = Crawler(
    Concertina(epsilon=0.02, amplitude=1.2, share=0.3, bumps=2),
    Friction(mu_t=1.0, mu_f=3.0, mu_b=3.0),
    delta=1e-6,
)
ONE = Crawler(Concertina(epsilon=0.05, amplitude=1.3), delta=1e-6)


def test_two_bumps_are_antisymmetric_and_keep_their_length():
    """Theta(1 - s) = -Theta(s), and the chord along the body never changes, in all stages."""
    motion = SIDEWAYS.body.prescribed()
    t = np.linspace(0.0, 0.999, 41)
    s = np.linspace(0, 1, 20001)[:, None] * np.ones((1, t.size))
    angle = motion.angle(s, t)
    np.testing.assert_allclose(angle[::-1], -angle, atol=1e-9)
    chord = np.trapezoid(np.cos(angle), s[:, 0], axis=0)
    np.testing.assert_allclose(chord, chord[0], atol=1e-9)
    rise = np.trapezoid(np.sin(angle[:10001]), s[:10001, 0], axis=0)  # of the middle over the rear
    assert np.ptp(rise) == pytest.approx(SIDEWAYS.body.stroke, rel=1e-6)


@pytest.mark.parametrize("crawler", [ONE, slow(SIDEWAYS)])
def test_the_anchor_holds_and_the_stroke_is_the_geometry(crawler):
    """The distance is what the shape shortens or shifts, less order delta; nothing rotates."""
    p = crawler.period(intervals=2, quadrature_tolerance=1e-8)
    assert p.d == pytest.approx(crawler.body.stroke, rel=2e-4)
    assert p.d < crawler.body.stroke
    assert p.nodes.slowest.max() < 30 * crawler.delta
    assert abs(p.rotation) < 1e-12
    assert p.efficiency < crawler.bound


def test_isotropic_crawler_scales_as_the_paper_says():
    """d ~ epsilon, W_inner ~ epsilon^2, W_outer/d -> 1, 1 - efficiency ~ epsilon."""
    epsilons = (0.01, 0.005, 0.0025)
    how = {"intervals": 1, "quadrature_tolerance": 1e-8}
    periods = [ONE.with_(epsilon=e, delta=delta_for(e)).period(**how) for e in epsilons]
    for found, order, off in (
        ([p.d for p in periods], 1, 0.01),
        ([p.W_inner for p in periods], 2, 0.02),
        ([1 - p.efficiency for p in periods], 1, 0.05),
    ):
        assert fitted_order(epsilons, found) == pytest.approx(order, abs=off)
    assert all(abs(p.W_outer / p.d - 1) < 2.2 * e for p, e in zip(periods, epsilons, strict=True))
    assert 0.99 < periods[-1].efficiency < 1.0


@pytest.mark.slow
def test_two_bump_crawler_beats_nine_tenths_of_the_bound():
    p = SIDEWAYS.with_(epsilon=0.01, delta=2.5e-7).period(intervals=1, quadrature_tolerance=1e-8)
    assert 0.9 / SIDEWAYS.friction.mu_t < p.efficiency < SIDEWAYS.bound


def test_backwards_is_forwards_with_the_coefficients_exchanged():
    forwards = ONE.with_(friction=Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3))
    backwards = ONE.with_(friction=Friction(mu_t=1.7, mu_f=1.3, mu_b=1.0), backwards=True)
    a, b = (c.period(intervals=1, nodes=4) for c in (forwards, backwards))
    assert a.efficiency == pytest.approx(b.efficiency, rel=1e-8)


def test_a_bump_that_takes_half_its_region_tears_the_anchor_loose_on_very_rough_sideways_friction():
    """At mu_t = 10 its drag exceeds the anchor's margin; a smaller share of the region mends it."""
    rough = ONE.with_(friction=Friction(mu_t=10.0, mu_f=1.0, mu_b=1.0), epsilon=0.02)
    loose, firm = (rough.with_(share=share).period(intervals=1, nodes=4) for share in (0.5, 0.15))
    assert loose.d < 0.8 * rough.body.stroke
    assert firm.d == pytest.approx(rough.with_(share=0.15).body.stroke, rel=1e-2)


@pytest.mark.slow
def test_the_error_bar_covers_a_much_smaller_delta():
    crawler = ONE.with_(epsilon=0.01, delta=delta_for(0.01))
    point = epsilon_point(crawler)
    harder = crawler.with_(delta=crawler.delta / 100).period(intervals=2)
    assert abs(harder.efficiency - point.efficiency) < 1.1 * point.errors["efficiency"]
