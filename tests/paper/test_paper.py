"""The paper's models: ellipse gaits, admissible ones, smooth bodies in the lab; static friction: held
links, cases without a kinetic solution, the flap body, the velocity map; and resumable studies with
the table and figures made from them."""

import numpy as np
import pytest

from colloc import Chain, Friction, ProblemError, Wave, ellipse, replay, solve_balance
from colloc.mechanics.contact import crossing_depth
from scripts import reproduce_paper
from scripts.models import ellipses, static_friction
from scripts.models.period import period, snapshots
from scripts.paper import figures, rows
from scripts.paper.study import Context, PaperStudy, Part, source_closure
from scripts.paper.three_link import connection, faces_needed, third_slowest_dips

BODY, ISOTROPIC, DELTA = Chain(), Friction(), 1e-4
T = np.linspace(0, 1, 4001)
BEST = np.array([[0.0], [2.859], [1.3018]])


def test_half_a_period_gives_what_a_replay_of_the_whole_period_gives():
    rng = np.random.default_rng(21)
    A0, angle = rng.uniform(0, 2.6, 4), rng.uniform(0.1, 1.5, 4)
    amplitude = rng.uniform(0.3, 1.0, 4) * ellipses.largest_amplitude(A0, angle)
    gaits = np.stack([A0, amplitude * np.cos(angle), amplitude * np.sin(angle)])
    found = ellipses.performance(DELTA, gaits, instants=1600)
    for i, gait in enumerate(gaits.T):
        exact = replay(BODY, ISOTROPIC, ellipse(*gait), DELTA, tolerance=1e-5)
        # the balance's residual, 1e-11, over its stiffness, of order delta
        assert abs(exact.rotation) < 1e-7
        assert found.distance[i] == pytest.approx(exact.distance, abs=5e-6)
        assert found.work[i] == pytest.approx(exact.work, rel=1e-5)


def test_no_motion_on_the_axes_and_little_on_the_diagonal():
    side = np.linspace(0.2, 1.4, 7)
    zero = np.zeros_like(side)
    assert ellipses.performance(DELTA, np.stack([zero, zero, side])).distance.max() < 1e-6
    assert ellipses.performance(DELTA, np.stack([zero, side, zero])).distance.max() < 1e-6
    diagonal = ellipses.performance(DELTA, np.stack([zero, side, side])).distance.max()
    assert diagonal < 0.05 * ellipses.performance(DELTA, BEST).distance[0]


def test_second_maximum_is_interior_and_matches_the_paper():
    found = ellipses.refined_maximum(DELTA, np.array([1.1, 0.7, 1.1]), instants=200)
    assert found.replay.efficiency == pytest.approx(0.2076, abs=3e-4)
    assert found.gait[0] == pytest.approx(1.11, abs=0.03)
    assert not found.at_contact


def test_first_maximum_is_at_the_limit_of_contact():
    found = ellipses.refined_maximum(DELTA, BEST[:, 0] * 0.97, instants=200)
    assert found.at_contact
    assert found.replay.efficiency == pytest.approx(0.2600, abs=2e-4)
    assert abs(found.gait[0]) < 0.01
    assert np.hypot(*found.gait[1:]) == pytest.approx(np.pi, abs=1e-3)


@pytest.mark.slow
def test_three_printed_maxima_come_out_of_the_sweep():
    grid = ellipses.gait_grid(np.pi / 40)
    efficiency = grid.unflattened(ellipses.performance(DELTA, grid.gaits).efficiency)
    gaits = np.stack(np.meshgrid(grid.A0, grid.A1, grid.B1, indexing="ij"))
    maxima = ellipses.distinct_maxima(DELTA, efficiency, gaits, instants=400)
    found = [(m.replay.efficiency, abs(m.gait[0])) for m in maxima]
    for efficiency, A0 in ((0.2600, 0.0), (0.2076, 1.11), (0.1030, 2.59)):
        assert any(abs(e - efficiency) < 5e-4 and abs(a - A0) < 0.03 for e, a in found)
    first, second = (
        next(m for m in maxima if abs(m.replay.efficiency - e) < 5e-4) for e in (0.2600, 0.2076)
    )
    assert second.replay.distance / first.replay.distance == pytest.approx(0.37, abs=0.012)
    assert second.replay.work / first.replay.work == pytest.approx(0.47, abs=0.012)


def test_admissible_agrees_with_segment_intersection():
    rng = np.random.default_rng(12)
    gaits = rng.uniform(0, 1, (3, 1500)) * np.array([[1.0], [3.0], [2.4]])
    inside = ellipses.admissible(BODY, gaits)
    near = np.abs(ellipses.contact_reach(gaits) - 2 * np.pi) < 2e-2
    for gait in np.flatnonzero(~near):
        angles = ellipses.ellipse_angles(gaits[:, gait : gait + 1], T[::4])[0][:, 0]
        bent = np.abs(angles).max() <= np.pi + 1e-5
        touches = crossing_depth(BODY, angles).max() > 1e-9
        # segments that fold back beyond pi are refused by the limit on the angles, not by crossing
        assert inside[gait] == (bent and not touches) or (not bent and not inside[gait])
    assert 0.2 < inside.mean() < 0.9


def test_largest_amplitude_is_on_the_boundary():
    A0, angle = np.meshgrid([0.0, 0.6, 1.8, 2.9], np.linspace(0.01, 1.55, 9), indexing="ij")
    r = ellipses.largest_amplitude(A0, angle)
    for factor, expected in ((0.999, True), (1.001, False)):
        gaits = np.stack([A0, factor * r * np.cos(angle), factor * r * np.sin(angle)])
        assert (ellipses.admissible(BODY, gaits.reshape(3, -1)) == expected).all()


def test_snapshots_are_inextensible_and_advance_by_the_distance():
    motion, along_easy = Wave().prescribed(), Friction(mu_t=20.0, mu_f=1.0, mu_b=1.0)
    made = snapshots(motion, along_easy, 1e-3, count=2, panels=40)
    steps = np.hypot(np.diff(made.x, axis=0), np.diff(made.y, axis=0))
    np.testing.assert_allclose(steps.sum(axis=0), steps.sum(axis=0)[0], rtol=1e-4)
    # first and last node lie within the body
    assert steps.sum(axis=0)[0] == pytest.approx(1.0, abs=2e-3)
    moved = made.x[:, -1] - made.x[:, 0]
    np.testing.assert_allclose(moved, period(motion, along_easy, 1e-3, intervals=2).d, rtol=1e-4)
    np.testing.assert_allclose(made.y[:, -1], made.y[:, 0], atol=1e-6)


def test_link_speed_is_the_largest_on_the_link():
    rng = np.random.default_rng(31)
    angles, rates, z = rng.normal(size=(2, 30)), rng.normal(size=(2, 30)), rng.normal(size=(3, 30))
    velocity = BODY.velocity(BODY.posture(angles), rates, z)
    sigma = np.linspace(-1 / 6, 1 / 6, 101)[:, None, None]
    sampled = np.hypot(velocity.vs, velocity.vn + sigma * velocity.w).max(axis=0)
    np.testing.assert_allclose(static_friction.link_speeds(BODY, velocity), sampled, rtol=1e-12)


@pytest.mark.parametrize("case", static_friction.WORKED_CASES, ids=lambda c: c.name)
def test_held_links_creep_at_order_delta_and_bear_part_of_the_friction(case):
    held = static_friction.held_link(case)
    ratio = held.speed / held.delta
    assert ratio[-1] < 10
    assert ratio[-1] == pytest.approx(ratio[-2], rel=1e-3)
    assert 0 < held.density[-1] < 0.999
    assert held.density[-1] == pytest.approx(held.density[-2], abs=1e-5)


@pytest.mark.parametrize("case", static_friction.SYMMETRIC_CASES, ids=lambda c: c.name)
def test_symmetric_cases_have_no_kinetic_solution(case):
    """The unbalanced force falls with the velocity, and jumps over zero at rest."""
    gap = static_friction.kinetic_gap(case)
    assert gap.no_solution
    V = np.concatenate([-np.geomspace(1, 1e-8, 60), np.geomspace(1e-8, 1, 60)])
    unbalanced = static_friction.symmetric_balance(case, V, 1e-15)
    assert (np.diff(unbalanced) <= 1e-9).all()
    assert np.abs(unbalanced).min() > 0.9 * min(gap.below, -gap.above)


@pytest.mark.parametrize("case", static_friction.SYMMETRIC_CASES, ids=lambda c: c.name)
def test_delta_supplies_the_missing_part(case):
    """The solver, which knows no symmetry, finds the root of the one-velocity balance."""
    gap = static_friction.kinetic_gap(case)
    held = static_friction.held_link(case)
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
        speed, link = static_friction.slowest_link(a, r, 1e-4)
        return bool(speed[0] < 1e-3), int(link[0])

    assert held((1.6, 1.5), (1.0, 0.9)) == (True, 1)  # C: middle link, both angles near pi/2
    assert held((2.5, 0.2), (1.0, 0.0)) == (True, 2)  # D: joint 2 rests, joint 1 bent beyond pi/2
    assert held((-2.0, 1.0), (1.0, 0.0))[0]
    assert held((3.0, -3.0), (1.0, -0.7)) == (True, 1)  # F: near pi and -pi
    assert not held((0.3, 0.4), (1.0, 0.3))[0]
    assert not held((0.3, 0.4), (1.0, 0.0))[0]


class TestFlapBody:
    body = static_friction.FlapBody()

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
            assert static_friction.flap_gap(self.body, opening).no_solution
            force = static_friction.axial_force(self.body, opening, V, 1e-16)
            assert (np.diff(force) <= 1e-10).all()
            flaps = static_friction.flap_gap(self.body, opening).at_rest
            assert np.abs(force).min() == pytest.approx(abs(flaps), rel=1e-6)
            assert 0 < flaps < 0.2  # shorter than the body, which is 0.8 long

    def test_delta_gives_the_limit_law(self):
        opening = np.linspace(0.1, 1.5, 7)
        fraction = np.array([static_friction.flap_gap(self.body, o).fraction for o in opening])
        angles, rates = static_friction.flap_motion(opening)
        errors = []
        for delta in (1e-4, 1e-5):
            z = solve_balance(self.body, ISOTROPIC, angles, rates, delta).require().z
            assert np.abs(z[1:]).max() < 1e-12  # along the body only, though nothing imposes it
            errors.append(np.abs(z[0] / delta - fraction / np.sqrt(1 - fraction**2)).max())
        assert errors[1] < 1e-4
        assert errors[0] / errors[1] > 5


COARSE = 1e-3


def test_its_nodes_are_balanced_velocities_at_unit_larger_rate_and_those_of_reversed_rates_mirror():
    made = connection(Context({"delta": COARSE, "angles": 8, "ratios": 5}, {}, 1))
    rng, (n, m) = np.random.default_rng(3), (8, 5)
    i, j, k, face = (rng.integers(size, size=60) for size in (n, n, m, 2))
    angles = np.stack([made["angles"][i], made["angles"][j]])
    rates = np.where(np.arange(2)[:, None] == face, 1.0, made["ratios"][k])
    stored = np.stack([made["z"][face, row, i, j, k] for row in range(3)])
    for scale in (1.0, -7.3):
        direct = solve_balance(Chain(), Friction(), angles, scale * rates, abs(scale) * COARSE).z
        np.testing.assert_allclose(scale * stored, direct, atol=1e-9)


def test_two_more_faces_are_needed_where_friction_backwards_is_another():
    small = connection(Context({"delta": COARSE, "angles": 2, "ratios": 2}, {}, 1))
    assert small["anisotropic_faces"] == 4
    assert faces_needed(Friction(mu_t=1.7), COARSE) == 2


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


def _square(context: Context) -> dict:
    return {"y": np.array(context.settings["x"]) ** 2}


def _sum(context: Context) -> dict:
    return {"total": context.needed["square"]["y"].sum()}


def _study(folder, x=(1.0, 2.0), quick=False) -> PaperStudy:
    parts = [
        Part("square", _square, settings={"x": list(x)}, quick={"x": [1.0]}),
        Part("sum", _sum, needs=("square",)),
    ]
    return PaperStudy(parts, folder, quick=quick)


def test_parts_are_finished_until_their_inputs_change(tmp_path):
    study = _study(tmp_path)
    assert study.select(["sum"]) == ["square", "sum"]
    for name in study.select(["sum"]):
        assert not study.finished(name)
        study.compute(name, 1)
    assert study.arrays("sum")["total"] == 5.0
    assert all(_study(tmp_path).finished(name) for name in ("square", "sum"))
    changed = _study(tmp_path, x=(3.0,))
    assert not changed.finished("square")
    assert not changed.finished("sum")  # through what it needs
    assert not _study(tmp_path, quick=True).finished("square")
    with pytest.raises(ProblemError, match="no part 'cube'"):
        study.select(["cube"])


def test_source_closure_follows_imports():
    found = source_closure("scripts.paper.three_link")
    assert {"colloc.mechanics.fixed_point", "scripts.models.ellipses"} <= found.keys()
    assert not {"scripts.paper.figures", "scripts.paper.study"} & found.keys()


def test_verdicts():
    assert rows.number("x", "0.259", 0.2594, 0.0, "exact").verdict == "agrees"
    assert rows.number("x", "0.259", 0.2600, 1e-5, "exact").verdict == "printed value -0.4 %"
    assert rows.number("x", "0.259", 0.2600, 6e-4, "rough").verdict == "agrees"
    assert rows.statement("x", "small", "2", holds=False).verdict == "does not hold"


def test_dips_of_the_third_slowest_end():
    t = np.linspace(0, 1, 1001)
    moving = np.ones_like(t)
    speeds = np.stack([np.abs(t - 0.3), 2 * np.abs(t - 0.3), 0.01 + np.abs(t - 0.3), moving])
    when, speed = third_slowest_dips(t, speeds)
    assert when[0] == pytest.approx(0.3, abs=0.02)
    assert speed[0] <= 0.02


@pytest.mark.slow
def test_command_line_computes_resumes_and_draws(tmp_path, capsys):
    arguments = ["--quick", "--only", "instant", "flap", "--processes", "1"]
    arguments += ["--output", str(tmp_path)]
    assert reproduce_paper.main(arguments) == 0
    assert "flap: computing" in capsys.readouterr().out
    assert reproduce_paper.main(arguments) == 0
    assert "flap: finished before" in capsys.readouterr().out
    text = (tmp_path / "paper-quick.md").read_text()
    assert "figure 4: flap body" in text
    assert "no solution" in text
    assert "does not hold" not in text
    assert "`sweep`" in text.split("Not computed yet")[1]
    drawn = sorted(p.name for p in (tmp_path / "paper-quick").glob("*.p*"))
    assert [n for n in drawn if n.endswith(".png")] == [
        "figure-03-velocity-and-force.png",
        "figure-04-flap-body.png",
    ]
    assert len(drawn) == 4
    assert reproduce_paper.main(["--only", "nothing", "--output", str(tmp_path)]) == 1
    assert "there is no part 'nothing'" in capsys.readouterr().err


def test_every_part_has_rows_or_a_figure_and_these_their_parts():
    parts = set(reproduce_paper.study(reproduce_paper.Path("results"), quick=True).parts)
    assert parts == {name for _, needs in (*rows._ROWS.items(), *figures.FIGURES) for name in needs}
