"""Link chains against the smooth body, wave B: python -m scripts.chain_against_smooth [--output FOLDER]

Prints errors and fitted orders of chains of 10 to 320 links, and draws FOLDER/chain_convergence.png and .pdf.
"""

import argparse
from math import log2
from pathlib import Path

import numpy as np

from colloc.mechanics.friction import Friction
from colloc.smooth.motion import sine_wave
from scripts.figures_smooth import chain_convergence
from scripts.models.chain_study import chain_period
from scripts.models.period import measured_period

LINKS = (10, 20, 40, 80, 160, 320)
FRICTIONS = (Friction(), Friction(10.0, 1.0, 1.0), Friction(100.0, 1.0, 1.0))
DELTA = 1e-4


def work_errors(friction: Friction) -> list[float]:
    """Relative errors of the work of chains, printed as they come."""
    smooth = measured_period(sine_wave(), friction, DELTA)
    print(f"\nwave B, {friction}: smooth W {smooth.W:.8f}, efficiency {smooth.efficiency:.8f}")
    print(f"{'links':>6} {'efficiency':>11} {'W/W_smooth - 1':>15} {'order':>6}")
    errors: list[float] = []
    for n in LINKS:
        d, W = chain_period(sine_wave(), friction, DELTA, n)
        error = W / smooth.W - 1
        order = f"{log2(abs(errors[-1] / error)):6.2f}" if errors else ""
        print(f"{n:6d} {d / W:11.7f} {error:15.3e} {order}", flush=True)
        errors.append(error)
    return errors


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("results/figures"), help="folder of the figure")
    options = parser.parse_args()
    errors = {friction.mu_t: np.array(work_errors(friction)) for friction in FRICTIONS}
    chain_convergence(np.array(LINKS), errors, options.output)


if __name__ == "__main__":
    main()
