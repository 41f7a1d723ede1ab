"""Fourier series and their classes."""

import numpy as np
import pytest

from colloc.gaits.harmonic import Fourier, Harmonic, ellipse, harmonics_within, shift_phase
from colloc.system.errors import ProblemError

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


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Harmonic(2, "antipodal"), "odd harmonics only.*ask for 1 or 3"),
        (lambda: Harmonic(6, "antipodal"), "odd harmonics only.*ask for 5 or 7"),
        (lambda: Harmonic(0), "harmonics"),
        (lambda: Harmonic(1.5), "harmonics"),
        (lambda: Harmonic(symmetry="mirror"), "symmetry"),
        (lambda: Fourier([0.0], [[1.0]], [[1.0, 2.0]]), "shape"),
        (lambda: Harmonic(2).member(np.full(9, 1e308), 2), "must be a finite"),
    ],
)
def test_unusable_classes_and_coefficients_are_refused_in_words(make, words):
    with pytest.raises(ProblemError, match=words):
        make()
