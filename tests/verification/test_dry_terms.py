"""Each part of the interval for dry friction widens it by as much as that part is off."""

from dataclasses import replace

import numpy as np
import pytest

from colloc import Chain, Friction, ellipse, replay
from colloc.verification import dry_friction as module
from colloc.verification.dry_friction import Between, DryBalance, DryFriction, dry_friction

BODY, LAW, GAIT = Chain(), Friction(), ellipse(A0=0, A1=2.0, B1=1.0)
DELTA = 1e-6 * float(np.abs(GAIT(np.linspace(0.0, 1.0, 101))[1]).max(axis=0).mean())
OFF = 1e-3


@pytest.fixture
def interval(monkeypatch):
    """The interval if dry friction were the replay's, but for what is added to a field."""

    def bounds(name="", added=lambda n: 0.0):
        def known(body, law, angles, rates):
            n = angles.shape[1]
            z = body.solve(body.law(law), angles, rates, DELTA).z
            power = body.sliding(body.law(law), angles, rates, z, np.full((1, n), DELTA)).power[0]
            found = DryBalance(power, power, z, np.zeros_like(z))
            return found._replace(**{name: getattr(found, name) + added(n)}) if name else found

        monkeypatch.setattr(module, "dry_balance", known)
        return dry_friction(BODY, LAW, GAIT, tolerance=1e-4)

    return bounds


def shifted(row, every=1):
    """Something off in a row, at every so many instants."""
    return lambda n: OFF * (np.arange(3) == row)[:, None] * (np.arange(n) % every == 0)


def widths(found):
    return found.distance.most - found.distance.least, found.work.most - found.work.least


@pytest.mark.parametrize("what", ["distance", "work"])
def test_what_the_quadrature_is_off_by_counts_once_to_each_side(monkeypatch, interval, what):
    exact, replayed = interval(), replay(BODY, LAW, GAIT, DELTA, tolerance=1e-4)
    assert np.mean(exact.distance) == pytest.approx(replayed.distance)
    assert np.mean(exact.work) == pytest.approx(replayed.work)

    def worse(*given, **how):
        found = replay(*given, **how)
        return replace(found, errors=found.errors | {what: found.errors[what] + OFF})

    monkeypatch.setattr(module, "replay", worse)
    found = interval()
    for name in ("distance", "work"):
        by = OFF if name == what else 0.0
        ends = np.array(getattr(found, name)) - np.array(getattr(exact, name))
        np.testing.assert_allclose(ends, [-by, by], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("what", "row", "every"),
    [("z", 0, 1), ("z", 1, 1), ("apart", 0, 1), ("apart", 1, 1), ("apart", 0, 2)],
)
def test_a_velocity_that_is_off_or_open_leads_as_far_as_it_carries_in_a_period(
    interval, what, row, every
):
    """Between two instants the worse counts: with every other off, all of the period."""
    exact, found = widths(interval()), widths(interval(what, shifted(row, every)))
    assert found[0] - exact[0] == pytest.approx(2 * OFF, rel=1e-3)
    assert found[1] == pytest.approx(exact[1])


def test_a_rotation_that_is_open_turns_the_whole_way(interval):
    exact, found = widths(interval()), widths(interval("apart", shifted(2)))
    angles, rates = GAIT(np.arange(2000) / 2000)
    z = BODY.solve(LAW, angles, rates, 1e-5).z
    posture = BODY.posture(angles)
    way = np.hypot(*BODY.centre_velocity(posture, BODY.velocity(posture, rates, z))).mean()
    assert found[0] - exact[0] == pytest.approx(2 * OFF * way, rel=0.02)


@pytest.mark.parametrize(("what", "sign", "end"), [("least", -1, 0), ("most", 1, 1)])
def test_power_that_may_be_less_or_more_moves_that_end_of_the_work_alone(interval, what, sign, end):
    exact, found = interval().work, interval(what, lambda n: sign * OFF).work
    assert abs(found[end] - exact[end]) == pytest.approx(OFF, rel=1e-3)
    assert found[1 - end] == pytest.approx(exact[1 - end])


def test_efficiency_lies_between_the_least_way_for_the_most_work_and_the_most_for_the_least():
    found = DryFriction(Between(0.2, 0.3), Between(1.0, 2.0), 0.0, 10)
    assert found.efficiency == (0.1, 0.3)
