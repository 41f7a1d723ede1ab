"""A sweep of smooth bodies, as a user writes it."""

import json

import pytest

from colloc.commands.sweep import main
from colloc.studies.store import load_study

STUDY = """
from colloc import Axis, Friction, Harmonic, ModalBody, Problem, Study

def problem(mu_t):
    body, gait = ModalBody(2, panels=4), Harmonic(1, "antipodal")
    return Problem("modes", body=body, friction=Friction(mu_t, 1, 1), gait=gait, delta=0.02, intervals=8)

STUDY = Study("modes", (Axis("mu_t", (100.0, 50.0)),), problem, cold_starts=0, warm_starts=1)
"""


@pytest.mark.slow
def test_gaits_of_modes_travel_between_neighbours_and_are_kept(tmp_path, capsys):
    (tmp_path / "study.py").write_text(STUDY)
    assert main([str(tmp_path / "study.py"), "--output", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["counts"] == {"solved": 2}
    best = load_study(tmp_path / "modes.nc").variables["efficiency"]
    assert float(best[0]) > float(best[1]) > 0.3  # more friction sideways helps
