"""Harmonic gait classes: symmetry, gauge and coefficients."""

import numpy as np
import pytest

from colloc.gaits.harmonic import Fourier, Harmonic, ellipse, harmonics_within, shifted
from colloc.system.errors import ProblemError

T = np.linspace(0, 1, 37)


def random_gait(seed, n_joint=3, harmonics=3):
    rng = np.random.default_rng(seed)
    return Fourier(rng.normal(size=n_joint), *rng.normal(size=(2, n_joint, harmonics)))


def test_rates_are_the_derivative_of_angles():
    gait, h = random_gait(1), 1e-6
    np.testing.assert_allclose(
        (gait.angles(T + h) - gait.angles(T - h)) / (2 * h), gait.rates(T), rtol=1e-6, atol=1e-6
    )


@pytest.mark.parametrize("n_joint", [1, 2, 3, 4])
@pytest.mark.parametrize(
    ("symmetry", "harmonics"), [("none", 1), ("none", 3), ("bilateral", 2), ("antipodal", 3)]
)
def test_members_have_the_symmetry_of_their_class(n_joint, symmetry, harmonics):
    gait_class = Harmonic(harmonics, symmetry)
    rng = np.random.default_rng(2)
    gait = gait_class.member(rng.normal(size=gait_class.size(n_joint)), n_joint)
    if symmetry == "bilateral":
        np.testing.assert_allclose(gait.angles(-T), -gait.angles(T)[::-1], atol=1e-12)
    elif symmetry == "antipodal":
        np.testing.assert_allclose(gait.angles(T + 0.5), -gait.angles(T), atol=1e-12)
    else:
        assert gait.sin[0, 0] == 0


@pytest.mark.parametrize("harmonics", [2, 6])
def test_an_even_harmonic_that_antipodal_gaits_cannot_have_is_refused(harmonics):
    with pytest.raises(
        ProblemError, match=rf"odd harmonics only.*ask for {harmonics - 1} or {harmonics + 1}"
    ):
        Harmonic(harmonics, "antipodal")
    assert harmonics_within(harmonics, "antipodal") == Harmonic(harmonics - 1, "antipodal")


@pytest.mark.parametrize("symmetry", ["none", "bilateral", "antipodal"])
@pytest.mark.parametrize("n_joint", [1, 2, 3])
@pytest.mark.parametrize("harmonics", [1, 2, 3, 4])
def test_every_class_that_can_be_made_has_gaits_of_its_highest_harmonic(
    harmonics, n_joint, symmetry
):
    gait_class = harmonics_within(harmonics, symmetry)
    rng = np.random.default_rng(5)
    gait = gait_class.member(rng.normal(size=gait_class.size(n_joint)), n_joint)
    assert np.hypot(gait.cos[:, -1], gait.sin[:, -1]).max() > 0.01


@pytest.mark.parametrize("symmetry", ["none", "bilateral", "antipodal"])
def test_parameters_and_gait_are_inverse_to_each_other(symmetry):
    gait_class = Harmonic(3, symmetry)
    rng = np.random.default_rng(3)
    p = rng.normal(size=gait_class.size(2))
    if symmetry != "bilateral":
        p[gait_class.size(2) // 2] += (
            0  # any member with a non-negative first cosine is its own canonical form
        )
        gait = gait_class.member(p, 2)
        if gait.cos[0, 0] < 0:
            p = gait_class.parameters(gait)
    np.testing.assert_allclose(gait_class.parameters(gait_class.member(p, 2)), p, atol=1e-12)


def test_the_free_start_phase_is_removed_without_changing_the_path():
    gait = random_gait(4, 2, 2)
    member = Harmonic(2, "none").member(Harmonic(2, "none").parameters(gait), 2)
    phase = np.arctan2(gait.sin[0, 0], gait.cos[0, 0]) / (2 * np.pi)
    np.testing.assert_allclose(member.angles(T), gait.angles(T + phase), atol=1e-12)
    np.testing.assert_allclose(shifted(gait, 0.3).angles(T), gait.angles(T + 0.3), atol=1e-12)


def test_the_paper_s_ellipse():
    angles = ellipse(0.4, 1.1, 0.7).angles(T)
    expected = 0.4 + 1.1 * np.cos(2 * np.pi * T) + 0.7 * np.sin(2 * np.pi * T)
    np.testing.assert_allclose(angles[0], expected)
    np.testing.assert_allclose(angles[1], -expected + 1.4 * np.sin(2 * np.pi * T), atol=1e-12)


@pytest.mark.parametrize("bad", [{"harmonics": 0}, {"harmonics": 1.5}, {"symmetry": "mirror"}])
def test_unknown_classes_are_refused(bad):
    with pytest.raises(ProblemError, match=next(iter(bad))):
        Harmonic(**bad)


def test_coefficients_of_different_shape_are_refused():
    with pytest.raises(ProblemError, match="shape"):
        Fourier([0.0], [[1.0]], [[1.0, 2.0]])


def test_numbers_too_large_to_add_are_refused_in_words():
    with pytest.raises(ProblemError, match="must be a finite"):
        Harmonic(2).member(np.full(9, 1e308), 2)
