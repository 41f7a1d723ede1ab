"""Static friction: held links, cases without a kinetic solution, and the flap body; and the velocity
map, the paper's "connection" over shapes and ratios of rates."""

import numpy as np
import pytest

from colloc import Chain, Friction, solve_balance
from scripts.models.static_friction import (
    SYMMETRIC_CASES,
    WORKED_CASES,
    FlapBody,
    axial_force,
    flap_gap,
    flap_motion,
    held_link,
    kinetic_gap,
    link_speeds,
    slowest_link,
    symmetric_balance,
)
from scripts.paper.study import Context
from scripts.paper.three_link import connection, faces_needed

BODY, ISOTROPIC = Chain(), Friction()


def test_link_speed_is_the_largest_on_the_link():
    rng = np.random.default_rng(31)
    angles, rates, z = rng.normal(size=(2, 30)), rng.normal(size=(2, 30)), rng.normal(size=(3, 30))
    velocity = BODY.velocity(BODY.posture(angles), rates, z)
    sigma = np.linspace(-1 / 6, 1 / 6, 101)[:, None, None]
    sampled = np.hypot(velocity.vs, velocity.vn + sigma * velocity.w).max(axis=0)
    np.testing.assert_allclose(link_speeds(BODY, velocity), sampled, rtol=1e-12)


@pytest.mark.parametrize("case", WORKED_CASES, ids=lambda c: c.name)
def test_held_links_creep_at_order_delta_and_bear_part_of_the_friction(case):
    held = held_link(case)
    ratio = held.speed / held.delta
    assert ratio[-1] < 10
    assert ratio[-1] == pytest.approx(ratio[-2], rel=1e-3)
    assert 0 < held.density[-1] < 0.999
    assert held.density[-1] == pytest.approx(held.density[-2], abs=1e-5)


@pytest.mark.parametrize("case", SYMMETRIC_CASES, ids=lambda c: c.name)
def test_symmetric_cases_have_no_kinetic_solution(case):
    """The unbalanced force falls with the velocity, and jumps over zero at rest."""
    gap = kinetic_gap(case)
    assert gap.no_solution
    V = np.concatenate([-np.geomspace(1, 1e-8, 60), np.geomspace(1e-8, 1, 60)])
    unbalanced = symmetric_balance(case, V, 1e-15)
    assert (np.diff(unbalanced) <= 1e-9).all()
    assert np.abs(unbalanced).min() > 0.9 * min(gap.below, -gap.above)


@pytest.mark.parametrize("case", SYMMETRIC_CASES, ids=lambda c: c.name)
def test_delta_supplies_the_missing_part(case):
    """The solver, which knows no symmetry, finds the root of the one-velocity balance."""
    gap = kinetic_gap(case)
    held = held_link(case)
    assert held.link == 1
    if case.name == "C":
        assert held.couple[-1] == pytest.approx(abs(gap.fraction), rel=1e-3)
        assert held.density[-1] < 1e-10
    else:
        assert held.density[-1] == pytest.approx(abs(gap.fraction), rel=1e-3)
        f = abs(gap.fraction)
        assert held.speed[-1] / held.delta[-1] == pytest.approx(f / np.sqrt(1 - f * f), rel=1e-3)


def test_regions_lie_where_the_paper_finds_them():
    def held(angles: tuple[float, float], rates: tuple[float, float]) -> tuple[bool, int]:
        a, r = np.array(angles)[:, None], np.array(rates)[:, None]
        speed, link = slowest_link(a, r, 1e-4)
        return bool(speed[0] < 1e-3), int(link[0])

    assert held((1.6, 1.5), (1.0, 0.9)) == (True, 1)  # C: middle link, both angles near pi/2
    assert held((2.5, 0.2), (1.0, 0.0)) == (True, 2)  # D: joint 2 rests, joint 1 bent beyond pi/2
    assert held((-2.0, 1.0), (1.0, 0.0))[0]
    assert held((3.0, -3.0), (1.0, -0.7)) == (True, 1)  # F: near pi and -pi
    assert not held((0.3, 0.4), (1.0, 0.3))[0]
    assert not held((0.3, 0.4), (1.0, 0.0))[0]


class TestFlapBody:
    body = FlapBody()

    def test_geometry_against_plain_trigonometry(self):
        angles, rates = np.array([[0.4], [-0.9]]), np.array([[1.3], [0.2]])
        z = np.array([[0.3], [-0.2], [0.7]])
        velocity = self.body.velocity(self.body.posture(angles), rates, z)
        for flap in (0, 1):
            a, w = angles[flap, 0], rates[flap, 0] + 0.7
            middle = 0.05 * np.array([np.cos(a), np.sin(a)])
            v = np.array([0.3 - w * middle[1], -0.2 + w * middle[0]])
            assert velocity.vs[flap + 1, 0] == pytest.approx(v @ [np.cos(a), np.sin(a)], abs=1e-14)
            assert velocity.vn[flap + 1, 0] == pytest.approx(v @ [-np.sin(a), np.cos(a)], abs=1e-14)
            assert velocity.w[flap + 1, 0] == pytest.approx(w)
        assert velocity.vn[0, 0] == pytest.approx(-0.2 + 0.4 * 0.7)

    def test_kinetic_friction_has_no_solution(self):
        """As the dissipation is convex it falls strictly, and leaps over zero at rest."""
        V = np.concatenate([-np.geomspace(3, 1e-8, 100), [0.0], np.geomspace(1e-8, 3, 100)])
        for opening in (0.1, 0.7, 1.4):
            assert flap_gap(self.body, opening).no_solution
            force = axial_force(self.body, opening, V, 1e-16)
            assert (np.diff(force) <= 1e-10).all()
            flaps = flap_gap(self.body, opening).at_rest
            assert np.abs(force).min() == pytest.approx(abs(flaps), rel=1e-6)
            assert 0 < flaps < 0.2  # shorter than the body, which is 0.8 long

    def test_delta_gives_the_limit_law(self):
        opening = np.linspace(0.1, 1.5, 7)
        fraction = np.array([flap_gap(self.body, o).fraction for o in opening])
        angles, rates = flap_motion(opening)
        errors = []
        for delta in (1e-4, 1e-5):
            z = solve_balance(self.body, ISOTROPIC, angles, rates, delta).require().z
            assert np.abs(z[1:]).max() < 1e-12  # along the body only, though nothing imposes it
            errors.append(np.abs(z[0] / delta - fraction / np.sqrt(1 - fraction**2)).max())
        assert errors[1] < 1e-4
        assert errors[0] / errors[1] > 5


DELTA = 1e-3


def test_its_nodes_are_balanced_velocities_at_unit_larger_rate_and_those_of_reversed_rates_mirror():
    made = connection(Context({"delta": DELTA, "angles": 8, "ratios": 5}, {}, 1))
    rng, (n, m) = np.random.default_rng(3), (8, 5)
    i, j, k, face = (rng.integers(size, size=60) for size in (n, n, m, 2))
    angles = np.stack([made["angles"][i], made["angles"][j]])
    rates = np.where(np.arange(2)[:, None] == face, 1.0, made["ratios"][k])
    stored = np.stack([made["z"][face, row, i, j, k] for row in range(3)])
    for scale in (1.0, -7.3):
        direct = solve_balance(Chain(), Friction(), angles, scale * rates, abs(scale) * DELTA).z
        np.testing.assert_allclose(scale * stored, direct, atol=1e-9)


def test_two_more_faces_are_needed_where_friction_backwards_is_another():
    small = connection(Context({"delta": DELTA, "angles": 2, "ratios": 2}, {}, 1))
    assert small["anisotropic_faces"] == 4
    assert faces_needed(Friction(mu_t=1.7), DELTA) == 2


def test_kink_where_a_joint_rests():
    """Two links rest beside a joint at rest, and the velocity has a kink there."""
    angles = np.array([[0.75 * np.pi], [0.0]])

    def omega(ratio: float) -> float:
        rates = np.array([[1.0], [ratio]])
        return float(solve_balance(Chain(), Friction(), angles, rates, 1e-8).require().z[2, 0])

    assert abs(omega(0.0) + 1) < 1e-6  # the tail link alone turns, against joint 1
    jumps = [(omega(h) - omega(0.0)) / h - (omega(0.0) - omega(-h)) / h for h in (1e-2, 1e-3, 1e-4)]
    assert abs(jumps[2]) > 0.05
    assert jumps[1] == pytest.approx(jumps[2], rel=0.1)  # a smooth function's would fall with h
