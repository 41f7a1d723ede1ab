"""Link chains against the smooth body, wave B: python -m scripts.chain_against_smooth."""

from math import log2
from pathlib import Path

import numpy as np

from colloc.chain_study import chain_period
from colloc.figures_smooth import chain_convergence
from colloc.friction import Friction
from colloc.motion import sine_wave
from colloc.smooth_period import measured_period

LINKS, errors = (10, 20, 40, 80, 160, 320), {}
for friction in (Friction(), Friction(10.0, 1.0, 1.0), Friction(100.0, 1.0, 1.0)):
    smooth = measured_period(sine_wave(), friction, 1e-4)
    print(f"\nwave B, {friction}: smooth W {smooth.W:.8f}, efficiency {smooth.efficiency:.8f}")
    print(f"{'links':>6} {'efficiency':>11} {'W/W_smooth - 1':>15} {'order':>6}")
    last, errors[friction.mu_t] = None, []
    for n in LINKS:
        d, W = chain_period(sine_wave(), friction, 1e-4, n)
        error = W / smooth.W - 1
        order = "" if last is None else f"{log2(abs(last / error)):6.2f}"
        print(f"{n:6d} {d / W:11.7f} {error:15.3e} {order}")
        last = error
        errors[friction.mu_t].append(error)
chain_convergence(np.array(LINKS), {mu: np.array(e) for mu, e in errors.items()}, Path("results/figures"))
