"""Other tools get the same physics from the benchmarks, and references are right; each module of scripts/
and benchmarks/ imports without doing anything, and explains itself."""

import ast
import importlib
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import published, zoo
from benchmarks.peer_table import OPTIMA, judged
from benchmarks.peers import drag, physics
from benchmarks.peers.starts import feasible_motion, starts
from colloc import Chain, Friction, ellipse, evaluate, replay
from colloc.mechanics.balance import instant, net_force, total_power
from scripts.models.ellipses import admissible


@pytest.mark.parametrize("delta", [1e-1, 1e-4])
def test_other_tools_are_given_the_same_physics(delta):
    rng = np.random.default_rng(1)
    for _ in range(5):
        (own, z), t, theta = rng.normal(size=(2, 3)), rng.uniform(0, np.pi), rng.normal()
        balance, rates = physics.balance_and_rates(np, t, theta, z, own, delta)
        angles, speeds = ellipse(*own)(np.array([t / (2 * np.pi)]))
        now = instant(Chain(), Friction(), angles, speeds / (2 * np.pi), z[:, None], delta)
        np.testing.assert_allclose(balance, net_force(now.posture, now.force)[:, 0], atol=3e-6)
        assert rates[2] == pytest.approx(total_power(now.velocity, now.force).item(), rel=1e-5)
        forces = physics.link_forces(t, z, own, delta)
        lifted, same_rates = physics.balance_and_rates(np, t, theta, z, own, delta, forces)
        np.testing.assert_allclose(lifted, [*balance, *np.zeros(9)], atol=1e-12)
        np.testing.assert_allclose(same_rates, rates)


def test_starts_are_admissible_and_their_motion_is_in_balance():
    own = starts(20)
    assert admissible(Chain(), own.T).all()
    phases = np.linspace(0, np.pi, 9)
    states, z = feasible_motion(own[0], 0.01, phases)
    for k in range(0, 9, 2):
        balance, _ = physics.balance_and_rates(np, phases[k], states[0, k], z[:, k], own[0], 0.01)
        assert np.abs(balance).max() < 1e-3
    whole = replay(Chain(), Friction(), ellipse(*own[0]), 0.01 * 2 * np.pi)
    assert states[1, -1] / states[2, -1] == pytest.approx(whole.efficiency, rel=1e-4)


def test_a_run_is_judged_by_the_replay_of_its_gait():
    good = {"gait": [0.0, 2.859, 1.302], "efficiency": OPTIMA[0] * 1.01}
    found, claim, short = judged(good)
    assert found
    assert claim == pytest.approx(0.01, abs=1e-4)
    assert abs(short) < 1e-5
    assert not judged({"gait": [0.0, 1.0, 1.0], "efficiency": 0.26})[0]
    assert not judged({"gait": [0.0, 3.5, 1.0], "efficiency": 0.26})[0]
    assert not judged({"failed_at": 0.1, "message": "restoration failed"})[0]


def test_rows_about_published_results_judge_by_the_published_digits():
    assert published.number("", "", 0.259, 0.2600, 1.5e-3).holds
    differs = published.number("", "", 0.094, 0.1000, 1.5e-3, "why")
    assert differs.cells[-1] == "+0.006; why; **differs**"
    assert published.scallop().holds
    assert published.small_stroke().holds
    assert published.small_wave().holds


@pytest.mark.slow
def test_purcells_swimmers_have_the_link_ratio_and_the_wave_of_the_papers():
    """A gain of roughly 60 %; a wave of the shortest possible length, three links: 120 degrees."""
    assert published.link_ratio().holds
    assert published.wave_of_bending(8).holds


def test_the_swimmer_written_apart_has_the_small_strokes_of_a_closed_form():
    assert drag.displacement_per_area() == pytest.approx(5 / 243, rel=1e-6)
    # the connection does not depend on the heading, nor on the unit of drag
    one, turned = (drag.resistance(heading, np.array([0.4, -0.9])) for heading in (0.0, 1.1))
    np.testing.assert_allclose(np.linalg.eigvalsh(one), np.linalg.eigvalsh(turned), atol=1e-15)


def test_the_numbers_of_the_zoo_keep_their_problems_and_all_families_are_stated():
    lengths = "0.1712, 0.1186, 0.2235, 0.1596, 0.3273"
    paths = "periodic B-splines of degree 4, 24 knots, symmetry none, within 3.14"
    body = f"links of lengths {lengths} from the tail [body lengths]"
    assert zoo.described(zoo.zoo_problem(99)) == f"{body}, friction (5.95461, 1, 1) {paths}"
    kinds = {type(zoo.law_problem(k).friction).__name__ for k in range(10)}
    assert kinds == {"Elliptic", "Viscous", "PowerLaw", "OwnLaw", "Friction"}
    assert zoo.law_problem(7).hash == zoo.law_problem(7).hash != zoo.law_problem(2).hash
    assert zoo.described(zoo.modal_problem(0)).startswith("smooth, 2 legendre modes")
    assert {zoo.modal_problem(k).body.modes for k in range(20)} == {2, 3, 4, 5, 6}


def test_ten_robots_have_all_numbers_of_links_and_those_of_few_stand_on_all_floors():
    robots = [zoo.robot_problem(k) for k in range(10)]
    assert {robot.body.n_link for robot in robots} == {*range(3, 13)}
    few = [robot.body.feet for robot in robots if robot.body.n_link < 7]
    rolls = [{foot.friction is not None for foot in feet} for feet in few]
    assert all(each in rolls for each in (set(), {False}, {True}, {False, True}))


@pytest.mark.slow
def test_the_best_serpenoid_of_a_robot_is_a_wave_within_its_limits_that_is_worth_as_much_replayed():
    robot = zoo.robot_problem(44)
    wave = zoo.best_serpenoid(robot)
    assert wave.violation < 1e-3
    assert np.abs(wave.gait.angles(np.arange(100) / 100)).max() <= np.min(robot.joint_limit)
    phases = np.unwrap(np.angle(wave.gait.cos - 1j * wave.gait.sin)[:, 0])
    np.testing.assert_allclose(np.diff(phases, 2), 0.0, atol=1e-9)
    assert evaluate(robot, wave.gait).value == pytest.approx(wave.value, rel=1e-2)


ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("scripts", "scripts/paper", "scripts/models", "benchmarks")
MODULES = sorted(
    path for folder in FOLDERS for path in (ROOT / folder).glob("*.py") if path.stat().st_size
)
OPTIONAL = {"docs_site": "mkdocs", "play_in_mujoco": "mujoco"}
"""Modules that need more than the tests do."""
EXAMPLES = ("continue_delta", "continue_epsilon")
"""A dozen lines without a function, to be read."""


def needed(path):
    if path.stem in OPTIONAL:
        pytest.importorskip(OPTIONAL[path.stem])


def name_of(path):
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_importing_a_module_does_nothing_else(path, tmp_path, monkeypatch, capfd):
    needed(path)
    monkeypatch.chdir(tmp_path)
    # a fresh run of the file, whoever imported the module before
    runpy.run_path(str(path), run_name="imported")
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())


def starts_itself(path):
    """Whether a module does something when it is run."""
    last = ast.parse(path.read_text(encoding="utf-8")).body[-1:]
    return bool(last) and isinstance(last[0], ast.If) and "__main__" in ast.unparse(last[0].test)


PROGRAMS = [path for path in MODULES if starts_itself(path) and path.stem not in EXAMPLES]


@pytest.mark.parametrize("path", PROGRAMS, ids=name_of)
@pytest.mark.parametrize(("option", "code"), [("--help", 0), ("--no-such-option", 2)])
def test_a_program_answers_help_and_refuses_others(
    path, option, code, tmp_path, monkeypatch, capfd
):
    needed(path)
    module = importlib.import_module(name_of(path))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(path), option])
    with pytest.raises(SystemExit) as ended:
        module.main()
    assert ended.value.code == code
    assert not list(tmp_path.iterdir())
    said = capfd.readouterr()
    assert (said.err if code else said.out).startswith("usage:")
    if not code:
        assert len(said.out.split()) > 10, "says nothing but its usage"
        assert said.err == ""
