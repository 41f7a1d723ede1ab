"""Every check of the certificate refuses what lies just above its limit, and nothing else does."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import colloc
from colloc import Chain, Fourier, Friction, Harmonic, Problem, Solution, ellipse, replay, save
from colloc.commands.results import verify as recheck
from colloc.gaits.objective import QUANTITIES
from colloc.results.answer import SecondOrder
from colloc.results.checks import extrapolated_limit
from colloc.search import certify as verify
from colloc.search.certify import certify, gait_certificate
from colloc.verification import replay as replay_module
from tests.shared.cases import slow, slow_but

JUST_BELOW, JUST_ABOVE = 0.95, 1.05
LONG = map(slow, ("small_gaits", "four_link", "five_link"))


@pytest.fixture(scope="module")
def replays(three_link):
    """What certifying the solution replays, by delta: every test changes a copy."""
    found = {}

    def kept(*arguments, **settings):
        found.setdefault(arguments[3], replay(*arguments, **settings))
        return found[arguments[3]]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(replay_module, "replay", kept)
        assert certify(three_link.answer).passed
    return found


@pytest.fixture
def failures(three_link, replays, monkeypatch):
    """From a changed solution and changes of its replays to the checks that fail."""

    def names(solution=three_link, change=lambda part, replayed: replayed):
        largest = max(replays)
        monkeypatch.setattr(
            replay_module, "replay", lambda *a, **k: change(a[3] / largest, replays[a[3]])
        )
        return {check.name for check in certify(solution.answer).failures}

    return names


def with_answer(solution, **changes):
    return Solution(solution.problem, replace(solution.answer, **changes))


def changed(replayed, **numbers):
    """A replay with other numbers, quantities of its period among them."""
    values = {name: numbers.pop(name) for name in QUANTITIES if name in numbers}
    return replace(replayed, values=replayed.values | values, **numbers)


def judged(name, run):
    """At so many times its limit `name` fails, only above it and nothing else."""
    assert run(JUST_BELOW) == set()
    assert run(JUST_ABOVE) == {name}


@pytest.mark.parametrize(
    ("name", "field", "limit"),
    [
        ("KKT error", "kkt_error", 1e-6),
        ("KKT error", "complementarity", 1e-6),
        ("constraint violation", "violation", 1e-8),
    ],
)
def test_first_order_conditions(failures, three_link, name, field, limit):
    judged(name, lambda f: failures(with_answer(three_link, **{field: f * limit})))


def test_balance_at_the_nodes(failures, three_link):
    index = three_link.answer.layout.spins[0, 10]

    def off(step):
        x = three_link.answer.x.copy()
        x[index] += step
        return with_answer(three_link, x=x)

    checks = certify(off(1e-7).answer).checks
    check = next(each for each in checks if each.name == "balance at nodes")
    judged("balance at nodes", lambda f: failures(off(f * 1e-6 * 1e-7 / check.value)))


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("balance in replay", lambda r, f: {"residual": f * 1e-6}),
        ("net rotation", lambda r, f: {"rotation": -f * 1e-4 * r.distance / r.lever}),
        ("replay error", lambda r, f: {"error": f * 1e-6}),
        ("stability", lambda r, f: {"multipliers": (0.1, f * np.exp(2j))}),
        ("work = dissipation", lambda r, f: {"actuator_work": r.work * (1 + f * 1e-7)}),
        ("work = dissipation", lambda r, f: {"actuator_work": r.work * (1 - f * 1e-7)}),
    ],
)
def test_what_the_replay_measures(failures, name, changes):
    judged(name, lambda f: failures(change=lambda part, r: changed(r, **changes(r, f))))


@pytest.mark.parametrize("sign", [1, -1])
def test_collocated_against_replayed_efficiency(failures, three_link, replays, sign):
    true = replays[max(replays)].efficiency

    def run(f):
        return failures(with_answer(three_link, value=true * (1 + sign * f * 1e-4)))

    judged("replay gap", run)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("joint", [0, 1])
def test_closure(failures, three_link, monkeypatch, joint, sign):
    path, astray = Fourier.__call__, sign * np.eye(2)[:, [joint]]

    def run(f):
        def drifting(gait, t):
            angles, rates = path(gait, t)
            return angles + f * 1e-9 * t * astray, rates

        monkeypatch.setattr(Fourier, "__call__", drifting)
        return failures()

    judged("closure", run)


@pytest.mark.parametrize(
    ("name", "of", "tight"),
    [
        ("joint limits", "angles", lambda most, f: {"joint_limit": most - f * 1e-6}),
        ("joint speed", "rates", lambda most, f: {"speed_limit": most / (1 + f * 1e-4)}),
    ],
)
def test_limits_are_those_of_the_problem(failures, three_link, name, of, tight):
    most = np.abs(getattr(three_link.gait, of)(np.linspace(0, 1, 20001))).max()
    stated = three_link.problem.with_
    judged(name, lambda f: failures(with_answer(three_link, problem=stated(**tight(most, f)))))


def test_a_least_value_is_missed_by_no_more_than_a_mesh_may_err(failures, three_link, replays):
    """The replay's distance counts: who asks for as much has it, who asks for more has not."""
    there = replays[max(replays)].distance

    def run(f):
        asked = three_link.problem.with_(at_least={"distance": there / (1 - f * 1e-4)})
        return failures(with_answer(three_link, problem=asked))

    judged("least distance", run)
    assert run(-1.0) == run(0.0) == set()


@pytest.mark.parametrize(
    ("part", "passes"), slow_but([(1.15, False)], [(-1.15, False), (0.85, True), (1.15, False)])
)
def test_a_way_on_a_slope_may_lead_off_by_a_thousandth_of_a_radian(part, passes):
    """Where the gait goes is known from another integration; it is asked to go beside that."""
    gait = replace(ellipse(0, 2.8, 1.3), theta=0.7)
    ran = colloc.slope_motion(Chain(), Friction(), gait, 1e-2, 0.1, tolerance=1e-3)
    goes = np.arctan2(ran.aside[0], ran.climb[0])
    asked = {"delta": 1e-2, "grade": 0.1, "towards": goes + part * 1e-3}
    aside = Problem("aside", gait=Harmonic(1), **asked)
    found = gait_certificate(aside, gait, 1e-2, np.empty(0), tolerance=1e-3)
    (check,) = (check for check in found.checks if check.name == "direction")
    assert check.passed == passes
    assert check.value == pytest.approx(-part * 1e-3, abs=1e-4)


@pytest.mark.parametrize("depth", ["crossing_depth", "passing_depth"])
def test_self_contact(failures, monkeypatch, depth):
    free = getattr(verify, depth)

    def run(f):
        monkeypatch.setattr(verify, depth, lambda *arguments: free(*arguments) + f * 1e-6)
        return failures()

    judged("self-contact", run)


def test_mesh_error(failures, three_link, monkeypatch):
    def run(f):
        found = SimpleNamespace(estimate=f * three_link.problem.mesh_tolerance)
        monkeypatch.setattr(verify, "mesh_error", lambda *a: found)
        return failures()

    judged("mesh error", run)


def test_a_mesh_of_a_path_errs_at_the_delta_of_its_speed(unsolved, monkeypatch):
    stated = Problem("p", ellipse(0, 2.0, 1.0), gait=colloc.Polygon(4, "bilateral"), delta=1e-2)
    answer, asked = unsolved(stated).answer, []
    no_error = SimpleNamespace(estimate=0.0)
    monkeypatch.setattr(verify, "mesh_error", lambda *at: asked.append(at[3]) or no_error)
    certify(answer, tolerance=1e-2)
    assert asked == [answer.delta_per_period] > [5e-2]


@pytest.mark.parametrize("sign", [1, -1])
def test_influence_of_delta(failures, replays, sign):
    largest = replays[max(replays)].efficiency

    def smaller_deltas(f):
        limit = largest * (1 + sign * f * 1e-2)
        return lambda part, r: r if part == 1 else changed(r, distance=limit * r.work)

    judged("delta influence", lambda f: failures(change=smaller_deltas(f)))


def test_the_replay_is_as_accurate_as_was_asked_for(three_link, tmp_path, capsys):
    """1e-9 is reached; 1e-15 is beyond the balance, and what is not reached is not certified."""
    file = save(three_link, tmp_path / "a.h5")
    assert recheck([str(file), "--tolerance", "1e-9"]) == 0
    assert recheck([str(file), "--tolerance", "1e-15"]) == 4
    assert "NOT VERIFIED" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["two_link", "three_link", *LONG])
def test_errors_of_a_certificate_hold(solved, name):
    """Against replays to 1e-9 at delta and at a ten-thousandth of it."""
    solution = solved(name)[0]
    known, at = solution.certificate, (solution.problem.body, solution.problem.friction)
    deltas = solution.delta_per_period * np.array([1.0, 1e-4])
    here, limit = (replay(*at, solution.gait, d, tolerance=1e-9).efficiency for d in deltas)
    assert abs(known.efficiency - here) <= known.efficiency_error < 2e-6 * here
    assert abs(known.efficiency_at_zero_delta - limit) <= known.error_at_zero_delta < 1e-4 * limit


def test_the_limit_of_small_delta_is_exact_where_delta_acts_linearly():
    linear = [0.25 + 3.0 * delta for delta in (1e-2, 1e-3, 1e-4)]
    found = extrapolated_limit(linear, [0.0, 0.0, 0.0])
    assert found[0] == pytest.approx(0.25, abs=1e-15)
    assert found[1] == pytest.approx(3e-4, rel=1e-9)
    # other parts may hide the linear one in the last change: what it leaves is allowed for
    hidden = extrapolated_limit([linear[0], linear[1], linear[1]], [0.0, 0.0, 0.0])
    assert hidden[1] == pytest.approx(3e-4, rel=1e-9)
    # the last value is moved by a ninth of the last change: so is what it may be wrong by
    error = extrapolated_limit([0.25] * 3, [7e-3, 9e-4, 2e-4])[1]
    assert error == pytest.approx(2e-4 + (2e-4 + 9e-4) / 9, rel=1e-12)


def test_other_motions_count_as_error_and_explain_gaps(failures, three_link, replays, monkeypatch):
    """Up to 1 % that the law leaves open may pass, stated in every error."""
    fine = replays[max(replays)]

    def open_by(part):
        return lambda _, r: replace(r, others={"work": part * r.work}, several=0.01)

    judged("one motion", lambda f: failures(change=lambda p, r: open_by(f * 1e-2)(p, r)))
    gapped = with_answer(three_link, value=fine.efficiency * (1 + 3e-4))
    assert failures(gapped) == {"replay gap"}
    assert failures(gapped, open_by(2.5e-4)) == set()
    monkeypatch.setattr(replay_module, "replay", lambda *a, **k: open_by(5e-3)(1, replays[a[3]]))
    known = certify(three_link.answer)
    assert min(known.efficiency_error, known.error_at_zero_delta) >= 5e-3 * known.efficiency
    assert known.errors["work"] >= 5e-3 * known.work
    # a rotation that is too much carries other points of the body elsewhere
    monkeypatch.setattr(
        replay_module, "replay", lambda *a, **k: changed(replays[a[3]], rotation=1e-3)
    )
    known = certify(three_link.answer)
    assert known.errors["distance"] >= 1e-3 * fine.lever >= 1e-3 / 3
    assert known.efficiency_error >= 1e-3 * fine.lever / known.work


def test_a_certificate_says_how_far_a_body_leans_and_on_a_slope_how_long_its_motion_is_open(
    three_link, replays
):
    fine, gait = replace(replays[max(replays)], several=0.3), three_link.gait

    def values(**changes):
        at = three_link.problem.with_(**changes), gait, fine, np.empty(0), 1e-6, None
        return {name: value for name, value, *_ in verify._rows(*at)}

    assert values(grade=0.1)["one motion"] == 0.3
    body, angles = Chain(masses=(0.2, 0.6, 0.2)), gait.angles(np.linspace(0, 1, 2001))
    assert values(body=body)["statics"] == pytest.approx(body.imbalance(angles).max(), rel=1e-4)


@pytest.mark.parametrize(("rotation", "trivial"), [(0.0, True), (-0.1, False)])
def test_a_gait_that_turns_on_the_spot_is_not_trivial(rotation, trivial):
    answer = SimpleNamespace(problem=Problem("x"), efficiency=1e-6, rotation=rotation)
    assert verify.is_trivial(answer) == trivial


def test_a_saddle_is_not_certified_and_said_to_be_one(failures, three_link):
    """Curvature over the objective, less its error; a tenth of a radian gains that much."""

    def curved(smallest, error, n_free=2):
        return with_answer(three_link, second_order=SecondOrder(smallest, error, n_free))

    judged("second order", lambda f: failures(curved(-f * 1e-2, 0.0)))
    judged("second order", lambda f: failures(curved(-f * 1e-2 - 0.5, 0.5)))

    for measured, said in {
        (-0.02, 0.0, 2): "a saddle",
        (1e-6, 1e-5, 2): "flat",
        (0.02, 0.03, 2): "flat",
        (0.5, 0.01, 2): "an optimum",
        (np.inf, 0.0, 0): "a vertex",
        (np.nan, np.nan, 0, "not measured"): "not measured",
    }.items():
        solution = with_answer(three_link, second_order=SecondOrder(*measured))
        checks = {check.name: check.meaning for check in certify(solution.answer).checks}
        assert said in checks["second order"]


@pytest.mark.parametrize("image", ["mirrored", "back in time", "from the other end"])
def test_no_check_knows_left_from_right_or_one_sense_from_the_other(image):
    """Nor friction nor the body does: an image of a gait has its certificate."""
    gait = Fourier([0.3, 0.4], [[0.0, 0.0], [0.5, 0.0]], [[0.6, -0.2], [0.0, 0.1]])
    rates = gait.rates(np.arange(1000) / 1000)
    assert rates.max() < 0.9 * -rates.min()  # what this gait is here for
    other = {
        "mirrored": Fourier(-gait.mean, -gait.cos, -gait.sin),
        "back in time": Fourier(gait.mean, gait.cos, -gait.sin),
        "from the other end": Fourier(gait.mean[::-1], gait.cos[::-1], gait.sin[::-1]),
    }[image]
    limits = {"joint_limit": 0.7, "speed_limit": 4.0, "torque_limit": 0.02, "power_limit": 0.05}
    friction = Friction(mu_t=1.7, mu_f=1, mu_b=1)
    problem = Problem("images", friction=friction, gait=Harmonic(2), delta=1e-2, **limits)
    one, two = (
        gait_certificate(problem, each, 1e-2, np.empty(0), instants=800, tolerance=1e-5)
        for each in (gait, other)
    )
    failed = {check.name for check in one.failures}
    assert failed >= {"joint limits", "joint speed", "actuators", "net rotation"}
    for a, b in zip(one.checks, two.checks, strict=True):
        assert abs(b.value) == pytest.approx(abs(a.value), rel=1e-3, abs=1e-7), a.name
    assert two.efficiency == pytest.approx(one.efficiency, rel=1e-4)


def test_samples_make_every_error_larger_by_their_own_and_nothing_else_differs(three_link):
    known, samples = three_link.certificate, (1e-2, 2e-2, 3e-2, 4e-2)
    more = known.with_samples(samples)
    names = ("value_error", "efficiency_error", "distance_error", "work_error")
    by = dict(zip(names, samples, strict=True))
    by |= {"value_error_at_zero_delta": samples[0], "error_at_zero_delta": samples[1]}
    wanted = {name: number + by.get(name, 0.0) for name, number in known.numbers.items()}
    assert more.numbers == pytest.approx(wanted, rel=1e-12)
    assert more.by_replay.numbers == pytest.approx(known.numbers, rel=1e-9, abs=1e-15)
