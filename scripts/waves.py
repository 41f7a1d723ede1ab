"""The paper's waves (figures 5 and 6), converged, and which parameters come near what it prints: python -m scripts.waves."""

import argparse

from colloc.mechanics.friction import Friction
from colloc.smooth.motion import sine_wave, standing_wave, tanh_wave
from scripts.models.period import measured_period

ISOTROPIC, SIDEWAYS, ALONG = Friction(), Friction(1.0, 100.0, 100.0), Friction(100.0, 1.0, 1.0)
CASES = [
    ("A anisotropic (printed 0.93)", tanh_wave(), SIDEWAYS, 32),
    ("B anisotropic (printed 0.76)", sine_wave(), ALONG, 8),
    ("A isotropic", tanh_wave(), ISOTROPIC, 16),
    ("B isotropic", sine_wave(), ISOTROPIC, 32),
    ("C isotropic", standing_wave(), ISOTROPIC, 8),
    *((f"B, mu_t = {m:g}", sine_wave(), Friction(m, 1.0, 1.0), 8) for m in (200.0, 1000.0, 1e4)),
    *((f"B, amplitude {a:g}", sine_wave(a), ALONG, 8) for a in (0.9, 0.95, 1.05)),
    *((f"A, steepness {k:g}", tanh_wave(1.3, k), SIDEWAYS, 8) for k in (5.0, 80.0, 320.0)),
    *((f"A, amplitude {a:g}", tanh_wave(a, 20.0), SIDEWAYS, 8) for a in (1.2, 1.4)),
    *((f"A, mu_f = mu_b = {m:g}", tanh_wave(), Friction(1.0, m, m), 8) for m in (2.0, 5.0, 10.0)),
    *((f"A, {w:g} waves", tanh_wave(1.3, 20.0, w), SIDEWAYS, 8) for w in (1.0, 4.0)),
]


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    print(f"{'wave':30} {'d':>12} {'W':>12} {'efficiency':>12} {'+-':>8}")
    for name, motion, friction, intervals in CASES:
        p = measured_period(motion, friction, 1e-4, intervals=intervals)
        print(f"{name:30} {p.d:12.8f} {p.W:12.8f} {p.efficiency:12.8f} {p.errors['efficiency']:8.1e}", flush=True)


if __name__ == "__main__":
    main()
