"""The three-link problem in rockit, after its examples dae.py (algebraic states) and repeated
solves.

Run in the peers' environment: python -m benchmarks.peers.rockit_three_link --starts 20 [--tuned]

The program is written and its derivatives are made once; every level is a call of one function from
a packed guess (`gist`) to a packed solution. `set_initial` would evaluate the guess expression by
expression, twenty times as long as IPOPT's work.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from rockit import DirectCollocation, Ocp

from benchmarks.peers.physics import DELTAS, balance_and_rates, gait
from benchmarks.peers.runs import arguments, failed, found, run, words_of
from benchmarks.peers.settings import DEFAULT, DEGREE, INTERVALS, TUNED
from benchmarks.peers.starts import feasible_motion


@dataclass
class Program:
    """The solver, phases of nodes and roots, and how a motion is packed."""

    solve: ca.Function
    phases: np.ndarray
    unpack: ca.Function
    pack: np.ndarray


def build(tuned: bool) -> Program:
    """The problem, transcribed."""
    ocp = Ocp(T=np.pi)
    theta, x, W = ocp.state(), ocp.state(), ocp.state()
    z = ocp.algebraic(3)
    parameters = ocp.variable(3)
    delta = ocp.parameter()
    (q1, q2), _ = gait(ca, ocp.t, *ca.vertsplit(parameters))
    balance, rates = balance_and_rates(
        ca, ocp.t, theta, ca.vertsplit(z), ca.vertsplit(parameters), delta
    )
    for state, rate in zip((theta, x, W), rates, strict=True):
        ocp.set_der(state, rate)
    for equation in balance:
        ocp.add_alg(equation)
    ocp.subject_to(ocp.at_t0(x) == 0)
    ocp.subject_to(ocp.at_t0(W) == 0)
    ocp.subject_to(-np.pi <= (q1 <= np.pi))
    ocp.subject_to(-np.pi <= (q2 <= np.pi))
    ocp.add_objective(-ocp.at_tf(x) / ocp.at_tf(W))
    ipopt = {**DEFAULT, **(TUNED if tuned else {})}
    ocp.solver(
        "ipopt", {"print_time": False, "expand": True, "error_on_fail": True, "ipopt": ipopt}
    )
    ocp.method(DirectCollocation(N=INTERVALS, M=1, degree=DEGREE, scheme="radau"))
    ocp.set_value(delta, DELTAS[0])
    states = ca.vertcat(theta, x, W)
    at_nodes = ocp.sample(states, grid="control")[1]
    at_roots = [ocp.sample(part, grid="integrator_roots")[1] for part in (states, z)]
    solve = ocp.to_function("solve", [ocp.gist], [ocp.gist])
    samples = [at_nodes, *at_roots, ocp.value(parameters), ocp.value(delta)]
    unpack = ca.Function("unpack", [ocp.gist], samples)
    every = ca.vertcat(*[ca.vec(part) for part in samples])
    pack = np.linalg.pinv(np.array(ca.evalf(ca.jacobian(every, ocp.gist))))
    step = np.pi / INTERVALS
    roots = (
        np.arange(INTERVALS)[:, None] + np.array(ca.collocation_points(DEGREE, "radau"))
    ).ravel() * step
    return Program(solve, np.concatenate([np.arange(INTERVALS + 1) * step, roots]), unpack, pack)


def solve(program: Program, start: np.ndarray) -> dict:
    """Continuation in delta from one start; the gait and efficiency of the last level, or where it
    failed."""
    own = start
    for level in DELTAS:
        delta = level / (2 * np.pi)
        states, velocity = feasible_motion(own, delta, program.phases)
        first = INTERVALS + 1
        motion = [states[:, :first], states[:, first:], velocity[:, first:], own, delta]
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
    chosen = arguments(__doc__, tuned="options under which it converges from every start")
    run(chosen, lambda: build(chosen.tuned), solve)
