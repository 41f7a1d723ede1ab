"""A duel with complementarity: python -m benchmarks.complementarity [--starts 10] [--output FOLDER]

Three links on feet (`problems/three_link_feet.py`), once as a mathematical program with
complementarity constraints and once by colloc, from the same random gaits. With each foot's force f
in units of its weight, its velocity v and speed s, dry friction is

    v + s f = 0,    0 <= s  complementary to  1 - |f|^2 >= 0,

at Radau points; products are relaxed (Scholtes) and driven to 0 in a homotopy of IPOPT solves, with
the settings that nosnoc documents for its own (https://nosnoc-py.readthedocs.io), whose switching
systems cannot state friction in the plane. What is claimed is held against the bounds of dry
friction of the same gait, without a delta (`Solution.dry`). Writes FOLDER/complementarity.md;
outcomes are kept in FOLDER/complementarity.sqlite, so an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import casadi as ca
import numpy as np

import colloc
from benchmarks.known import known
from benchmarks.tables import cached, markdown_table
from colloc import Chain, Fourier, Harmonic, Problem
from colloc.commands.ending import OK, run
from colloc.mechanics.contact import crossing_depth, smooth_minimum

INTERVALS, DEGREE, LENGTH = 40, 2, 1 / 3
RELAXED = [10.0**-k for k in range(2, 9)]
"""What products of complementary values may be, one solve each."""
IPOPT = {
    "tol": 1e-10,
    "mu_strategy": "adaptive",
    "mu_oracle": "quality-function",
    "bound_relax_factor": 0.0,
    "max_iter": 500,
}
GOOD, SAME = 1e-3, 2e-3
"""Relative: a claim may be off so much from the bounds of dry friction; gaits count as the best up
to so much less."""
BODY = Chain(feet=1)
PROBLEM = Problem("three_link_feet", body=BODY, gait=Harmonic(1))


class Rates(NamedTuple):
    """Of feet and of the body at all instants ``(1, n)``, in axes of the tail."""

    feet: list[tuple[ca.SX, ca.SX]]
    balance: list[ca.SX]
    centre: tuple[ca.SX, ca.SX]


def angles(xp, t, p):
    """Of both joints and their rates at phases, by five numbers: the period may begin anywhere."""
    c, s, turn = xp.cos(2 * np.pi * t), xp.sin(2 * np.pi * t), 2 * np.pi
    return (p[0] + p[1] * c, p[2] + p[3] * c + p[4] * s), (
        -turn * p[1] * s,
        turn * (p[4] * c - p[3] * s),
    )


def rates(joints, speeds, z, forces) -> Rates:
    """Velocities of the feet, and force and moment on the body by forces on them, in units of their
    weights."""
    x, y, vx, vy = 0.0, 0.0, z[0], z[1]
    feet, balance = [], [0.0, 0.0, 0.0]
    for k in range(3):
        phi, w = sum(joints[:k], 0 * joints[0]), z[2] + sum(speeds[:k])
        half = 0.5 * LENGTH * ca.cos(phi), 0.5 * LENGTH * ca.sin(phi)
        x, y, vx, vy = x + half[0], y + half[1], vx - w * half[1], vy + w * half[0]
        feet.append((vx, vy))
        fx, fy = forces[2 * k], forces[2 * k + 1]
        balance = [balance[0] + fx, balance[1] + fy, balance[2] + x * fy - y * fx]
        x, y, vx, vy = x + half[0], y + half[1], vx - w * half[1], vy + w * half[0]
    return Rates(feet, balance, (sum(v for v, _ in feet) / 3, sum(v for _, v in feet) / 3))


class Program:
    """The nonlinear program, its bounds and its phases."""

    def __init__(self) -> None:
        points = ca.collocation_points(DEGREE, "radau")
        differences, _, weights = ca.collocation_coeff(points)
        step = 1.0 / INTERVALS
        self.phases = ((np.arange(INTERVALS)[:, None] + np.array(points)) * step).ravel()
        n = self.phases.size
        p, begin, relaxed = ca.SX.sym("p", 5), ca.SX.sym("begin"), ca.SX.sym("relaxed")
        z, f, s, theta = (
            ca.SX.sym(name, rows, n) for name, rows in (("z", 3), ("f", 6), ("s", 3), ("theta", 1))
        )
        joints, speeds = angles(ca, ca.DM(self.phases).T, ca.vertsplit(p))
        now = rates(joints, speeds, ca.vertsplit(z), ca.vertsplit(f))
        left = ca.horzcat(begin, theta[DEGREE - 1 : -1 : DEGREE])
        along = ca.vertcat(left, ca.reshape(theta, DEGREE, INTERVALS))
        turned = differences.T @ along - step * ca.reshape(z[2, :], DEGREE, INTERVALS)
        share = ca.repmat(weights.T, 1, INTERVALS) * step
        c, w = (ca.cos(theta), ca.sin(theta)), now.centre
        self.distance, aside = (
            ca.dot(share, v) for v in (c[0] * w[0] - c[1] * w[1], c[1] * w[0] + c[0] * w[1])
        )
        self.work = ca.dot(share, s[0, :] + s[1, :] + s[2, :]) / 3
        equal = [turned, *now.balance, aside, theta[-1] - begin]
        equal += [
            v + s[k, :] * f[2 * k + i, :]
            for k, foot in enumerate(now.feet)
            for i, v in enumerate(foot)
        ]
        slack = [1 - f[2 * k, :] ** 2 - f[2 * k + 1, :] ** 2 for k in range(3)]
        a, b = joints
        low = [
            *slack,
            np.pi - a,
            np.pi + a,
            np.pi - b,
            np.pi + b,
            *(relaxed - s[k, :] * slack[k] for k in range(3)),
        ]
        low += [
            2 * np.pi - smooth_minimum(side * (2 * a + b), side * (a + 2 * b)) for side in (1, -1)
        ]
        equal, low = (ca.vertcat(*[ca.vec(row) for row in rows]) for rows in (equal, low))
        self.x = ca.vertcat(p, begin, ca.vec(z), ca.vec(f), ca.vec(s), ca.vec(theta))
        self.lower = np.concatenate(
            [np.full(6 + 9 * n, -np.inf), np.zeros(3 * n), np.full(n, -np.inf)]
        )
        self.g_upper = np.concatenate([np.zeros(equal.size1()), np.full(low.size1(), np.inf)])
        told = {
            "x": self.x,
            "p": relaxed,
            "f": -self.distance / self.work,
            "g": ca.vertcat(equal, low),
        }
        self.solve = ca.nlpsol(
            "mpcc",
            "ipopt",
            told,
            {"print_time": False, "ipopt": IPOPT | {"print_level": 0, "sb": "yes"}},
        )

    def begin(self, p: np.ndarray) -> np.ndarray:
        """The motion of a gait at delta = 0.01, in balance: the best guess there is."""
        motion = member(p)
        q, rate = motion(self.phases)
        z = colloc.solve_balance(BODY, PROBLEM.friction, q, rate, 1e-2).require().z
        feet = np.array(
            [np.broadcast_to(np.array(v), (2, self.phases.size)) for v in self._feet(q, rate, z)]
        )
        speed = np.hypot(feet[:, 0], feet[:, 1])
        f = (-feet / np.sqrt(speed**2 + 1e-4)[:, None]).reshape(6, -1)
        theta = np.cumsum(z[2]) / self.phases.size
        return np.concatenate([p, [0.0], z.ravel("F"), f.ravel("F"), speed.ravel("F"), theta])

    @staticmethod
    def _feet(q: np.ndarray, rate: np.ndarray, z: np.ndarray) -> list[list[np.ndarray]]:
        joints, speeds, tail = ([ca.DM(row).T for row in array] for array in (q, rate, z))
        return [
            [np.array(v)[0] for v in foot] for foot in rates(joints, speeds, tail, [0.0] * 6).feet
        ]

    def best(self, p: np.ndarray) -> tuple[Fourier, float] | str:
        """The gait and what is claimed of it, or what IPOPT says of where it failed."""
        x = self.begin(p)
        for relaxed in RELAXED:
            found = self.solve(
                x0=x, p=relaxed, lbx=self.lower, ubx=np.inf, lbg=0.0, ubg=self.g_upper
            )
            x, status = np.array(found["x"])[:, 0], self.solve.stats()["return_status"]
            if status not in ("Solve_Succeeded", "Solved_To_Acceptable_Level"):
                return f"{status} at {relaxed:g}"
        return member(x[:5]), -float(found["f"])


def member(p: np.ndarray) -> Fourier:
    """The gait of five numbers."""
    return Fourier(
        mean=np.array([p[0], p[2]]), cos=np.array([[p[1]], [p[3]]]), sin=np.array([[0.0], [p[4]]])
    )


def starts(count: int) -> list[np.ndarray]:
    """Random gaits whose links do not cross."""
    rng, found, phases = np.random.default_rng(0), list[np.ndarray](), np.linspace(0, 1, 100)
    while len(found) < count:
        p = rng.uniform([-1, 0.5, -1, -1.5, -1.5], [1, 1.5, 1, 1.5, 1.5])
        q = member(p).angles(phases)
        if np.abs(q).max() < 3 and crossing_depth(BODY, q).max() <= 0:
            found.append(p)
    return found


def colloc_best(p: np.ndarray) -> tuple[Fourier, float] | str:
    solution = colloc.solve(PROBLEM.with_(guess=member(p)), starts=1)
    return (
        (solution.gait, solution.certificate.value_at_zero_delta)
        if solution.success
        else solution.message
    )


def tried(best, p: np.ndarray) -> dict[str, float | str]:
    """What a method claims from one start, the upper bound of what its gait has, by how much the
    claim misses the bounds."""
    begin = time.process_time()
    found = best(p)
    spent = time.process_time() - begin
    if isinstance(found, str):
        return {"failed": found, "seconds": spent}
    gait, claim = found
    low, high = colloc.evaluate(PROBLEM, gait).dry().efficiency
    return {
        "claim": claim,
        "value": high,
        "error": max(low - claim, claim - high, 0.0) / high,
        "seconds": spent,
    }


def row(name: str, outcomes: Sequence[dict]) -> list[object]:
    """Of the table: answers, claims that hold, gaits as good as the best, processor time of one
    that holds, errors."""
    answers = [one for one in outcomes if "failed" not in one]
    hold = [one for one in answers if one["error"] < GOOD]
    most = next(row.value for row in known() if row.problem.name == PROBLEM.name)
    good = sum(one["value"] > (1 - SAME) * most for one in hold)
    errors = [one["error"] for one in answers] or [np.nan]
    spent = sum(one["seconds"] for one in outcomes) / max(len(hold), 1)
    return [
        name,
        len(outcomes),
        len(answers),
        len(hold),
        good,
        spent,
        float(np.median(errors)),
        float(np.max(errors)),
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="A duel with a complementarity method.")
    parser.add_argument(
        "--starts", type=int, default=10, help="random gaits to begin at (default: 10)"
    )
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("results"),
        help="folder of the table (default: results)",
    )
    return run(parser, _duel, arguments)


def _duel(options: argparse.Namespace) -> int:
    columns = [
        "",
        "starts",
        "answers",
        "claims that hold",
        "the best gait",
        "s each",
        "median error of d/W",
        "largest",
    ]
    options.output.mkdir(parents=True, exist_ok=True)
    methods, outcomes = (
        {"complementarity": Program().best, "colloc": colloc_best},
        dict[str, list[dict]](),
    )
    for k, gait in enumerate(starts(options.starts)):
        for name, best in methods.items():
            key = f"{name} {INTERVALS} {DEGREE} {k}"
            outcomes.setdefault(name, []).append(
                cached(options.output / "complementarity.sqlite", key, partial(tried, best, gait))
            )
            print(f"start {k}, {name}: {outcomes[name][-1]}", flush=True)
    rows = [row(name, own) for name, own in outcomes.items()]
    Path(options.output, "complementarity.md").write_text(
        markdown_table(columns, rows) + "\n", encoding="utf-8"
    )
    return OK


if __name__ == "__main__":
    sys.exit(main())
