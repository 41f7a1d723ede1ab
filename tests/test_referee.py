"""The table of known gaits is what a replay finds, and only what is better gets in."""

import json
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from threading import Barrier, BrokenBarrierError

import pytest

import colloc
from benchmarks.known import known, markdown, row_of, save_known, with_row
from benchmarks.referee import main
from colloc import ProblemError, StoreError
from colloc.commands.main import main as colloc_main

ROWS = known()
PAGE = Path(__file__).parents[1] / "docs" / "known.md"
QUICK = ("three_link", "two_link", "three_link_fast")
CASES = [
    pytest.param(row, id=name, marks=[pytest.mark.slow] * (name not in QUICK))
    for row in ROWS
    if (name := row.statement["name"])
]
PROBLEM = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)


@pytest.fixture(scope="module")
def best():
    return colloc.solve(PROBLEM, starts=1)


@pytest.mark.parametrize("row", CASES)
def test_a_row_comes_out_of_its_own_replay(row):
    assert row.complaint(row.certificate()) == ""


def test_no_two_rows_answer_one_question_and_the_page_shows_them_all():
    names = {row.statement["name"] for row in ROWS}
    assert len({row.question for row in ROWS}) == len(ROWS) == len(names)
    assert markdown(ROWS) in PAGE.read_text(encoding="utf-8")


def test_a_value_that_the_gait_does_not_have_is_seen(best):
    row = row_of(best, "colloc solve quick.py")
    false = replace(row, value=row.value * (1 + 1e-4))
    assert "the table says" in false.complaint(false.certificate())
    with pytest.raises(ProblemError, match="not accepted: the table says"):
        with_row([], false)


def test_a_gait_that_breaks_a_limit_is_not_accepted(best):
    row = row_of(best, "colloc solve quick.py")
    false = replace(row, statement={**row.statement, "joint_limit": 1.0})
    with pytest.raises(ProblemError, match="beyond the limit 1"):
        with_row([], false)
    least = [[colloc.Objective("distance").fields(), 1.0]]
    false = replace(row, statement={**row.statement, "at_least": least})
    with pytest.raises(ProblemError, match="fails on"):
        with_row([], false)


@pytest.mark.slow
def test_only_what_is_better_takes_the_place_of_a_rival(best):
    good = row_of(best, "colloc solve quick.py")
    wide = PROBLEM.with_(gait=colloc.Harmonic(2, "bilateral"), guess=best.gait)
    poor = row_of(colloc.solve(PROBLEM.with_(joint_limit=2.0), starts=1), "by hand")
    poor = replace(poor, statement=good.statement)  # an answer to the same question
    assert poor.value < good.value - 1e-3
    assert with_row([poor], good) == (good,)
    with pytest.raises(ProblemError, match="is known already"):
        with_row([good], poor)
    with pytest.raises(ProblemError, match="is known already"):
        with_row([good], good)
    other = row_of(colloc.solve(wide, starts=1), "colloc solve wide.py")
    assert with_row([good], other) == (good, other)  # another class is another question


def test_the_referee_takes_a_result_and_holds_it(best, tmp_path, capsys):
    table, result = tmp_path / "known.json", tmp_path / "quick.h5"
    save_known([], table)
    colloc.save(best, result)
    arguments = ["--table", str(table)]
    assert main([*arguments, "--add", str(result), "--by", "colloc solve quick.py"]) == 0
    assert main(arguments) == 0
    assert "1 of 1 rows hold" in capsys.readouterr().out
    assert main([*arguments, "--only", "other"]) == 2
    assert main([*arguments, "--add", str(result)]) == 2
    false = replace(known(table)[0], value=0.27)
    save_known([false], table)
    assert main(arguments) == 4
    table.write_text("[{}]")
    with pytest.raises(StoreError, match="no table of known gaits"):
        known(table)
    with pytest.raises(StoreError, match="cannot read"):
        known(tmp_path / "none.json")


@pytest.mark.slow
def test_without_a_table_the_referee_begins_a_copy_where_it_is_called(best, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    colloc.save(best, "quick.h5")
    arguments = ["--add", "quick.h5", "--by", "colloc solve quick.py"]
    assert main(arguments) == 0
    assert main([*arguments, "--table", "mine.json"]) == 0
    assert known() == ROWS
    assert known("known.json") == known("mine.json")
    assert known("known.json")[:-1] == ROWS
    assert known("known.json")[-1].statement["name"] == "quick"
    assert main(arguments) == 2  # it goes on from the table that is there


def test_two_that_are_taken_in_at_once_are_both_there(best, tmp_path, monkeypatch):
    both, save, table = Barrier(2, timeout=0.5), save_known, tmp_path / "known.json"
    save([], table)

    def after_both_have_read(rows, path):
        with suppress(BrokenBarrierError):  # one waits for the other to end
            both.wait()
        save(rows, path)

    def take_in(solution):
        result = colloc.save(solution, tmp_path / f"{solution.problem.name}.h5")
        return main(["--table", str(table), "--add", str(result), "--by", "colloc solve quick.py"])

    monkeypatch.setattr("benchmarks.referee.save_known", after_both_have_read)
    law = colloc.Friction(mu_t=2, mu_f=1, mu_b=1)
    other = colloc.solve(PROBLEM.with_(name="other", friction=law), starts=1)
    with ThreadPoolExecutor(2) as threads:
        assert list(threads.map(take_in, [best, other])) == [0, 0]
    assert {row.statement["name"] for row in known(table)} == {"quick", "other"}


@pytest.mark.slow
def test_bounds_under_dry_friction_are_saved_and_checked_again(best, tmp_path, capsys):
    result, table = tmp_path / "quick.h5", tmp_path / "known.json"
    solution = colloc.load(colloc.save(best, result))
    assert solution.certificate.dry is None
    solution.certify_dry()
    colloc.save(solution, result)
    again = colloc.load(result).certificate
    assert again == solution.certificate
    assert again.dry[0] < again.efficiency_at_zero_delta + again.error_at_zero_delta
    assert again.dry[1] > again.efficiency_at_zero_delta - again.error_at_zero_delta
    row = row_of(solution, "colloc solve quick.py --dry")
    save_known([row], table)
    assert main(["--table", str(table), "--dry"]) == 0
    save_known([replace(row, dry=(row.dry[0], row.dry[1] - 1e-4))], table)
    assert main(["--table", str(table), "--dry"]) == 4
    assert colloc_main(["verify", str(result)]) == 0
    solution.certificate = replace(solution.certificate, dry=(0.1, 0.2))
    colloc.save(solution, result)
    assert colloc_main(["verify", str(result)]) == 4
    assert "under dry friction, which is not what is found" in capsys.readouterr().out


BROKEN = [{"parameters": each} for each in ([], [None] * 3, [float("nan")] * 3)]
BROKEN += [{"value": {}}, {"dry": [[]]}, {"statement": {}}]


@pytest.mark.parametrize("broken", BROKEN, ids=str)
def test_a_table_with_a_row_that_is_none_is_refused_in_a_sentence(broken, tmp_path, capsys):
    row = next(row for row in ROWS if row.statement["name"] == "three_link")
    (tmp_path / "mine.json").write_text(json.dumps([asdict(row) | broken]))
    assert main(["--table", str(tmp_path / "mine.json")]) == 2
    assert "is no table of known gaits" in capsys.readouterr().err
