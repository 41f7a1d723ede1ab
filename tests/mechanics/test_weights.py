"""Weights and masses of links: friction follows the former, inertia and centre the latter."""

import numpy as np
import pytest

import colloc
from colloc import Chain, Friction, Harmonic, Problem, ellipse, evaluate
from colloc.bounds.motions import Domain
from colloc.bounds.sampled import Budget, efficiency_bound
from colloc.mechanics.inertia import kinetic_energy
from research.guarantee.guaranteed import certify
from research.guarantee.potential_range import potential_space
from tests.shared.mechanics import coulomb, random_instants

LENGTHS, WEIGHTS = (0.2, 0.5, 0.3), (0.5, 0.2, 0.3)
MASSES, INERTIAS = (0.6, 0.3, 0.1), (0.004, 0.006, 0.0009)


@pytest.mark.parametrize(
    ("said", "unsaid"),
    [
        (Chain(weights=(1 / 3,) * 3), Chain()),
        (Chain(LENGTHS, weights=WEIGHTS, masses=WEIGHTS), Chain(LENGTHS, weights=WEIGHTS)),
    ],
    ids=["weights as the lengths", "masses as the weights"],
)
def test_what_would_be_so_anyway_changes_no_bit_where_it_is_said(said, unsaid):
    assert said.largest_imbalance == unsaid.largest_imbalance == 0.0
    at = Friction(mu_t=2, mu_f=1, mu_b=3), *random_instants(50), 1e-4
    one, other = (body.motion(*at, body.solve(*at)) for body in (said, unsaid))
    for own, theirs in zip(one, other, strict=True):
        np.testing.assert_array_equal(own, theirs)


@pytest.mark.parametrize("mu", [(1, 1, 3), (1, 3, 1), (3, 1, 2)], ids=str)
def test_the_largest_forces_are_reached_by_links_that_slide_along_across_or_turn(mu):
    body, law, straight = Chain(LENGTHS, weights=WEIGHTS), coulomb(*mu), np.zeros((2, 3))
    most = body.contact.largest_forces(law).ravel()
    along, across, couples = np.split(most, 3)
    ways = np.array([[1.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    found = np.abs(body.forces(law, straight, straight, ways, 1e-9))
    np.testing.assert_allclose(found[:3, :2].max(axis=1), along)
    np.testing.assert_allclose(found[3:6, 2], across)
    np.testing.assert_allclose(along, max(mu[1:]) * np.array(WEIGHTS))
    # a link that turns about its middle has the couple of half its weight a quarter away
    turn = np.array([[0.0], [-LENGTHS[0] / 2], [1.0]])
    spinning = body.forces(law, straight[:, :1], straight[:, :1], turn, 1e-9)
    assert abs(spinning[6, 0]) == pytest.approx(couples[0])
    angles, rates = random_instants(200)
    z = np.random.default_rng(1).normal(size=(3, 200))
    assert (np.abs(body.forces(law, angles, rates, z, 1e-9)) <= most[:, None] * (1 + 1e-12)).all()


@pytest.mark.slow
def test_a_bound_knows_the_weights_or_refuses():
    heavy = Chain(weights=(0.4, 0.2, 0.4))
    budget = Budget(intervals=4, shapes=6, directions=12, rounds=2)
    plain, other = (efficiency_bound(body, Friction(), budget=budget) for body in (Chain(), heavy))
    assert abs(plain.sampled - other.sampled) > 1e-3
    numbers = np.array(other.coefficients)
    with pytest.raises(colloc.ProblemError, match="weights"):
        certify(Domain(heavy, Friction(), np.pi), potential_space(other, heavy), numbers, 0.6)


def test_a_body_with_masses_says_so_and_how_it_leans():
    body = Chain(masses=(0.1, 0.3, 0.6), inertias=(0.01, 0.0, 0.01))
    text = body.describe()
    assert not Chain(weights=(0.4, 0.4, 0.2)).symmetric
    assert not Chain(inertias=(0.01, 0.01, 0.02)).symmetric
    assert "of masses 0.1, 0.3, 0.6" in text
    assert "of moments of inertia 0.01, 0, 0.01" in text
    assert "beside the centre of mass" in text
    assert not body.symmetric
    angles = random_instants(20)[0]
    assert (body.imbalance(angles) <= body.largest_imbalance).all()
    assert body.imbalance(np.zeros((2, 1)))[0] == pytest.approx(0.5 / 3, rel=1e-12)


def energy(angles, rates, z, masses=MASSES, inertias=INERTIAS):
    """Kinetic energy of rigid links at one instant, by complex numbers."""
    phi, spin = np.cumsum([0.0, *angles]), z[2] + np.cumsum([0.0, *rates])
    links = np.array(LENGTHS) * np.exp(1j * phi)
    starts = z[0] + 1j * z[1] + np.concatenate([[0.0], np.cumsum(1j * spin * links)[:-1]])
    speed = np.abs(starts + 0.5j * spin * links)
    return 0.5 * (masses @ speed**2 + inertias @ spin**2)


@pytest.mark.parametrize("seed", range(3))
def test_kinetic_energy_weighs_every_link_by_its_mass(seed):
    rng = np.random.default_rng(seed)
    angles, rates, z = rng.normal(size=2), rng.normal(size=2), rng.normal(size=3)
    at = [each[:, None] for each in (angles, rates, z)]
    found = kinetic_energy(Chain(LENGTHS, masses=MASSES, inertias=INERTIAS), *at).item()
    assert found == pytest.approx(energy(angles, rates, z, MASSES, INERTIAS), rel=1e-12)
    # unsaid, they are rods of equal density
    lengths, found = np.array(LENGTHS), kinetic_energy(Chain(LENGTHS), *at).item()
    assert found == pytest.approx(energy(angles, rates, z, lengths, lengths**3 / 12), rel=1e-12)


def test_what_joints_do_beyond_friction_is_the_growth_of_kinetic_energy():
    """Up to any phase, work of joints = work against friction + Fr times the growth of E."""
    froude, body = 0.3, Chain(LENGTHS, masses=MASSES, inertias=INERTIAS)
    at = {"friction": Friction(mu_t=2), "gait": Harmonic(1), "froude": froude, "delta": 1e-2}
    problem = Problem("heavy_tail", body=body, **at)
    solution = evaluate(problem.with_(mesh_tolerance=1e-4), ellipse(0.2, 0.9, 0.8))
    robot = solution.robot(length=1.0, mass=1.0, period=(1 / (9.81 * froude)) ** 0.5)
    t = np.linspace(0, 1, 2001)
    motion = solution.sample(t)
    spent = (robot.torques(t) / robot.torque_unit * motion.rates).sum(axis=0)
    beyond = spent - solution.power(motion)
    gained = np.concatenate([[0.0], np.cumsum(0.5 * (beyond[1:] + beyond[:-1]) * np.diff(t))])
    instants = zip(motion.angles.T, motion.rates.T, motion.z.T, strict=True)
    growth = froude * np.array([energy(*instant) for instant in instants])
    growth -= growth[0]
    assert np.ptp(growth) > 0.03 * solution.work
    np.testing.assert_allclose(gained, growth, rtol=0, atol=1e-2 * np.ptp(growth))
