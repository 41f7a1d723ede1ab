"""The report is one self-contained, well-formed page that trusts nothing in the file, and a browser runs it without a word."""

import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from colloc.commands.report import main
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.problem import Problem, Reference
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction
from colloc.pictures.motion_frames import frames
from colloc.pictures.report_charts import forbidden_rectangles, plane_charts
from colloc.pictures.report_page import json_block, report_page
from colloc.results.chart import Chart, linear_ticks, log_ticks
from colloc.results.checks import Check
from colloc.results.markup import VOID, Markup, element, table
from colloc.results.solution import Solution
from colloc.results.store import save

BROWSER = next((path for path in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if path), None)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no chromium or google-chrome on this machine")


class Outline(HTMLParser):
    """Checks nesting, and collects attributes and scripts."""

    def __init__(self):
        super().__init__()
        self.open, self.attributes, self.text, self.scripts = [], [], [], []

    def handle_starttag(self, tag, attrs):
        self.attributes += [(tag, name, value) for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.attributes += [(tag, name, value) for name, value in attrs]

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data):
        (self.scripts if self.open and self.open[-1] == "script" else self.text).append(data)


def outline(page):
    parser = Outline()
    parser.feed(page)
    parser.close()
    assert parser.open == []
    return parser


def crawler(n_link, **changes):
    """A travelling wave along a chain of n_link links."""
    j = np.arange(n_link - 1)
    fields = {
        "name": f"crawler{n_link}",
        "body": Chain((1 / n_link,) * n_link),
        "friction": Friction(1.5, 1.0, 1.2),
        "gait": Harmonic(1),
        "guess": Fourier(np.zeros(n_link - 1), 0.6 * np.cos(0.9 * j)[:, None], 0.6 * np.sin(0.9 * j)[:, None] + 0.1),
        "delta": 1e-2,
        "intervals": 8,
    }
    return Problem(**{**fields, **changes})


@pytest.fixture(scope="module")
def page(three_link):
    return report_page(three_link, Reference(0.259, 0.0015, "the paper"), "upper bound 0.473")


def test_the_page_holds_what_it_should(page, three_link):
    text = " ".join(outline(page).text)
    for words in (
        "three_link", "✓ certified", "0.26003", "agrees with 0.259", "upper bound 0.473", "Motion in the lab frame",
        "replay gap", "joints 1 and 2", "speeds of the links", "power against friction", "efficiency at each level",
        "mesh: error of",
        "How to reproduce", "colloc solve three_link.py", "casadi", three_link.problem.hash,
    ):  # fmt: skip
        assert words in text, words
    assert text.count("✓ holds") == len(three_link.certificate.checks)
    assert "✗" not in text


def test_the_page_needs_no_network_and_no_other_file(page):
    seen = outline(page)
    for tag, name, value in seen.attributes:
        assert name not in ("src", "srcset", "href", "action", "background", "poster", "xlink:href"), (tag, name, value)
        assert "://" not in (value or ""), (tag, name, value)
        assert not name.startswith("on"), (tag, name)
    assert "://" not in page
    assert "@import" not in page
    assert "url(" not in page
    for call in ("fetch(", "XMLHttpRequest", "WebSocket", "import(", "eval(", "innerHTML", "document.write"):
        assert call not in page
    policy = [value for tag, name, value in seen.attributes if tag == "meta" and name == "content" and "default-src" in value]
    assert policy[0].startswith("default-src 'none'")
    assert not {tag for tag, _, _ in seen.attributes} & {"link", "iframe", "object", "embed", "img"}


EVIL = "</script><script>alert(1)</script><img src=x onerror=alert(2)>\"'&<!--"


def test_everything_from_the_file_is_escaped(three_link):
    certificate = three_link.certificate
    certificate = replace(certificate, checks=(Check(EVIL, 1.0, 0.0, EVIL), *certificate.checks))
    levels = [replace(three_link.levels[0], status=EVIL, optimal=False), *three_link.levels]
    versions = {EVIL: EVIL, "colloc": EVIL}
    evil = Solution(three_link.problem, levels, certificate, 1.0, EVIL, EVIL, versions)
    page = report_page(evil, Reference(0.2, 0.1, EVIL), EVIL)
    seen = outline(page)
    assert "<img" not in page
    assert len(re.findall("<script", page)) == 2  # the motion, and the page's own
    assert all("alert" not in script for script in seen.scripts)
    assert sum(text.count("alert(1)") for text in seen.text) >= 8  # shown as text
    card = evil._repr_html_()
    outline(card)
    assert "<img" not in card
    assert "<script" not in card


def test_json_in_the_page_cannot_end_its_block():
    block = json_block("x", {"a": EVIL})
    assert "<" not in block.removeprefix('<script id="x" type="application/json">').removesuffix("</script>")
    assert json.loads(outline(block).scripts[0])["a"] == EVIL


def test_markup_escapes_text_and_attributes_but_not_markup():
    assert element("p", "<b>", Markup("<i></i>"), title='"&') == '<p title="&quot;&amp;">&lt;b&gt;<i></i></p>'
    assert element("input", checked=True, value=None) == '<input checked="checked" />'
    assert table([["<a>", "b"]], ["<h>"]).count("&lt;") == 2


def test_failures_show_in_red_and_a_solve_without_levels_has_a_page_too(three_link):
    bad = replace(three_link.certificate, checks=(Check("replay gap", 0.1, 1e-4, "x"), *three_link.certificate.checks))
    text = " ".join(outline(report_page(Solution(three_link.problem, three_link.levels, bad))).text)
    assert "✗ fails" in text
    assert "✗ certificate failed" in text
    empty = Solution(three_link.problem, [], message="no first level.")
    text = " ".join(outline(report_page(empty)).text)
    assert "✗ not converged" in text
    assert "no first level." in text


@pytest.mark.parametrize("n_link", range(2, 9))
def test_chains_of_two_to_eight_links(n_link, unsolved):
    solution = unsolved(crawler(n_link))
    page = report_page(solution)
    seen = outline(page)
    motion = json.loads(seen.scripts[0])
    assert len(motion["x"]) == n_link + 1
    assert len(motion["angles"]) == n_link - 1
    planes = min(n_link - 2, 6)
    assert page.count('class="dot"') == planes + page.count(", closer</text>")
    assert len(page) < 600_000


@pytest.mark.parametrize("n_link", [2, 3, 5])
def test_frames_keep_link_lengths_and_their_friction_balances(n_link, unsolved):
    problem = crawler(n_link, delta=1e-3)
    shown = frames(unsolved(problem), count=25, per_link=400)
    lengths = np.hypot(*np.diff(shown.ends, axis=1))
    np.testing.assert_allclose(lengths, np.full_like(lengths, 1 / n_link), atol=1e-12)
    # the arrows are friction per length: their sum is the net force, which vanishes up to the midpoint rule; at collocation
    # points only, between them z is interpolated: hence the loose bound on a mesh of eight intervals
    total = shown.arrow.mean(axis=1)
    assert np.median(np.hypot(*total)) < 0.02
    np.testing.assert_allclose(shown.step, shown.centre[:, -1] - shown.centre[:, 0])


def test_a_small_loop_is_also_shown_closer(unsolved):
    small = crawler(3, guess=Fourier(np.array([2.3, -2.3]), np.array([[0.2], [-0.2]]), np.array([[0.15], [0.15]])))
    problem = small.with_(smallest_shape_speed=0.01)
    angles = problem.guess.angles(np.linspace(0, 1, 50))
    whole, closer = plane_charts(problem, angles)
    assert ", closer" in closer
    x0, x1, y0, y1, low, high, *_ = (float(v) for v in re.search('data-box="([^"]*)"', closer).group(1).split(","))
    assert x0 < x1
    assert y0 > y1
    assert low < angles[0].min() < angles[0].max() < high
    points = re.findall(r"([0-9.]+),([0-9.]+)", re.search('polyline points="([^"]*)"', closer).group(1))
    x = np.array(points, dtype=float)[:, 0]
    np.testing.assert_allclose(x, x0 + (angles[0] - low) / (high - low) * (x1 - x0), atol=0.1)
    assert ", closer" not in whole


def test_forbidden_rectangles_cover_the_exact_set_of_the_three_link_body():
    """Design: crossing iff both angles positive and min(2 a + b, a + 2 b) > 2 pi, or the mirror image."""
    problem = crawler(3)
    area = sum((x[1] - x[0]) * (y[1] - y[0]) for x, y in forbidden_rectangles(problem))
    # per sign: the triangle-like region min(2a+b, a+2b) > 2 pi in [0, pi]^2 has area pi^2 / 6
    assert area == pytest.approx(2 * np.pi**2 / 6, rel=0.02)
    bounded = forbidden_rectangles(problem.with_(joint_limit=np.pi / 2))
    assert sum((x[1] - x[0]) * (y[1] - y[0]) for x, y in bounded) == pytest.approx(3 * np.pi**2, rel=0.02)


def test_ticks_are_round_and_inside():
    assert linear_ticks(0.0, 1.0) == pytest.approx([0, 0.2, 0.4, 0.6, 0.8, 1.0])
    assert linear_ticks(-0.26, 0.27) == pytest.approx([-0.2, 0.0, 0.2])
    assert log_ticks(1e-5, 10.0) == pytest.approx([1e-5, 1e-3, 1e-1, 10.0])
    chart = Chart((1e-4, 1.0), (0.0, 2.0), "x", log_x=True)
    assert chart.px(1e-2) == pytest.approx(0.5 * (chart.px(1e-4) + chart.px(1.0)))
    assert chart.py(2.0) < chart.py(0.0)


def test_the_command_writes_the_page_beside_the_result(three_link, tmp_path, capsys):
    file = save(three_link, tmp_path / "x.h5")
    assert main([str(file)]) == 0
    assert "self-contained" in capsys.readouterr().out
    outline((tmp_path / "x.html").read_text(encoding="utf-8"))
    assert main([str(tmp_path / "none.h5")]) == 2


@needs_browser
def test_a_browser_runs_the_page_without_a_word(three_link, tmp_path):
    page = tmp_path / "page.html"
    page.write_text(report_page(three_link), encoding="utf-8")
    options = "headless no-sandbox disable-gpu disable-quic no-first-run disable-background-networking disable-component-update"
    command = [
        BROWSER,
        *(f"--{option}" for option in options.split()),
        "--disable-sync",
        f"--user-data-dir={tmp_path / 'profile'}",
        "--enable-logging=stderr",
        "--virtual-time-budget=1500",
        "--dump-dom",
        f"file://{page}",
    ]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert "CONSOLE" not in result.stderr, [line for line in result.stderr.splitlines() if "CONSOLE" in line]
    assert 'data-ready="yes"' in result.stdout
    phase = float(re.search(r"t = ([0-9.]+)</output>", result.stdout).group(1))
    assert phase > 0.0  # it plays
    cursors = re.findall(r'class="cursor" x1="([0-9.]+)"', result.stdout)
    assert len(set(cursors)) == 1
    assert "cx=" in re.search(r'<circle class="dot"[^>]*>', result.stdout).group(0)


def test_a_notebook_shows_a_card(three_link):
    card = outline(three_link._repr_html_())
    text = " ".join(card.text)
    for words in ("three_link", "solved", "0.26003", "checks, all hold", "joint angles [rad]"):
        assert words in text
    failed = Solution(three_link.problem, [], message="no first level.")
    assert "not converged" in " ".join(outline(failed._repr_html_()).text)
