"""The answer of a search: a gait as a point of its full program, with its history and motion."""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from colloc.dynamics.collocated import CollocatedPose, whole_turns
from colloc.dynamics.control_problem import control_problem
from colloc.gaits.gait import ANTIPODAL, BILATERAL, NONE, delta_per_period, solved_phases
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.mechanics.balance import load_wrench
from colloc.mechanics.bodies import Sliding
from colloc.mechanics.chain import Chain
from colloc.mechanics.inertia import about_centre, checked_mass, turning
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.results.motion import RigidMotion, SampledMotion, rotate
from colloc.system.arguments import finite_array
from colloc.transcription.layout import RADIANS, Layout, layout_of

REDUCED, PRESCRIBED, EVALUATED = "reduced", "prescribed", "evaluated"


@dataclass(frozen=True)
class Step:
    """An iterate of a search, as a line of a table, with totals of a period as collocated."""

    delta: float  # in the units of the class of gaits
    intervals: int
    value: float  # of the objective
    distance: float
    work: float
    kkt_error: float
    optimal: bool  # whether the first-order conditions hold to the tolerance of the step
    status: str
    iterations: int
    seconds: float
    program: str = REDUCED  # or the problem's formulation as solved by IPOPT


@dataclass(frozen=True)
class SecondOrder:
    """Smallest curvature of the Lagrangian over the value of the objective [1/rad^2], and its
    error; infinite if no direction is free, NaN (`why_not`) if it was not measured."""

    smallest: float
    error: float
    n_free: int
    why_not: str = ""


NOT_MEASURED = SecondOrder(np.nan, np.nan, 0, "nothing is free in a prescribed motion")


@dataclass(frozen=True, eq=False)
class Answer:
    """A gait as a point of the full direct-collocation program of its problem, with first-order
    conditions in units of the friction, otherwise unscaled."""

    problem: Problem  # as it was solved: the body on its panels, at the final delta
    gait: AnyGait
    delta: float  # in the units of the problem's class of gaits
    edges: np.ndarray  # of the mesh, in phases of the gait, (n_interval + 1,)
    scheme: str
    x: np.ndarray  # variables of the motion (`colloc.transcription.layout`), (n,)
    lam_x: np.ndarray  # multipliers of their bounds, (n,)
    lam_g: np.ndarray  # multipliers of the constraints, (m,)
    value: float  # of the objective, as collocation sees it, like distance and work of a period
    distance: float
    work: float
    kkt_error: float
    violation: float
    complementarity: float
    status: str
    optimal: bool  # whether the first-order conditions hold
    iterations: int
    seconds: float
    program: str = REDUCED  # where the conditions were measured; else the problem's formulation
    second_order: SecondOrder = NOT_MEASURED
    message: str = ""  # what does not hold, or holds in a way that should be told
    history: tuple[Step, ...] = ()  # how the search came here; the last step is the answer itself

    def __repr__(self) -> str:
        verdict = "" if self.optimal else f", {self.status}"
        size, at = f"{self.x.size} variables", f"delta = {self.delta:.1e}"
        return f"<Answer at {at}: {self.value:.6g}, {self.program}, {size}{verdict}>"

    @property
    def efficiency(self) -> float:
        """Distance over work, as collocation sees them."""
        return self.distance / self.work

    @property
    def step(self) -> Step:
        names = [each.name for each in fields(Step) if each.name != "intervals"]
        return Step(intervals=self.edges.size - 1, **{name: getattr(self, name) for name in names})

    @cached_property
    def mesh(self) -> Mesh:
        return Mesh(scheme(self.scheme), self.edges)

    @cached_property
    def layout(self) -> Layout:
        return layout_of(control_problem(self.problem), self.mesh)

    @cached_property
    def delta_per_period(self) -> float:
        return delta_per_period(self.problem.gait, self.gait, self.delta)

    # its motion at any time, by the scheme's own interpolant
    def sliding(self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray) -> Sliding:
        delta = np.full((1, z.shape[1]), self.delta_per_period)
        return self.problem.body.sliding(self.problem.law, angles, rates, z, delta)

    @cached_property
    def _points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        angles, rates = self.gait(self.mesh.times)
        unit: float | np.ndarray = RADIANS
        if self.problem.gait.relative_delta:  # the gait has another pace than the variables
            unit = self.gait.length / self.layout.shape_speed(self.x)
        return angles, rates, unit * self.layout.tail_velocity(self.problem.body, self.x)

    @cached_property
    def at_points(self) -> Sliding:
        """The body at the collocation points; its force is the residual of the balance."""
        problem, mesh, (angles, rates, z) = self.problem, self.mesh, self._points
        body, now = problem.body, self.sliding(angles, rates, z)
        force, theta = np.array(now.force), np.empty(mesh.n_point)
        theta[mesh.points] = self.x[self.layout.theta[0]][mesh.sites]
        if (load := problem.regime.pull(theta[None])) is not None:
            force += load_wrench(body, body.posture(angles), load)  # type: ignore[attr-defined]
        if problem.froude:  # less what changes the momenta
            momenta = RADIANS * self.x[self.layout.momenta]
            grown = momenta[:, mesh.sites] - momenta[:, mesh.edge_sites[:-1], None]
            growth, at_points = np.empty((2, 3, mesh.n_point))
            inverse = np.linalg.inv(mesh.scheme.A)
            growth[:, mesh.points] = np.einsum("ij,ckj->cki", inverse, grown) / mesh.h[:, None]
            at_points[:, mesh.points] = momenta[:, mesh.sites]
            growth -= turning(z, at_points)
            change = about_centre(checked_mass(body), angles, growth, -1.0)
            force -= problem.regime.at(self.gait).froude * change
        return now._replace(force=force)

    @property
    def rotation(self) -> float:
        """Net rotation over a period [rad], counter-clockwise."""
        problem, theta = self.problem, self.x[self.layout.theta[0]]
        turns = problem.regime.motion_symmetry(problem.gait.symmetry) == NONE
        return float(theta[-1] - theta[0]) + (problem.rotation or 0.0) if turns else 0.0

    def sample(self, t: np.ndarray | float) -> SampledMotion:
        """Motion at phases t; periods follow each other. The centre of mass is at the origin at t =
        0, and the first period's displacement along +x, or its mean circle if it is asked to turn;
        on a slope +x is straight uphill."""
        t = finite_array("t", np.atleast_1d(t), 1)
        period, phase = np.divmod(t, 1.0)
        problem, body = self.problem, self.problem.body
        symmetry = problem.regime.motion_symmetry(problem.gait.symmetry)
        solved, second = solved_phases(symmetry, phase)  # phases of the solved part
        mesh, z_points = self.mesh, self._points[2]
        (k, tau), theta_0 = mesh.locate(solved), self.x[self.layout.theta[0, 0]]
        pose = CollocatedPose.on_mesh(mesh, z_points[2], self.at_points.centre, theta_0)
        theta, place = pose.at(k, tau)
        z = np.einsum("ts,cts->ct", mesh.scheme.lagrange(tau), z_points[:, mesh.points[k]])
        centre = np.array([place.real, place.imag])
        end = np.array([pose.place[-1].real, pose.place[-1].imag])  # its displacement
        angles, rates = self.gait(phase)
        if symmetry == BILATERAL and isinstance(body, Chain):
            # seen from the head the body repeats itself with reversed rates
            q, r = self.gait(solved)
            head, heading = body.seen_from_head(q, r, z)
            z = np.where(second, head, z)
            theta = np.where(second, theta + heading, theta)
            centre = np.where(second, 2 * end[:, None] - centre, centre)
            end = 2 * end
        elif symmetry == ANTIPODAL:
            mirror, x_theta = np.array([[1.0], [-1.0], [-1.0]]), self.x[self.layout.theta[0]]
            z = np.where(second, mirror * z, z)
            theta = np.where(second, whole_turns(x_theta[0], x_theta[-1]) - theta, theta)
            centre = np.where(second, end[:, None] + np.array([[1.0], [-1.0]]) * centre, centre)
            end = np.array([2 * end[0], 0.0])
        before = RigidMotion(self.rotation, complex(*end)).repeat(period)
        theta, centre = theta + before.rotation, before.of(centre)
        tail = centre - rotate(body.centre(angles), theta)
        return SampledMotion(t, angles, rates, z, theta, centre, tail)


@dataclass(frozen=True, eq=False)
class Alternative:
    """A distinct gait that starts met; its value is that on a coarse mesh."""

    value: float
    delta: float
    starts: int
    on_speed_floor: bool
    gait: AnyGait

    def __str__(self) -> str:
        size = ", as small as its bound allows" if self.on_speed_floor else ""
        met = f"{self.starts} start{'s' * (self.starts > 1)}"
        return f"{self.value:.4f} at delta {self.delta:.0e} ({met}{size})"
