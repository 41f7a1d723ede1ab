"""Figures of bodies: velocities and forces on links (3, 9, 10), the flap body (4), waves (5, 6),
snapshots of gaits (12)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from colloc.mechanics.balance import instant
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.pictures import style
from scripts import panel_marks
from scripts.paper.study import Arrays

_ARROWS = 9
"""Arrows on a link."""


def draw_link_fields(
    axes: Any, body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray,
    z: np.ndarray, delta: float,
    fields: str = "vf", lengths: tuple[float, float] = (0.25, 0.12), pose: tuple[float,
    complex] = (0.0, 0j),
) -> None:  # fmt: skip
    """A body with arrows of velocity ("v") and friction force per length ("f") along its links."""
    angles, rates, z = (np.asarray(a, dtype=float).reshape(-1, 1) for a in (angles, rates, z))
    now = instant(body, friction, angles, rates, z, delta)
    turn = np.exp(1j * pose[0])
    along = (now.posture.cos + 1j * now.posture.sin) * turn
    middle = (now.posture.x + 1j * now.posture.y) * turn + pose[1]
    sigma = np.linspace(-0.46, 0.46, _ARROWS) * body.length_column()
    place = middle + along * sigma
    vs, vn = now.velocity.vs + 0 * sigma, now.velocity.vn + now.velocity.w * sigma
    velocity = (vs + 1j * vn) * along
    speed = np.sqrt(vs**2 + vn**2 + delta**2)
    mu_s = friction.tangential(vs)
    force = -(mu_s * vs + 1j * friction.mu_t * vn) / speed * along
    half = 0.5 * body.length_column()
    for k in range(body.n_link):
        ends = middle[k] + along[k] * np.array([-half[k, 0], half[k, 0]])
        axes.plot(ends.real, ends.imag, color=style.BLACK, lw=2, solid_capstyle="round", zorder=2)
    shown = {"v": (velocity, lengths[0], style.VELOCITY), "f": (force, lengths[1], style.FORCE)}
    for key in fields:
        field, length, colour = shown[key]
        panel_marks.arrows(axes, place.real, place.imag, field.real, field.imag, length, colour)
        tips = place + length * field
        # so that the limits include the arrows
        axes.plot(tips.real.ravel(), tips.imag.ravel(), alpha=0)


def _plate(axes: Any, friction: Friction, title: str) -> None:
    """A plate at 45 degrees in uniform horizontal motion, and the force on it."""
    direction = np.exp(0.25j * np.pi)
    ends = direction * np.array([-0.5, 0.5])
    axes.plot(ends.real, ends.imag, color=style.BLACK, lw=2)
    local = np.exp(-0.25j * np.pi)
    force = -(friction.mu_f * local.real + 1j * friction.mu_t * local.imag) * direction
    panel_marks.arrows(
        axes,
        np.array([0.0]),
        np.array([0.0]),
        np.array([1.0]),
        np.array([0.0]),
        0.7,
        style.VELOCITY,
    )
    panel_marks.arrows(
        axes,
        np.array([0.0]),
        np.array([0.0]),
        np.array([force.real]),
        np.array([force.imag]),
        0.5,
        style.FORCE,
    )
    axes.set(xlim=(-1.2, 0.9), ylim=(-0.55, 0.55), title=title)
    panel_marks.bare(axes)


def figure_3(made: Arrays, folder: Path) -> list[Path]:
    """Force on a plate; velocities and forces on a three-link body, tail held and in balance."""
    body, friction = Chain(), Friction()
    figure, axes = style.subplots(2, 3, figsize=(7.2, 3.6), height_ratios=(1, 1.2))
    for a, (mu_f, mu_t) in zip(axes[0], ((1, 1), (1, 2), (2, 1)), strict=True):
        _plate(a, Friction(mu_t=mu_t, mu_f=mu_f, mu_b=mu_f), rf"$\mu_f = {mu_f},\ \mu_t = {mu_t}$")
    panel_marks.letter(axes[0, 0], "A")
    axes[0, 0].text(0.75, 0.05, "v", color=style.VELOCITY)
    axes[0, 0].text(-0.65, 0.05, "F", color=style.FORCE)
    z = made["z"][0]
    for a, velocity, fields, text, title in (
        (axes[1, 0], np.zeros(3), "v", "B", "tail held"),
        (axes[1, 1], z, "v", "C", "in balance: velocity"),
        (axes[1, 2], z, "f", "D", "in balance: friction"),
    ):
        draw_link_fields(
            a, body, friction, made["angles"], made["rates"], velocity, 1e-4, fields, (0.35, 0.12)
        )
        panel_marks.bare(a)
        a.set_title(title)
        panel_marks.letter(a, text)
    return style.save(figure, folder / "figure-03-velocity-and-force")


def figure_4(made: Arrays, folder: Path) -> list[Path]:
    """The flap body: the scene, its unbalanced force against velocity, and what delta gives."""
    body, half, flap = made["lengths"], 0.06, made["lengths"][1]
    figure, (scene, force, speed) = style.subplots(
        1, 3, figsize=(7.4, 2.5), width_ratios=(1.1, 1, 1)
    )
    scene.plot([0, body[0]], [0, 0], color=style.BLACK, lw=2.5)
    for sign in (1, -1):
        for angle, line in ((0.35, "-"), (float(made["example"]), "--"), (1.2, "--")):
            scene.plot(
                [0, flap * np.cos(angle)],
                [0, sign * flap * np.sin(angle)],
                line,
                color=style.BLUE,
                lw=1.6,
            )
        arc = flap * 1.15 * np.exp(1j * sign * np.linspace(0.4, 1.15, 20))
        scene.annotate(
            "",
            (arc[-1].real, arc[-1].imag),
            (arc[-4].real, arc[-4].imag),
            arrowprops={"arrowstyle": "->"},
        )
        scene.plot(arc.real, arc.imag, color=style.BLACK, lw=0.7)
    scene.set(xlim=(-0.05, body[0] + 0.05), ylim=(-3 * half, 3 * half), title="two flaps open")
    panel_marks.bare(scene)
    panel_marks.letter(scene, "A")
    smooth, kinetic = made["example_force"]
    V = made["example_V"] * 1e3
    for side in (V < 0, V > 0):
        force.plot(
            V[side], kinetic[side], color=style.VERMILION, label="kinetic" if side[0] else None
        )
    force.plot(V, smooth, color=style.BLUE, ls="--", label=r"$\delta = 10^{-4}$")
    force.axhline(0, color="0.6", lw=0.7)
    force.plot(0, made["example_force"][1][V.size // 2], "o", ms=4, color=style.VERMILION)
    force.set(
        xlabel=r"body velocity $V\ [10^{-3}]$", ylabel="net force", title="no velocity balances it"
    )
    force.legend()
    panel_marks.letter(force, "B")
    degrees = np.rad2deg(made["openings"])
    keep = [i for i, d in enumerate(made["deltas"]) if d in (1e-2, 1e-4)]
    speed.plot(degrees, made["limit"], color=style.BLACK, label=r"$f/\sqrt{\ell^2 - f^2}$")
    for i, colour, line in zip(keep, (style.ORANGE, style.SKY), ("--", ":"), strict=True):
        power = round(np.log10(made["deltas"][i]))
        speed.plot(
            degrees,
            made["V_over_delta"][i],
            line,
            lw=2,
            color=colour,
            label=rf"$\delta = 10^{{{power}}}$",
        )
    speed.set(
        xlabel="opening [degrees]", ylabel=r"$V/\delta$", title="what the regularisation gives"
    )
    speed.legend()
    panel_marks.letter(speed, "C")
    return style.save(figure, folder / "figure-04-flap-body")


def _wave(axes: Any, made: Arrays, name: str, title: str, drop: float = 0.0) -> None:
    """Snapshots, each lower than the one before by `drop`."""
    x, y = made[f"{name}/x"], made[f"{name}/y"]
    colours = style.snapshot_colours(x.shape[1])
    for k in range(x.shape[1]):
        axes.plot(x[:, k], y[:, k] - k * drop, color=colours[k], lw=1.3)
        if k % 2 == 0:
            axes.text(
                x[0, k],
                y[0, k] - k * drop,
                str(k + 1),
                fontsize=6,
                color=colours[k],
                ha="right",
                va="top",
            )
    axes.set(title=title, xlabel="x", ylabel="y")
    axes.set_aspect("equal")


def _wave_title(made: Arrays, name: str) -> str:
    return (
        f"d = {made[f'{name}/distance']:.4f}, W = {made[f'{name}/work']:.3f}, d/W = "
        f"{made[f'{name}/efficiency']:.4f}"
    )


def figure_5(made: Arrays, folder: Path) -> list[Path]:
    """Waves with anisotropy 100."""
    figure, axes = style.subplots(2, 1, figsize=(6.5, 4.6))
    for a, name, what in zip(
        axes, ("5A", "5B"), (r"$\mu_f = \mu_b = 100\,\mu_t$", r"$\mu_t = 100\,\mu_f$"), strict=True
    ):
        _wave(a, made, name, f"{what}: {_wave_title(made, name)}")
        panel_marks.letter(a, name[1])
    return style.save(figure, folder / "figure-05-waves-anisotropic")


def figure_6(made: Arrays, folder: Path) -> list[Path]:
    """The same waves, and a standing one, with isotropic friction."""
    figure, axes = style.subplots(1, 3, figsize=(9, 5.2), width_ratios=(0.8, 1.2, 1.2))
    for a, name, drop in zip(axes, ("6A", "6B", "6C"), (0.07, 0.12, 0.12), strict=True):
        _wave(a, made, name, _wave_title(made, name).replace(", d/W", "\nd/W"), drop)
        panel_marks.letter(a, name[1])
    return style.save(figure, folder / "figure-06-waves-isotropic")


def draw_cases(figure_axes: Any, made: Arrays, group: str, names: str) -> None:
    """Worked cases with velocities and forces, one per axes."""
    for axes, name in zip(figure_axes, names, strict=True):
        key = f"{group}/{name}"
        draw_link_fields(
            axes,
            Chain(),
            Friction(),
            made[f"{key}/angles"],
            made[f"{key}/rates"],
            made[f"{key}/z"],
            float(made["delta"]),
        )
        panel_marks.bare(axes)
        degrees = ", ".join(f"{a:.0f}" for a in np.rad2deg(made[f"{key}/angles"]))
        rates = ", ".join(f"{r:g}" for r in made[f"{key}/rates"])
        axes.set_title(f"{name}: angles {degrees} deg, rates {rates}", fontsize=8)


def figure_10(made: Arrays, folder: Path) -> list[Path]:
    """Symmetric cases: fields, and what stays unbalanced as the middle link's one velocity
    varies."""
    figure, axes = style.subplots(2, 3, figsize=(9.5, 5.4), height_ratios=(1.2, 1))
    draw_cases(axes[0], made, "symmetric", "ABC")
    V = made["symmetric_velocity"]
    for a, name in zip(axes[1], "ABC", strict=True):
        below, rest, above = made[f"symmetric/{name}/gap"]
        a.plot(
            V * 1e3,
            made[f"symmetric/{name}/unbalanced"],
            color=style.BLUE,
            ls="--",
            label=r"$\delta = 10^{-4}$",
        )
        kinetic = made[f"symmetric/{name}/kinetic"]
        for side, end in ((V < 0, below), (V > 0, above)):
            at, force = np.append(V[side], 0.0), np.append(kinetic[side], end)
            order = np.argsort(at)
            a.plot(
                at[order] * 1e3,
                force[order],
                color=style.VERMILION,
                label="kinetic" if end == below else None,
            )
        a.plot(0, rest, "o", ms=4, color=style.VERMILION)
        a.axhline(0, color="0.6", lw=0.7)
        couple = name == "C"
        a.set(xlabel=f"middle link: {'rotation rate' if couple else 'velocity'} [1e-3]")
        a.set_ylabel("net torque" if couple else "net force")
    axes[1, 0].legend()
    return style.save(figure, folder / "figure-10-symmetric-cases")


def draw_motion(axes: Any, made: Arrays, name: str, phases: np.ndarray, rows: int) -> None:
    """Snapshots at phases in `rows` rows, in the body's own place but spread out."""
    t, x, y = made[f"{name}/t"], made[f"{name}/x"], made[f"{name}/y"]
    per_row = -(-phases.size // rows)
    for k, phase in enumerate(phases):
        i = int(np.argmin(np.abs(t - phase)))
        cx, cy = x[:, i].mean(), y[:, i].mean()
        ox, oy = 0.75 * (k % per_row), -0.9 * (k // per_row)
        axes.plot(x[:, i] - cx + ox, y[:, i] - cy + oy, color=style.BLACK, lw=1.3)
        for end, colour in enumerate((style.BLACK, style.BLUE, style.VERMILION, style.GREEN)):
            axes.plot(x[end, i] - cx + ox, y[end, i] - cy + oy, "o", ms=2.5, color=colour)
        axes.text(ox, oy - 0.5, f"{phase:.2f}", fontsize=6, ha="center")
    panel_marks.bare(axes)


def draw_lab(axes: Any, made: Arrays, name: str, phases: np.ndarray) -> None:
    """Snapshots where they are in the lab frame, darker later."""
    t, x, y = made[f"{name}/t"], made[f"{name}/x"], made[f"{name}/y"]
    for colour, phase in zip(style.snapshot_colours(phases.size), phases, strict=True):
        i = int(np.argmin(np.abs(t - phase)))
        axes.plot(x[:, i], y[:, i], color=colour, lw=1.6, label=f"{phase:g}")
    axes.legend(
        title="t",
        ncols=len(phases),
        fontsize=6,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.25),
        columnspacing=1,
    )
    axes.set(
        xlabel="x",
        ylabel="y",
        title=f"lab frame, net displacement {np.hypot(x[0, -1], y[0, -1]):.3f}",
    )
    axes.set_aspect("equal")


def draw_speeds(axes: Any, made: Arrays, name: str, until: float) -> None:
    """Speeds of the four link ends against time."""
    keep = made[f"{name}/t"] <= until
    for end, (colour, label) in enumerate(
        zip(
            (style.BLACK, style.BLUE, style.VERMILION, style.GREEN),
            ("tail", "joint 1", "joint 2", "head"),
            strict=True,
        )
    ):
        axes.plot(
            made[f"{name}/t"][keep],
            made[f"{name}/speeds"][end][keep],
            color=colour,
            label=label,
            lw=1.1,
        )
    axes.set(xlabel="t", ylabel="speed of link ends", xlim=(0, until))
    axes.legend(ncols=2)


def figure_12_motion(made: Arrays, folder: Path) -> list[Path]:
    """The two best gaits: end-point speeds, snapshots, lab frame."""
    figure, axes = style.subplots(2, 3, figsize=(10, 5.4), width_ratios=(1, 1.5, 1))
    phases = np.arange(21) / 20
    for row, (name, until, times) in enumerate(
        (("D", 0.5, (0, 0.12, 0.38, 0.5, 1)), ("F", 1.0, (0, 0.2, 0.5, 0.8, 1)))
    ):
        lab_phases = np.array(times)
        draw_speeds(axes[row, 0], made, name, until)
        draw_motion(axes[row, 1], made, name, phases, 3)
        draw_lab(axes[row, 2], made, name, lab_phases)
        panel_marks.letter(axes[row, 0], name)
        panel_marks.letter(axes[row, 2], "E" if name == "D" else "G")
        axes[row, 1].set_title("snapshots (time below)")
    return style.save(figure, folder / "figure-12-best-motions")
