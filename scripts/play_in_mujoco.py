"""Play a gait in MuJoCo beside colloc's own motion: python -m scripts.play_in_mujoco
results/three_link.h5 [--froude .002 .05]

MuJoCo is the multibody mechanics: its mass matrix, bias forces and Jacobians, of the model that
``colloc export --format mjcf`` writes. Joints follow the gait exactly (their accelerations are
given, the tail's are solved for), contacts are off, and the law of friction acts at points: Gauss
points of every link, or its feet. The equations of motion are integrated by LSODA over periods
until all are alike, in units of body length, mass and period. What colloc says of the same motion,
with its own equations, friction in closed form and its own integrator, stands beside it.

``--contacts`` adds the file as it is exported: servos, gravity, and MuJoCo's contacts, whose
friction is elliptic. ``--film`` writes that as a GIF. Needs ``pip install colloc[engines]``.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

import colloc
from colloc import Chain, Problem
from colloc.commands.main import OK, run
from colloc.mechanics.inertia import checked_mass
from colloc.mechanics.law import Law
from colloc.pictures.export import mjcf
from colloc.results.solution import Solution
from colloc.system.errors import CollocError

if sys.platform == "linux" and not os.environ.get("DISPLAY"):
    os.environ.setdefault("MUJOCO_GL", "egl")  # draws without a screen
try:
    import mujoco
except ImportError:
    sys.exit("colloc: this needs MuJoCo, which is not installed: pip install 'colloc[engines]'.")
except AttributeError:
    sys.exit(
        "colloc: MuJoCo cannot draw with the OpenGL that MUJOCO_GL names: set another one, or none."
    )

FROUDE = (0.002, 0.005, 0.02, 0.05, 0.15, 0.4)
POINTS, DELTA, TOLERANCE, MOST_PERIODS, ALIKE = 100, 1e-2, 1e-8, 40, 1e-5
"""Gauss points a link; regularisation, coarse enough for an explicit law at points; of the
integrator; periods at most, and the relative change of a period's distance and work at which they
count as alike."""
SIZE, FRAMES, TURNS = (480, 640), 60, 4
"""Of the film in pixels; its frames a period; periods."""


class _Points(NamedTuple):
    """Points of a link at x along and y across it, ``(n, 1)`` each, that bear weights under one
    law, turned by an angle."""

    link: int
    x: np.ndarray
    y: np.ndarray
    weight: np.ndarray
    law: Law
    angle: float = 0.0

    @classmethod
    def under(cls, problem: Problem, body: Chain) -> list[_Points]:
        """Every foot, Gauss points of pads, or of every link that lies on the floor."""
        floor, points = body.lengths, []
        for foot in body.standing_on:
            nodes, weights = np.polynomial.legendre.leggauss(POINTS if foot.extent else 1)
            place = foot.place + 0.5 * foot.extent * nodes[:, None]
            weight, law = float(foot.weight or 0.0), foot.friction or problem.friction
            at = foot.link, place * floor[foot.link], foot.offset + 0 * place
            points.append(cls(*at, 0.5 * weights[:, None] * weight, law, foot.angle))
        if points:
            return points
        nodes, weights = np.polynomial.legendre.leggauss(POINTS)
        along, shares = 0.5 * (nodes + 1)[:, None], 0.5 * weights[:, None]
        links = enumerate(zip(floor, body.weight_column()[:, 0], strict=True))
        return [
            cls(k, length * along, 0 * along, weight * shares, problem.friction)
            for k, (length, weight) in links
        ]

    def forces(
        self, vx: np.ndarray, vy: np.ndarray, delta: float
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Along and across the link, ``(n, 1)`` each, and the power against them."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        fs, fn = self.law.density(c * vx + s * vy, c * vy - s * vx, np.full(vx.shape, delta))
        fx, fy = self.weight * (c * fs - s * fn), self.weight * (s * fs + c * fn)
        return fx, fy, -float((fx * vx + fy * vy).sum())


class Played:
    """A gait of a chain in MuJoCo, its joints prescribed.

    State: place and heading of the tail, their rates, work against friction.
    """

    def __init__(self, solution: Solution, delta: float, froude: float) -> None:
        problem = solution.problem
        self.gait, self.delta, self.froude = solution.gait, delta, froude
        # a body length, mass and period of 1; weight is 1 / Fr
        self.model = mujoco.MjModel.from_xml_string(
            mjcf(solution.robot(1.0, 1.0, 1.0), contacts=False)
        )
        self.model.opt.gravity[:] = 0.0
        self.data = mujoco.MjData(self.model)
        self.points = _Points.under(problem, checked_mass(problem.body))

    def _times_mass(self, vector: np.ndarray) -> np.ndarray:
        found = np.zeros(self.model.nv)
        mujoco.mj_mulM(self.model, self.data, found, vector)
        return found

    def friction(self) -> tuple[np.ndarray, float]:
        """Generalised force of the law at all points ``(nv,)``, and its power, at the state of
        MuJoCo's data."""
        data, total, power = self.data, np.zeros(self.model.nv), 0.0
        way, turn = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        for at in self.points:
            mujoco.mj_jac(self.model, data, way, turn, data.xpos[at.link + 1], at.link + 1)
            frame = data.xmat[at.link + 1].reshape(3, 3)
            velocity, omega = frame.T @ (way @ data.qvel), (turn @ data.qvel)[2]
            fx, fy, spent = at.forces(
                velocity[0] - omega * at.y, velocity[1] + omega * at.x, self.delta
            )
            push = frame @ np.array([fx.sum(), fy.sum(), 0.0])
            total += (way.T @ push + turn[2] * (at.x * fy - at.y * fx).sum()) / self.froude
            power += spent / self.froude
        return total, power

    def rates(self, t: float, state: np.ndarray) -> np.ndarray:
        """Of the state at a phase."""
        h = 1e-5
        here = np.array([t % 1.0])
        angles, rates = (a[:, 0] for a in self.gait(here))
        later, before = (self.gait.rates((here + step) % 1.0)[:, 0] for step in (h, -h))
        data, wanted = self.data, (later - before) / (2 * h)
        data.qpos[:], data.qvel[:] = (
            np.concatenate([state[:3], angles]),
            np.concatenate([state[3:6], rates]),
        )
        mujoco.mj_forward(self.model, data)
        mass = np.stack([self._times_mass(unit) for unit in np.eye(self.model.nv)])
        force, power = self.friction()
        # rows of the tail: M (a, q'') + bias = force; the joints' rows say what torque that takes
        tail = np.linalg.solve(mass[:3, :3], (force - data.qfrc_bias)[:3] - mass[:3, 3:] @ wanted)
        return np.concatenate([state[3:6], tail, [power]])

    def centre(self, state: np.ndarray) -> np.ndarray:
        """Where the centre of mass is at the beginning of a period, ``(2,)``."""
        self.data.qpos[:] = np.concatenate([state[:3], self.gait.angles(np.zeros(1))[:, 0]])
        mujoco.mj_forward(self.model, self.data)
        return np.array(self.data.subtree_com[1][:2])

    def period(self, start: np.ndarray) -> np.ndarray:
        """The state a period later."""
        how: Any = {"method": "LSODA", "rtol": TOLERANCE, "atol": TOLERANCE, "max_step": 0.02}
        found = solve_ivp(self.rates, (0.0, 1.0), start, **how)
        if not found.success:
            raise RuntimeError(found.message)
        return np.asarray(found.y[:, -1])

    def settled(self) -> tuple[float, float]:
        """Distance, and work over weight and length, of a period when all are alike."""
        state, known = np.zeros(7), np.full(2, np.inf)
        for _ in range(MOST_PERIODS):
            before, state = state, self.period(state)
            way = self.centre(state) - self.centre(before)
            now = np.array([np.hypot(*way), (state - before)[6] * self.froude])
            if np.abs(now / known - 1).max() < ALIKE:
                break
            known = now
        return float(now[0]), float(now[1])


def compared(solution: Solution, froude: float, delta: float = DELTA) -> dict[str, float]:
    """Distance and work of a period at a Froude number, of MuJoCo and of colloc, and how far they
    are apart, relative."""
    problem = solution.problem
    distance, work = Played(solution, delta, froude).settled()
    at = problem.body, problem.friction, solution.gait, delta
    own = colloc.replay(*at, froude=froude, tolerance=1e-5)
    apart = max(abs(distance / own.distance - 1), abs(work / own.work - 1))
    found = {"distance": distance, "own_distance": own.distance}
    return found | {"work": work, "own_work": own.work, "apart": apart}


def _renderer(model: mujoco.MjModel) -> mujoco.Renderer:
    try:
        return mujoco.Renderer(model, *SIZE)
    except (AttributeError, ImportError, mujoco.FatalError):
        raise CollocError(
            "MuJoCo finds no OpenGL to draw with: install EGL or OSMesa and set MUJOCO_GL=egl or "
            "osmesa, or leave --film out."
        ) from None


def with_contacts(
    solution: Solution, froude: float, film: Path | None = None
) -> tuple[float, float]:
    """Distance [body lengths] and work [weight x length] of the last period in MuJoCo's own
    contacts, of a robot of 1 m."""
    period = float(np.sqrt(1.0 / (9.81 * froude)))
    model = mujoco.MjModel.from_xml_string(mjcf(solution.robot(1.0, 1.0, period)))
    data, steps = mujoco.MjData(model), round(period / model.opt.timestep)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    renderer, frames = _renderer(model) if film else None, []
    camera = mujoco.MjvCamera()
    camera.distance, camera.elevation, camera.azimuth = 1.4, -55.0, 90.0
    start, work = np.zeros(3), 0.0
    for k in range(TURNS * steps):
        if k == (TURNS - 1) * steps:
            start, work = data.subtree_com[1].copy(), 0.0
        data.ctrl[:] = solution.gait.angles(np.array([k / steps % 1.0]))[:, 0]
        mujoco.mj_step(model, data)
        work += float(data.qfrc_actuator @ data.qvel) * model.opt.timestep
        if renderer and k % max(1, steps // FRAMES) == 0:
            camera.lookat[:] = data.subtree_com[1]
            renderer.update_scene(data, camera)
            frames.append(renderer.render())
    if film:
        from PIL import Image  # matplotlib brings it

        pictures = [Image.fromarray(frame) for frame in frames]
        pictures[0].save(film, save_all=True, append_images=pictures[1:], duration=40, loop=0)
    return float(np.hypot(*(data.subtree_com[1] - start)[:2])), work / 9.81


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description="Play a gait in MuJoCo beside colloc's own motion."
    )
    contacts = "also MuJoCo's own contacts, at the last Froude number"
    parser.add_argument("result", help="a result file of a chain")
    parser.add_argument("--froude", type=float, nargs="+", default=FROUDE, metavar="FR")
    parser.add_argument("--contacts", action="store_true", help=contacts)
    parser.add_argument("--film", type=Path, metavar="GIF", help="film of MuJoCo's own contacts")
    return run(parser, _play, arguments)


def _play(options: argparse.Namespace) -> int:
    solution = colloc.load(options.result)
    print(f"{solution.problem.name}, delta = {DELTA:g}\n")
    print("| Froude number | d MuJoCo | d colloc | W MuJoCo | W colloc | apart |")
    print("|---|---|---|---|---|---|")
    for froude in options.froude:
        *values, apart = compared(solution, froude).values()
        numbers = " | ".join(f"{value:.5f}" for value in values)
        print(f"| {froude:g} | {numbers} | {apart:.1e} |", flush=True)
    if options.contacts or options.film:
        distance, work = with_contacts(solution, options.froude[-1], options.film)
        said = f"d = {distance:.4f}, W = {work:.4f}, d/W = {distance / work:.4f}"
        print(f"\nMuJoCo's own contacts at {options.froude[-1]:g}: {said}")
    return OK


if __name__ == "__main__":
    sys.exit(main())
