"""Each part of the interval for dry friction widens it by as much as that part is off, and none is
left out."""

from dataclasses import replace

import numpy as np
import pytest

from colloc import Chain, Friction, ellipse, replay
from colloc.verification import dry_friction as module
from colloc.verification.dry_balance import DryBalance
from colloc.verification.dry_friction import Between, DryFriction, dry_friction

BODY, LAW, GAIT = Chain(), Friction(), ellipse(A0=0, A1=2.0, B1=1.0)
OFF = 1e-3


@pytest.fixture(scope="module")
def replayed():
    mean = float(np.abs(GAIT(np.linspace(0.0, 1.0, 101))[1]).max(axis=0).mean())
    return replay(BODY, LAW, GAIT, 1e-6 * mean, tolerance=1e-4)


def interval(monkeypatch, change):
    """The interval, were dry friction known exactly, to be what the replay has, but for one
    change."""

    def known(body, law, angles, rates):
        delta = 1e-6 * float(np.abs(GAIT(np.linspace(0.0, 1.0, 101))[1]).max(axis=0).mean())
        z = body.solve(body.law(law), angles, rates, delta).z
        power = body.sliding(
            body.law(law), angles, rates, z, np.full((1, angles.shape[1]), delta)
        ).power[0]
        found = {"least": power, "most": power, "z": z, "apart": np.zeros_like(z)}
        return DryBalance(**(found | change(found)))

    monkeypatch.setattr(module, "dry_balance", known)
    return dry_friction(BODY, LAW, GAIT, tolerance=1e-4)


def shifted(row, by):
    moved = np.zeros((3, 1))
    moved[row] = by
    return moved


def widths(found):
    return found.distance.most - found.distance.least, found.work.most - found.work.least


@pytest.mark.parametrize("what", ["distance", "work"])
def test_what_the_quadrature_is_off_by_counts_once_to_each_side(monkeypatch, replayed, what):
    exact = interval(monkeypatch, lambda known: {})
    assert np.mean(exact.distance) == pytest.approx(replayed.distance)
    assert np.mean(exact.work) == pytest.approx(replayed.work)

    def worse(*given, **how):
        found = replay(*given, **how)
        return replace(found, errors=found.errors | {what: found.errors[what] + OFF})

    monkeypatch.setattr(module, "replay", worse)
    found = interval(monkeypatch, lambda known: {})
    for name in ("distance", "work"):
        by = OFF if name == what else 0.0
        ends = np.array(getattr(found, name)) - np.array(getattr(exact, name))
        np.testing.assert_allclose(ends, [-by, by], rtol=0, atol=1e-9)


@pytest.mark.parametrize("row", [0, 1])
@pytest.mark.parametrize("what", ["z", "apart"])
def test_a_velocity_that_is_off_or_open_leads_as_far_as_it_carries_in_a_period(
    monkeypatch, what, row
):
    exact = widths(interval(monkeypatch, lambda known: {}))
    found = widths(interval(monkeypatch, lambda known: {what: known[what] + shifted(row, OFF)}))
    assert found[0] - exact[0] == pytest.approx(2 * OFF, rel=1e-3)
    assert found[1] == pytest.approx(exact[1])


def test_a_rotation_that_is_open_turns_the_whole_way(monkeypatch):
    exact = widths(interval(monkeypatch, lambda known: {}))
    found = widths(interval(monkeypatch, lambda known: {"apart": known["apart"] + shifted(2, OFF)}))
    t = np.arange(2000) / 2000
    angles, rates = GAIT(t)
    z = BODY.solve(LAW, angles, rates, 1e-5).z
    posture = BODY.posture(angles)
    way = np.hypot(*BODY.centre_velocity(posture, BODY.velocity(posture, rates, z))).mean()
    assert found[0] - exact[0] == pytest.approx(2 * OFF * way, rel=0.02)


@pytest.mark.parametrize(("what", "sign", "end"), [("least", -1, 0), ("most", 1, 1)])
def test_power_that_may_be_less_or_more_moves_that_end_of_the_work_alone(
    monkeypatch, what, sign, end
):
    exact = interval(monkeypatch, lambda known: {}).work
    found = interval(monkeypatch, lambda known: {what: known[what] + sign * OFF}).work
    assert abs(found[end] - exact[end]) == pytest.approx(OFF, rel=1e-3)
    assert found[1 - end] == pytest.approx(exact[1 - end])


def test_between_two_instants_the_worse_of_them_counts(monkeypatch):
    """Every other instant is off: all of the period counts as that."""
    exact = widths(interval(monkeypatch, lambda known: {}))

    def every_other(known):
        apart = np.zeros_like(known["apart"])
        apart[0, ::2] = OFF
        return {"apart": apart if apart.shape[1] > 1 else known["apart"]}

    found = widths(interval(monkeypatch, every_other))
    assert found[0] - exact[0] == pytest.approx(2 * OFF, rel=1e-3)


def test_efficiency_lies_between_the_least_way_for_the_most_work_and_the_most_for_the_least():
    found = DryFriction(Between(0.2, 0.3), Between(1.0, 2.0), 0.0, 10)
    assert found.efficiency == (0.1, 0.3)
