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
backward friction coefficient, ``d`` distance per cycle, ``W`` work per cycle against friction,
``efficiency`` = d/W (lambda in the paper).

The paper: S. Alben, "Efficient sliding locomotion with isotropic friction" (2019).
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable
from types import FunctionType

_NAMES = {
    "gaits.problem": "Problem",
    "gaits.problem_file": "Reference load_problem",
    "gaits.objective": "Objective",
    "mechanics.chain": "Chain",
    "gaits.coupled": "Coupled",
    "mechanics.floor_contact": "Foot Pad Wheel",
    "mechanics.densities": "PathLimit Quantity",
    "smooth.smooth_body": "Concertina CrawlerBody ModalBody Wave",
    "mechanics.friction": "Friction Axle",
    "laws.resistance": "Elliptic PowerLaw Viscous",
    "laws.own_law": "OwnLaw fitted_friction FittedFriction",
    "gaits.harmonic": "Harmonic Fourier Serpenoid ellipse",
    "gaits.regime": "Free",
    "gaits.robot": "Robot",
    "gaits.bspline": "BSpline Basis Corners Polygon",
    "studies.solve": "solve multistart Starts",
    "studies.sweep": "sweep",
    "studies.study": "Study Axis",
    "studies.families": "pareto_front steer",
    "results.solution": "Solution",
    "results.store": "load save",
    "pictures.export": "Servo",
    "search.evaluate": "evaluate identify",
    "search.certify": "certify",
    "verification.replay": "replay",
    "verification.differential_motion": "slope_motion motion_from_rest",
    "dynamics.dynamics": "slow_enough",
    "mechanics.fixed_point": "solve_balance",
    "system.errors": "CollocError NotConvergedError ProblemError StoreError",
}
"""Module to the public names that live there (`__init__.pyi` says the same to type checkers)."""
_HOME = {name: f"colloc.{module}" for module, names in _NAMES.items() for name in names.split()}
__all__ = sorted(_HOME)


@functools.cache
def _check_arguments(function: Callable[..., object]) -> Callable[..., object]:
    from colloc.system.arguments import checked_arguments

    checked = checked_arguments(function)
    checked.__module__ = __name__  # where other processes find it
    return checked


def __dir__() -> list[str]:
    return sorted({*__all__, "__version__", *(name for name in globals() if name.startswith("__"))})


def __getattr__(name: str) -> object:
    # PEP 562: imported on first use, so that the NumPy part never loads CasADi
    if name in _HOME:
        value = getattr(importlib.import_module(_HOME[name]), name)
        return _check_arguments(value) if isinstance(value, FunctionType) else value
    if name == "__version__":
        from colloc.system.environment import version_of

        return version_of("colloc")
    raise AttributeError(f"module 'colloc' has no attribute {name!r}")
