"""Rows of the table on single instants, static friction, the flap body and smooth waves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from colloc.mechanics.friction import Friction, line_integrals
from scripts.paper.rows import Row, number_row, statement_row
from scripts.paper.study import PaperStudy


def instant(study: PaperStudy) -> Iterator[Row]:
    made = study.arrays("instant")
    u, v, omega = made["z"][0]
    change = np.abs(made["z"][0] - made["z"][-1]).max()
    yield statement_row(
        "figure 3: motion of the tail",
        "counter-clockwise, downward, leftward",
        f"u = {u:.4f}, v = {v:.4f}, omega = {omega:.4f}",
        bool(u < 0 and v < 0 and omega > 0),
        f"{change:.0e} (delta)",
    )


def static(study: PaperStudy) -> Iterator[Row]:
    made = study.arrays("static")
    fraction = made["fraction"][list(made["fraction_deltas"]).index(1e-4)]
    sampled = float(np.sqrt(fraction * (1 - fraction) / made["samples"]))
    yield statement_row(
        "part of the velocity-map space in which a link is slower than 1e-3",
        "small",
        f"{fraction:.3f}",
        fraction < 0.25,
        f"{sampled:.1g} (sampling)",
    )
    for name in "CDEF":
        key = f"worked/{name}"
        speed, density = made[f"{key}/speed"], made[f"{key}/density"]
        scales = speed[-1] / made[f"{key}/delta"][-1]
        yield statement_row(
            f"figure 9{name}: link {int(made[f'{key}/link']) + 1} held by static friction",
            "(statement)",
            f"speed {scales:.3f} delta, force {density[-1]:.4f} of the kinetic one",
            bool(speed[-1] < 1e-8),
            f"{abs(density[-1] - density[-2]):.0e} (delta)",
        )
    for name in "ABC":
        below, rest, above = made[f"symmetric/{name}/gap"]
        yield statement_row(
            f"figure 10{name}: kinetic friction leaves a force or couple at any velocity",
            "no solution",
            f"{below:+.4f} / {rest:+.4f} / {above:+.4f} just below, at, above rest",
            bool(made[f"symmetric/{name}/no_solution"]),
        )
    length = np.array([[1 / 3]])
    zero, turn = np.zeros((1, 1)), np.ones((1, 1))
    couple = -float(line_integrals(Friction()).force(zero, zero, turn, length, 1e-9).couple[0, 0])
    yield Row(
        "torque of a link of length 1/3 that turns about its middle",
        "1/36",
        f"{couple:.9f}",
        "1e-9 (delta)",
        "agrees" if abs(couple - 1 / 36) < 1e-8 else "differs",
    )


def flap(study: PaperStudy) -> Iterator[Row]:
    made = study.arrays("flap")
    holds = bool(made["no_solution"].all())
    least = float(np.abs(made["gap"]).min())
    yield statement_row(
        f"figure 4: flap body, {len(made['openings'])} openings, without delta",
        "no solution",
        f"net force at least {least:.3f} whatever the velocity",
        holds,
    )
    ratio, limit = made["V_over_delta"], made["limit"]
    which = list(made["deltas"]).index(1e-4)
    yield Row(
        "figure 4: velocity/delta of the body at delta = 1e-4",
        "not printed",
        f"{ratio[which].min():.4f} to {ratio[which].max():.4f}",
        f"{np.abs(ratio[which] - limit).max():.1e} from the limit law",
        "-",
    )


def waves(study: PaperStudy) -> Iterator[Row]:
    made = study.arrays("waves")
    for name, printed in (("5A", "0.93"), ("5B", "0.76")):
        yield number_row(
            f"figure {name}: efficiency with anisotropy 100",
            printed,
            float(made[f"{name}/efficiency"]),
            float(made[f"{name}/errors"][2]),
            "half the intervals, lower order",
        )
    for name in ("6A", "6B", "6C"):
        W, d = float(made[f"{name}/work"]), float(made[f"{name}/distance"])
        dd, dW, _ = made[f"{name}/errors"]
        yield statement_row(
            f"figure {name}: W, isotropic",
            "0.4 to 0.5",
            f"{W:.5f}",
            round(W, 1) in (0.4, 0.5),
            f"{dW:.0e} (half the intervals)",
        )
        yield statement_row(
            f"figure {name}: d, isotropic",
            "less than 0.005",
            f"{d:.5f}",
            d - dd < 0.005,
            f"{dd:.0e} (half the intervals)",
        )


def wave_parameters(study: PaperStudy) -> Iterator[Row]:
    made = study.arrays("wave_parameters")
    for name, value in zip(made["names"], made["efficiency"], strict=True):
        printed = "0.93" if name.startswith("A") else "0.76"
        yield Row(
            f"wave {name}",
            printed,
            f"{value:.4f}",
            "study of what would give the printed value",
            f"{value - float(printed):+.3f}",
        )
    sharp = np.array(study.settings("wave_parameters")["steepness"], dtype=float)
    if sharp.size >= 3:
        # the corners' length falls like 1/steepness, and so does what they waste: 1/efficiency is
        # nearly linear in it
        cost = 1 / made["efficiency"][: sharp.size]
        limits = [
            (cost[k + 1] * sharp[k + 1] - cost[k] * sharp[k]) / (sharp[k + 1] - sharp[k])
            for k in (-3, -2)
        ]
        yield Row(
            "wave A: corners infinitely sharp",
            "0.93",
            f"{1 / limits[1]:.3f}",
            f"{abs(1 / limits[1] - 1 / limits[0]):.3f} (extrapolated from the sharpest three)",
            f"{1 / limits[1] - 0.93:+.3f}",
        )
    yield Row(
        "wave B: mu_t that gives the printed value",
        "100",
        f"{float(made['mu_t_for_B']):.0f}",
        "1 (root search)",
        "-",
    )


def crawlers(study: PaperStudy) -> Iterator[Row]:
    """Rows on the concertina crawlers (figure 13)."""
    made = study.arrays("crawlers")
    smallest = int(np.argmin(made["epsilon"]))
    epsilon = made["epsilon"][smallest]
    for name in ("isotropic", "forward easiest", "transverse easiest"):
        for key, printed in (("d", 1), ("W_inner", 2), ("W_outer", 1)):
            order = float(made[f"{name}/order/{key}"])
            yield statement_row(
                f"crawler, {name}: order of {key} in epsilon",
                str(printed),
                f"{order:.3f}",
                abs(order - printed) < 0.1,
                "fit",
            )
        share = made[f"{name}/efficiency"][smallest] / made[f"{name}/bound"]
        error = made[f"{name}/error_efficiency"][smallest] / made[f"{name}/bound"]
        yield statement_row(
            f"crawler, {name}: efficiency at epsilon = {epsilon:g}, of the bound "
            f"{float(made[f'{name}/bound']):g}",
            "1 + O(epsilon)",
            f"{share:.5f}",
            bool(abs(1 - share) < 20 * epsilon),
            f"{error:.0e} (time, panels, delta)",
        )
