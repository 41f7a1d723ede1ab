"""Rows of the table on three-link bodies: map, sweeps, optima, influence of delta, the two best
motions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from scripts.models.motion_record import third_slowest_dips
from scripts.paper.array_store import read_attribute
from scripts.paper.rows import Row, number_row, statement_row
from scripts.paper.study import Arrays, PaperStudy


def connection(study: PaperStudy) -> Iterator[Row]:
    made = study.arrays("connection")
    cubic = list(made["methods"]).index("cubic")
    for n, errors in zip(made["resolutions"], made["errors"], strict=True):
        largest, rms, median = errors[cubic]
        yield Row(
            f"velocity map, {n} x {n} x {n + 1} nodes a face, cubic: error against direct solves",
            "not printed",
            f"largest {largest:.1e}, rms {rms:.1e}, median {median:.1e}",
            "random shapes and rates",
            "-",
        )
    faces = int(made["other/anisotropic/faces"])
    yield statement_row("maps needed if mu_b != mu_f", "two more", f"{faces - 2} more", faces == 4)


def sweep(study: PaperStudy) -> Iterator[Row]:
    s = study.arrays("sweep")
    count = int(s["inside"].sum())
    moving = np.hypot(*np.meshgrid(s["A1"], s["B1"], indexing="ij"))[None] > 0
    difference = np.where(moving, np.abs(s["efficiency_mapped"] - s["efficiency_direct"]), 0)
    yield Row(
        f"sweep over {count} gaits at 100 instants: largest efficiency error of the map route",
        "not printed",
        f"{np.nanmax(difference):.1e} from the direct route; {s['sample_error_mapped'].max():.1e} "
        f"from 1600 instants",
        f"direct route: {s['sample_error_direct'].max():.1e} from 1600 instants",
        "-",
    )
    processes = int(read_attribute(study.path("sweep"), "processes"))
    mapped, direct = float(s["seconds_mapped"]), float(s["seconds_direct"])
    yield Row(
        f"time of that sweep, through the map / directly [s], on {processes} processes",
        "-",
        f"{mapped:.1f} / {direct:.1f}",
        "-",
        "-",
    )
    work, r = s["work_direct"], np.hypot(*np.meshgrid(s["A1"], s["B1"], indexing="ij"))
    ring = (r > 0.7) & (r < 0.8)
    by_A0 = np.nanmean(np.where(ring[None], work, np.nan)[s["A0"] < 2.3], axis=(1, 2))
    spread = (by_A0.max() - by_A0.min()) / by_A0.mean()
    yield statement_row(
        "W does not depend strongly on A0",
        "(statement)",
        f"mean W at amplitude 0.75 varies by {spread:.0%} over A0",
        spread < 0.5,
    )


def pacing(study: PaperStudy) -> Iterator[Row]:
    made = study.arrays("pacing")
    cubic = list(made["methods"]).index("cubic")
    count = made["gaits"].shape[1]
    for n, errors in zip(made["resolutions"], made["route_error"], strict=True):
        yield Row(
            f"largest efficiency error of the map route, {n} x {n} x {n + 1} nodes, {count} gaits",
            "not printed",
            f"{errors[cubic]:.1e} (linear: {errors[1 - cubic]:.1e})",
            "against the direct route",
            "-",
        )
    for relative, d, e in zip(
        made["relative"],
        made["paced_distance_change"],
        made["paced_efficiency_change"],
        strict=True,
    ):
        yield Row(
            f"delta = {relative:g} times the larger rate instead of 1e-4 per period, {count} gaits",
            "not printed",
            f"efficiency changes by at most {e:.1e}, d by {d:.1e}",
            "direct solves, same instants",
            "-",
        )


def plane(study: PaperStudy) -> Iterator[Row]:
    p = study.arrays("plane")
    best = int(p["rim_distance"].argmax())
    yield number_row(
        "largest distance at A0 = 0",
        "0.261",
        float(p["rim_distance"][best]),
        float(p["rim_distance_error"][best]) + 1e-6,
        f"time step; at A1 = {p['rim'][1, best]:.3f}, B1 = {p['rim'][2, best]:.3f}, on the limit "
        f"of contact",
    )
    d = p["distance"]
    largest = np.nanmax(d)
    lines = max(np.nanmax(d[0]), np.nanmax(d[:, 0]))
    yield statement_row(
        "distance along A1 = 0 and along B1 = 0", "0", f"at most {lines:.1e}", lines < 1e-3
    )
    diagonal, side = np.diag(d), np.asarray(p["A1"])
    modest = float(np.nanmax(diagonal[side <= 1.4]))
    yield statement_row(
        "distance along A1 = B1, up to 1.4 rad",
        "nearly zero",
        f"at most {modest:.4f} ({modest / largest:.0%} of the largest)",
        modest < 0.05 * largest,
    )
    yield statement_row(
        "distance along A1 = B1, up to the limit of contact",
        "nearly zero",
        f"at most {np.nanmax(diagonal):.3f} ({np.nanmax(diagonal) / largest:.0%} of the largest)",
        bool(np.nanmax(diagonal) < 0.05 * largest),
    )
    W, radius = p["work"], np.hypot(*np.meshgrid(p["A1"], p["B1"], indexing="ij"))
    known = np.isfinite(W)
    correlation = float(np.corrcoef(W[known], radius[known])[0, 1])
    factors = p["circle_work"].max(axis=1) / p["circle_work"].min(axis=1)
    yield statement_row(
        "W at A0 = 0 grows with the amplitude",
        "(statement)",
        f"correlation of W with hypot(A1, B1): {correlation:.3f}",
        correlation > 0.9,
    )
    yield statement_row(
        "W at A0 = 0 does not depend on the direction in (A1, B1)",
        "nearly",
        f"varies by a factor {factors.max():.2f} at amplitude "
        f"{p['circle_radius'][factors.argmax()]:g}, "
        f"{factors.min():.2f} at {p['circle_radius'][factors.argmin()]:g}",
        bool(factors.max() < 1.25),
    )


def _nearest(found: Arrays, A0: float) -> int:
    return int(np.argmin(np.abs(found["gaits"][:, 0] - A0) - 0.1 * found["efficiency"]))


def optima(study: PaperStudy) -> Iterator[Row]:
    found = study.arrays("optima")
    places = [_nearest(found, a) for a in (0.0, 1.1, 2.5)]
    influence = study.arrays("delta")
    by_delta = influence["distance_work_efficiency"][: len(found["gaits"]), :, 2]
    drift = np.abs(by_delta / by_delta[:, -1:] - 1)[:, list(influence["deltas"]).index(1e-4)]
    contact = int(found["at_contact"].sum())
    listed = ", ".join(
        f"{e:.4f} (A0 = {g[0]:.2f})"
        for e, g in zip(found["efficiency"], found["gaits"], strict=True)
    )
    yield Row(
        "local maxima of the efficiency",
        "3",
        f"{len(found['gaits'])}, {contact} of them at the limit of contact: {listed}",
        "grid neighbours, climbed",
        "the three printed, and one more at the limit of contact"
        if len(found["gaits"]) == 4
        else "-",
    )
    for name, i, printed, A0 in zip(
        ("first", "second", "third"),
        places,
        ("0.259", "0.207", "0.094"),
        ("0", "1.1", "2.5"),
        strict=True,
    ):
        e, gait, moved = (
            float(found["efficiency"][i]),
            found["gaits"][i],
            float(found["position_error"][i]),
        )
        # a maximum loses to second order in its position; the landscape varies over about a radian
        error = e * float(found["relative_error"][i] + drift[i] + moved**2)
        where = (
            f"time step, delta, position; at A0 = {gait[0]:.3f}, A1 = {gait[1]:.3f}, B1 = "
            f"{gait[2]:.3f}"
        )
        yield number_row(f"efficiency of the {name} maximum", printed, e, error, where)
        yield number_row(
            f"A0 of the {name} maximum", A0, float(gait[0]), moved, "search with half the instants"
        )
    for A0, best in zip(found["named_A0"], found["named_best"], strict=True):
        yield Row(
            f"best efficiency at exactly A0 = {A0:g}",
            "not printed",
            f"{best[2]:.4f} at A1 = {best[0]:.3f}, B1 = {best[1]:.3f}",
            "grid in A1, B1 at 400 instants",
            "-",
        )
    swept = study.arrays("sweep")
    first, second = places[:2]
    for key, printed in (("distance", "0.37"), ("work", "0.47")):
        ratio = float(found[key][second] / found[key][first])
        moves = [
            _relative_slope(swept, key, found["gaits"][i]) * float(found["position_error"][i])
            for i in (first, second)
        ]
        what = f"{key} of the second maximum over that of the first"
        yield number_row(what, printed, ratio, ratio * sum(moves), "position of the maxima")
    d = float(found["distance"][first])
    moved = (
        d
        * _relative_slope(swept, "distance", found["gaits"][first])
        * float(found["position_error"][first])
    )
    yield number_row("distance of the first maximum", "0.26", d, moved, "position of the maximum")


def _relative_slope(swept: Arrays, key: str, gait: np.ndarray) -> float:
    """Largest relative change of a swept measure per radian, from the grid node nearest to a gait
    to its neighbours."""
    axes = [swept[name] for name in ("A0", "A1", "B1")]
    values = swept[f"{key}_direct"]
    distance = sum(
        (a - g) ** 2 for a, g in zip(np.meshgrid(*axes, indexing="ij"), np.abs(gait), strict=True)
    )
    node = np.unravel_index(np.argmin(np.where(np.isnan(values), np.inf, distance)), values.shape)
    near = values[tuple(slice(max(0, k - 1), k + 2) for k in node)]
    return float(np.nanmax(np.abs(near / values[node] - 1)) / (axes[0][1] - axes[0][0]))


def delta(study: PaperStudy) -> Iterator[Row]:
    made = study.arrays("delta")
    deltas, values = made["deltas"], made["distance_work_efficiency"]
    below = [i for i, d in enumerate(deltas) if d <= 1e-4]
    moving = values[:, -1, 0] > 0.01
    relative = np.abs(values[moving][:, below] / values[moving][:, below[-1:]] - 1).max(axis=(0, 1))
    yield statement_row(
        f"change of results for delta in (0, 1e-4], {moving.sum()} gaits with d > 0.01",
        "less than 1 %",
        f"d {relative[0]:.1e}, W {relative[1]:.1e}, efficiency {relative[2]:.1e} (relative)",
        bool((relative < 0.01).all()),
        f"against delta = {deltas[-1]:g}",
    )
    rest = np.abs(values[~moving][:, below, 0] - values[~moving][:, below[-1:], 0])
    if rest.size:
        yield Row(
            f"the same, {(~moving).sum()} gaits that hardly move",
            "not printed",
            f"d changes by at most {rest.max():.1e} (not relative)",
            f"against delta = {deltas[-1]:g}",
            "-",
        )


def motions(study: PaperStudy) -> Iterator[Row]:
    made, found = study.arrays("motions"), study.arrays("optima")
    step = float(made["D/t"][1])
    for name, printed in (("D", ("0.07", "0.43")), ("F", ("0.33", "0.67"))):
        t, speed = third_slowest_dips(made[f"{name}/t"], made[f"{name}/speeds"])
        index = int(made[f"{name}/index"])
        # the phase at which a shape is passed moves with the position of the maximum
        moved = float(
            found["position_error"][index] / (2 * np.pi * found["gaits"][index, 1:].min())
        )
        for value in printed:
            near = np.abs(t - float(value)) < 0.05
            if not near.any():
                yield Row(
                    f"motion {name}: three ends almost static at t =",
                    value,
                    "no such instant",
                    "-",
                    "does not hold",
                )
                continue
            i = np.flatnonzero(near)[0]
            what = (
                f"motion {name}: three of four ends almost static at t = (third slowest end "
                f"moves at {speed[i]:.1e})"
            )
            yield number_row(
                what, value, float(t[i]), 2 * step + moved, "time step, position of the maximum"
            )
