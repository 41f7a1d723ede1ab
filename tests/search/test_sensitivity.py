"""What a wrong floor costs: derivatives of best values obey identities and match new optima."""

from dataclasses import replace

import numpy as np
import pytest

import colloc
from colloc.gaits.parameters import parameters
from colloc.search.sensitivity import _again, sensitivity

WAYS = ("sideways", "forwards", "backwards")
OWN = colloc.OwnLaw()
MIRRORED = (colloc.Foot(0, 0.2), colloc.Foot(1), colloc.Foot(2, 0.8))
BILATERAL, STEEP = colloc.Harmonic(1, "bilateral"), colloc.Friction(mu_t=1, mu_f=1, mu_b=2)


@pytest.fixture(scope="module")
def found(three_link):
    return three_link.sensitivity()


def test_as_much_more_friction_all_round_costs_as_much(three_link, found):
    """Forces scale with the coefficients, which velocities do not notice: sum of mu dV/dmu = -V."""
    total = sum(found[f"friction {way}"].slope for way in WAYS)
    assert total == pytest.approx(-three_link.value, rel=2e-5)
    for way in WAYS:  # and so it is written
        (row,) = (line for line in str(found).splitlines() if f"friction {way}" in line)
        _, *beside, slope, _, _ = row.split()[2:]
        there = [three_link.value + by * found[f"friction {way}"].slope for by in (-0.1, 0.1)]
        assert beside == [f"{value:.4f}" for value in there]
        assert float(slope) == pytest.approx(found[f"friction {way}"].slope, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "other"), [("feet", ()), ("fast", ("Froude number",)), ("uphill", ("grade",))]
)
def test_so_it_is_on_feet_and_where_gravity_and_inertia_are_as_much_stronger(name, other, solved):
    solution = solved(f"three_link_{name}")[0]
    found = solution.sensitivity()
    total = sum(found[each].slope for each in (*(f"friction {way}" for way in WAYS), *other))
    assert total == pytest.approx(-solution.value, rel=1e-4)


def test_a_longer_middle_is_shorter_ends(found):
    """A part more of both ends, a third each, takes two parts of the middle."""
    outer, middle = (found[f"length of {x}"].slope for x in ("links 1 and 3", "link 2"))
    assert outer == pytest.approx(-2 * middle, rel=1e-6)


def test_only_what_holds_the_gait_back_has_a_price(found, three_link):
    assert found["smallest shape speed"].slope == 0
    largest = np.abs(three_link.gait.angles(np.linspace(0, 1, 2001))).max()
    assert largest == pytest.approx(np.pi, abs=1e-4)
    assert found["joint limit"].slope > 10 * found["joint limit"].error


def differences(solution, parameter, step):
    """Derivative of the best value by gaits sought again, one-sided at an end, and its error."""
    some = sensitivity(solution, resolve=True, change=step)[parameter].again
    half = sensitivity(solution, resolve=True, change=step / 2)[parameter].again
    assert all(each.status == "solved" for each in (*some, *half))
    error = 4 * max(each.error for each in (*some, *half)) / step
    if len(some) == 2:
        wide, narrow = (
            (more.value - less.value) / (more.change - less.change) for less, more in (some, half)
        )
        return (4 * narrow - wide) / 3, error + abs(narrow - wide) / 3
    (wide,), (narrow,) = some, half
    slopes = [(each.value - solution.value) / each.change for each in (wide, narrow)]
    return 2 * slopes[1] - slopes[0], 2 * error + abs(slopes[1] - slopes[0]) / 3


@pytest.fixture
def of(monkeypatch):
    """A function that lets a sensitivity ask for some numbers of a problem only."""

    def only(*names):
        some = lambda problem: [each for each in parameters(problem) if each.name in names]  # noqa: E731
        monkeypatch.setattr("colloc.search.sensitivity.parameters", some)

    return only


def test_a_slope_is_that_of_gaits_that_are_sought_again(three_link, found, of):
    of(name := "length of link 2")
    slope, error = differences(three_link, name, 0.01)
    assert error < 0.01 * abs(slope)
    assert abs(found[name].slope - slope) <= found[name].error + error


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "finer"), [("three_link_offset", 1e-8), ("three_link_fast", 1e-6)]
)
def test_slopes_on_a_finer_mesh_differ_by_no_more_than_the_errors(name, finer, solved, of):
    """An answer's gait lies beside the true one, which moves slopes to first order."""
    rough = solved(name)[0]
    finely = {"delta_start": rough.problem.delta, "mesh_tolerance": finer}
    fine = colloc.solve(rough.problem.with_(guess=rough.gait, **finely), starts=1)
    of("friction sideways", "friction backwards")
    for effect, other in zip(rough.sensitivity().effects, fine.sensitivity().effects, strict=True):
        assert abs(effect.slope - other.slope) <= effect.error + other.error, effect.name
        assert effect.error < 5e-3 * abs(effect.slope), effect.name


def test_a_slope_that_changes_with_the_step_is_off_by_at_most_its_error(three_link, monkeypatch):
    """Something else begins within a few steps; at the number itself it is the plain slope."""
    plain = {each.name: each for each in parameters(three_link.problem)}["friction sideways"]
    bent = replace(plain, name="bent", changed=lambda step: plain.changed(step + 1e8 * step**3))
    monkeypatch.setattr("colloc.search.sensitivity.parameters", lambda problem: [plain, bent])
    true, found = three_link.sensitivity().effects
    assert abs(found.slope - true.slope) > 2 * true.error
    assert abs(found.slope - true.slope) <= found.error


@pytest.mark.slow
@pytest.mark.parametrize(
    "problem", ["three_link", "three_link_folded", "three_link_feet", "three_link_uphill"]
)
def test_all_slopes_are_those_of_gaits_that_are_sought_again(problem, solved, of):
    """Also where the net rotation, the way across a slope, or a joint limit carries a multiplier.
    The gaits are sought on finer meshes, as what a mesh leaves of a value counts a hundred times in
    differences of 1 %, and is no part of their errors."""
    solution = solved(problem)[0]
    stated = solution.problem
    finely = {"mesh_tolerance": 0.1 * stated.mesh_tolerance}
    finer = colloc.solve(stated.with_(guess=solution.gait, **finely), 1)
    # a limit that does not bind has the multiplier that IPOPT's barrier leaves, 1e-12
    effects = [each for each in solution.sensitivity().effects if abs(each.slope) > 1e-9]
    effects = [each for each in effects if each.name != "delta"]
    for effect in effects:
        of(effect.name)
        slope, error = differences(finer, effect.name, 0.01)
        assert abs(effect.slope - slope) <= effect.error + error, effect.name
    assert len(effects) >= 6


def test_the_gait_on_file_falls_behind_to_second_order(three_link, of):
    of("length of link 2")
    behind = []
    for change in (0.005, 0.01):
        again = sensitivity(three_link, resolve=True, change=change)["length of link 2"].again
        assert not any(each.breaks for each in again)
        behind.append(sum(each.behind for each in again))
    assert 0 < 4 * behind[0] == pytest.approx(behind[1], rel=0.1)


def test_a_path_on_file_is_replayed_at_delta_at_unit_shape_speed_and_for_its_turn(of, monkeypatch):
    """Per period it is ten times that here, and what counts is the chord."""
    of("friction sideways")
    at = {"rotation": 0.3, "delta": 4e-4, "mesh_tolerance": 1e-2, "gait": colloc.Polygon(4)}
    polygon = colloc.solve(colloc.Problem("p", colloc.ellipse(0, 0.8, 0.6), **at), 1)
    found = sensitivity(polygon, resolve=True, change=1e-3)["friction sideways"].again
    assert [a.on_file for a in found] == pytest.approx([a.value for a in found], rel=1e-4)
    assert not any(each.breaks for each in found)
    monkeypatch.setattr("colloc.search.sensitivity.finish", lambda *at: polygon)
    less = _again(polygon, polygon.problem.with_(rotation=0.28), 0.1)
    assert less.breaks == "turns +1.1° too far per cycle"


def test_a_gait_that_exceeds_a_limit_or_turns_says_so(three_link, of):
    of("joint limit")
    slopes = three_link.sensitivity(resolve=True)
    (less,) = slopes["joint limit"].again
    assert "beyond its limits" in less.breaks
    assert less.value < three_link.value
    first = slopes.value - 0.1 * slopes["joint limit"].slope
    numbers = [f"{x:.4f}" for x in (first, less.value, less.on_file)]
    assert str(slopes).split()[-11:-4] == ["limit", "-10", "%", *numbers, f"{less.behind:.1e}"]
    (told,) = slopes.facts()["effects"][0]["again"]
    assert (told["on_file"], told["behind"]) == (less.on_file, less.value - less.on_file)


@pytest.mark.parametrize(("part", "says"), [(1.05, "distance 0.2679, not 0.2813"), (0.95, "")])
def test_a_gait_on_file_that_goes_less_far_than_is_asked_says_so(
    three_link, monkeypatch, part, says
):
    monkeypatch.setattr("colloc.search.sensitivity.optimise", lambda *at: None)
    monkeypatch.setattr("colloc.search.sensitivity.finish", lambda *at: three_link)
    asked = three_link.problem.with_(at_least={"distance": part * three_link.distance})
    again, at = _again(three_link, asked, 0.1), (asked.body, asked.law, three_link.gait)
    assert again.breaks == says
    kept = colloc.replay(*at, asked.delta)
    assert again.on_file_error == pytest.approx(kept.error * kept.value, rel=0.1)


def test_feet_that_have_to_be_alike_move_together():
    body, gait = colloc.Chain(feet=MIRRORED), colloc.Harmonic(1, "bilateral")
    stated = {each.name: each for each in parameters(colloc.Problem("x", body=body, gait=gait))}
    assert "place of foot 2" not in stated  # the middle of the body
    moved = stated["place of feet 1 and 3"].changed(0.1).body.feet
    assert [foot.place for foot in moved] == pytest.approx([0.3, 0.5, 0.7])
    heavier = stated["weight of foot 2"].changed(0.3).body.feet
    assert [foot.weight for foot in heavier] == pytest.approx([17 / 60, 26 / 60, 17 / 60])


@pytest.mark.parametrize(
    ("middle", "others"),
    [
        (colloc.Foot(1), [f"friction {way}" for way in WAYS]),
        (colloc.Wheel(1, rolling=0.1), [f"friction {way} of foot 2" for way in WAYS]),
        (colloc.Wheel(1, axle=True), [f"{x} resistance of foot 2" for x in ("rolling", "slip")]),
    ],
)
def test_wheels_have_numbers_of_their_own(middle, others):
    body = colloc.Chain(feet=(colloc.Wheel(0, rolling=0.05), middle, colloc.Wheel(2, rolling=0.05)))
    stated = {each.name: each for each in parameters(colloc.Problem("x", body=body))}
    own = [f"friction {way} of feet 1 and 3" for way in WAYS]
    words = "friction", "resistance"
    assert {x for x in stated if any(word in x for word in words)} == {*others, *own}
    changed = [foot.friction for foot in stated[own[1]].changed(0.2).body.feet]
    outer = colloc.Friction(mu_t=1, mu_f=0.06, mu_b=0.05)
    assert changed == [outer, body.feet[1].friction, outer]


@pytest.mark.parametrize(
    "stated",
    [
        {"friction": OWN},
        {"body": colloc.Chain(feet=[colloc.Foot(k, friction=OWN) for k in range(3)])},
    ],
)
def test_formulas_of_a_law_of_ones_own_are_no_numbers(stated):
    names = [each.name for each in parameters(colloc.Problem("x", **stated))]
    assert "delta" in names
    assert not any("friction" in name or "drag" in name for name in names)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"joint_limit": ((-1, 2), 1.5), "speed_limit": 12.0},
        {"at_least": {"distance": 0.1}, "torque_limit": (0.1, 0.2)},
        {"body": colloc.Chain(weights=(0.3, 0.3, 0.4), width=0.02), "grade": 0.1},
        {"body": colloc.Chain(feet=MIRRORED), "gait": BILATERAL},
        {"friction": colloc.PowerLaw(0.3), "gait": colloc.Harmonic(2)},
        {"friction": colloc.Axle(rolling=0.03, sideways=0.7)},
        {"gait": colloc.Polygon(3)},
        {"body": colloc.ModalBody(2), "gait": colloc.Harmonic(1), "at_least": {"distance": 0.0}},
        {"body": colloc.Chain((0.5, 0.5), feet=1), "friction": STEEP, "gait": BILATERAL},
    ],
)
def test_every_number_can_change_and_nothing_else_does(changes):
    problem = colloc.Problem("x", **changes)
    for each in parameters(problem):
        same, less = each.changed(0.0), each.changed(-0.01)
        assert same.with_(guess=problem.guess).hash == problem.hash, each.name
        now = {own.name: own.value for own in parameters(less)}[each.name]
        expected = 0.99 * each.value if each.relative else each.value - 0.01
        assert now == pytest.approx(expected, rel=1e-12), each.name


def test_what_is_no_optimum_is_refused(three_link, tmp_path):
    given = colloc.evaluate(three_link.problem, three_link.gait)
    with pytest.raises(colloc.ProblemError, match="this gait was not optimised"):
        given.sensitivity()
    rough = colloc.solve(three_link.problem.with_(delta=1e-4), starts=1, seconds=1e-3)
    with pytest.raises(colloc.ProblemError, match="this solve ended as: interrupted"):
        rough.sensitivity()
    with pytest.raises(KeyError, match="there is friction sideways"):
        three_link.sensitivity()["colour"]


def test_the_error_of_a_slope_is_the_most_it_differs_by_on_another_mesh(three_link, monkeypatch):
    """Meshes on which a problem is worth so many times its friction sideways."""
    on = [lambda problem, n=n: n * problem.friction.mu_t for n in (3.0, 2.6, 3.1)]
    monkeypatch.setattr("colloc.search.sensitivity._lagrangians", lambda answer: on)
    found = three_link.sensitivity()["friction sideways"]
    assert (found.slope, found.error) == pytest.approx((3.0, 0.4), rel=1e-6)
