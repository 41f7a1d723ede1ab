"""Travelling waves optimised for given friction, from the paper's sine wave: python -m scripts.optimise_waves."""

import argparse

import numpy as np

from colloc.mechanics.friction import Friction
from scripts.models.period import measured_period
from scripts.models.wave_optimum import odd_wave, optimise_wave


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    print(f"{'mu_t':>5} {'most waves':>10} {'sine wave':>10} {'optimised':>10} {'+-':>8}  amplitudes, waves, evaluations")
    for mu_t in (5.0, 10.0, 100.0):
        friction = Friction(mu_t, 1.0, 1.0)
        for most in (1.0, 2.0):
            sine = measured_period(odd_wave(np.array([1.0]), 1.0), friction, 1e-4, intervals=4).efficiency
            found = optimise_wave(friction, np.array([1.0, 0.0]), 1.0, most_waves=most)
            print(
                f"{mu_t:5g} {most:10g} {sine:10.6f} {found.period.efficiency:10.6f} {found.period.errors['efficiency']:8.1e}  "
                f"{np.round(found.amplitudes, 4)}, {found.waves:.4f}, {found.evaluations}",
                flush=True,
            )


if __name__ == "__main__":
    main()
