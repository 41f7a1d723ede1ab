"""The report is one self-contained page that trusts nothing in the file."""

import json
import re
import shutil
import subprocess
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser

import numpy as np
import pytest

import colloc
from colloc import Chain, Fourier, Friction, Harmonic, Problem, Reference, Solution, ellipse
from colloc.commands.solve import summary_dict
from colloc.pictures.movie import frames
from colloc.pictures.report_page import report_page
from colloc.results.checks import Check
from colloc.results.motion import lab_outline
from colloc.search.certify import certify
from colloc.search.evaluate import evaluate
from colloc.verification.replay import replay
from tests.pictures.test_figure import crawler
from tests.shared.cases import slow_but

BROWSER = next(
    (path for path in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if path),
    None,
)
VOID = {"meta", "br", "hr", "input", "img", "link"}  # elements without an end tag
EVIL = "</script><script>alert(1)</script><img src=x onerror=alert(2)>\"'&<!--"
NO_SLIDERS = {
    "nine": (Fourier(np.zeros(8), np.full((8, 1), 0.1), np.eye(8, 1)), Chain((1 / 9,) * 9)),
    "feet": (ellipse(0.0, 1.0, 1.0), Chain((1 / 3,) * 3, feet=1), Friction(), Harmonic(1)),
}
needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
STAGE = """
const made = [], elements = {}, lists = LISTS, texts = TEXTS;
const element = id => elements[id] ||= {
  textContent: texts[id] || "", value: "1", checked: true, dataset: {}, style: {}, clientWidth: 6000, clientHeight: 2000, addEventListener() {},
  getContext: () => new Proxy({}, { get: (_, name) => (...at) => made.push([name, ...at]) }),
};
for (const each of Object.values(lists).flat()) Object.assign(each, { style: {}, addEventListener() {}, nextElementSibling: {} });
globalThis.document = { documentElement: element("page"), addEventListener() {}, getElementById: element, querySelectorAll: what => lists[what] };
globalThis.window = {
  matchMedia: () => ({ matches: true, addEventListener() {} }), getComputedStyle: () => ({ getPropertyValue: () => "black" }),
  requestAnimationFrame() {}, addEventListener() {}, location: { hash: "HASH" },
};
"""
FLOORS = [(3, (1, 1, 1)), (5, (3, 1, 1)), (8, (2, 0.5, 1.5)), (2, (1, 0.3, 0.9))]


class Outline(HTMLParser):
    """Checks nesting, and collects attributes and scripts."""

    def __init__(self):
        super().__init__()
        self.open, self.attributes, self.text, self.scripts = [], [], [], []

    def handle_starttag(self, tag, attrs):
        self.attributes += [(tag, name, value) for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert tag in VOID or self.open, f"</{tag}> closes nothing"
        assert tag in VOID or self.open.pop() == tag

    def handle_data(self, data):
        (self.scripts if self.open and self.open[-1] == "script" else self.text).append(data)


def outline(page):
    parser = Outline()
    parser.feed(page)
    parser.close()
    assert parser.open == []
    return parser


@pytest.fixture(scope="module")
def page(three_link):
    return report_page(three_link, Reference(0.259, 0.0015, "the paper"), "upper bound 0.473")


def test_another_result_stands_beside_it_and_both_films_are_seen_whole_at_one_scale(
    three_link, solved
):
    other = replace(solved("three_link_offset")[0], seconds=987.0)
    page = report_page(three_link, beside=other)
    text = " ".join(outline(page).text)
    assert "Beside three_link_offset" in text
    assert "10 % less with 10 % more" in text
    assert "Different: efficiencies differ by 20" in text
    assert "987.0" in text
    films = re.findall(r'<svg width="(\d+)" height="(\d+)".* aria-label="(\w+) as it moves', page)
    assert [name for *_, name in films] == ["three_link", "three_link_offset"]
    sizes = np.array([each[:2] for each in films], float)
    assert (sizes <= (321, 201)).all()
    windows = [np.ptp(frames(each, 25, 1, 2).window, axis=0) for each in (three_link, other)]
    scales = sizes / np.array(windows)
    assert np.ptp(scales) < 0.01 * scales.max()


def test_the_page_needs_no_network_and_no_other_file(page):
    seen, links = outline(page), ("src", "srcset", "href", "action", "background", "poster")
    for tag, name, value in seen.attributes:
        assert name not in links, (tag, name, value)
        # a mark drawn again
        assert name != "xlink:href" or (tag == "use" and value.startswith("#")), (tag, name, value)
        assert not name.startswith("on"), (tag, name)
    assert not re.findall(r"://|@import|url\((?!#)", page)
    calls = "fetch( XMLHttpRequest WebSocket import( eval( innerHTML document.write"
    assert not [call for call in calls.split() if call in page]
    policy = [value for tag, _, value in seen.attributes if tag == "meta" and "default" in value]
    assert policy[0].startswith("default-src 'none'")
    assert not {tag for tag, _, _ in seen.attributes} & {"link", "iframe", "object", "embed", "img"}


def test_a_reader_who_hears_the_page_is_told_what_is_drawn_and_can_scroll_with_the_keyboard(page):
    drawn = re.findall(r"<(?:svg|canvas)[^>]*>", page)
    assert len(drawn) > 6
    assert all('role="img"' in tag and re.search(r'aria-label="[^"]+"', tag) for tag in drawn)
    labels = re.findall(r'<svg[^>]*aria-label="([^"]*)"', page)
    assert re.findall(r"<figcaption>(.*?)</figcaption>", page) == labels
    scrolling = re.findall(r'<(?:pre|div class="scroll")[^>]*>', page)
    assert scrolling
    assert all('tabindex="0"' in tag for tag in scrolling)
    assert not re.search(r"<th[^>]*></th>", page)
    assert re.search(r"friction forwards</td><td>1</td><td>0.2895</td><td>0.2306<", page)


def test_everything_from_the_file_is_escaped(three_link):
    checks = (Check(EVIL, 1.0, 0.0, EVIL), *three_link.certificate.checks)
    history = (*three_link.history, replace(three_link.history[0], status=EVIL, optimal=False))
    answer = replace(three_link.answer, history=history)
    versions = {EVIL: EVIL, "colloc": EVIL}
    certificate = replace(three_link.certificate, checks=checks)
    problem = three_link.problem.with_(
        objective=colloc.Objective("distance / work", name=f"\\eta {EVIL}")
    )
    evil = Solution(problem, answer, certificate, 1.0, EVIL, EVIL, versions)
    page = report_page(evil, Reference(0.2, 0.1, EVIL), EVIL)
    seen = outline(page)
    assert "<img" not in page
    assert len(re.findall("<script", page)) == 4  # motion and body, and the page's own two
    assert all("alert" not in script for script in seen.scripts)
    assert sum(text.count("alert(1)") for text in seen.text) >= 8  # shown as text
    card = evil._repr_html_()
    outline(card)
    assert "<img" not in card
    assert "<script" not in card


@pytest.mark.parametrize("n_link", slow_but([2, 3], [2, 3, 5, 8]))
def test_chains_of_two_to_eight_links(n_link, unsolved):
    page = report_page(unsolved(crawler(n_link)))
    motion = json.loads(outline(page).scripts[0])
    assert len(motion["x"]) == n_link + 1
    assert len(motion["angles"]) == n_link - 1
    assert page.count('class="dot"') == min(n_link - 2, 6)
    assert len(page) < 600_000


@pytest.mark.parametrize("n_link", [2, 3, 5])
def test_frames_keep_link_lengths_and_their_friction_balances(n_link, unsolved):
    problem = crawler(n_link).with_(delta=1e-3)
    shown = frames(solution := unsolved(problem), count=241, arrows=300)
    lengths = np.hypot(*np.diff(shown.ends, axis=1))
    np.testing.assert_allclose(lengths, np.full_like(lengths, 1 / n_link), atol=1e-12)
    # friction per length adds up to the net force, which vanishes but for z between mesh points
    assert np.median(np.hypot(*shown.arrow.mean(axis=1))) < 0.02
    velocity = np.gradient(shown.arrow_base, shown.motion.t, axis=2)
    spent = -(shown.arrow * velocity).sum(axis=0).mean(axis=0)
    assert np.trapezoid(spent, shown.motion.t) == pytest.approx(solution.measured.work, rel=5e-3)
    drawn, (low, high) = shown.arrow_scale * shown.arrow, shown.window
    assert np.hypot(*drawn).max() == pytest.approx(0.12)
    tips = (shown.arrow_base + drawn).reshape(2, -1)
    tips = np.concatenate([before.of(tips) for before in shown.before], axis=1)
    assert np.all(low < tips.min(axis=1))
    assert np.all(tips.max(axis=1) < high)
    assert np.all(high - low < np.ptp(tips, axis=1) + 0.48)


@pytest.fixture(scope="module")
def turning(unsolved):
    """A gait that turns, asked for the angle by which it does, with a replay; not an optimum."""
    guess = Fourier(mean=[0.5, 0.9], cos=[[1.0], [0.2]], sin=[[0.0], [1.1]])
    how = {"rotation": None, "guess": guess, "intervals": 40, "mesh_tolerance": 0}
    free = unsolved(crawler(3).with_(**how))
    assert abs(free.rotation) > 0.1
    problem = free.problem.with_(rotation=free.rotation)
    asked = replace(free, problem=problem, answer=replace(free.answer, problem=problem))
    return replace(asked, certificate=certify(asked.answer))


def test_the_page_of_a_turning_gait_states_angle_and_radius_and_claims_no_straight_way(turning):
    page = report_page(turning)
    text = re.sub(r"\s+", " ", " ".join(outline(page).text))
    assert 'name="mu_t" min="0.1" max="7.5" step="any" value="1.5"' in page
    words = f"turns {abs(np.degrees(turning.rotation)):.4g}° "
    assert f"{np.degrees(turning.rotation):+.2f}° turned a cycle" in text
    assert f"{turning.turning_radius:.4g} radius of the circle it crawls" in text
    assert words in text
    assert "turned by the requested angle" in text
    assert "straight" not in text
    assert words in " ".join(outline(turning._repr_html_()).text)
    assert turning.to_xarray().attrs["turning_radius"] == turning.turning_radius


@pytest.mark.skipif(BROWSER is None, reason="no chromium or google-chrome on this machine")
def test_a_browser_runs_the_page_without_a_word(three_link, tmp_path):
    file = tmp_path / "page.html"
    file.write_text(report_page(three_link), encoding="utf-8")
    options = (
        "headless no-sandbox disable-gpu disable-quic no-first-run disable-background-networking "
        "disable-component-update disable-sync enable-logging=stderr virtual-time-budget=1500 "
        f"dump-dom user-data-dir={tmp_path / 'profile'}"
    )
    command = [BROWSER, *(f"--{option}" for option in options.split()), f"file://{file}"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert not [line for line in result.stderr.splitlines() if "CONSOLE" in line]
    assert 'data-ready="yes"' in result.stdout


def test_a_notebook_shows_a_card_with_a_film_of_two_periods(three_link):
    film = re.search(r'points" values="([^"]+)"', three_link._repr_html_())[1].split(";")
    # (time, point, 2) [pixels]
    drawn = np.array([[p.split(",") for p in frame.split()] for frame in film], dtype=float)
    half, scale = len(film) // 2, 3 * np.hypot(*(drawn[0, 1] - drawn[0, 0]))
    links, steps = np.diff(drawn, axis=1), drawn[half:] - drawn[:half]
    np.testing.assert_allclose(np.linalg.norm(links, axis=2), scale / 3, atol=0.15)
    # the second period repeats the first one, a distance further on
    moved = np.linalg.norm(steps, axis=2)
    np.testing.assert_allclose(moved, scale * three_link.measured.distance, atol=0.3)
    up = lab_outline(three_link.problem.body, three_link.sample(0.0))[1, :, 0]
    np.testing.assert_allclose(drawn[0, :, 1] - drawn[0, 0, 1], scale * (up[0] - up), atol=0.3)
    failed = Solution(three_link.problem, replace(three_link.answer, optimal=False))
    assert "not converged" in " ".join(outline(failed._repr_html_()).text)


def test_a_problem_stated_in_a_program_is_printed_as_a_file_that_states_it(three_link, tmp_path):
    text = unescape(report_page(replace(three_link, source="")))
    stated = text[text.index("from colloc import Problem") :].partition("</code>")[0]
    (tmp_path / "stated.py").write_text(stated, encoding="utf-8")
    assert colloc.load_problem(tmp_path / "stated.py").hash == three_link.problem.hash
    assert "save the problem source above" in text
    assert "# links of mine" in report_page(replace(three_link, source="N = 3  # links of mine\n"))


@pytest.fixture(scope="module")
def found():
    body = Chain(feet=(colloc.Foot(0), colloc.Wheel(1), colloc.Pad(2, 0.2, 0.7)))
    problem = Problem("feet", body=body, gait=Harmonic(1), delta=1e-2)
    return evaluate(problem, ellipse(0.0, 1.6, 1.1))


def test_feet_that_hold_are_filled_in_the_film_of_a_card(found):
    held = found.holding(found.sample(np.linspace(0.0, 1.0, 25)))[:, :-1]
    assert 0.1 < held.mean() < 0.9
    hollow = re.findall(r'attributeName="stroke-opacity"[^>]*values="([^"]+)"', found._repr_html_())
    drawn = [each.split(";") for each in hollow]
    np.testing.assert_array_equal(drawn, np.where(np.tile(held, 2), "0", "1"))
    shares = found.holding(found.sample(np.arange(2000) / 2000)).mean(axis=1)
    assert summary_dict(found, None, None, None)["feet_hold"] == pytest.approx(shares)
    colours = re.findall('stroke="(#.{6})" stroke-width="8"', found._repr_html_())
    assert colours == ["#d55e00", "#009e73", "#d55e00"]  # a wheel is green


def played(page, of, after, lists=None, hash=""):
    """What the page's own script with such words in it has made, on a stage with such elements."""
    scripts = outline(page).scripts
    (script,) = (text for text in scripts if of in text)
    data = {"motion": '{"t"', "toy-body": '{"lengths"'}
    texts = {id: "".join(x for x in scripts if x.startswith(y)) for id, y in data.items()}
    stage = STAGE.replace("LISTS", json.dumps(lists or {})).replace("TEXTS", json.dumps(texts))
    stage = stage.replace("HASH", hash) if lists else ""
    program = f"{stage}{script}\nconsole.log(JSON.stringify([{after}]));"
    done = subprocess.run(["node", "-"], input=program, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def points(made):
    return np.array([at[1:3] for at in made if at[0] in ("arc", "moveTo", "lineTo")], dtype=float)


@needs_node
def test_the_page_draws_every_period_as_the_body_friction_and_shape_are_then(turning):
    page, scale = report_page(turning), frames(turning).arrow_scale
    dot = {"first": 0, "second": 1, "sides": "10,90,20,80", "limits": "-3,3,-2,2"}
    marks = {".cursor": [{"dataset": {"low": 10, "high": 90}}], ".dot": [{"dataset": dot}]}
    for t in (0.2625, 1.4875, 2.6625):  # frames, and no edges of the mesh
        after = 'made, elements["phase-shown"].textContent, elements.phase.value, lists'
        made, said, place, lists = played(page, "function trail", after, marks, f"#t={t}")
        arcs = [k for k, (name, *_) in enumerate(made) if name == "arc"]
        drawn = points([made[k] for k in arcs]), points(made[arcs[-1] :])
        pixels = np.concatenate([drawn[0], drawn[1][1::5], drawn[1][2::5]]).T.ravel()
        shown = frames(turning, motion=turning.sample(np.array([t])))
        # hinges and head, the centre, and arrows of friction from their base to their tip
        base, tips = shown.arrow_base, shown.arrow_base + scale * shown.arrow
        known = shown.ends[:, 1:], shown.motion.centre[:, None], base, tips
        x, y = np.concatenate(known, axis=1)[..., 0]
        one, none = np.ones_like(x), np.zeros_like(x)
        rows = np.concatenate([np.stack([x, one, none]), np.stack([-y, none, one])], axis=1).T
        # a scale and a shift of the canvas, the same for all
        fit = np.linalg.lstsq(rows, pixels, rcond=None)[0]
        np.testing.assert_allclose(pixels, rows @ fit, atol=1e-3 * fit[0])
        assert (said, place) == (f"t = {t:.3f}", round(1000 * t / 3))
        (cursor,), (spot,) = (lists[name] for name in marks)
        a, b = shown.motion.angles[:, 0]
        at = [float(x[:-1]) for x in (cursor["style"]["left"], *spot["style"].values())]
        known = 10 + 80 * (t % 1), 10 + 80 * (a + 3) / 6, 80 - 60 * (b + 2) / 4
        np.testing.assert_allclose(at, known, atol=0.01)


@needs_node
def test_feet_that_slide_are_drawn_hollow_in_the_page(found):
    """Filled, and then once more in the colour of the page."""
    page, marks, seen = report_page(found), {".cursor": [], ".dot": []}, []
    for t in np.arange(3, 240, 40) / 240:
        (made,) = played(page, "function trail", "made", marks, f"#t={t}")
        begin, end = [k for k, (name, *_) in enumerate(made) if name == "arc"][-2:]
        slides = ~found.holding(found.sample(t))[:, 0]
        seen.append(slides.sum())
        assert sum(name == "moveTo" for name, *_ in made[begin:end]) == 3 + slides.sum()
    assert np.ptp(seen) > 0


@needs_node
@pytest.mark.parametrize(("n_link", "mu"), FLOORS)
def test_the_balance_in_the_page_moves_a_chain_as_the_replay_does(n_link, mu, page):
    lengths = np.random.default_rng(n_link).uniform(0.5, 1.5, n_link)
    lengths /= lengths.sum()
    body = json.dumps({"lengths": lengths.tolist(), "weights": lengths.tolist()})
    gait = {"amplitude": 0.9, "lag": 1.1, "offset": 0.2}
    call = f"crawl({body}, {json.dumps(gait)}, {json.dumps(mu)}, 1e-2, 2000)"
    (moved,) = played(page, "function crawl", call)
    lag = 1.1 * (np.arange(1, n_link) - n_link / 2)[:, None]
    wave = Fourier(np.full(n_link - 1, 0.2), 0.9 * np.cos(lag), 0.9 * np.sin(lag))
    floor = Friction(mu_t=mu[0], mu_f=mu[1], mu_b=mu[2])
    right = replay(Chain(tuple(lengths)), floor, lambda t: (wave.angles(t), wave.rates(t)), 1e-2)
    assert moved["distance"] == pytest.approx(right.distance, abs=1e-6)
    assert moved["work"] == pytest.approx(right.work, rel=1e-6)
    assert moved["turn"] == pytest.approx(right.rotation, abs=1e-6)


@needs_node
def test_sliders_of_the_page_say_and_draw_what_their_wave_does(page):
    """The ellipse with equal amplitudes a quarter apart is a wave with that lag."""
    values = {"amplitude": 60, "lag": 90, "offset": 9, "mu_t": 2, "mu_f": 1, "mu_b": 1.5}
    sliders = [{"name": name, "value": str(x), "dataset": {}} for name, x in values.items()]
    after = 'elements["toy-said"].textContent, made'
    said, made = played(page, "function crawl", after, {"#toy-sliders input": sliders})
    a = np.sqrt(0.5) * np.pi / 3
    wave = Fourier([np.pi / 20] * 2, [[a], [a]], [[-a], [a]])
    floor = Friction(mu_t=2, mu_f=1, mu_b=1.5)
    right = evaluate(
        Problem("w", None, Chain(), floor, Harmonic(1), rotation=None, delta=1e-3), wave
    )
    numbers = r"[\d.]+(?= body)|(?<=work )[\d.]+|(?<=by )[-\d.]+"
    distance, work, turn = map(float, re.findall(numbers, said))
    assert distance == pytest.approx(right.distance, abs=1e-3)
    assert work == pytest.approx(right.work, rel=1e-3)
    assert turn == pytest.approx(np.degrees(right.rotation), abs=0.06) != 0
    # the way of the centre, and the body with its head and its centre, at first
    *links, head, _, centre, _ = points(made)[241:] @ [1, -1j]
    bends = np.angle(np.diff(links)[1:] / np.diff(links)[:-1])
    np.testing.assert_allclose(bends, wave.angles(np.zeros(1))[:, 0])
    assert (head, centre) == pytest.approx((links[-1], np.convolve(links, [1, 2, 2, 1])[3] / 6))


@pytest.mark.parametrize("name", slow_but(["feet"], NO_SLIDERS))
def test_only_chains_of_up_to_eight_links_on_their_bellies_get_sliders(name, page, unsolved):
    assert "Play with it" in page
    problem = Problem(name, *NO_SLIDERS[name], intervals=8)
    assert "Play with it" not in report_page(unsolved(problem))
