"""The three-link problem in rockit, after its examples dae.py (algebraic states) and repeated_solve.py (parameters).

Run in the peers' environment: python -m benchmarks.peers.rockit_three_link --starts 20 [--tuned]
"""

from __future__ import annotations

import argparse
import json
import time

import casadi as ca
import numpy as np
from rockit import DirectCollocation, Ocp

from benchmarks.peers.physics import DELTAS, balance_and_rates, gait
from benchmarks.peers.settings import DEFAULT, DEGREE, INTERVALS, TUNED
from benchmarks.peers.starts import feasible_motion, starts


def build(tuned: bool) -> tuple:
    """The problem, its symbols, and the time to write it down (transcription happens at the first solve)."""
    ocp = Ocp(T=np.pi)
    theta, x, W = ocp.state(), ocp.state(), ocp.state()
    z = ocp.algebraic(3)
    parameters = ocp.variable(3)
    delta = ocp.parameter()
    (q1, q2), _ = gait(ca, ocp.t, *ca.vertsplit(parameters))
    balance, rates = balance_and_rates(ca, ocp.t, theta, ca.vertsplit(z), ca.vertsplit(parameters), delta)
    for state, rate in zip((theta, x, W), rates, strict=True):
        ocp.set_der(state, rate)
    for equation in balance:
        ocp.add_alg(equation)
    ocp.subject_to(ocp.at_t0(x) == 0)
    ocp.subject_to(ocp.at_t0(W) == 0)
    ocp.subject_to(-np.pi <= (q1 <= np.pi))
    ocp.subject_to(-np.pi <= (q2 <= np.pi))
    ocp.add_objective(-ocp.at_tf(x) / ocp.at_tf(W))
    ocp.solver("ipopt", {"print_time": False, "ipopt": {**DEFAULT, **(TUNED if tuned else {})}})
    ocp.method(DirectCollocation(N=INTERVALS, M=1, degree=DEGREE, scheme="radau"))
    return ocp, (theta, x, W), z, parameters, delta


def solve(built: tuple, start: np.ndarray) -> dict:
    """Continuation in delta from one start; the gait and efficiency of the last level, or where it failed."""
    ocp, states, z, parameters, delta = built
    own = start
    for level in DELTAS:
        phases = np.linspace(0, np.pi, 8 * INTERVALS + 1)
        motion, velocity = feasible_motion(own, level / (2 * np.pi), phases)
        # as functions of time: arrays of states fail inside rockit 0.6.7 (its line 273 names an undefined `kron`)
        for state, values in zip(states, motion, strict=True):
            ocp.set_initial(state, ca.interpolant("state", "linear", [phases], values)(ocp.t))
        ocp.set_initial(z, ca.interpolant("z", "linear", [phases], velocity.ravel(order="F"))(ocp.t))
        ocp.set_initial(parameters, own)
        ocp.set_value(delta, level / (2 * np.pi))
        try:
            solution = ocp.solve()
        except RuntimeError:
            return {"failed_at": level, "message": ocp.non_converged_solution.stats["return_status"]}
        own = np.array(solution.value(parameters)).ravel()
        x, W = (solution.sample(s, grid="control")[1][-1] for s in states[1:])
    return {"efficiency": float(x / W), "gait": own.tolist()}


def main() -> None:
    parser = argparse.ArgumentParser(description="The three-link problem in rockit; see the top of this file.")
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--tuned", action="store_true", help="the IPOPT options that colloc's lifted formulation uses")
    options = parser.parse_args()
    begin = time.process_time()
    built = build(options.tuned)
    first = True
    for start in starts(options.starts):
        result = solve(built, start)
        now = time.process_time()
        result |= {"cpu": now - begin, "start": start.tolist(), "with_build": first}
        first, begin = False, now
        print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
