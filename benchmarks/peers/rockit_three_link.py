"""The three-link problem in rockit, after its examples dae.py (algebraic states) and repeated
solves.

Run in the peers' environment: python -m benchmarks.peers.rockit_three_link --starts 20 [--lifted]
(with the forces of links as unknowns, like examples/three_link_lifted.py)

The program is written and its derivatives are made once; every level is a call of one function from
a packed guess (`gist`) to a packed solution. `set_initial` would evaluate the guess expression by
expression, twenty times as long as IPOPT's work.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from rockit import DirectCollocation, Ocp

from benchmarks.peers.physics import DELTAS, LENGTH, balance_and_rates, gait, link_forces
from benchmarks.peers.runs import arguments, failed, found, run, words_of
from benchmarks.peers.settings import DEGREE, OPTIONS
from benchmarks.peers.starts import feasible_motion


@dataclass
class Program:
    """The solver, phases of nodes and roots, and how a motion is packed."""

    solve: ca.Function
    phases: np.ndarray
    unpack: ca.Function
    pack: ca.DM
    lifted: bool


def build(intervals: int, lifted: bool) -> Program:
    """The problem, transcribed."""
    ocp = Ocp(T=np.pi)
    theta, x, W = ocp.state(), ocp.state(), ocp.state()
    z, forces = ocp.algebraic(3), [ocp.algebraic() for _ in range(9 if lifted else 0)]
    parameters = ocp.variable(3)
    delta = ocp.parameter()
    (q1, q2), _ = gait(ca, ocp.t, *ca.vertsplit(parameters))
    balance, rates = balance_and_rates(
        ca, ocp.t, theta, ca.vertsplit(z), ca.vertsplit(parameters), delta, forces or None
    )
    for state, rate in zip((theta, x, W), rates, strict=True):
        ocp.set_der(state, rate)
    for equation in balance:
        ocp.add_alg(equation)
    for force, most in zip(forces, 3 * [LENGTH, LENGTH, LENGTH**2 / 4], strict=False):
        ocp.subject_to(-most <= (force <= most), grid="integrator_roots")
    ocp.subject_to(ocp.at_t0(x) == 0)
    ocp.subject_to(ocp.at_t0(W) == 0)
    ocp.subject_to(-np.pi <= (q1 <= np.pi))
    ocp.subject_to(-np.pi <= (q2 <= np.pi))
    ocp.add_objective(-ocp.at_tf(x) / ocp.at_tf(W))
    ocp.solver(
        "ipopt", {"print_time": False, "expand": True, "error_on_fail": True, "ipopt": OPTIONS}
    )
    ocp.method(DirectCollocation(N=intervals, M=1, degree=DEGREE, scheme="radau"))
    ocp.set_value(delta, DELTAS[0])
    states = ca.vertcat(theta, x, W)
    at_nodes = ocp.sample(states, grid="control")[1]
    at_roots = [
        ocp.sample(part, grid="integrator_roots")[1] for part in (states, ca.vertcat(z, *forces))
    ]
    solve = ocp.to_function("solve", [ocp.gist], [ocp.gist])
    samples = [at_nodes, *at_roots, ocp.value(parameters), ocp.value(delta)]
    unpack = ca.Function("unpack", [ocp.gist], samples)
    every = ca.vertcat(*[ca.vec(part) for part in samples])
    placed = ca.evalf(ca.jacobian(every, ocp.gist))
    pack = ca.solve(placed.T @ placed, placed.T)
    step = np.pi / intervals
    roots = (
        np.arange(intervals)[:, None] + np.array(ca.collocation_points(DEGREE, "radau"))
    ).ravel() * step
    return Program(
        solve, np.concatenate([np.arange(intervals + 1) * step, roots]), unpack, pack, lifted
    )


def solve(program: Program, start: np.ndarray) -> dict:
    """Continuation in delta from one start; the gait and efficiency of the last level, or where it
    failed."""
    own = start
    for level in DELTAS:
        delta = level / (2 * np.pi)
        states, velocity = feasible_motion(own, delta, program.phases)
        first = len(program.phases) // (DEGREE + 1) + 1
        at_roots = velocity[:, first:]
        if program.lifted:
            forces = link_forces(program.phases[first:], at_roots, own, delta)
            at_roots = np.concatenate([at_roots, forces])
        motion = [states[:, :first], states[:, first:], at_roots, own, delta]
        guess = program.pack @ np.concatenate(
            [np.asarray(part).ravel(order="F") for part in motion]
        )
        try:
            solution = program.solve(guess)
        except RuntimeError as error:
            return failed(level, words_of(error))
        states, _, _, own, _ = (np.array(part) for part in program.unpack(solution))
        own = own.ravel()
    return found(states[1, -1] / states[2, -1], own)


if __name__ == "__main__":
    chosen = arguments(__doc__, lifted="forces of links are unknowns")
    run(chosen, lambda: build(chosen.intervals, chosen.lifted), solve)
