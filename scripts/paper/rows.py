"""The table results/paper.md: one row for every number the paper prints, made from the stored parts
only, with a verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from colloc.mechanics.friction import Friction, line_integrals
from scripts.paper.study import Arrays, PaperStudy
from scripts.paper.three_link import third_slowest_dips

_HEADER = """# The paper's numbers, computed

Source: S. Alben, "Efficient sliding locomotion with isotropic friction" (2019). Printed: as in the paper. Computed: by
colloc, with delta = 1e-4 unless stated. Error: estimated as the row says. Verdict: *agrees* if the printed value, to its
last digit, lies within the error of the computed one; *consistent* if a range or a statement holds; otherwise how far off.

This file is written by `python -m scripts.reproduce_paper{quick}`; every row by that command with `--only PART`.

| number | printed | computed | estimated error | verdict | part |
|---|---|---|---|---|---|
"""  # fmt: skip


class Row(NamedTuple):
    """A line of the table."""

    what: str
    printed: str
    computed: str
    error: str = "-"
    verdict: str = "-"


def number(what: str, printed: str, computed: float, error: float, source: str) -> Row:
    """A row for a printed number; `error` is absolute, `source` says where it comes from."""
    value, decimals = float(printed), len(printed.partition(".")[2])
    if abs(computed - value) <= 0.5 * 10.0**-decimals + error:
        verdict = "agrees"
    else:
        verdict = f"printed value {100 * (value / computed - 1):+.1f} %" if computed else "differs"
    digits = 6 if error == 0 else int(np.clip(np.ceil(-np.log10(error)) + 1, 2, 9))
    return Row(what, printed, f"{computed:.{digits}f}", f"{error:.1g} ({source})", verdict)


def statement(what: str, printed: str, computed: str, holds: bool, error: str = "-") -> Row:
    """A row for a range or a statement, which holds or does not."""
    return Row(what, printed, computed, error, "consistent" if holds else "does not hold")


def connection(made: Arrays) -> Iterator[Row]:
    more = int(made["anisotropic_faces"]) - 2
    yield statement("maps needed if mu_b != mu_f", "two more", f"{more} more", more == 2)


def sweep(s: Arrays) -> Iterator[Row]:
    yield Row(
        f"sweep over {int(s['inside'].sum())} gaits at 100 instants: largest efficiency error",
        "not printed",
        f"{s['sample_error'].max():.1e}",
        f"of {s['sample_error'].size} gaits at 1600 instants",
    )
    r = np.hypot(*np.meshgrid(s["A1"], s["B1"], indexing="ij"))
    ring = np.where((r > 0.7) & (r < 0.8), s["work"][s["A0"] < 2.3], np.nan)
    by_A0 = np.nanmean(ring, axis=(1, 2))
    spread = (by_A0.max() - by_A0.min()) / by_A0.mean()
    yield statement(
        "W does not depend strongly on A0",
        "(statement)",
        f"mean W at amplitude 0.75 varies by {spread:.0%} over A0",
        spread < 0.5,
    )


def plane(p: Arrays) -> Iterator[Row]:
    best = int(p["rim_distance"].argmax())
    yield number(
        "largest distance at A0 = 0",
        "0.261",
        float(p["rim_distance"][best]),
        float(p["rim_distance_error"][best]) + 1e-6,
        f"time step; at A1 = {p['rim'][1, best]:.3f}, B1 = {p['rim'][2, best]:.3f}, on the limit "
        f"of contact",
    )
    d, W, diagonal = p["distance"], p["work"], np.diag(p["distance"])
    lines, largest = max(np.nanmax(d[0]), np.nanmax(d[:, 0])), np.nanmax(d)
    what = "distance along A1 = 0 and along B1 = 0"
    yield statement(what, "0", f"at most {lines:.1e}", lines < 1e-3)
    for upto, top in (("1.4 rad", 1.4), ("the limit of contact", np.pi)):
        most = float(np.nanmax(diagonal[p["A1"] <= top]))
        computed = f"at most {most:.4f} ({most / largest:.0%} of the largest)"
        holds = most < 0.05 * largest
        yield statement(f"distance along A1 = B1, up to {upto}", "nearly zero", computed, holds)
    known, radius = np.isfinite(W), np.hypot(*np.meshgrid(p["A1"], p["B1"], indexing="ij"))
    correlation = float(np.corrcoef(W[known], radius[known])[0, 1])
    computed = f"correlation of W with hypot(A1, B1): {correlation:.3f}"
    what = "W at A0 = 0 grows with the amplitude"
    yield statement(what, "(statement)", computed, correlation > 0.9)
    factors = p["circle_work"].max(axis=1) / p["circle_work"].min(axis=1)
    most, least = (p["circle_radius"][k] for k in (factors.argmax(), factors.argmin()))
    yield statement(
        "W at A0 = 0 does not depend on the direction in (A1, B1)",
        "nearly",
        f"varies by a factor {factors.max():.2f} at amplitude {most:g}, {factors.min():.2f} at "
        f"{least:g}",
        bool(factors.max() < 1.25),
    )


def optima(found: Arrays, influence: Arrays, swept: Arrays) -> Iterator[Row]:
    gaits, efficiency, moved = (found[k] for k in ("gaits", "efficiency", "position_error"))
    by_delta = influence["distance_work_efficiency"][: len(gaits), :, 2]
    drift = np.abs(by_delta / by_delta[:, -1:] - 1)[:, list(influence["deltas"]).index(1e-4)]
    listed = ", ".join(f"{e:.4f} (A0 = {g[0]:.2f})" for e, g in zip(efficiency, gaits, strict=True))
    yield Row(
        "local maxima of the efficiency",
        "3",
        f"{len(gaits)}, {int(found['at_contact'].sum())} of them at the limit of contact: {listed}",
        "grid neighbours, climbed",
        "the three printed, and one more at the limit of contact" if len(gaits) == 4 else "-",
    )
    places = [int(np.argmin(np.abs(gaits[:, 0] - A0) - 0.1 * efficiency)) for A0 in (0.0, 1.1, 2.5)]
    printed = (("first", "0.259", "0"), ("second", "0.207", "1.1"), ("third", "0.094", "2.5"))
    for i, (name, value, A0) in zip(places, printed, strict=True):
        # a maximum loses to second order in its position; the landscape varies over about a radian
        error = efficiency[i] * float(found["relative_error"][i] + drift[i] + moved[i] ** 2)
        at = ", ".join(f"{k} = {a:.3f}" for k, a in zip(("A0", "A1", "B1"), gaits[i], strict=True))
        source = f"time step, delta, position; at {at}"
        yield number(f"efficiency of the {name} maximum", value, efficiency[i], error, source)
        source = "search with half the instants"
        yield number(f"A0 of the {name} maximum", A0, float(gaits[i, 0]), float(moved[i]), source)
    for A0, (A1, B1, best) in zip(found["named_A0"], found["named_best"], strict=True):
        computed = f"{best:.4f} at A1 = {A1:.3f}, B1 = {B1:.3f}"
        source = "grid in A1, B1 at 400 instants"
        yield Row(f"best efficiency at exactly A0 = {A0:g}", "not printed", computed, source)

    def moves(key: str, i: int) -> float:
        return _relative_slope(swept, key, gaits[i]) * float(moved[i])

    first, second = places[:2]
    for key, value in (("distance", "0.37"), ("work", "0.47")):
        ratio = float(found[key][second] / found[key][first])
        error, what = (
            ratio * (moves(key, first) + moves(key, second)),
            f"{key} of the second maximum",
        )
        yield number(
            f"{what} over that of the first", value, ratio, error, "position of the maxima"
        )
    d, source = float(found["distance"][first]), "position of the maximum"
    yield number("distance of the first maximum", "0.26", d, d * moves("distance", first), source)


def _relative_slope(swept: Arrays, key: str, gait: np.ndarray) -> float:
    """Largest relative change of a swept measure per radian, from the grid node nearest to a gait
    to its neighbours."""
    axes, values = [swept[name] for name in ("A0", "A1", "B1")], swept[key]
    grid = zip(np.meshgrid(*axes, indexing="ij"), np.abs(gait), strict=True)
    distance = np.where(np.isnan(values), np.inf, sum((a - g) ** 2 for a, g in grid))
    node = np.unravel_index(np.argmin(distance), values.shape)
    near = values[tuple(slice(max(0, k - 1), k + 2) for k in node)]
    return float(np.nanmax(np.abs(near / values[node] - 1)) / (axes[0][1] - axes[0][0]))


def delta(made: Arrays) -> Iterator[Row]:
    deltas, values = made["deltas"], made["distance_work_efficiency"]
    below, moving = deltas <= 1e-4, values[:, -1, 0] > 0.01
    last, source = values[:, -1:], f"against delta = {deltas[-1]:g}"
    relative = np.abs(values[:, below] / last - 1)[moving].max(axis=(0, 1))
    yield statement(
        f"change of results for delta in (0, 1e-4], {moving.sum()} gaits with d > 0.01",
        "less than 1 %",
        f"d {relative[0]:.1e}, W {relative[1]:.1e}, efficiency {relative[2]:.1e} (relative)",
        bool((relative < 0.01).all()),
        source,
    )
    rest = np.abs(values[:, below] - last)[~moving, :, 0].max(initial=0.0)
    computed = f"d changes by at most {rest:.1e} (not relative)"
    what = f"the same, {(~moving).sum()} gaits that hardly move"
    yield Row(what, "not printed", computed, source)


def motions(made: Arrays, found: Arrays) -> Iterator[Row]:
    for name, printed in (("D", ("0.07", "0.43")), ("F", ("0.33", "0.67"))):
        t, speed = third_slowest_dips(made[f"{name}/t"], made[f"{name}/speeds"])
        index = int(made[f"{name}/index"])
        # the phase at which a shape is passed moves with the position of the maximum
        moved = found["position_error"][index] / (2 * np.pi * found["gaits"][index, 1:].min())
        error, source = 2 * made["D/t"][1] + moved, "time step, position of the maximum"
        for value in printed:
            i = int(np.argmax(np.abs(t - float(value)) < 0.05))
            what = f"motion {name}: three of four ends almost static at t = (third slowest end moves at"
            yield number(f"{what} {speed[i]:.1e})", value, float(t[i]), float(error), source)


def instant(made: Arrays) -> Iterator[Row]:
    u, v, omega = made["z"][0]
    yield statement(
        "figure 3: motion of the tail",
        "counter-clockwise, downward, leftward",
        f"u = {u:.4f}, v = {v:.4f}, omega = {omega:.4f}",
        bool(u < 0 and v < 0 and omega > 0),
        f"{np.abs(made['z'][0] - made['z'][-1]).max():.0e} (delta)",
    )


def static(made: Arrays) -> Iterator[Row]:
    fraction = made["fraction"][list(made["fraction_deltas"]).index(1e-4)]
    error = f"{float(np.sqrt(fraction * (1 - fraction) / made['samples'])):.1g} (sampling)"
    what = "part of the velocity-map space in which a link is slower than 1e-3"
    yield statement(what, "small", f"{fraction:.3f}", fraction < 0.25, error)
    for name in "CDEF":
        key = f"worked/{name}"
        speed, density = made[f"{key}/speed"], made[f"{key}/density"]
        scales = speed[-1] / made[f"{key}/delta"][-1]
        yield statement(
            f"figure 9{name}: link {int(made[f'{key}/link']) + 1} held by static friction",
            "(statement)",
            f"speed {scales:.3f} delta, force {density[-1]:.4f} of the kinetic one",
            bool(speed[-1] < 1e-8),
            f"{abs(density[-1] - density[-2]):.0e} (delta)",
        )
    for name in "ABC":
        gap = " / ".join(f"{force:+.4f}" for force in made[f"symmetric/{name}/gap"])
        yield statement(
            f"figure 10{name}: kinetic friction leaves a force or couple at any velocity",
            "no solution",
            f"{gap} just below, at, above rest",
            bool(made[f"symmetric/{name}/no_solution"]),
        )
    zero, turn, length = (np.full((1, 1), value) for value in (0.0, 1.0, 1 / 3))
    couple = -float(line_integrals(Friction()).force(zero, zero, turn, length, 1e-9).couple[0, 0])
    verdict = "agrees" if abs(couple - 1 / 36) < 1e-8 else "differs"
    what = "torque of a link of length 1/3 that turns about its middle"
    yield Row(what, "1/36", f"{couple:.9f}", "1e-9 (delta)", verdict)


def flap(made: Arrays) -> Iterator[Row]:
    yield statement(
        f"figure 4: flap body, {len(made['openings'])} openings, without delta",
        "no solution",
        f"net force at least {float(np.abs(made['gap']).min()):.3f} whatever the velocity",
        bool(made["no_solution"].all()),
    )
    ratio = made["V_over_delta"][list(made["deltas"]).index(1e-4)]
    error = f"{np.abs(ratio - made['limit']).max():.1e} from the limit law"
    what = "figure 4: velocity/delta of the body at delta = 1e-4"
    yield Row(what, "not printed", f"{ratio.min():.4f} to {ratio.max():.4f}", error)


def waves(made: Arrays) -> Iterator[Row]:
    for name, printed in (("5A", "0.93"), ("5B", "0.76")):
        what, source = (
            f"figure {name}: efficiency with anisotropy 100",
            "half the intervals, lower order",
        )
        error = float(made[f"{name}/errors"][2])
        yield number(what, printed, float(made[f"{name}/efficiency"]), error, source)
    for name in ("6A", "6B", "6C"):
        W, d, (dd, dW, _) = (made[f"{name}/{key}"] for key in ("work", "distance", "errors"))
        for key, printed, value, holds, error in (
            ("W", "0.4 to 0.5", W, round(float(W), 1) in (0.4, 0.5), dW),
            ("d", "less than 0.005", d, bool(d - dd < 0.005), dd),
        ):
            source = f"{error:.0e} (half the intervals)"
            yield statement(
                f"figure {name}: {key}, isotropic", printed, f"{value:.5f}", holds, source
            )


def crawlers(made: Arrays) -> Iterator[Row]:
    smallest = int(np.argmin(made["epsilon"]))
    epsilon = made["epsilon"][smallest]
    for name in ("isotropic", "forward easiest", "transverse easiest"):
        for key, printed in (("d", 1), ("W_inner", 2), ("W_outer", 1)):
            order = float(made[f"{name}/order/{key}"])
            what, holds = f"crawler, {name}: order of {key} in epsilon", abs(order - printed) < 0.1
            yield statement(what, str(printed), f"{order:.3f}", holds, "fit")
        bound = float(made[f"{name}/bound"])
        share, error = (
            made[f"{name}/{key}"][smallest] / bound for key in ("efficiency", "error_efficiency")
        )
        yield statement(
            f"crawler, {name}: efficiency at epsilon = {epsilon:g}, of the bound {bound:g}",
            "1 + O(epsilon)",
            f"{share:.5f}",
            bool(abs(1 - share) < 20 * epsilon),
            f"{error:.0e} (time, panels, delta)",
        )


_ROWS: dict[Callable[..., Iterator[Row]], tuple[str, ...]] = {
    connection: ("connection",),
    sweep: ("sweep",),
    plane: ("plane",),
    optima: ("optima", "delta", "sweep"),
    delta: ("delta",),
    motions: ("motions", "optima"),
    instant: ("instant",),
    static: ("static",),
    flap: ("flap",),
    waves: ("waves",),
    crawlers: ("crawlers",),
}
"""The functions above, and the parts whose arrays they take in this order."""


def table(study: PaperStudy) -> str:
    """The table in Markdown; parts that have not been computed are named at its end."""
    text, missing = _HEADER.format(quick=" --quick" if study.quick else ""), []
    for rows, parts in _ROWS.items():
        if not all(map(study.finished, parts)):
            missing.append(f"`{parts[0]}`")
            continue
        for row in rows(*map(study.arrays, parts)):
            text += f"| {' | '.join(row)} | `{parts[0]}` |\n"
    if missing:
        names = ", ".join(missing)
        text += f"\nNot computed yet, or inputs have changed since: {names}.\n"
    return text
