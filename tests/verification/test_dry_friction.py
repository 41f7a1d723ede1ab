"""Motion at delta = 0 between bounds, against cone programs; each part widens them by its own."""

from dataclasses import replace

import clarabel
import numpy as np
import pytest
from scipy import sparse

import colloc
from colloc import Chain, Elliptic, Foot, Friction, ellipse, replay
from colloc.commands.results import verify as main
from colloc.verification import dry_friction as module
from colloc.verification.dry_friction import dry_balance, dry_friction

ISOTROPIC, ELLIPTIC = Friction(), Elliptic(mu_t=2.0, mu_f=1.0, mu_b=1.0)
UNEVEN = Chain(
    (0.3, 0.2, 0.5),
    feet=(Foot(0, 0.4, weight=0.2), Foot(1, 0.5, weight=0.3), Foot(2, 0.1), Foot(2, 0.9)),
)
BODY, LAW, GAIT = Chain(), Friction(), ellipse(A0=0, A1=2.0, B1=1.0)
DELTA = 1e-6 * float(np.abs(GAIT(np.linspace(0.0, 1.0, 101))[1]).max(axis=0).mean())
OFF = 1e-3


def instants(body, seed, count=20):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.5, 1.5, (body.n_joint, count)), rng.normal(size=(body.n_joint, count))


def least_power(body, mu_t, angles, rates):
    """Least sum of weights times |(v along, mu_t v across)| of a body on feet, by Clarabel."""
    turn = np.exp(1j * np.cumsum([0.0, *angles]))
    spin, links = np.cumsum([0.0, *rates]), np.array(body.lengths) * turn
    hinges, moving = (np.cumsum([0.0, *each])[:-1] for each in (links, 1j * spin * links))
    m = len(body.standing_on)
    table, right = np.zeros((3 * m, 3 + m)), np.zeros(3 * m)
    for k, foot in enumerate(body.standing_on):
        axis = turn[foot.link]
        at = hinges[foot.link] + foot.place * links[foot.link] + 1j * foot.offset * axis
        own = moving[foot.link] + 1j * spin[foot.link] * (at - hinges[foot.link])
        seen = np.array([1.0, 1j, 1j * at, own]) * np.conj(axis)
        rows = np.stack([seen.real, mu_t * seen.imag])
        table[3 * k, 3 + k], table[3 * k + 1 : 3 * k + 3, :3] = -1.0, -rows[:, :3]
        right[3 * k + 1 : 3 * k + 3] = rows[:, 3]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    cost = np.array([0.0, 0.0, 0.0, *(foot.weight for foot in body.standing_on)])
    parts = sparse.csc_matrix((3 + m, 3 + m)), cost, sparse.csc_matrix(table), right
    cones = [clarabel.SecondOrderConeT(3)] * m
    return clarabel.DefaultSolver(*parts, cones, settings).solve().obj_val


@pytest.mark.parametrize(
    ("body", "law", "mu_t"),
    [
        (Chain(feet=1), ISOTROPIC, 1.0),
        (UNEVEN, ISOTROPIC, 1.0),
        (UNEVEN, ELLIPTIC, 2.0),
        (Chain((0.4, 0.6), feet=2), ELLIPTIC, 2.0),
    ],
)
def test_on_feet_the_least_power_of_a_cone_program_lies_between_the_bounds(body, law, mu_t):
    angles, rates = instants(body, 1)
    found = dry_balance(body, law, angles, rates)
    power = np.array([least_power(body, mu_t, *at) for at in zip(angles.T, rates.T, strict=True)])
    assert np.all(found.least <= power + 1e-8)
    assert np.all(power <= found.most + 1e-8)
    assert np.all(found.most - found.least < 1e-8)


@pytest.mark.parametrize("body", [Chain(), Chain((0.2, 0.3, 0.1, 0.4)), UNEVEN])
@pytest.mark.parametrize("law", [ISOTROPIC, ELLIPTIC])
def test_the_ordinary_balance_tends_to_what_lies_between_the_bounds(body, law):
    angles, rates = instants(body, 3, 50)
    found = dry_balance(body, law, angles, rates)
    size = np.abs(rates).max(axis=0)
    assert np.all(found.least <= found.most)
    assert np.all(found.most - found.least <= 1e-8 * size)
    assert np.all(found.apart <= 1e-4 * size)
    off = []
    for delta in (1e-4, 1e-6):
        solved = body.solve(body.law(law), angles, rates, delta)
        power = body.motion(body.law(law), angles, rates, delta, solved).power
        off.append(np.maximum(found.least - power, power - found.most).max())
    assert off[1] < 0.05 * off[0] < 1e-4


def test_bounds_are_proportional_to_rates_and_to_friction_and_nothing_moves_at_rest():
    angles, rates = instants(Chain(), 4)
    one, faster = (dry_balance(Chain(), ISOTROPIC, angles, factor * rates) for factor in (1.0, 1e3))
    np.testing.assert_allclose(faster.most, 1e3 * one.most, rtol=1e-12)
    rough = dry_balance(Chain(), Friction(3.0, 3.0, 3.0), angles, rates)
    np.testing.assert_allclose(rough.most, 3.0 * one.most, rtol=1e-9)
    still = dry_balance(Chain(), ISOTROPIC, angles, 0.0 * rates)
    assert not np.any([still.least, still.most])
    assert not np.any(still.apart)


def test_the_interval_of_a_period_holds_what_a_certificate_states_for_delta_to_zero(three_link):
    dry, stated = three_link.dry(), three_link.certificate
    (least, most), error = dry.efficiency, stated.error_at_zero_delta
    assert least - error <= stated.efficiency_at_zero_delta <= most + error
    assert most - least < 1e-5
    assert dry.open == 0.0


@pytest.mark.parametrize("body", [Chain(), pytest.param(Chain(feet=2), marks=pytest.mark.slow)])
def test_corners_where_rates_jump_do_not_widen_the_interval_of_a_period(body):
    gait = colloc.Corners([[1.2, 1.5, -1.2], [-1.2, 0.3, 1.2]], "bilateral")
    least, most = dry_friction(body, ISOTROPIC, gait, breaks=gait.corner_phases).efficiency
    assert most - least < 2e-4
    replayed = colloc.replay(body, ISOTROPIC, gait, 1e-5, breaks=gait.corner_phases).efficiency
    assert least - 1e-4 < replayed < most + 1e-4


def test_verify_tells_the_interval_on_demand(three_link, tmp_path, capsys):
    file = str(colloc.save(three_link, tmp_path / "x.h5"))
    assert main([file, "--dry", "--quiet"]) == 0
    assert "dry friction: d/W between 0.26002" in capsys.readouterr().out
    assert main([file, "--quiet"]) == 0
    assert "dry" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("lengths", "places", "rates"),
    [((1 / 3,) * 3, (0.5,) * 3, (1, 1)), ((0.2, 0.5, 0.3), (0.1, 0.2, 0.9), (0.3, 1))],
)
def test_of_three_feet_in_a_row_any_two_may_rest_the_bounds_hold_all(lengths, places, rates):
    """Each bears as much as makes either motion cost the same: the middle one half."""
    masses, hinges = (0.5, 0.2, 0.3), np.array([0.0, lengths[0], lengths[0] + lengths[1]])
    at = hinges + np.array(places) * lengths
    middle = np.dot(masses, hinges + 0.5 * np.array(lengths))
    weights = np.array([at[2] - at[1], at[2] - at[0], at[1] - at[0]]) / (2 * (at[2] - at[0]))
    feet = tuple(Foot(k, places[k], weight=weights[k]) for k in range(3))
    body, straight = Chain(lengths, feet=feet, masses=masses), np.zeros((2, 1))
    found = dry_balance(body, ISOTROPIC, straight, np.array(rates)[:, None])
    # speeds across while the tail rests
    bent = np.array(rates) @ np.maximum(at - hinges[1:, None], 0.0)
    pairs = [[0, 1], [1, 2], [0, 2]]
    rest = np.array([np.linalg.solve([[1, at[i]], [1, at[j]]], -bent[[i, j]]) for i, j in pairs])
    speeds = bent + rest @ [np.ones(3), at]
    power = np.abs(speeds) @ weights
    assert np.all((found.least <= power) & (power <= found.most))
    assert found.most - found.least < 1e-12
    across, spin = np.abs((rest - found.z[1:, 0]) @ [[1, 0], [middle, 1]]).max(axis=0)
    assert found.apart[0, 0] < 1e-5
    assert across <= found.apart[1, 0]
    assert spin <= found.apart[2, 0] < 1.5 * np.ptp(rest[:, 1])


@pytest.fixture
def interval(monkeypatch):
    """The interval if dry friction were the replay's, but for what is added to a field."""

    def bounds(name="", added=lambda n: 0.0):
        def known(body, law, angles, rates):
            n = angles.shape[1]
            z = body.solve(body.law(law), angles, rates, DELTA).z
            power = body.sliding(body.law(law), angles, rates, z, np.full((1, n), DELTA)).power[0]
            found = module.DryBalance(power, power, z, np.zeros_like(z))
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
def test_a_velocity_that_is_off_leads_as_far_as_it_carries_in_a_period(interval, what, row, every):
    """Between two instants the worse counts: with every other off, all of the period."""
    exact, found = widths(interval()), widths(interval(what, shifted(row, every)))
    assert found[0] - exact[0] == pytest.approx(2 * OFF, rel=1e-3)
    assert found[1] == pytest.approx(exact[1])


@pytest.mark.parametrize("what", ["apart", "z"])
def test_a_rotation_that_is_open_turns_the_whole_way(interval, what):
    exact, found = widths(interval()), widths(interval(what, shifted(2)))
    angles, rates = GAIT(np.arange(2000) / 2000)
    z = BODY.solve(LAW, angles, rates, 1e-5).z
    posture = BODY.posture(angles)
    way = np.hypot(*BODY.centre_velocity(posture, BODY.velocity(posture, rates, z))).mean()
    # that of the tail swings the centre of mass, too
    way += (what == "z") * np.hypot(*BODY.centre(angles)).mean()
    assert found[0] - exact[0] == pytest.approx(2 * OFF * way, rel=0.02)


@pytest.mark.parametrize(("apart", "part"), [(0.05, 0.0), (0.2, 1.0)])
def test_a_motion_is_open_where_it_is_not_known_to_a_hundredth_of_the_largest_rate(
    interval, apart, part
):
    largest = np.abs(GAIT(np.arange(2000) / 2000)[1]).max(axis=0)
    assert 0.05 < 1e-2 * largest.min() < 1e-2 * largest.max() < 0.2
    assert interval("apart", lambda n: apart).open == part


@pytest.mark.parametrize("law", [ISOTROPIC, ELLIPTIC])
def test_before_any_cut_no_rigid_motion_of_the_mean_speed_that_is_allowed_is_excluded(
    monkeypatch, law
):
    monkeypatch.setattr(module, "_ROUNDS", 0)
    body, rng = Chain((0.4, 0.6)), np.random.default_rng(6)
    angles, rates = instants(body, 5) * np.reshape([0.1, 1.0], (2, 1, 1))  # nearly straight
    found, part = dry_balance(body, law, angles, rates), (np.arange(50) + 0.5) / 50
    ends = np.array([1, 1j]) @ np.stack(body.joints(angles)).swapaxes(0, 1)
    points = ends[:-1, None] + part[:, None] * np.diff(ends, axis=0)[:, None]
    arms, of_links = points - np.array([1, 1j]) @ body.centre(angles), np.array(body.lengths)
    u, v, spin = rng.normal(size=(3, 500, 1, 1, 20)) * np.reshape([1.0, 1.0, 9.0], (3, 1, 1, 1, 1))
    speed = np.abs(u + 1j * v + 1j * spin * arms).mean(axis=2).swapaxes(1, 2) @ of_links
    allowed = 2 * found.most / law.smallest / speed
    moves, turns = np.hypot(u, v)[:, 0, 0] * allowed, np.abs(spin[:, 0, 0]) * allowed
    assert (moves <= found.apart[0]).all()
    assert (turns <= found.apart[2]).all()
    assert (turns.max(axis=0) / found.apart[2]).min() > 0.6


@pytest.mark.parametrize(("what", "sign", "end"), [("least", -1, 0), ("most", 1, 1)])
def test_power_that_may_be_less_or_more_moves_that_end_of_the_work_alone(interval, what, sign, end):
    exact, found = interval().work, interval(what, lambda n: sign * OFF).work
    assert abs(found[end] - exact[end]) == pytest.approx(OFF, rel=1e-3)
    assert found[1 - end] == pytest.approx(exact[1 - end])


def test_efficiency_lies_between_the_least_way_for_the_most_work_and_the_most_for_the_least():
    found = module.DryFriction(module.Between(0.2, 0.3), module.Between(1.0, 2.0), 0.0, 10)
    assert found.efficiency == (0.1, 0.3)
