"""Prescribed motions are problems with nothing free: measured, certified, stored and drawn like
gaits that were searched."""

import numpy as np
import pytest

from colloc.commands.results import export
from colloc.gaits.gait_fields import BODIES as KINDS
from colloc.gaits.gait_fields import CLASSES, fields, part_from
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.prescribed import Prescribed
from colloc.gaits.problem import Problem
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.pictures.movie import frames
from colloc.pictures.report_page import report_page
from colloc.results.motion import friction_arrows
from colloc.results.solution import SOLVED
from colloc.results.store import load, save
from colloc.search.explore import first_optimum
from colloc.search.solve import solve
from colloc.smooth.modal_body import ModalBody
from colloc.smooth.prescribed_body import Concertina, Wave, schedule
from colloc.system.errors import ProblemError
from scripts.models.period import measured_period, period

ALONG = Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0)
BODIES = [
    Wave(),
    Wave("tanh", 1.3, 2.0),
    Wave("standing"),
    Concertina(epsilon=0.2),
    Concertina(epsilon=0.1, bumps=2),
]


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
    assert (read.problem.hash, read.problem.body, read.problem.gait) == (
        wave.problem.hash,
        Wave(),
        wave.problem.gait,
    )
    np.testing.assert_array_equal(read.sample(0.7).tail, wave.sample(0.7).tail)
    assert frames(read, count=5).ends.shape == (2, 97, 5)
    assert export([str(tmp_path / "wave.h5"), "--period", "1"]) == 2


@pytest.mark.slow
def test_it_gets_a_report_and_a_figure(wave):
    assert "a sine wave of amplitude 1 rad" in report_page(wave)
    assert len(wave.plot().axes) == 5


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
    problem = Problem(
        "any",
        body=body,
        friction=Friction(mu_t=2.0, mu_f=1.0, mu_b=1.0),
        delta=1e-2,
        mesh_tolerance=0,
        scheme="gauss-2",
    )
    reference = period(body.prescribed(), problem.friction, 1e-2, intervals=4, nodes=2)
    # the same quadrature in time
    optimum = first_optimum(problem, problem.guess)
    assert optimum.step.work == pytest.approx(reference.W, rel=1e-6)


@pytest.mark.parametrize("body", BODIES, ids=lambda body: body.describe()[:24])
def test_bodies_answer_every_question_and_can_be_kept(body):
    assert isinstance(body, Body)
    assert part_from(KINDS, fields(body)) == body
    gait = Problem("any", body=body).gait
    assert (
        gait
        == part_from(CLASSES, fields(gait))
        == Prescribed(body.prescribed().stages, body.symmetries[0])
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"gait": Harmonic()}, "leave gait out"),
        ({"gait": Prescribed((0.0, 0.25, 1.0))}, "may have the symmetry antipodal"),
        ({"body": Chain(), "gait": Prescribed()}, "not prescribed"),
        ({"body": ModalBody(), "gait": Prescribed()}, "not prescribed"),
        ({"body": Wave(amplitude=1.8)}, "the tangent reaches 1.8 rad"),
    ],
)
def test_what_does_not_go_together_is_refused(changes, message):
    with pytest.raises(ProblemError, match=message):
        Problem(**({"name": "any", "body": Wave(), "friction": ALONG} | changes))


@pytest.mark.parametrize("profile", ["square", 1])
def test_unknown_waves_are_refused(profile):
    with pytest.raises(ProblemError, match="profile must be"):
        Wave(profile)
