"""Fourier series, their classes, and serpenoid gaits: a few numbers for any number of links."""

import numpy as np
import pytest

from colloc import Chain, Fourier, Friction, Harmonic, Problem, Serpenoid, ellipse, load, save
from colloc.gaits.harmonic import harmonics_within, shift_phase
from colloc.search.iterate import space_near
from colloc.search.solve import solve

T = np.linspace(0, 1, 37)


def random_gait(seed, n_joint=3, harmonics=3):
    rng = np.random.default_rng(seed)
    return Fourier(rng.normal(size=n_joint), *rng.normal(size=(2, n_joint, harmonics)))


def test_rates_are_the_derivative_of_angles():
    gait, h = random_gait(1), 1e-6
    slope = (gait.angles(T + h) - gait.angles(T - h)) / (2 * h)
    np.testing.assert_allclose(slope, gait.rates(T), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("symmetry", ["none", "bilateral", "antipodal"])
@pytest.mark.parametrize("n_joint", [1, 2, 3, 4])
@pytest.mark.parametrize("harmonics", [1, 2, 3, 4])
def test_members_have_the_symmetry_of_their_class_its_highest_harmonic_and_their_parameters(
    harmonics, n_joint, symmetry
):
    gait_class = harmonics_within(harmonics, symmetry)
    p = np.random.default_rng(2).normal(size=gait_class.size(n_joint))
    gait = gait_class.member(p, n_joint)
    if symmetry == "bilateral":
        np.testing.assert_allclose(gait.angles(-T), -gait.angles(T)[::-1], atol=1e-12)
    elif symmetry == "antipodal":
        np.testing.assert_allclose(gait.angles(T + 0.5), -gait.angles(T), atol=1e-12)
    else:
        assert gait.sin[0, 0] == 0
    assert np.hypot(gait.cos[:, -1], gait.sin[:, -1]).max() > 0.01
    if symmetry == "bilateral" or gait.cos[0, 0] > 0:  # else it is told from half a period later
        np.testing.assert_allclose(gait_class.parameters(gait), p, atol=1e-12)


def test_the_free_start_phase_is_removed_without_changing_the_path():
    gait = random_gait(4, 2, 2)
    member = Harmonic(2, "none").member(Harmonic(2, "none").parameters(gait), 2)
    phase = np.arctan2(gait.sin[0, 0], gait.cos[0, 0]) / (2 * np.pi)
    np.testing.assert_allclose(member.angles(T), gait.angles(T + phase), atol=1e-12)
    np.testing.assert_allclose(shift_phase(gait, 0.3).angles(T), gait.angles(T + 0.3), atol=1e-12)


def test_the_paper_s_ellipse():
    angles = ellipse(0.4, 1.1, 0.7).angles(T)
    expected = 0.4 + 1.1 * np.cos(2 * np.pi * T) + 0.7 * np.sin(2 * np.pi * T)
    np.testing.assert_allclose(angles[0], expected)
    np.testing.assert_allclose(angles[1], -expected + 1.4 * np.sin(2 * np.pi * T), atol=1e-12)


FIVE = Chain((0.2,) * 5)
SNAKE = Friction(mu_t=10, mu_f=1, mu_b=1)


@pytest.mark.parametrize(
    "gait_class", [Serpenoid(2), Serpenoid(2, "bilateral"), Serpenoid(3, "antipodal")], ids=str
)
def test_joints_follow_one_another_by_a_lag_and_a_member_has_its_parameters(gait_class):
    problem, t = Problem("s", body=FIVE, friction=SNAKE, gait=gait_class), np.linspace(0, 1, 7)
    space, v = space_near(problem, Problem("g", body=FIVE).guess)
    v = v + 0.05 * np.random.default_rng(1).standard_normal(v.size)
    gait = space.member(v)
    angles, earlier = gait.angles(t), gait.angles(t - gait.lag / (2 * np.pi))
    np.testing.assert_allclose(angles[1:], earlier[:-1], atol=1e-13)
    words = f"({5 * abs(gait.lag) / (2 * np.pi):.3f} waves along the body, towards the "
    assert words + ("head" if gait.lag > 0 else "tail") in gait.lines()[0]  # who does it later
    np.testing.assert_allclose(gait_class.parameters(gait), v, atol=1e-14)
    told = Fourier(gait.mean, gait.cos, gait.sin)  # which does not know its lag
    np.testing.assert_allclose(gait_class.parameters(told), v, atol=1e-6)


def test_a_solved_one_is_certified_kept_and_no_better_than_all_harmonics(tmp_path):
    problem = Problem("snake", body=FIVE, friction=SNAKE, gait=Serpenoid(symmetry="antipodal"))
    found = solve(problem, starts=1)
    assert found.success
    whole = solve(problem.with_(gait=Harmonic(1, "antipodal"), guess=found.gait), starts=1)
    assert found.efficiency < whole.efficiency
    read = load(save(found, tmp_path / "snake.h5"))
    assert read.problem.gait == problem.gait
    assert read.gait.lag == found.gait.lag
    assert "waves along the body" in str(read.gait)
