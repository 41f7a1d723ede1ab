"""Commands that solve several problems one after another: what an interrupted one has solved, the
same command does not solve again."""

from functools import wraps

import pytest

from colloc.commands.main import main
from colloc.search.checkpoint import Run

FILE = """
from colloc import *
FLOOR = Friction(mu_t=4, mu_f=1, mu_b=1)
PROBLEM = Problem("p", gait=Harmonic(1, "bilateral"), friction=FLOOR, delta=1e-2, mesh_tolerance=1e-3)
"""
COMMANDS = {"steer": ["--turn", "10"], "pareto": ["--points", "2"]}


@pytest.mark.parametrize("name", COMMANDS)
def test_an_interrupted_command_goes_on_from_its_last_problem(name, tmp_path, monkeypatch, capsys):
    (tmp_path / "p.py").write_text(FILE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    command = [name, "p.py", *COMMANDS[name], "--starts", "1", "--no-figure", "--quiet"]
    kept, computed, interruptions = Run.result, [], []

    def interrupted_at_the_second(run, stage, arguments):
        @wraps(stage)
        def counted(*arguments):
            computed.append(run.problem.hash)
            if computed[0] != computed[-1] and not interruptions:
                interruptions.append("once")
                raise KeyboardInterrupt
            return stage(*arguments)

        return kept(run, counted, arguments)

    monkeypatch.setattr(Run, "result", interrupted_at_the_second)
    assert main(command) == 130
    assert "the same command goes on" in capsys.readouterr().err
    second = computed[-1]
    computed.clear()
    assert main(command) == 0
    assert set(computed) == {second}
    assert not list(tmp_path.glob("**/*.sqlite"))
