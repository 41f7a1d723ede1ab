"""Wheels on axles: what they tend to, a solve, and a replay that knows no colloc."""

import numpy as np
import pytest

import colloc
from colloc import Axle, Chain, Foot, Fourier, Friction, OwnLaw, Problem, ProblemError, Wheel, solve
from tests.mechanics.test_floor_contact import wheels_that_do_not_slip

DELTA = 1e-4


def on_axles(**wheel):
    return Chain(feet=tuple(Wheel(link, axle=True, **wheel) for link in range(3)))


def test_a_wheel_says_which_of_the_two_laws_it_has():
    assert Wheel(0, rolling=0.1).friction == Friction(mu_t=1.0, mu_f=0.1, mu_b=0.1)
    assert Wheel(0, rolling=0.1, axle=True).friction == Axle(rolling=0.1, sideways=1.0)
    assert Wheel(0, axle=True).kind == "wheel"
    assert Foot(0, friction=Axle(rolling=1.0)).kind == "foot"


def test_rolling_fast_takes_nothing_from_what_holds_sideways():
    one, slow, fast = np.ones((1, 1)), np.array([[0.1]]), np.array([[100.0]])
    for vs in (slow, fast):
        force = Axle(rolling=0.02, sideways=1.0).density(vs, slow, 1e-9 * one)
        np.testing.assert_allclose(force, [-0.02 * one, -one])


@pytest.mark.parametrize(("mu", "name"), [(0.0, "rolling"), (-1.0, "sideways")])
def test_coefficients_are_positive(mu, name):
    with pytest.raises(ProblemError, match=name):
        Axle(**{name: mu})


@pytest.mark.parametrize("wheel", [{"rolling": 1e-7}, {"rolling": 1.0, "sideways": 1e7}], ids=str)
def test_wheels_that_roll_freely_or_hold_firmly_do_not_slip(wheel):
    """To rolling over sideways friction times delta, and not times the speed: it is nonholonomic at
    any small ratio."""
    angles = np.array([[0.9, -0.4, 0.3], [0.2, -1.1, 1.4]])
    rates = np.array([[1.0, -0.5, 0.8], [-0.6, 1.2, 0.4]])
    body = on_axles(**wheel)
    z = colloc.solve_balance(body, Friction(), angles, rates, 1e-3).require().z
    known = [wheels_that_do_not_slip(body, *at) for at in zip(angles.T, rates.T, strict=True)]
    np.testing.assert_allclose(z, np.transpose(known), atol=1e-8)


def test_formulas_that_are_dry_in_each_direction_are_refused_for_an_axle():
    for along, across in (
        ("-0.3*vs/sqrt(vs**2 + delta**2)", "-vn/sqrt(vn**2 + delta**2)"),
        ("-vs", "-tanh(vn/delta)"),
    ):
        with pytest.raises(ProblemError, match=r"state a wheel's friction as Axle"):
            OwnLaw(along, across)
    assert OwnLaw("-0.3*vs", "-vn").degree == 1.0
    assert OwnLaw("-0.3*tanh(100*vs)", "-tanh(100*vn)").degree is None


def replayed(gait, rolling, n=1000):
    """Distance and work of three links, each on a wheel in its middle, from positions of the wheels
    in the plane: midpoints in time, and Newton's method on the dissipation as delta falls."""
    mu, z, way, heading, work = np.array([[rolling], [1.0]]), np.zeros(3), 0j, 0.0, 0.0
    for t in (np.arange(n) + 0.5) / n:
        q, rate = (
            np.append(0.0, row(np.array([t]))[:, 0].cumsum()) for row in (gait.angles, gait.rates)
        )
        link = np.exp(1j * q) / 3
        place, speed = (np.cumsum(row) - row / 2 for row in (link, 1j * rate * link))
        maps = 3 * np.stack([np.ones(3), np.full(3, 1j), 1j * place]) * link.conj()
        maps, own = np.stack([maps.real, maps.imag]), 3 * speed * link.conj()

        def at(z, delta, maps=maps, own=own):
            v = np.stack([own.real, own.imag]) + np.einsum("czk,z->ck", maps, z)
            r = np.hypot(v, delta)
            slope = np.einsum("czk,ck,cyk->zy", maps, mu * delta**2 / r**3 / 3, maps)
            force = np.einsum("czk,ck->z", maps, mu * v / r / 3)
            return (mu * r).sum() / 3, force, slope, (mu * v * v / r).sum() / 3

        for delta in (*np.geomspace(0.3, DELTA, 12), DELTA):
            for _ in range(50):
                value, force, slope, power = at(z, delta)
                if np.abs(force).max() < 1e-9:
                    break
                step, part = np.linalg.solve(slope, -force), 1.0
                while part > 1e-3 and at(z + part * step, delta)[0] > value:
                    part /= 2
                z = z + part * step
        centre = speed.mean() + z[0] + 1j * z[1] + 1j * z[2] * place.mean()
        way += centre * np.exp(1j * (heading + z[2] / 2 / n)) / n
        heading += z[2] / n
        work += power / n
    return abs(way), work


def test_it_is_solved_and_certified_and_another_replay_says_the_same():
    problem = Problem(
        "axles", body=on_axles(rolling=0.3), gait=colloc.Harmonic(1, "bilateral"), delta=DELTA
    )
    found = solve(problem, starts=2)
    assert found.status == "solved", found.message
    distance, work = replayed(found.gait, 0.3)
    assert found.distance == pytest.approx(distance, rel=1e-3)
    assert found.efficiency == pytest.approx(distance / work, rel=1e-3)
    assert found.dry().efficiency == pytest.approx([found.efficiency] * 2, rel=1.5e-3)
    # its mirror image goes as far
    image = colloc.evaluate(problem, Fourier.from_table(-found.gait.table))
    assert image.distance == pytest.approx(found.distance)
