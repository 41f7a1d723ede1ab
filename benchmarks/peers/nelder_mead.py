"""What a newcomer would try: Nelder-Mead over (A0, A1, B1) on the paper's fixed point: python -m benchmarks.peers.nelder_mead

Every evaluation solves the balance at 400 instants of the period by the fixed point (batched, which a first version would not
be) at delta = 1e-4, and sums distance and work. Gaits that cross themselves or exceed pi are worth nothing.
"""

from __future__ import annotations

import argparse
import json
import time

import numpy as np
from scipy.optimize import minimize

from benchmarks.peers.starts import starts
from colloc import Chain, Friction, ellipse, solve_balance
from colloc.mechanics.balance import instant, total_power
from scripts.models.ellipses import admissible

INSTANTS = 400


def minus_efficiency(parameters: np.ndarray) -> float:
    """-d/W of an ellipse by the trapezoidal rule, and 0 for inadmissible ones."""
    body, friction = Chain(), Friction()
    if not admissible(body, parameters[:, None])[0]:
        return 0.0
    gait, t = ellipse(*parameters), np.arange(INSTANTS) / INSTANTS
    angles, rates = gait.angles(t), gait.rates(t)
    z = solve_balance(body, friction, angles, rates, 1e-4, tolerance=1e-8, method="fixed_point").z
    now = instant(body, friction, angles, rates, z, 1e-4)
    cx, cy = (c[0] for c in body.centre_velocity(now.posture, now.velocity))
    theta = np.concatenate([[0.0], np.cumsum(0.5 * (z[2, 1:] + z[2, :-1]))]) / INSTANTS
    c, s = np.cos(theta), np.sin(theta)
    d = np.hypot(np.mean(c * cx - s * cy), np.mean(s * cx + c * cy))
    return -float(d / total_power(now.velocity, now.force).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description="Nelder-Mead over ellipses; see the top of this file.")
    parser.add_argument("--starts", type=int, default=20)
    for start in starts(parser.parse_args().starts):
        begin = time.process_time()
        settings = {"xatol": 1e-4, "fatol": 1e-9, "maxfev": 1000}
        found = minimize(minus_efficiency, start, method="Nelder-Mead", options=settings)
        result = {"efficiency": -found.fun, "gait": found.x.tolist(), "evaluations": found.nfev}
        result |= {"cpu": time.process_time() - begin, "start": start.tolist(), "with_build": True}
        print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
