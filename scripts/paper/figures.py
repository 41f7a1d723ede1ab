"""Every computed figure of the paper, redrawn from the stored parts of
`scripts/reproduce_paper.py`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from colloc.mechanics.balance import instant
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import SMOOTHING, near_contacts
from colloc.mechanics.friction import Friction
from colloc.pictures import style
from scripts.models.ellipses import ellipse_angles
from scripts.paper.study import Arrays, PaperStudy

_ARROWS = 9
"""Arrows on a link."""
_ENDS = {
    "tail": style.BLACK,
    "joint 1": style.BLUE,
    "joint 2": style.VERMILION,
    "head": style.GREEN,
}
_MEASURES = (("distance", "d"), ("work", "W"), ("efficiency", r"$\lambda = d/W$"))


def subplots(
    rows: int = 1, columns: int = 1, *, figsize: tuple[float, float], **options: Any
) -> tuple[Figure, Any]:
    figure = Figure(figsize=figsize)
    return figure, figure.subplots(rows, columns, **options)


def letter(axes: Any, text: str) -> None:
    """A bold panel letter at the upper left, outside the axes."""
    place: Any = {"transform": axes.transAxes, "fontweight": "bold", "va": "bottom", "ha": "right"}
    axes.text(-0.02, 1.02, text, **place)


def bare(axes: Any) -> None:
    """Equal scales, no frame."""
    axes.set_aspect("equal")
    axes.set_axis_off()


def arrows(axes: Any, place: Any, field: Any, scale: float, colour: str) -> None:
    """Arrows of length `scale` times the complex field, in data units."""
    place, field = np.atleast_1d(place), scale * np.atleast_1d(field)
    axes.quiver(
        place.real, place.imag, field.real, field.imag, color=colour, angles="xy",
        scale_units="xy", scale=1, width=0.004, headwidth=4, headlength=5, zorder=3,
    )  # fmt: skip


def link_fields(
    axes: Any, angles: Any, rates: Any, z: Any, fields: str = "vf", length: float = 0.25
) -> None:
    """A body with arrows of velocity ("v") and friction force per length ("f") along its links."""
    body, friction, delta = Chain(), Friction(), 1e-4
    angles, rates, z = (np.asarray(a, dtype=float).reshape(-1, 1) for a in (angles, rates, z))
    now = instant(body, friction, angles, rates, z, delta)
    along, middle = now.posture.cos + 1j * now.posture.sin, now.posture.x + 1j * now.posture.y
    sigma = np.linspace(-0.46, 0.46, _ARROWS) * body.length_column()
    vs, vn = now.velocity.vs + 0 * sigma, now.velocity.vn + now.velocity.w * sigma
    speed = np.sqrt(vs**2 + vn**2 + delta**2)
    for ends in middle + along * body.length_column() * [[-0.5, 0.5]]:
        axes.plot(ends.real, ends.imag, color=style.BLACK, lw=2, solid_capstyle="round", zorder=2)
    for key, field, size, colour in (
        ("v", (vs + 1j * vn) * along, length, style.VELOCITY),
        ("f", -(vs + 1j * vn) / speed * along, 0.12, style.FORCE),
    ):
        if key in fields:
            place = middle + along * sigma
            arrows(axes, place, field, size, colour)
            tips = (place + size * field).ravel()
            axes.plot(tips.real, tips.imag, alpha=0)  # so that the limits include the arrows
    bare(axes)


def figure_3(made: Arrays, folder: Path) -> list[Path]:
    """Force on a plate; velocities and forces on a three-link body, tail held and in balance."""
    figure, axes = subplots(2, 3, figsize=(7.2, 3.6), height_ratios=(1, 1.2))
    for a, (mu_f, mu_t) in zip(axes[0], ((1, 1), (1, 2), (2, 1)), strict=True):
        # at 45 degrees, in uniform horizontal motion
        direction = np.exp(0.25j * np.pi)
        ends, local = direction * np.array([-0.5, 0.5]), np.conj(direction)
        a.plot(ends.real, ends.imag, color=style.BLACK, lw=2)
        arrows(a, 0j, 1 + 0j, 0.7, style.VELOCITY)
        force = -(mu_f * local.real + 1j * mu_t * local.imag) * direction
        arrows(a, 0j, force, 0.5, style.FORCE)
        title = rf"$\mu_f = {mu_f},\ \mu_t = {mu_t}$"
        a.set(xlim=(-1.2, 0.9), ylim=(-0.55, 0.55), title=title)
        bare(a)
    letter(axes[0, 0], "A")
    axes[0, 0].text(0.75, 0.05, "v", color=style.VELOCITY)
    axes[0, 0].text(-0.65, 0.05, "F", color=style.FORCE)
    z, below = made["z"][0], zip(axes[1], "BCD", strict=True)
    for (a, text), velocity, fields, title in zip(
        below,
        (np.zeros(3), z, z),
        "vvf",
        ("tail held", "in balance: velocity", "in balance: friction"),
        strict=True,
    ):
        link_fields(a, made["angles"], made["rates"], velocity, fields, 0.35)
        a.set_title(title)
        letter(a, text)
    return style.save(figure, folder / "figure-03-velocity-and-force")


def figure_4(made: Arrays, folder: Path) -> list[Path]:
    """The flap body: the scene, its unbalanced force against velocity, and what delta gives."""
    body, flap = made["lengths"][:2]
    figure, panels = subplots(1, 3, figsize=(7.4, 2.5), width_ratios=(1.1, 1, 1))
    scene, force, speed = panels
    scene.plot([0, body], [0, 0], color=style.BLACK, lw=2.5)
    for sign in (1, -1):
        for angle, line in ((0.35, "-"), (float(made["example"]), "--"), (1.2, "--")):
            tip = flap * np.exp(1j * sign * angle)
            scene.plot([0, tip.real], [0, tip.imag], line, color=style.BLUE, lw=1.6)
        arc = flap * 1.15 * np.exp(1j * sign * np.linspace(0.4, 1.15, 20))
        tip, before = ((arc[k].real, arc[k].imag) for k in (-1, -4))
        scene.annotate("", tip, before, arrowprops={"arrowstyle": "->"})
        scene.plot(arc.real, arc.imag, color=style.BLACK, lw=0.7)
    scene.set(xlim=(-0.05, body + 0.05), ylim=(-0.18, 0.18), title="two flaps open")
    bare(scene)
    smooth, kinetic = made["example_force"]
    V = made["example_V"] * 1e3
    for side, label in ((V < 0, "kinetic"), (V > 0, None)):
        force.plot(V[side], kinetic[side], color=style.VERMILION, label=label)
    force.plot(V, smooth, color=style.BLUE, ls="--", label=r"$\delta = 10^{-4}$")
    force.axhline(0, color="0.6", lw=0.7)
    force.plot(0, kinetic[V.size // 2], "o", ms=4, color=style.VERMILION)
    force.set(xlabel=r"body velocity $V\ [10^{-3}]$", ylabel="net force")
    force.set_title("no velocity balances it")
    degrees = np.rad2deg(made["openings"])
    speed.plot(degrees, made["limit"], color=style.BLACK, label=r"$f/\sqrt{\ell^2 - f^2}$")
    for power, colour, line in ((-2, style.ORANGE, "--"), (-4, style.SKY, ":")):
        ratio = made["V_over_delta"][list(made["deltas"]).index(10.0**power)]
        speed.plot(degrees, ratio, line, lw=2, color=colour, label=rf"$\delta = 10^{{{power}}}$")
    speed.set(xlabel="opening [degrees]", ylabel=r"$V/\delta$")
    speed.set_title("what the regularisation gives")
    for axes, text in zip(panels, "ABC", strict=True):
        letter(axes, text)
        if axes is not scene:
            axes.legend()
    return style.save(figure, folder / "figure-04-flap-body")


def _wave(axes: Any, made: Arrays, name: str, what: str, drop: float = 0.0) -> None:
    """Snapshots, each lower than the one before by `drop`."""
    x, y = made[f"{name}/x"], made[f"{name}/y"]
    for k, colour in enumerate(style.snapshot_colours(x.shape[1])):
        axes.plot(x[:, k], y[:, k] - k * drop, color=colour, lw=1.3)
        if k % 2 == 0:
            place: Any = {"fontsize": 6, "ha": "right", "va": "top"}
            axes.text(x[0, k], y[0, k] - k * drop, str(k + 1), color=colour, **place)
    d, W, efficiency = (float(made[f"{name}/{k}"]) for k in ("distance", "work", "efficiency"))
    axes.set(title=what.format(f"d = {d:.4f}, W = {W:.3f}", f"d/W = {efficiency:.4f}"))
    axes.set(xlabel="x", ylabel="y")
    axes.set_aspect("equal")
    letter(axes, name[1])


def figure_5(made: Arrays, folder: Path) -> list[Path]:
    """Waves with anisotropy 100."""
    figure, axes = subplots(2, 1, figsize=(6.5, 4.6))
    _wave(axes[0], made, "5A", r"$\mu_f = \mu_b = 100\,\mu_t$: {}, {}")
    _wave(axes[1], made, "5B", r"$\mu_t = 100\,\mu_f$: {}, {}")
    return style.save(figure, folder / "figure-05-waves-anisotropic")


def figure_6(made: Arrays, folder: Path) -> list[Path]:
    """The same waves, and a standing one, with isotropic friction."""
    figure, axes = subplots(1, 3, figsize=(9, 5.2), width_ratios=(0.8, 1.2, 1.2))
    for a, name, drop in zip(axes, ("6A", "6B", "6C"), (0.07, 0.12, 0.12), strict=True):
        _wave(a, made, name, "{}\n{}", drop)
    return style.save(figure, folder / "figure-06-waves-isotropic")


def _admissible_square(nodes: np.ndarray) -> np.ndarray:
    shapes = np.stack(np.meshgrid(nodes, nodes, indexing="ij")).reshape(2, -1)
    excess = np.max([each.excess(shapes)[0] for each in near_contacts(Chain())], axis=0)
    return (excess <= SMOOTHING).reshape(nodes.size, -1)


def _label_angles(axes: Any) -> None:
    ticks, labels = [-np.pi, 0, np.pi], [r"$-\pi$", "0", r"$\pi$"]
    axes.set(xticks=ticks, xticklabels=labels, yticks=ticks, yticklabels=labels)
    axes.set_xlabel(r"$\Delta\theta_1$", labelpad=-2)
    axes.set_ylabel(r"$\Delta\theta_2$", labelpad=-4)


def figure_7(made: Arrays, folder: Path) -> list[Path]:
    """Non-self-intersecting shapes, and the ellipses of the local maxima of the efficiency."""
    figure, axes = subplots(figsize=(6.2, 4.4))
    nodes, t = np.linspace(-np.pi, np.pi, 401), np.linspace(0, 1, 400)
    axes.contourf(nodes, nodes, _admissible_square(nodes).T, levels=[0.5, 1.5], colors=["#e4edf2"])
    colours = (style.BLUE, style.VERMILION, style.PURPLE, style.GREEN, style.ORANGE)
    for gait, efficiency, colour in zip(made["gaits"], made["efficiency"], colours, strict=False):
        angles = ellipse_angles(gait[:, None], t)[0][:, 0]
        axes.plot(*angles, color=colour, label=f"$A_0$ = {abs(gait[0]):.2f}: {efficiency:.4f}")
    axes.plot([-np.pi, np.pi], [np.pi, -np.pi], ":", color="0.5", lw=0.8)
    for shape in ((2.094, 2.094), (np.pi, 1.57), (1.57, np.pi), (0, 0), (1.4, -1.4)):
        joints = np.stack(Chain().joints(np.array(shape)[:, None]))[..., 0]
        drawn = 0.7 * (joints - joints.mean(axis=1, keepdims=True)) + np.array(shape)[:, None]
        axes.plot(*drawn, color=style.BLACK, lw=1.5)
    _label_angles(axes)
    axes.set_aspect("equal")
    axes.set_title("admissible shapes (shaded), locally most efficient ellipses")
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1), title="efficiency")
    return style.save(figure, folder / "figure-07-paths")


def figure_8(made: Arrays, folder: Path) -> list[Path]:
    """Slices of the velocity map on both faces."""
    angles, ratios = made["angles"], made["ratios"]
    chosen = [round(f * (ratios.size - 1)) for f in (0, 0.25, 0.5, 0.75, 1)]
    inside = _admissible_square(angles)[:, :, None]
    figure = Figure(figsize=(9.5, 6.4))
    figure.set_layout_engine("none")
    names = (r"$\dot x_0$", r"$\dot y_0$", r"$\dot\theta_0$")
    a1, a2 = np.meshgrid(angles, angles, indexing="ij")
    for face, component in np.ndindex(2, 3):
        x, y = 0.33 * component, 0.5 * face
        axes: Any = figure.add_axes((x, 0.52 - y, 0.25, 0.43), projection="3d")
        shown = np.where(inside, made["z"][face, component], np.nan)
        low, high = np.nanmin(shown[:, :, chosen]), np.nanmax(shown[:, :, chosen])
        colours = colormaps[style.SEQUENTIAL]((shown - low) / (high - low))
        colours[np.isnan(shown)] = (1, 1, 1, 0)
        for k in chosen:
            axes.plot_surface(
                a1, a2, np.full_like(a1, ratios[k]), facecolors=colours[:, :, k], rstride=1,
                cstride=1, shade=False, linewidth=0, antialiased=False, rasterized=True,
            )  # fmt: skip
        _label_angles(axes)
        axes.set_zlabel(rf"$\dot{{\Delta\theta}}_{2 - face}$", labelpad=-2)
        axes.set_zticks([-1, 0, 1])
        axes.patch.set_visible(False)  # or it covers the colour bar beside it
        axes.set_box_aspect((1, 1, 1.5))
        axes.set_title(rf"{names[component]}, $\dot{{\Delta\theta}}_{1 + face} = 1$", y=1.05)
        bar = figure.add_axes((0.268 + x, 0.58 - y, 0.008, 0.3))
        figure.colorbar(ScalarMappable(Normalize(low, high), style.SEQUENTIAL), cax=bar)
    return style.save(figure, folder / "figure-08-velocity-map")


def _cases(panels: Sequence[Any], made: Arrays, group: str, names: str) -> None:
    """Worked cases with velocities and forces, one per axes."""
    for axes, name in zip(panels, names, strict=True):
        angles, rates, z = (made[f"{group}/{name}/{key}"] for key in ("angles", "rates", "z"))
        link_fields(axes, angles, rates, z)
        degrees = ", ".join(f"{a:.0f}" for a in np.rad2deg(angles))
        moving = ", ".join(f"{r:g}" for r in rates)
        axes.set_title(f"{name}: angles {degrees} deg, rates {moving}", fontsize=8)


def figure_9(made: Arrays, folder: Path) -> list[Path]:
    """Where a link is slower than 1e-3: slices of both spaces, and the worked cases."""
    figure = Figure(figsize=(10, 6.6))
    grid = figure.add_gridspec(4, 6, height_ratios=(1, 1, 0.12, 1.5))
    nodes, ratios = made["angles"], made["ratios"]
    wanted = np.interp((-1, -0.5, -0.05, 0, 0.05, 0.5), ratios, np.arange(ratios.size))
    chosen = np.unique(np.round(wanted).astype(int))
    colours, inside = [style.SKY, style.ORANGE, style.VERMILION], _admissible_square(nodes)
    for face in range(2):
        for column, k in enumerate(chosen):
            axes = figure.add_subplot(grid[face, column])
            axes.contourf(nodes, nodes, inside.T, levels=[0.5, 1.5], colors=["#eef2f4"])
            held = (made[f"speed_{face}"][:, :, k] < made["threshold"]) & inside
            link = np.where(held, made[f"link_{face}"][:, :, k], np.nan)
            axes.pcolormesh(nodes, nodes, link.T, cmap=ListedColormap(colours), vmin=-0.5, vmax=2.5)
            _label_angles(axes)
            axes.set_aspect("equal")
            axes.set_title(rf"$\dot{{\Delta\theta}}_{2 - face} = {ratios[k]:g}$", fontsize=8)
            if column == 0:
                letter(axes, "AB"[face])
    for k, colour in enumerate(colours):
        text: Any = {"color": colour, "fontsize": 9, "fontweight": "bold"}
        figure.text(0.3 + 0.16 * k, 0.385, f"link {k + 1} slow", **text)
    below = grid[3, :].subgridspec(1, 4)
    _cases([figure.add_subplot(below[0, i]) for i in range(4)], made, "worked", "CDEF")
    return style.save(figure, folder / "figure-09-static-friction")


def figure_10(made: Arrays, folder: Path) -> list[Path]:
    """Symmetric cases: fields, and what stays unbalanced as the middle link's one velocity
    varies."""
    figure, axes = subplots(2, 3, figsize=(9.5, 5.4), height_ratios=(1.2, 1))
    _cases(axes[0], made, "symmetric", "ABC")
    V = made["symmetric_velocity"] * 1e3
    for a, name in zip(axes[1], "ABC", strict=True):
        (below, rest, above), smooth, kinetic = (
            made[f"symmetric/{name}/{key}"] for key in ("gap", "unbalanced", "kinetic")
        )
        a.plot(V, smooth, color=style.BLUE, ls="--", label=r"$\delta = 10^{-4}$")
        before = np.append(V[V < 0], 0), np.append(kinetic[V < 0], below)
        after = np.append(0, V[V > 0]), np.append(above, kinetic[V > 0])
        a.plot(*before, color=style.VERMILION, label="kinetic")
        a.plot(*after, color=style.VERMILION)
        a.plot(0, rest, "o", ms=4, color=style.VERMILION)
        a.axhline(0, color="0.6", lw=0.7)
        what = ("rotation rate", "torque") if name == "C" else ("velocity", "force")
        a.set(xlabel=f"middle link: {what[0]} [1e-3]", ylabel=f"net {what[1]}")
    axes[1, 0].legend()
    return style.save(figure, folder / "figure-10-symmetric-cases")


def _stars(axes: Any, gaits: np.ndarray) -> None:
    axes.plot(*gaits[:, 1:].T, "*", color=style.VERMILION, ms=8, clip_on=False)


def figure_11(made: Arrays, found: Arrays, folder: Path) -> list[Path]:
    """Distance, work and efficiency at A0 = 0."""
    figure, axes = subplots(1, 3, figsize=(9.5, 3.1))
    for a, (key, name), text in zip(axes, _MEASURES, "ABC", strict=True):
        field = made[key].T
        drawn = a.contourf(made["A1"], made["B1"], field, levels=20, cmap=style.SEQUENTIAL)
        figure.colorbar(drawn, ax=a, shrink=0.85)
        a.set(xlabel=r"$A_1$", ylabel=r"$B_1$", title=f"{key}, {name}")
        a.set(xlim=(0, np.pi), ylim=(0, 2.3))
        a.plot([0, 2.2], [0, 2.2], ":", color="white", lw=0.8)
        a.set_aspect("equal")
        letter(a, text)
    best = found["gaits"][np.abs(found["gaits"][:, 0]) < 0.05]
    _stars(axes[2], best)
    place: Any = {"xytext": (-10, -12), "textcoords": "offset points", "fontweight": "bold"}
    axes[2].annotate("D", best[0, 1:], color="white", **place)
    return style.save(figure, folder / "figure-11-no-offset")


def figure_12_maps(made: Arrays, found: Arrays, folder: Path) -> list[Path]:
    """Distance, work and efficiency for various A0: slices, the other half being the mirror
    image."""
    wanted = (0.0, 0.55, 1.1, 1.65, 2.2, 2.59)
    slices = [int(np.argmin(np.abs(made["A0"] - a))) for a in wanted]
    margins = {"left": 0.05, "right": 0.92, "bottom": 0.1, "top": 0.93}
    margins |= {"hspace": 0.25, "wspace": 0.1}
    shared: Any = {"sharex": True, "sharey": True, "gridspec_kw": margins}
    figure, axes = subplots(3, len(slices), figsize=(11, 4.8), **shared)
    figure.set_layout_engine("none")  # many axes of equal scale collapse under it
    for row, ((key, name), text) in enumerate(zip(_MEASURES, "ABC", strict=True)):
        levels = np.linspace(0, float(np.nanmax(made[key][slices])), 21)
        for a, k in zip(axes[row], slices, strict=True):
            field = made[key][k].T
            drawn = a.contourf(made["A1"], made["B1"], field, levels=levels, cmap=style.SEQUENTIAL)
            a.set(xlim=(0, np.pi), ylim=(0, 2.3))
            a.set_aspect("equal")
            if row == 0:
                a.set_title(f"$A_0$ = {made['A0'][k]:.2f}")
            if row == 2:
                a.set_xlabel(r"$A_1$")
                _stars(
                    a, found["gaits"][np.abs(np.abs(found["gaits"][:, 0]) - made["A0"][k]) < 0.06]
                )
        axes[row, 0].set_ylabel(r"$B_1$")
        letter(axes[row, 0], text)
        bar: Any = {"fraction": 0.02, "pad": 0.01, "ticks": MaxNLocator(4)}
        figure.colorbar(drawn, ax=axes[row], label=name, **bar)
    return style.save(figure, folder / "figure-12-maps-with-offset")


def figure_12_motion(made: Arrays, folder: Path) -> list[Path]:
    """The two best gaits: speeds of link ends, snapshots in the body's own place but spread out,
    and where they are in the lab frame, darker later."""
    figure, axes = subplots(2, 3, figsize=(10, 5.4), width_ratios=(1, 1.5, 1))
    for (speeds, motion, lab), name, after, until, times in zip(
        axes, "DF", "EG", (0.5, 1.0), ((0, 0.12, 0.38, 0.5, 1), (0, 0.2, 0.5, 0.8, 1)), strict=True
    ):
        t, speed, x, y = (made[f"{name}/{key}"] for key in ("t", "speeds", "x", "y"))
        keep = t <= until
        for (label, colour), of_end in zip(_ENDS.items(), speed, strict=True):
            speeds.plot(t[keep], of_end[keep], color=colour, label=label, lw=1.1)
        speeds.set(xlabel="t", ylabel="speed of link ends", xlim=(0, until))
        speeds.legend(ncols=2)
        for k in range(21):
            i = int(np.argmin(np.abs(t - k / 20)))
            ox, oy = 0.75 * (k % 7), -0.9 * (k // 7)
            px, py = x[:, i] - x[:, i].mean() + ox, y[:, i] - y[:, i].mean() + oy
            motion.plot(px, py, color=style.BLACK, lw=1.3)
            motion.scatter(px, py, s=6, c=list(_ENDS.values()), zorder=3)
            motion.text(ox, oy - 0.5, f"{k / 20:.2f}", fontsize=6, ha="center")
        bare(motion)
        motion.set_title("snapshots (time below)")
        for colour, phase in zip(style.snapshot_colours(len(times)), times, strict=True):
            i = int(np.argmin(np.abs(t - phase)))
            lab.plot(x[:, i], y[:, i], color=colour, lw=1.6, label=f"{phase:g}")
        place: Any = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.25), "columnspacing": 1}
        lab.legend(title="t", ncols=len(times), fontsize=6, **place)
        lab.set(xlabel="x", ylabel="y")
        lab.set_title(f"lab frame, net displacement {np.hypot(x[0, -1], y[0, -1]):.3f}")
        lab.set_aspect("equal")
        letter(speeds, name)
        letter(lab, after)
    return style.save(figure, folder / "figure-12-best-motions")


def _stages(axes: Any, made: Arrays, name: str, times: Any, drop: complex) -> None:
    """Snapshots, each shifted by `drop` from the one before."""
    t, x, y = (made[f"{name}/{key}"] for key in ("t", "x", "y"))
    for row, (time, colour) in enumerate(
        zip(times, style.snapshot_colours(len(times)), strict=True)
    ):
        k = int(np.argmin(np.abs(t - time)))
        z = x[:, k] + 1j * y[:, k] + row * drop
        axes.plot(z.real, z.imag, color=colour, lw=1.5)
        label: Any = {"fontsize": 7, "ha": "right"}
        axes.text(z.real.min() - 0.02, z.imag.mean(), f"{t[k]:.2f}", **label)
    bare(axes)


def figure_13(made: Arrays, folder: Path) -> list[Path]:
    """Snapshots, work and distance, efficiency, and the crawler with two bumps."""
    figure = Figure(figsize=(10, 6.2))
    grid = figure.add_gridspec(2, 3, width_ratios=(1.1, 1, 1.1))
    panels = [figure.add_subplot(grid[k]) for k in ((0, 0), (1, 0), (0, 1), (1, 1))]
    panels.append(figure.add_subplot(grid[:, 2]))
    first, second, work, efficiency, two_bumps = panels
    for axes, text in zip(panels, "ABCDE", strict=True):
        letter(axes, text)
    one, two, epsilon = "isotropic", "transverse easiest", made["epsilon"]
    _stages(first, made, one, np.arange(7) / 12, -0.09j)
    first.set_title("first half-period")
    _stages(second, made, one, np.arange(3, 7) / 6, -0.09j)
    second.set_title("second half-period")
    outer, inner, d = (made[f"{one}/{key}"] for key in ("W_outer", "W_inner", "d"))
    for value, label, form, colour in (
        (outer, "work outside", "x-", style.VERMILION),
        (inner, "work inside", "s-", style.BLUE),
        (d, "distance", "^-", style.GREEN),
        (inner + outer, "total work", "o:", style.BLACK),
    ):
        work.loglog(epsilon, value, form, color=colour, label=label, ms=4, lw=1)
    work.loglog(epsilon, epsilon**2, "--", color="0.5", lw=0.8, label=r"$\epsilon^2$")
    for name, label, form, colour in (
        (one, "isotropic", "o-", style.BLACK),
        ("forward easiest", r"$\mu_f$ smallest", "^-", style.ORANGE),
        (two, r"$\mu_t$ smallest, two bumps", "s-", style.SKY),
    ):
        values, errors = made[f"{name}/efficiency"], made[f"{name}/error_efficiency"]
        how: Any = {"fmt": form, "color": colour, "label": label, "ms": 4, "lw": 1, "capsize": 2}
        efficiency.errorbar(epsilon, values / made[f"{name}/bound"], errors, **how)
    efficiency.axhline(1, color="0.6", lw=0.7)
    efficiency.set(ylabel=r"efficiency $\times \min(\mu)$", xscale="log")
    for axes in (work, efficiency):
        axes.set_xlabel(r"$\epsilon$")
        axes.legend()
    # this crawler lies across its path, which goes along x
    _stages(two_bumps, made, two, np.arange(5) / 4, 0.25 + 0j)
    two_bumps.set_title("two bumps, moving sideways")
    return style.save(figure, folder / "figure-13-crawlers")


FIGURES: tuple[tuple[Callable[..., list[Path]], tuple[str, ...]], ...] = (
    (figure_3, ("instant",)),
    (figure_4, ("flap",)),
    (figure_5, ("waves",)),
    (figure_6, ("waves",)),
    (figure_7, ("optima",)),
    (figure_8, ("connection",)),
    (figure_9, ("static",)),
    (figure_10, ("static",)),
    (figure_11, ("plane", "optima")),
    (figure_12_maps, ("sweep", "optima")),
    (figure_12_motion, ("motions",)),
    (figure_13, ("crawlers",)),
)
"""Each figure, and the parts whose arrays it takes in this order."""


def draw_all(study: PaperStudy, folder: Path) -> list[Path]:
    """Draw all figures whose parts are finished, and return the files written."""
    paths: list[Path] = []
    with style.figure_style():
        for draw, parts in FIGURES:
            if all(study.finished(part) for part in parts):
                paths += draw(*(study.arrays(part) for part in parts), folder)
    return paths
