"""The distance of a gait that is asked to turn is the chord of an arc, by every way to it."""

import numpy as np
import pytest

from colloc import Chain, Fourier, Friction, Problem, evaluate, replay
from colloc.dynamics.control_problem import control_problem
from colloc.gaits.gait import delta_per_period
from colloc.reduced.program import ReducedProgram
from colloc.results.motion import arc
from colloc.search.iterate import space_near
from colloc.transcription.full_program import FullProgram
from colloc.verification.mesh_error import mesh_error
from tests.shared.cases import cases

DELTA = 0.3
BODY, FRICTION = Chain(), Friction()
GAIT = Fourier(np.array([0.4, 0.3]), np.array([[1.0], [0.2]]), np.array([[0.1], [1.0]]))
FINE = {"delta": DELTA, "tolerance": 1e-8, "instants": 400}


def begun_at(phase):
    return lambda t: GAIT(t + phase)


def replayed(path=GAIT, turn=0.0):
    return replay(BODY, FRICTION, path, turn=turn, **FINE)


def on_a_dense_grid(path, n=4000):
    """Rotation and places by the trapezoidal rule, exact for smooth periodic motion."""
    t = np.arange(n) / n
    angles, rates = path(t)
    solved = BODY.solve(FRICTION, angles, rates, DELTA)
    moved = BODY.motion(FRICTION, angles, rates, DELTA, solved)
    omega, centre = solved.z[2], np.array([1, 1j]) @ np.array(moved.centre)

    def integral(rate):
        """From 0 up to every t and 1, by the spectrum; the mean grows."""
        k = np.fft.fftfreq(n, 1 / n)
        parts = np.fft.fft(rate) / n
        wave = np.where(k == 0, 0, parts / np.where(k == 0, 1, 2j * np.pi * k))
        found = np.fft.ifft(wave * n) + parts[0] * t
        return np.append(found, found[0] + parts[0]) - found[0]

    theta = integral(omega).real
    alpha, later = theta[-1], np.append(t, 1.0)
    # periodic: what is seen from axes that turn evenly; its primitive times e^(i alpha t) is the
    # place
    seen = np.exp(1j * (theta[:-1] - alpha * t)) * centre
    k = np.fft.fftfreq(n, 1 / n)
    loop = np.fft.ifft(np.fft.fft(seen) / (1j * (2 * np.pi * k + alpha)))
    return alpha, np.append(loop, loop[0]) * np.exp(1j * alpha * later)


def test_a_period_turns_about_a_point_and_the_chord_is_that_of_the_mean_circle():
    alpha, place = on_a_dense_grid(GAIT)
    assert abs(alpha) > 0.05
    # the point that a period leaves where it is: place(1) - c = e^(i alpha) (place(0) - c)
    centre = (place[-1] - np.exp(1j * alpha) * place[0]) / (1 - np.exp(1j * alpha))
    t = np.linspace(0, 1, place.size)[:-1]
    radius = abs(((place - centre)[:-1] * np.exp(-1j * alpha * t)).mean())
    assert np.ptp(abs(place - centre)) > 0.01 * radius  # it does wriggle
    found = replayed(turn=alpha)
    assert found.rotation == pytest.approx(alpha, abs=found.errors["rotation"])
    assert found.distance == pytest.approx(2 * radius * abs(np.sin(alpha / 2)), rel=1e-8)
    assert arc(alpha, np.array([place.real, place.imag])).radius == pytest.approx(radius, rel=1e-8)


def test_the_chord_does_not_depend_on_the_phase_that_a_period_is_begun_at():
    turn = replayed().rotation
    chords, displacements = (
        [replayed(begun_at(p), at).distance for p in (0, 0.13, 0.37, 0.71)] for at in (turn, 0.0)
    )
    assert np.ptp(displacements) > 0.01 * max(displacements)
    np.testing.assert_allclose(chords, chords[0], rtol=1e-9)


def test_an_answer_states_the_chord_that_its_replay_finds():
    turning = evaluate(Problem("turns", body=BODY, friction=FRICTION, delta=DELTA), GAIT)
    assert abs(turning.rotation) > 0.05
    assert turning.answer.distance == pytest.approx(turning.certificate.distance, rel=1e-5)
    assert turning.answer.value == pytest.approx(turning.certificate.value, rel=1e-5)


def test_the_chord_tends_to_the_displacement_as_the_turn_tends_to_nothing():
    straight = replayed().distance
    off = [abs(replayed(turn=turn).distance - straight) for turn in (1e-2, 1e-3, 1e-4)]
    assert off[0] > off[1] > off[2]
    assert off[2] == pytest.approx(off[1] / 10, rel=0.05)


CASES = """
series: gait=Harmonic(1)
with inertia: gait=Harmonic(1), froude=0.05
polygon of unequal friction: gait=Polygon(4), friction=Friction(mu_t=1.7, mu_f=1, mu_b=1.3)
"""
CASES = cases(CASES, globals())


def stated(case, turn, intervals=24):
    given = {"friction": FRICTION, "delta": DELTA, "delta_start": DELTA} | CASES[case]
    return Problem(case.replace(" ", "_"), GAIT, rotation=turn, intervals=intervals, **given)


@pytest.mark.parametrize("case", CASES)
def test_reduced_and_full_program_and_replay_agree_on_the_chord(case):
    free = stated(case, None)
    space, v = space_near(free, GAIT)
    turn = ReducedProgram(space, DELTA).motion.values(v, DELTA)["rotation"]
    problem = stated(case, turn)
    space, v = space_near(problem, GAIT)
    delta, program = DELTA, ReducedProgram(space, DELTA)
    values = program.motion.values(v, delta)
    assert values["rotation"] == pytest.approx(turn, abs=1e-12)

    full = FullProgram(space.control, space.full_parameters(v), space.mesh.edges)
    x, functions = full.feasible(space.full_parameters(v), delta), full.nlp.functions
    at = x, delta / full.delta_unit
    g = np.array(functions["jac_g"](*at)[0]).ravel()
    value = float(functions["grad_f"](*at)[0])
    assert value == pytest.approx(-values["distance"] / values["work"], rel=1e-9)
    for group in ("orientation", "rotation", "distance", "work"):
        rows = full.groups[group]
        np.testing.assert_allclose(g[rows], full.row_lower[rows], atol=1e-10)

    gait = space.member(v)
    per_period = delta_per_period(problem.gait, gait, delta)
    how = {"breaks": gait.corner_phases, "tolerance": 1e-6, "turn": turn}
    how |= {"regime": problem.regime} if problem.froude else {}
    fine = replay(BODY, problem.law, gait, per_period, **how)
    control = control_problem(problem)
    error = mesh_error(control, control.in_phases(full.mesh, gait), gait, per_period, 1e-7)
    off = values["distance"] / values["work"] / fine.efficiency - 1
    assert off == pytest.approx(error.total, abs=3e-6)
    assert abs(error.total) < error.estimate + 1e-7
