"""The three-link problem in YAPSS, after its examples isoperimetric.py (closed curves) and
newton.py (parameters).

Run in the peers' environment: python -m benchmarks.peers.yapss_three_link --starts 20
"""

from __future__ import annotations

import warnings

import numpy as np
import yapss
import yapss.math

from benchmarks.peers.physics import DELTAS, balance_and_rates, gait
from benchmarks.peers.runs import arguments, failed, found, run
from benchmarks.peers.settings import DEGREE, OPTIONS
from benchmarks.peers.starts import feasible_motion


def build(delta: float, own: np.ndarray, intervals: int) -> yapss.Problem:
    """The problem at one delta with a feasible guess."""
    ocp = yapss.Problem(name="three links", nx=[3], nu=[3], nh=[5], ns=3)

    def objective(arg) -> None:
        final = arg.phase[0].final_state
        arg.objective = -final[1] / final[2]

    def continuous(arg) -> None:
        phase = arg.phase[0]
        own = tuple(arg.parameter)
        balance, rates = balance_and_rates(
            yapss.math, phase.time, phase.state[0], tuple(phase.control), own, delta
        )
        phase.dynamics[:] = rates
        phase.path[:] = (*balance, *gait(yapss.math, phase.time, *own)[0])

    ocp.functions.objective, ocp.functions.continuous = objective, continuous
    bounds, guess = ocp.bounds.phase[0], ocp.guess.phase[0]
    bounds.initial_time.lower = bounds.initial_time.upper = 0.0
    bounds.final_time.lower = bounds.final_time.upper = np.pi
    bounds.initial_state.lower[1:] = bounds.initial_state.upper[1:] = 0.0
    bounds.path.lower[:] = [0, 0, 0, -np.pi, -np.pi]
    bounds.path.upper[:] = [0, 0, 0, np.pi, np.pi]
    phases = np.linspace(0, np.pi, 8 * intervals + 1)
    guess.time = phases
    guess.state, guess.control = feasible_motion(own, delta, phases)
    ocp.guess.parameter = own
    ocp.mesh.phase[0].collocation_points = intervals * (DEGREE,)
    ocp.mesh.phase[0].fraction = intervals * (1 / intervals,)
    ocp.spectral_method = "lgr"
    ocp.derivatives.method, ocp.derivatives.order = "auto", "second"
    for name, value in OPTIONS.items():
        setattr(ocp.ipopt_options, name, value)
    return ocp


def solve(intervals: int, start: np.ndarray) -> dict:
    """Continuation in delta from one start; the gait and efficiency of the last level, or where it
    failed."""
    own = start
    for level in DELTAS:
        solution = build(level / (2 * np.pi), own, intervals).solve()
        if solution.nlp_info.ipopt_status != 0:
            return failed(level, solution.nlp_info.ipopt_status_message)
        own = np.array(solution.parameter)
    return found(-solution.objective, own)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    chosen = arguments(__doc__)
    # a problem is written anew at every level: delta is a number in it
    run(chosen, lambda: chosen.intervals, solve)
