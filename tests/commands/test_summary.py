"""What a solve ends with: a few lines that a person reads, and numbers that mean the same as everywhere else."""

import json
import re
from dataclasses import replace

import pytest

from colloc.commands.main import main as colloc
from colloc.commands.summary import summary_dict, summary_lines
from colloc.results.checks import Check
from colloc.results.store import load

QUICK = """
from colloc import *
PROBLEM = Problem("quick", ellipse(0.0, 1.4, 0.8), gait=Harmonic(1, "bilateral"), delta=1e-2, delta_start=1e-2, intervals=12)
"""


def test_a_result_is_told_in_three_lines_and_its_checks_in_one(three_link):
    lines = summary_lines(three_link, None)
    assert len(lines) == 4
    assert lines[0].startswith("three_link: solved in ")
    assert "best of 8 starts" in lines[0]
    checks = three_link.certificate.checks
    nearest = max(checks, key=lambda check: abs(check.value) / check.threshold)
    how_near = f"{nearest.name}, {abs(nearest.value):.1e} where {nearest.threshold:.0e} is allowed"
    assert lines[3] == f"  {len(checks)} checks hold (largest: {how_near})"


def test_what_fails_is_told_in_full_and_what_holds_is_counted(three_link):
    bad = [Check("closure", 2e-3, 1e-9, "joint angles after one period"), Check("second order", 0.3, 1e-2, "a saddle")]
    good = [check for check in three_link.certificate.checks if check.name not in ("closure", "second order")]
    failed = replace(three_link, certificate=replace(three_link.certificate, checks=(*good, *bad)))
    lines = summary_lines(failed, None)
    assert f"  {bad[0].line()}" in lines
    assert f"  {bad[1].line()}" in lines
    assert sum(line.startswith("  NO ") for line in lines) == 2
    assert any(line.startswith(f"  {len(good)} checks hold (largest: ") for line in lines)


def test_verbose_tells_every_check_the_search_and_the_gait(three_link):
    lines = summary_lines(three_link, None, verbose=True)
    assert {f"  {check.line()}" for check in three_link.certificate.checks} <= set(lines)
    assert {f"  gait            {line}" for line in three_link.gait.lines()} <= set(lines)
    assert sum(line.startswith("  search ") for line in lines) >= 2
    assert not any("checks hold" in line for line in lines)


def test_the_numbers_of_the_one_object_are_the_certified_ones(three_link, tmp_path):
    """The collocated ones differ from them by more than their errors, so here they are made to differ by much."""
    solution = replace(three_link, answer=replace(three_link.answer, value=9.0, distance=9.0, work=9.0))
    facts = summary_dict(replace(solution, shrunk=solution), tmp_path, None, None)
    for name in ("value", "efficiency", "distance", "work"):
        assert facts[name] == facts["certificate"][name] == getattr(three_link.certificate, name)
    assert facts["shrunk"] == three_link.certificate.value


def test_what_solve_prints_is_what_the_file_and_verify_say(tmp_path, capsys):
    (tmp_path / "quick.py").write_text(QUICK)
    words = ["solve", str(tmp_path / "quick.py"), "--starts", "1", "--no-figure", "--output", f"{tmp_path}/", "--json"]
    assert colloc(words) == 0
    facts = json.loads(capsys.readouterr().out)
    certificate = load(tmp_path / "quick.h5").certificate
    assert [facts[name] for name in ("value", "distance", "work")] == [
        certificate.value,
        certificate.distance,
        certificate.work,
    ]
    assert colloc(words[:-1]) == 0
    printed = capsys.readouterr().out
    assert f"{facts['efficiency']:.6f} +- " in printed
    assert re.search(r"\d+ checks hold \(largest: ", printed)
    assert "cos 2πt" not in printed
    assert colloc([*words[:-1], "--verbose"]) == 0
    assert "cos 2πt" in capsys.readouterr().out
    assert facts["value"] == pytest.approx(facts["certificate"]["efficiency_at_zero_delta"], rel=1e-2)
