"""A sweep of smooth bodies, as a user writes it."""

import json

import pytest
from shared.store_samples import load_study

from colloc.commands.families import sweep as main
from colloc.commands.main import main as colloc_main

STUDY = """
from colloc import Axis, Friction, Harmonic, ModalBody, Problem, Study

def problem(mu_t):
    body, gait = ModalBody(2, panels=4), Harmonic(1, "antipodal")
    return Problem("modes", body=body, friction=Friction(mu_t=mu_t, mu_f=1, mu_b=1), gait=gait, delta=0.02, intervals=8)

STUDY = Study("modes", (Axis("mu_t", (100.0, 50.0)),), problem, cold_starts=0, warm_starts=1)
"""


@pytest.mark.slow
def test_gaits_of_modes_travel_between_neighbours_and_are_kept(tmp_path, capsys):
    (tmp_path / "study.py").write_text(STUDY)
    assert main([str(tmp_path / "study.py"), "--output", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["counts"] == {"solved": 2}
    best = load_study(tmp_path / "modes.nc").variables["efficiency"]
    assert float(best[0]) > float(best[1]) > 0.3  # more friction sideways helps


PRESCRIBED = """
from colloc import Axis, Friction, Problem, Study, Wave

def problem(mu_t):
    return Problem("waves", body=Wave("sine"), friction=Friction(mu_t=mu_t, mu_f=1, mu_b=1), delta=1e-2, mesh_tolerance=1e-3)

PROBLEM = problem(100.0)
STUDY = Study("waves", (Axis("mu_t", (100.0, 50.0)),), problem)
"""


def test_a_sweep_of_prescribed_motions_measures_each_once(tmp_path, capsys):
    """Nothing travels between neighbours and nothing is sampled where nothing is free."""
    (tmp_path / "study.py").write_text(PRESCRIBED)
    assert main([str(tmp_path / "study.py"), "--output", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["counts"] == {"solved": 2}
    study = load_study(tmp_path / "waves.nc").variables
    assert study["efficiency"][0] > study["efficiency"][1] > 0.5
    assert study["starts"].tolist() == [1, 1]


@pytest.mark.parametrize("command", ["multistart", "pareto"])
def test_what_needs_free_gaits_refuses_a_prescribed_motion_in_words(tmp_path, capsys, command):
    (tmp_path / "wave.py").write_text(PRESCRIBED)
    assert colloc_main([command, str(tmp_path / "wave.py"), "--output", f"{tmp_path}/"]) == 2
    assert "prescribed motion" in capsys.readouterr().err
