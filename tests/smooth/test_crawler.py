"""Crawlers with one travelling bump: the paper's is one of them, balance and slopes hold, and
optimising helps."""

import runpy

import numpy as np
import pytest

from colloc.commands.main import main as colloc_main
from colloc.gaits.bspline import Corners, Polygon
from colloc.gaits.problem import Problem
from colloc.mechanics.fixed_point import motion_and_derivatives
from colloc.mechanics.friction import Friction
from colloc.reduced.program import ReducedProgram
from colloc.results.solution import Solution
from colloc.results.store import load, save
from colloc.search.confirm import answer_of_iterate
from colloc.search.iterate import evaluate_at, space_near
from colloc.search.optimise import optimise
from colloc.search.options import COARSE
from colloc.search.solve import solve
from colloc.smooth.crawler_body import LAP, CrawlerBody
from colloc.smooth.prescribed_body import Concertina
from colloc.system.errors import ProblemError

BODY = CrawlerBody(0.05, panels=16)


def shapes(n, seed=5):
    rng = np.random.default_rng(seed)
    q = np.stack([rng.uniform(-LAP, LAP, n), *rng.normal(scale=0.4, size=(BODY.modes, n))])
    return q, rng.normal(size=q.shape)


def differences(function, at, h=1e-6):
    unit = np.eye(len(at))[:, :, None]
    return np.stack([(function(at + h * e) - function(at - h * e)) / (2 * h) for e in unit], axis=1)


def test_the_paper_s_crawler_is_one_of_them():
    crawler, corners = Concertina(epsilon=0.05, amplitude=1.3), BODY.concertina(1.3, sides=6)
    s = np.linspace(0.4, 0.6, 201)[:, None] * np.ones((1, 3))
    phases = np.array([1 / 12, 1 / 6, 1 / 3])  # half grown, grown, at the front
    shown = np.array([[p, 0.0, a, 0.0, 0.0] for p, a in ((LAP, 0.65), (LAP, 1.3), (0.0, 1.3))]).T
    assert {tuple(shape) for shape in shown.T} <= {tuple(vertex) for vertex in corners.T}
    np.testing.assert_allclose(
        BODY.tangent(s, shown), crawler.prescribed().angle(s, phases), atol=1e-12
    )


def test_the_mirrored_half_is_the_negative_shape():
    (q, _), s = shapes(4), np.linspace(0.44, 0.56, 60)[:, None]
    np.testing.assert_allclose(BODY.tangent(s, -q), -BODY.tangent(s, q), atol=1e-13)
    assert np.abs(BODY.tangent(np.array([[0.1], [0.449], [0.551]]), q)).max() == 0.0


def test_the_rate_of_the_angle_is_that_of_finite_differences():
    (q, rates), s, h = shapes(4), np.linspace(0.44, 0.56, 25)[:, None], 1e-6
    moved = (BODY.tangent(s, q + h * rates) - BODY.tangent(s, q - h * rates)) / (2 * h)
    np.testing.assert_allclose(BODY.turning(s, q, rates), moved, atol=1e-6)


def test_slopes_of_the_motion_are_those_of_finite_differences():
    (q, rates), delta, n = shapes(3), 0.1, BODY.n_joint

    def motion(y):
        solved = BODY.solve(Friction(), y[:n], y[n:], delta, tolerance=1e-13)
        now = BODY.motion(Friction(), y[:n], y[n:], delta, solved)
        return np.concatenate([now.z, now.centre, now.power[None]])

    numeric = differences(motion, np.concatenate([q, rates]))
    _, slopes = motion_and_derivatives(
        BODY, Friction(), q, rates, delta, BODY.solve(Friction(), q, rates, delta, tolerance=1e-13)
    )
    np.testing.assert_allclose(slopes, numeric, atol=1e-6 * np.abs(numeric).max())


def test_optimising_beats_the_paper_s_crawler():
    """On one coarse mesh and few panels, which are enough to tell them apart."""
    body = CrawlerBody(0.1, modes=2, panels=4)
    guess = Corners(body.concertina(1.499), "antipodal")
    space, v = space_near(
        Problem("crawler", guess, body, gait=Polygon(8, "antipodal"), intervals=8), guess
    )
    paper = -ReducedProgram(space, 1e-3).objective(v)
    found = optimise(space, v, 1e-3, COARSE)
    assert 0.5 < paper + 0.005 < -found.objective < 1.0


@pytest.mark.slow
def test_the_problem_file_is_certified_beats_the_paper_s_crawler_and_is_kept(tmp_path):
    found = solve(runpy.run_path("problems/crawler.py")["PROBLEM"], 1)
    assert found.status == "solved", found.message
    assert found.certificate.efficiency_at_zero_delta > 0.9069  # what equal sides of the path allow
    panels = found.answer.problem.body.panels
    assert panels > found.problem.body.panels
    read = load(save(found, tmp_path / "crawler.h5"))
    assert (read.problem.hash, read.answer.problem.body.panels) == (found.problem.hash, panels)
    np.testing.assert_array_equal(read.sample(0.3).tail, found.sample(0.3).tail)


@pytest.mark.parametrize("changes", [{"epsilon": 0.7}, {"share": 0.0}, {"modes": 1}])
def test_unusable_bodies_are_refused(changes):
    with pytest.raises(ProblemError, match="must lie between"):
        CrawlerBody(**({"epsilon": 0.1} | changes))


def test_every_command_that_reads_results_takes_a_crawler(tmp_path, capsys):
    """The paper's crawler as it is, collocated but not searched nor certified."""
    body = CrawlerBody(epsilon=0.2, modes=2, panels=4)
    guess = Corners(body.concertina(1.2), "antipodal")
    problem = Problem(
        "paper",
        guess,
        body=body,
        friction=Friction(),
        gait=Polygon(8, "antipodal"),
        delta=1e-3,
        delta_start=1e-3,
    )
    solution = Solution(
        problem, answer_of_iterate(evaluate_at(*space_near(problem, guess), problem.delta))
    )
    file = str(save(solution, tmp_path / "paper.h5"))
    for command, more in (
        ("report", ()), ("export", ("--max-speed", "2")), ("animate", ("--seconds", "0.4", "--fps",
        "5", "--periods", "1")),
        ("verify", ("--compare", file)),
    ):  # fmt: skip
        assert colloc_main([command, file, *more]) == 0
    assert "bump coordinate" in (tmp_path / "paper.html").read_text()
    assert (tmp_path / "paper.csv").read_text().count("coordinate_3_rad") == 2
    assert "the same optimum" in capsys.readouterr().out
    dataset = solution.to_xarray()
    assert dict(dataset.sizes) == {"t": 401, "coordinate": 3, "velocity": 3, "axis": 2}
    ahead = dataset.centre.isel(t=-1) - dataset.centre.isel(t=0)
    assert float(ahead.sel(axis="x")) == pytest.approx(solution.distance, rel=1e-9)


@pytest.mark.parametrize("share", [0.3, 0.5, 0.8])
def test_a_bump_lies_at_the_ends_of_its_region_where_it_grows_and_is_flattened_and_never_beyond(
    share,
):
    body = CrawlerBody(0.1, share=share)
    ends = body.breaks(np.array([[LAP, -LAP, 0.0, 0.4], *[[1.0] * 4] * body.modes]))[1:-1]
    np.testing.assert_allclose(ends[0, :2], 0.4, atol=1e-15)
    np.testing.assert_allclose(ends[-1, 2], 0.6, atol=1e-15)
    np.testing.assert_allclose(ends[-1] - ends[0], body.width, atol=1e-15)
    assert 0.4 < ends[0, 3] < ends[-1, 3] < 0.6


@pytest.mark.parametrize(
    "asked",
    [{"way": (0.9,)}, {"way": (0.9, "text")}, {"way": 0.9}, {"sides": 3}, {"amplitude": "wide"}],
)
def test_what_is_no_concertina_is_refused_in_one_sentence(asked):
    with pytest.raises(ProblemError, match="must be"):
        BODY.concertina(**{"amplitude": 1.3} | asked)
