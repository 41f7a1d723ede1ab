"""Motion of a collocated gait at any time, by the scheme's own interpolant."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from colloc.dynamics.collocated import CollocatedPose, whole_turns
from colloc.gaits.gait import finite_array
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.gaits.symmetry import ANTIPODAL, BILATERAL, NONE, reduced
from colloc.mechanics.balance import load_wrench
from colloc.mechanics.bodies import Sliding
from colloc.mechanics.chain import Chain
from colloc.mechanics.inertia import about_centre, checked_mass, turning
from colloc.numerics.mesh import Mesh
from colloc.results.motion import RigidMotion, SampledMotion, rotate
from colloc.transcription.layout import RADIANS, Layout


@dataclass(frozen=True, eq=False)
class CollocatedMotion:
    problem: Problem
    mesh: Mesh
    layout: Layout
    x: np.ndarray
    gait: AnyGait
    delta: float

    def __repr__(self) -> str:
        return (
            f"<CollocatedMotion of {self.problem.name}: sample(t), or Solution.to_xarray with "
            f"units>"
        )

    def sliding(self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray) -> Sliding:
        delta = np.full((1, z.shape[1]), self.delta)
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
        now, body = self.sliding(*self._points), self.problem.body
        force = np.array(now.force)
        if (load := self.problem.regime.pull(self._theta[None])) is not None:
            force += load_wrench(body, body.posture(self._points[0]), load)  # type: ignore[attr-defined]
        if self.problem.froude:
            force -= self._growth
        return now._replace(force=force)

    @property
    def _growth(self) -> np.ndarray:
        """Force and torque about the tail that change the momenta, ``(3, n_point)``."""
        mesh = self.mesh
        momenta = RADIANS * self.x[self.layout.momenta]
        grown = momenta[:, mesh.sites] - momenta[:, mesh.edge_sites[:-1], None]
        growth = np.empty((3, mesh.n_point))
        growth[:, mesh.points] = (
            np.einsum("ij,ckj->cki", np.linalg.inv(mesh.scheme.A), grown) / mesh.h[:, None]
        )
        at_points = np.empty_like(growth)
        at_points[:, mesh.points] = momenta[:, mesh.sites]
        chain, (angles, _, z) = checked_mass(self.problem.body), self._points
        return self.problem.regime.at(self.gait).froude * about_centre(
            chain, angles, growth - turning(z, at_points), -1.0
        )

    @property
    def _theta(self) -> np.ndarray:
        theta = np.empty(self.mesh.n_point)
        theta[self.mesh.points] = self.x[self.layout.theta[0]][self.mesh.sites]
        return theta

    @property
    def rotation(self) -> float:
        """Net rotation over a period [rad], counter-clockwise."""
        problem, theta = self.problem, self.x[self.layout.theta[0]]
        turns = problem.regime.motion_symmetry(problem.gait.symmetry) == NONE
        return float(theta[-1] - theta[0]) + (problem.rotation or 0.0) if turns else 0.0

    def sample(self, t: np.ndarray | float) -> SampledMotion:
        """Motion at phases t; periods follow each other. The centre of mass is at the origin at t =
        0, and the first period's displacement along +x; on a slope +x is straight uphill."""
        t = finite_array("t", np.atleast_1d(t), 1)
        period, phase = np.divmod(t, 1.0)
        problem, body = self.problem, self.problem.body
        symmetry = problem.regime.motion_symmetry(problem.gait.symmetry)
        solved, second = reduced(symmetry, phase)
        z, theta, centre, end = self._interpolate(solved)
        angles, rates = self.gait(phase)
        if symmetry == BILATERAL and isinstance(body, Chain):
            # seen from the head the body repeats itself with reversed rates
            head, heading = body.seen_from_head(
                self.gait.angles(solved), self.gait.rates(solved), z
            )
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
        return SampledMotion(
            t, angles, rates, z, theta, centre, centre - rotate(body.centre(angles), theta)
        )

    def _interpolate(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """z, theta and centre of mass at phases of the solved part, and its displacement."""
        mesh, z_points = self.mesh, self._points[2]
        k = np.clip(np.searchsorted(mesh.edges, t, side="right") - 1, 0, mesh.n - 1)
        tau = (t - mesh.edges[k]) / mesh.h[k]
        pose = CollocatedPose.on_mesh(
            mesh, z_points[2], self.at_points.centre, self.x[self.layout.theta[0, 0]]
        )
        theta, place = pose.at(k, tau)
        z = np.einsum("ts,cts->ct", mesh.scheme.lagrange(tau), z_points[:, mesh.points[k]])
        return (
            z,
            theta,
            np.array([place.real, place.imag]),
            np.array([pose.place[-1].real, pose.place[-1].imag]),
        )
