"""What a search tells and leaves: how far it has come, the levels of its continuation, and the other gaits that it met."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.gaits.gait_fields import AnyGait

REDUCED, PRESCRIBED, REALISED = "reduced", "prescribed", "realised"


@dataclass(frozen=True, eq=False)
class Level:
    """One converged or failed step of the continuation.

    Attributes
    ----------
    delta : float
        Regularisation speed, in the units of the problem's class of gaits: per period, or at unit shape speed.
    edges : (n_interval + 1,)
        The mesh, in phases of the gait found.
    x, lam_x : (n,)
        Variables (see `colloc.collocation.layout`) and multipliers of their bounds; work and forces are in units of
        `colloc.gaits.friction_unit`.
    lam_g : (m,)
        Multipliers of the constraints.
    efficiency, distance, work : float
        Over one whole period, as collocation sees them.
    kkt_error, violation, complementarity : float
        Measured first-order conditions, in units of the friction, otherwise unscaled.
    status : str
        The optimiser's own word.
    optimal : bool
        Whether the first-order conditions hold.
    iterations : int
    seconds, evaluation_seconds : float
    scheme : str
        Collocation scheme, which refinement may have raised in order; "" for the problem's.
    objective : float
        Value of the problem's objective, where that is not the efficiency.
    program : str
        What was solved: "reduced" by SQP, with every other variable following from the gait, or by IPOPT the problem's
        formulation; "prescribed" where nothing is free, "realised" where a gait stands for a relaxed one.
    knots : (n_arc + 1,), optional
        Phases where the arcs of a free path meet; they are among the edges. By default they are the edges.
    panels : int
        Of the body's quadrature, which refinement may have doubled; 0 for the problem's.
    """

    delta: float
    edges: np.ndarray
    x: np.ndarray
    lam_x: np.ndarray
    lam_g: np.ndarray
    efficiency: float
    distance: float
    work: float
    kkt_error: float
    violation: float
    complementarity: float
    status: str
    optimal: bool
    iterations: int
    seconds: float
    evaluation_seconds: float
    scheme: str = ""
    program: str = REDUCED
    knots: np.ndarray | None = None
    objective: float = float("nan")
    panels: int = 0

    @property
    def value(self) -> float:
        """Of the problem's objective."""
        return self.efficiency if np.isnan(self.objective) else self.objective

    def __repr__(self) -> str:
        verdict = "" if self.optimal else f", {self.status}"
        size = f"{self.x.size} variables"
        return f"<Level at delta = {self.delta:.1e}: d/W = {self.efficiency:.6g}, {self.program}, {size}{verdict}>"


@dataclass(frozen=True)
class SearchStep:
    """How far a search over many starts has come.

    Attributes
    ----------
    what : str
        What is counted: "starts" tried on a coarse mesh, or "gaits" followed to the final delta.
    done, count : int
        Gaits may be followed for less than their count: those of finite size only until one is found.
    efficiency : float
        Of the best gait so far, as collocation sees it; NaN before there is one.
    delta : float
        At which that is; NaN before.
    """

    what: str
    done: int
    count: int
    efficiency: float
    delta: float

    def __str__(self) -> str:
        best = f"; best d/W = {self.efficiency:.4f} at delta = {self.delta:.0e}" if self.delta > 0 else ""
        return f"{self.done} of {self.count} {self.what}{best}"


@dataclass(frozen=True, eq=False)
class Alternative:
    """A gait that a search over many starts met.

    Attributes
    ----------
    value : float
        Of the objective, as collocation sees it on a coarse mesh, which may be a little more than a fine one would.
    delta : float
        To which it was followed.
    starts : int
        How many led to it.
    on_speed_floor : bool
        Whether the bound on the shape speed decided its size.
    gait : AnyGait
    """

    value: float
    delta: float
    starts: int
    on_speed_floor: bool
    gait: AnyGait

    def __str__(self) -> str:
        size = ", as small as its bound allows" if self.on_speed_floor else ""
        return f"{self.value:.4f} at delta {self.delta:.0e} ({self.starts} start{'s' * (self.starts > 1)}{size})"
