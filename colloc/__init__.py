"""colloc: direct-collocation optimisation of sliding locomotion under Coulomb friction.

Conventions, stated once
------------------------
Units: body length 1, mass 1, period 1 unless a gait states otherwise; forces in units of the weight, so friction
coefficients are forces per weight, work is in weight x length, speeds in lengths per period, angles in radians.

Frames: the *body frame* has the tail at its origin and the tail link along +x. ``(u, v, omega)`` is the velocity of the
tail in that frame. The *lab frame* is fixed; ``theta`` is the angle of the tail link in it.

Order: links and joints are counted from tail to head. Joint angles are the paper's Delta-theta: each link's tangent
angle less that of the link behind it, positive counter-clockwise. Arrays are ``(n_body, n_time)``.

Names: ``s`` arc length, ``t`` time, ``delta`` regularisation speed of friction, ``epsilon`` half-width of the bump of a
concertina crawler, ``mu_t, mu_f, mu_b`` transverse, forward and backward friction coefficient, ``d`` distance per
period, ``W`` work per period against friction, ``efficiency`` = d/W (lambda in the paper).

The paper: S. Alben, "Efficient sliding locomotion with isotropic friction" (2019).
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from colloc.system.late_binding import bind

if TYPE_CHECKING:
    from colloc.gaits.free_path import ArcPath, FreePath
    from colloc.gaits.harmonic import Fourier, Harmonic, ellipse
    from colloc.gaits.objective import Objective
    from colloc.gaits.polygon import Corners, Polygon
    from colloc.gaits.problem import Problem
    from colloc.gaits.problem_file import Reference, load_problem
    from colloc.gaits.relaxed import Relaxed
    from colloc.laws.elliptic import Elliptic
    from colloc.laws.own_law import OwnLaw
    from colloc.laws.power_law import PowerLaw
    from colloc.laws.viscous import Viscous
    from colloc.mechanics.actuators import ActuatorLimits
    from colloc.mechanics.chain import Chain
    from colloc.mechanics.fixed_point import solve_balance
    from colloc.mechanics.friction import Friction
    from colloc.results.solution import Solution
    from colloc.results.store import load, save
    from colloc.search.certify import certify
    from colloc.smooth.concertina import Concertina
    from colloc.smooth.crawler_body import CrawlerBody
    from colloc.smooth.modal_body import ModalBody
    from colloc.smooth.prescribed_body import Wave
    from colloc.studies.calls import Starts, multistart, solve, sweep
    from colloc.studies.pareto import pareto_front
    from colloc.studies.study import Axis, Study
    from colloc.system.errors import CollocError, NotConvergedError, ProblemError, StoreError
    from colloc.verification.heading_map import heading_map
    from colloc.verification.replay import replay
    from colloc.verification.slope import slope_motion

_HOME = {
    "gaits.problem": ("Problem",),
    "gaits.problem_file": ("Reference", "load_problem"),
    "gaits.objective": ("Objective",),
    "mechanics.chain": ("Chain",),
    "mechanics.actuators": ("ActuatorLimits",),
    "smooth.modal_body": ("ModalBody",),
    "smooth.concertina": ("Concertina",),
    "smooth.crawler_body": ("CrawlerBody",),
    "smooth.prescribed_body": ("Wave",),
    "mechanics.friction": ("Friction",),
    "laws.elliptic": ("Elliptic",),
    "laws.viscous": ("Viscous",),
    "laws.power_law": ("PowerLaw",),
    "laws.own_law": ("OwnLaw",),
    "gaits.harmonic": ("Harmonic", "Fourier", "ellipse"),
    "gaits.free_path": ("FreePath", "ArcPath"),
    "gaits.polygon": ("Polygon", "Corners"),
    "gaits.relaxed": ("Relaxed",),
    "studies.calls": ("solve", "multistart", "Starts", "sweep"),
    "studies.study": ("Study", "Axis"),
    "studies.pareto": ("pareto_front",),
    "results.solution": ("Solution",),
    "results.store": ("load", "save"),
    "search.certify": ("certify",),
    "verification.replay": ("replay",),
    "verification.slope": ("slope_motion",),
    "verification.heading_map": ("heading_map",),
    "mechanics.fixed_point": ("solve_balance",),
    "system.errors": ("CollocError", "NotConvergedError", "ProblemError", "StoreError"),
}
"""Where the public names live, in the order of use; each is imported when it is first used."""

__all__ = [
    "ActuatorLimits",
    "ArcPath",
    "Axis",
    "Chain",
    "CollocError",
    "Concertina",
    "Corners",
    "CrawlerBody",
    "Elliptic",
    "Fourier",
    "FreePath",
    "Friction",
    "Harmonic",
    "ModalBody",
    "NotConvergedError",
    "Objective",
    "OwnLaw",
    "Polygon",
    "PowerLaw",
    "Problem",
    "ProblemError",
    "Reference",
    "Relaxed",
    "Solution",
    "Starts",
    "StoreError",
    "Study",
    "Viscous",
    "Wave",
    "certify",
    "ellipse",
    "heading_map",
    "load",
    "load_problem",
    "multistart",
    "pareto_front",
    "replay",
    "save",
    "slope_motion",
    "solve",
    "solve_balance",
    "sweep",
]

# what a solution offers and packages above it do
bind(
    {
        "card": "colloc.pictures.solution_card:solution_card",
        "plot": "colloc.pictures.solution_figure:solution_figure",
        "animate": "colloc.pictures.movie:write_movie",
        "report": "colloc.pictures.report_page:write_report",
        "plot_front": "colloc.pictures.front_figure:front_figure",
    }
)


def __dir__() -> list[str]:
    """Also the public names that nobody has used yet."""
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> object:
    """Import a public name when it is first used, so that the NumPy part never loads CasADi."""
    for module, names in _HOME.items():
        if name in names:
            return getattr(importlib.import_module(f"colloc.{module}"), name)
    raise AttributeError(f"module 'colloc' has no attribute {name!r}")
