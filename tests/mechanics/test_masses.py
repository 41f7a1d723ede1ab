"""Masses that are not spread like the lengths: kinetic energy, and the joints' power that goes into
it."""

import numpy as np
import pytest

from colloc import Chain, Friction, Harmonic, Problem, ellipse, evaluate
from colloc.mechanics.inertia import kinetic_energy

LENGTHS, MASSES, INERTIAS = (0.3, 0.45, 0.25), (0.6, 0.3, 0.1), (0.004, 0.006, 0.0009)
BODY = Chain(LENGTHS, masses=MASSES, inertias=INERTIAS)


def energy(angles, rates, z):
    """Kinetic energy of rigid links with these masses, by complex numbers; all arguments of one
    instant."""
    phi, spin = np.cumsum([0.0, *angles]), z[2] + np.cumsum([0.0, *rates])
    links = np.array(LENGTHS) * np.exp(1j * phi)
    starts = z[0] + 1j * z[1] + np.concatenate([[0.0], np.cumsum(1j * spin * links)[:-1]])
    speed = np.abs(starts + 0.5j * spin * links)
    return 0.5 * (MASSES @ speed**2 + INERTIAS @ spin**2)


@pytest.mark.parametrize("seed", range(3))
def test_kinetic_energy_weighs_every_link_by_its_mass(seed):
    rng = np.random.default_rng(seed)
    angles, rates, z = rng.normal(size=2), rng.normal(size=2), rng.normal(size=3)
    found = kinetic_energy(BODY, angles[:, None], rates[:, None], z[:, None])
    assert found.item() == pytest.approx(energy(angles, rates, z), rel=1e-12)


def test_what_joints_do_beyond_friction_is_the_growth_of_kinetic_energy():
    """From the start of a period to any phase of it: work of the joints = work against friction +
    Fr times what E grows by."""
    froude = 0.3
    at = {"friction": Friction(mu_t=2), "gait": Harmonic(1), "froude": froude, "delta": 1e-2}
    problem = Problem("heavy_tail", body=BODY, **at)
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
