"""Fourier series, serpenoid gaits, B-splines, given columns: against each other and differences."""

import h5py
import numpy as np
import pytest

import colloc
from colloc import Basis, BSpline, Chain, Fourier, Harmonic, Problem, Serpenoid, load, save
from colloc.gaits.fitted_gait import fitted_gait
from colloc.gaits.gait import SYMMETRIES
from colloc.gaits.gait_fields import CLASSES as KINDS
from colloc.gaits.gait_fields import fields, gait_from, part_from
from colloc.gaits.harmonic import harmonics_within, shift_phase
from colloc.gaits.linear import enclosed_area
from colloc.gaits.starts import initial_member
from colloc.search.iterate import space_near
from colloc.search.solve import solve

T = np.arange(200) / 200
PHASES = np.arange(96) / 96


def bump(t):
    return np.exp(2 * np.cos(2 * np.pi * t))


FOUR = tuple(lambda t, k=k: bump(t - k / 4) for k in range(4))
COS, SIN = np.cos(2 * np.pi * PHASES), np.sin(2 * np.pi * PHASES)
ELLIPSES = [np.stack([COS, -COS]), np.stack([SIN, SIN]), np.stack([np.ones(96), -np.ones(96)])]
SPLINES = BSpline(8, symmetry="bilateral")
CLASSES = [SPLINES, BSpline(7, 3), Basis(FOUR, "antipodal"), Basis(ELLIPSES)]


def member(gait_class, n_joint=2):
    p = np.random.default_rng(1).normal(size=gait_class.size(n_joint))
    return gait_class.member(p, n_joint)


@pytest.mark.parametrize("gait_class", [BSpline(9, 3), BSpline(5, 4), BSpline(64, 5), Basis(FOUR)])
def test_derivatives_of_the_functions_are_those_of_differences_and_a_period_closes(gait_class):
    h = 1e-6
    slope = (gait_class.functions(T + h) - gait_class.functions(T - h)) / (2 * h)
    values = gait_class.functions(T)
    np.testing.assert_allclose(gait_class.functions(T, 1), slope, atol=1e-6 * np.abs(slope).max())
    np.testing.assert_allclose(gait_class.functions(T + 1.0), values, rtol=0, atol=1e-11)
    if isinstance(gait_class, BSpline):
        np.testing.assert_allclose(values.sum(axis=0), 1.0, rtol=0, atol=1e-13)


@pytest.mark.parametrize("degree", [3, 4, 5])
def test_a_wave_is_met_at_the_order_of_the_splines(degree):
    wave = colloc.ellipse(0.2, 1.3, 0.8)
    near = (BSpline(n, degree).through(wave).angles(T) for n in (12, 24))
    off = [np.abs(angles - wave.angles(T)).max() for angles in near]
    assert np.log2(off[0] / off[1]) == pytest.approx(degree + 1, abs=0.3)


@pytest.mark.parametrize("symmetry", SYMMETRIES)
@pytest.mark.parametrize("columns", [None, FOUR])
def test_members_have_the_symmetry_of_their_class_and_are_found_again(symmetry, columns):
    gait_class = Basis(columns, symmetry) if columns else BSpline(8, symmetry=symmetry)
    for n_joint in (2, 3):
        gait = member(gait_class, n_joint)
        images = {"bilateral": -gait.angles(-T)[::-1], "antipodal": -gait.angles(T + 0.5)}
        np.testing.assert_allclose(images.get(symmetry, gait.angles(T)), gait.angles(T), atol=1e-8)
        again = gait_class.member(gait_class.parameters(gait), n_joint)
        np.testing.assert_allclose(again.table, gait.table, rtol=0, atol=1e-10)
        # as anybody's gait: by its angles alone
        again = gait_class.member(gait_class.parameters(gait.transform(np.eye(n_joint))), n_joint)
        np.testing.assert_allclose(again.angles(T), gait.angles(T), atol=1e-4)


@pytest.mark.parametrize("body", [Chain(), colloc.ModalBody(2)])
@pytest.mark.parametrize("gait_class", CLASSES)
def test_what_a_class_says_of_its_parameters_is_true_of_its_gaits(gait_class, body):
    gait, t = member(gait_class), np.arange(4000) / 4000
    v, (first, second) = gait_class.parameters(gait), gait.angles(t)
    square = (gait.rates(t) ** 2).sum(axis=0).mean()
    assert v @ gait_class.mean_square_rate(2) @ v == pytest.approx(square, rel=1e-4)
    assert (2 * np.pi * gait.shape_speed) ** 2 == pytest.approx(square, rel=1e-4)
    np.testing.assert_allclose(gait.mean, gait.angles(t).mean(axis=1), atol=1e-6)
    area = 0.5 * np.sum(first * np.roll(second, -1) - second * np.roll(first, -1))
    assert v @ enclosed_area(gait_class, 2) @ v == pytest.approx(area, rel=1e-4, abs=1e-9)
    np.testing.assert_allclose(gait.scaled(-3.0).angles(t), -3.0 * gait.angles(t))
    for parameters in (v, *np.eye(v.size)):
        largest = body.bounded_angles.largest(gait_class.member(parameters, 2).angles(t)).max()
        low, high = gait_class.bounds(body, largest)
        assert np.all((low - 1e-9 <= parameters) & (parameters <= high + 1e-9))
    points = gait_class.fewest_intervals(3)[0] * 3
    assert 4 * gait_class.harmonics <= points < max(4 * gait_class.harmonics + 3, 7)


def test_random_splines_are_smooth_waves_and_a_hop_leaves_finer_features_as_they_are():
    kind, rng = BSpline(24), np.random.default_rng(4)
    unit, gait = rng.uniform(size=kind.sample_dimension(2)), member(kind)
    np.testing.assert_array_equal(kind.sample(unit, 2).table, Harmonic(3).sample(unit, 2).table)
    hops = [kind.perturb(gait, 0.1, 1, rng).angles(T)[1] - gait.angles(T)[1] for _ in range(300)]
    powers = np.mean(np.abs(2 * np.fft.rfft(hops) / T.size) ** 2, axis=0) / 2
    np.testing.assert_allclose(powers[1:5] ** 0.5, [0.1, 0.05, 0.1 / 3, 0], rtol=0.1, atol=1e-12)


@pytest.mark.parametrize("gait_class", [Basis(FOUR, "antipodal"), Basis(ELLIPSES)])
def test_random_combinations_of_columns_are_drawn_about_rest_each_up_to_a_radian(gait_class):
    unit = np.random.default_rng(5).uniform(size=gait_class.sample_dimension(2))
    drawn, opposite = (gait_class.sample(u, 2).angles(T) for u in (unit, 1 - unit))
    np.testing.assert_allclose(drawn, -opposite, rtol=0, atol=1e-12)
    for one in 0.5 + 0.5 * np.eye(unit.size):
        angles = gait_class.sample(one, 2).angles(gait_class.instants)
        assert np.abs(angles).max() == pytest.approx(1.0)


@pytest.mark.parametrize("unit", [0.01, 40])
def test_a_hop_moves_angles_by_normals_of_its_step_whatever_the_units_of_a_column(unit):
    kind, rng = Basis([unit * np.stack([COS, 0.3 * SIN])]), np.random.default_rng(3)
    gait = kind.member(np.ones(1) / unit, 2)
    hops = [kind.perturb(gait, 0.2, 1, rng).angles(T)[0, 0] - 1.0 for _ in range(400)]
    assert (np.mean(hops), np.std(hops)) == pytest.approx((0.0, 0.2), abs=0.02)


def test_a_search_begins_with_a_wave_or_where_a_class_has_none_with_all_of_it_as_fast():
    wave, twice = colloc.ellipse(0.0, 1.2, 0.7), Basis([COS**2 - SIN**2, 2 * SIN * COS])
    for gait_class in (*CLASSES, twice):
        assert initial_member(gait_class, wave).shape_speed == pytest.approx(wave.shape_speed)
    near = initial_member(BSpline(24), wave)
    np.testing.assert_allclose(near.angles(T), wave.angles(T), atol=1e-4)
    all_of_it = initial_member(twice, wave).angles(T)
    assert np.ptp(all_of_it / np.sum(twice.functions(T), axis=0)) < 1e-9


def test_a_symmetry_halves_the_parameters_and_starts_of_many_knots_have_three_harmonics():
    assert [BSpline(8, symmetry=s).size(2) for s in SYMMETRIES] == [16, 8, 8]
    assert [Basis(FOUR, symmetry=s).size(2) for s in SYMMETRIES] == [8, 4, 4]
    # cos x - cos(3 x) / 6 keeps within so much
    assert Harmonic(3).bounds(Chain(), 3**0.5 / 2)[1].min() > 1
    assert Basis([np.stack([COS, np.ones(96)])]).size(2) == 1  # a joint may rest in a column
    smooth = [Harmonic(n).sample_dimension(2) for n in (2, 3, 3)]
    assert [BSpline(knots).sample_dimension(2) for knots in (5, 12, 64)] == smooth


def test_statements_read_back_as_what_they_were():
    for gait_class in CLASSES:
        gait = member(gait_class)
        assert part_from(KINDS, fields(gait_class)) == gait_class
        again = type(type(gait_class).__name__, (type(gait_class),), {})  # of two the last defined
        assert type(part_from([*KINDS, again], fields(gait_class))) is again
        read = gait_from(fields(gait))
        assert read.basis == gait.basis
        np.testing.assert_array_equal(read.table, gait.table)


@pytest.mark.slow
def test_columns_that_are_one_harmonic_have_its_optimum():
    own = colloc.solve(Problem("columns", gait=Basis(ELLIPSES, "bilateral")), starts=2)
    known = colloc.solve(Problem("harmonic", gait=Harmonic(1, "bilateral")), starts=2)
    assert own.status == known.status == "solved"
    assert own.value == pytest.approx(known.value, rel=1e-6)


def test_four_primitives_are_solved_kept_read_and_played(tmp_path):
    problem, path = Problem("four", gait=Basis(FOUR, "antipodal")), tmp_path / "four.h5"
    found = colloc.solve(problem, starts=4, output=path)  # every stage is written as it appears
    assert found.status == "solved"
    read = colloc.load(path)
    assert (read.problem.hash, read.value) == (found.problem.hash, found.value)
    np.testing.assert_array_equal(read.gait.angles(T), found.gait.angles(T))
    with h5py.File(path, "a") as file:  # as parameters were kept that meant others elsewhere
        file["answer/x"][found.answer.layout.decisions] *= -1
    np.testing.assert_allclose(colloc.load(path).gait.angles(T), found.gait.angles(T), atol=1e-9)
    played = colloc.evaluate(Problem("played"), found.gait)  # fitted anew, by a Fourier series
    assert played.efficiency == pytest.approx(found.efficiency, rel=1e-4)
    assert fitted_gait(found.gait, 2).largest < 1e-5


@pytest.mark.slow
def test_many_knots_do_as_well_as_the_harmonics_that_they_begin_at():
    """Rounding chooses among several optima, 0.4018 to 0.4069, so they agree to 1 %."""
    waves = colloc.solve(Problem("waves", gait=Harmonic(8, "bilateral")))
    problem = Problem("splines", gait=BSpline(24, symmetry="bilateral"), guess=waves.gait)
    splines = colloc.solve(problem, 1)
    assert splines.status == waves.status == "solved"
    assert splines.value > (1 - 1e-2) * waves.value
    assert splines.value == pytest.approx(waves.value, rel=1e-2)


def test_parameters_of_a_symmetric_spline_are_those_of_the_first_joint_on_any_machine():
    table = BSpline(6, symmetry="bilateral").member(np.arange(6.0), 2).table
    np.testing.assert_allclose(table[0], np.arange(6.0), atol=1e-12)


@pytest.mark.slow
def test_splines_with_inertia_are_certified():
    problem = Problem("paced", gait=BSpline(8, symmetry="antipodal"), froude=1e-3)
    assert colloc.solve(problem, starts=4).status == "solved"


def rough(t):
    return np.abs(np.sin(np.pi * (t - 0.3141))) ** 3


@pytest.mark.parametrize(
    ("column", "least", "most"), [(bump, 1.0, (10, 1.5, 1.2)), (rough, 0.3, (4, 4, 4))]
)
def test_interpolation_states_its_error(column, least, most):
    """Well where steps are small, too large of few samples, to a factor of a rough one."""
    for n, factor in zip((24, 48, 96), most, strict=True):
        basis, t = Basis([column(np.arange(n) / n)]), np.linspace(0, 1, 5001)
        true = np.abs(basis.functions(t)[0] - column(t)).max() / column(t).max()
        assert least < basis.error / true < factor


@pytest.mark.parametrize("unit", [1e-3, 1, 40])
def test_columns_have_the_harmonics_that_hold_all_but_a_millionth_of_their_mean_square_rates(unit):
    wave = lambda size, k: unit * size * np.sin(2 * np.pi * k * PHASES)  # noqa: E731
    for share, harmonics in ((0.8e-6, 3), (1.2e-6, 12)):
        both = wave(1, 3), wave(np.sqrt(share) * 3 / 12, 12)
        assert Basis([both[0] + both[1]]).harmonics == Basis(both).harmonics == harmonics


def test_a_file_of_columns_is_read_with_or_without_its_last_line_and_by_even_steps_only(tmp_path):
    """The last line repeats the first where every column is back to a tenth of a step."""
    t, path = np.linspace(0, 3, 97), tmp_path / "columns.csv"
    columns = np.column_stack([bump(t / 3 - late) for late in (0.0, 0.25, -0.5 / 96)])
    again, known = columns.copy(), Basis(list(columns[:-1].T)).functions(T)
    again[-1] += 0.08 * np.abs(np.diff(columns, axis=0)).max(axis=1).mean()

    def read(times, columns):
        rows = np.column_stack([times, columns])
        np.savetxt(path, rows, delimiter=",", header="time,one,two,three", comments="")
        return Basis(str(path)).functions(T)

    for kept in (columns, columns[:-1], again):
        np.testing.assert_allclose(read(t[: len(kept)], kept), known, rtol=0, atol=1e-12)
    for times in (-t, 0 * t, np.where(t == 3, 3.01, t), 0.01 * np.where(t == 3, 3.01, t)):
        with pytest.raises(colloc.ProblemError, match="must rise by even steps"):
            read(times, columns)


def random_gait(seed, n_joint=3, harmonics=3):
    rng = np.random.default_rng(seed)
    return Fourier(rng.normal(size=n_joint), *rng.normal(size=(2, n_joint, harmonics)))


@pytest.mark.parametrize("symmetry", ["none", "bilateral", "antipodal"])
@pytest.mark.parametrize("n_joint", [1, 2, 3, 4])
@pytest.mark.parametrize("harmonics", [1, 2, 3, 4])
def test_members_have_the_symmetry_and_last_harmonic_of_their_class(harmonics, n_joint, symmetry):
    gait_class = harmonics_within(harmonics, symmetry)
    p = np.random.default_rng(2).normal(size=gait_class.size(n_joint))
    gait = gait_class.member(p, n_joint)
    if symmetry == "bilateral":
        np.testing.assert_allclose(gait.angles(-T), -gait.angles(T)[::-1], atol=1e-12)
    elif symmetry == "antipodal":
        np.testing.assert_allclose(gait.angles(T + 0.5), -gait.angles(T), atol=1e-12)
    else:
        assert gait.sin[0, 0] == 0
    assert np.hypot(gait.cos[:, -1], gait.sin[:, -1]).max() > 0.01
    if symmetry == "bilateral" or gait.cos[0, 0] > 0:  # else it is told from half a period later
        np.testing.assert_allclose(gait_class.parameters(gait), p, atol=1e-12)


def test_rates_are_the_derivative_and_the_free_start_phase_is_removed_without_changing_the_path():
    gait, h = random_gait(4, 2, 2), 1e-6
    slope = (gait.angles(T + h) - gait.angles(T - h)) / (2 * h)
    np.testing.assert_allclose(slope, gait.rates(T), rtol=1e-6, atol=1e-6)
    member = Harmonic(2, "none").member(Harmonic(2, "none").parameters(gait), 2)
    phase = np.arctan2(gait.sin[0, 0], gait.cos[0, 0]) / (2 * np.pi)
    np.testing.assert_allclose(member.angles(T), gait.angles(T + phase), atol=1e-12)
    np.testing.assert_allclose(shift_phase(gait, 0.3).angles(T), gait.angles(T + 0.3), atol=1e-12)


FIVE = Chain((0.2,) * 5)
SNAKE = colloc.Friction(mu_t=10, mu_f=1, mu_b=1)


@pytest.mark.parametrize(
    "gait_class", [Serpenoid(2), Serpenoid(2, "bilateral"), Serpenoid(3, "antipodal")], ids=str
)
def test_joints_follow_one_another_by_a_lag_and_a_member_has_its_parameters(gait_class):
    problem, t = Problem("s", body=FIVE, friction=SNAKE, gait=gait_class), np.linspace(0, 1, 7)
    space, v = space_near(problem, Problem("g", body=FIVE).guess)
    v = v + 0.05 * np.random.default_rng(1).standard_normal(v.size)
    gait = space.member(v)
    angles, earlier = gait.angles(t), gait.angles(t - gait.lag / (2 * np.pi))
    np.testing.assert_allclose(angles[1:], earlier[:-1], atol=1e-13)
    images = {"bilateral": -gait.angles(-t)[::-1], "antipodal": -gait.angles(t + 0.5)}
    np.testing.assert_allclose(images.get(gait_class.symmetry, angles), angles, atol=1e-13)
    words = f"({5 * abs(gait.lag) / (2 * np.pi):.3f} waves along the body, towards the "
    assert words + ("head" if gait.lag > 0 else "tail") in gait.lines()[0]  # who does it later
    np.testing.assert_allclose(gait_class.parameters(gait), v, atol=1e-14)
    told = Fourier(gait.mean, gait.cos, gait.sin)  # which does not know its lag
    np.testing.assert_allclose(gait_class.parameters(told), v, atol=1e-6)
    later = gait_class.is_synchronous(shift_phase(told, 0.1))
    assert (gait_class.is_synchronous(gait), later) == (True, gait_class.symmetry == "bilateral")


def test_a_solved_one_is_certified_kept_and_no_better_than_all_harmonics(tmp_path):
    problem = Problem("snake", body=FIVE, friction=SNAKE, gait=Serpenoid(symmetry="antipodal"))
    found = solve(problem, starts=1)
    assert found.success
    whole = solve(problem.with_(gait=Harmonic(1, "antipodal"), guess=found.gait), starts=1)
    assert found.efficiency < whole.efficiency
    read = load(save(found, tmp_path / "snake.h5"))
    assert read.problem.gait == problem.gait
    assert read.gait.lag == found.gait.lag
    assert "waves along the body" in str(read.gait)
