"""colloc: direct-collocation optimisation of sliding locomotion under Coulomb friction.

Conventions, stated once
------------------------
Units: body length 1, mass 1, period 1 unless a gait states otherwise; forces in units of the
weight, so friction coefficients are forces per weight, work is in weight x length, speeds in
lengths per period, angles in radians.

Frames: the *body frame* has the tail at its origin and the tail link along +x. ``(u, v, omega)`` is
the velocity of the tail in that frame. The *lab frame* is fixed; ``theta`` is the angle of the tail
link in it.

Order: links and joints are counted from tail to head. Joint angles are the paper's Delta-theta:
each link's tangent angle less that of the link behind it, positive counter-clockwise. Arrays are
``(n_body, n_time)``.

Names: ``s`` arc length, ``t`` time, ``delta`` regularisation speed of friction, ``epsilon``
half-width of the bump of a concertina crawler, ``mu_t, mu_f, mu_b`` transverse, forward and
backward friction coefficient, ``d`` distance per period, ``W`` work per period against friction,
``efficiency`` = d/W (lambda in the paper).

The paper: S. Alben, "Efficient sliding locomotion with isotropic friction" (2019).
"""

from __future__ import annotations

import ast
import functools
import importlib
from collections.abc import Callable
from pathlib import Path
from types import FunctionType

from colloc.system.late_binding import bind
from colloc.system.versions import version_of

_HOME = {
    alias.name: node.module
    for node in ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body
    if isinstance(node, ast.ImportFrom) and node.module
    for alias in node.names
}
"""Public name to the module where it lives, as the stub beside this file states it."""
__all__ = sorted(_HOME)
_GONE = {
    "FreePath": "take BSpline(knots=24), which has better gaits than paths of bounded curvature "
    "(docs/gait_classes.md).",
    "ArcPath": "gaits are Fourier series, splines (BSpline(...).member) or polygons (Corners).",
    "Relaxed": "take Polygon(n) with many corners, which come as near as one likes "
    "(docs/known.md).",
    "known": "the table of known gaits is a benchmark: python -m benchmarks.referee checks it "
    "(docs/known.md).",
    "heading_map": "colloc.slope_motion and a root finder find headings that last "
    "(docs/howto/slopes.md).",
}
"""Public names there were, and what to write instead."""

# what a solution offers and packages above it do
bind(
    {
        "card": "colloc.pictures.solution_card:solution_card",
        "plot": "colloc.pictures.solution_figure:solution_figure",
        "plot_panel": "colloc.pictures.publication:draw_panel",
        "animate": "colloc.pictures.movie:write_movie",
        "report": "colloc.pictures.report_page:write_report",
        "robot": "colloc.results.robot:Robot",
        "plot_robot": "colloc.pictures.robot_figure:robot_figure",
        "plot_robot_panel": "colloc.pictures.robot_figure:draw_robot",
        "sensitivity": "colloc.search.sensitivity:sensitivity",
        "export": "colloc.pictures.export:write_export",
        "plot_steering": "colloc.pictures.steering_figure:steering_figure",
        "plot_steering_panel": "colloc.pictures.steering_figure:draw_steering",
        "plot_front": "colloc.pictures.front_figure:front_figure",
        "plot_front_values": "colloc.pictures.front_figure:draw_front",
    }
)


@functools.cache
def _checked(function: Callable[..., object]) -> Callable[..., object]:
    """A public function that checks its arguments, and is found here where other processes ask for
    it."""
    from colloc.system.arguments import checked_arguments

    checked = checked_arguments(function)
    checked.__module__ = __name__
    return checked


def __dir__() -> list[str]:
    """The public names, also those that nobody has used yet, and no others but those with two
    underscores."""
    return sorted({*__all__, "__version__", *(name for name in globals() if name.startswith("__"))})


def __getattr__(name: str) -> object:
    """Import a public name when it is first used, so that the NumPy part never loads CasADi."""
    if name in _HOME:
        found = getattr(importlib.import_module(_HOME[name]), name)
        return _checked(found) if isinstance(found, FunctionType) else found
    if name == "__version__":
        return version_of("colloc")
    if name in _GONE:
        from colloc.system.errors import ProblemError

        raise ProblemError(f"colloc.{name} is gone: {_GONE[name]}")
    raise AttributeError(f"module 'colloc' has no attribute {name!r}")
