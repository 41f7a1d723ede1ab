"""Shapes and rates that are hard for a balance solver: names, joint angles and joint rates."""

import numpy as np

from scripts.models.static_friction import SYMMETRIC_CASES, WORKED_CASES

PI = np.pi
HARD = {
    **{f"stick {c.name}": (c.angles, c.rates) for c in WORKED_CASES},
    **{f"symmetric {c.name}": (c.angles, c.rates) for c in SYMMETRIC_CASES},
    "both folded the same way": ((PI, PI), (1.0, 0.6)),
    "both folded opposite ways": ((PI, -PI), (1.0, -0.7)),
    "tail folded back, head straight": ((PI, 0.0), (1.0, 0.4)),
    "tail folded back, opening only": ((PI, 0.0), (1.0, 0.0)),
    "head folded back, closing": ((0.3, -PI), (0.2, -1.0)),
    "nearly folded": ((PI - 1e-9, -PI + 1e-9), (1.0, 0.3)),
    "second joint at 1e-9 of the first": ((0.7, -0.4), (1.0, 1e-9)),
    "first joint at 1e-9 of the second": ((2.1, 1.9), (1e-9, -1.0)),
    "second joint at 1e-300 of the first": ((0.7, -0.4), (1.0, 1e-300)),
    "second joint frozen": ((0.4, 2.6), (0.0, 1.0)),
    "straight body, both joints bend alike": ((0.0, 0.0), (1.0, 1.0)),
    "straight body, opposite bends": ((0.0, 0.0), (1.0, -1.0)),
    "straight body, one joint": ((0.0, 0.0), (1.0, 0.0)),
    "nearly straight": ((1e-12, -1e-12), (1.0, 0.5)),
    "middle link only translates": ((0.8, -0.8), (1.0, -1.0)),
    "square": ((PI / 2, PI / 2), (1.0, -0.3)),
    "rates of 1e-8": ((1.1, -0.6), (1e-8, 3e-9)),
    "rates of 1e8": ((1.1, -0.6), (1e8, 3e7)),
}
ANGLES, RATES = np.transpose([*HARD.values()], (1, 2, 0))
SPEED = np.abs(RATES).max(axis=0)
COEFFICIENTS = [(1.0, 1.0, 1.0), (1.7, 1.0, 1.3), (0.01, 1.0, 1.0), (100.0, 1.0, 1.0)]
COEFFICIENTS += [
    (1.0, 0.01, 100.0),
    (100.0, 0.01, 1.0),
    (0.01, 100.0, 1.0),
    (1.0, 1.0 + 1e-15, 1.0),
]
DELTAS = [1.0, 1e-2, 1e-4, 1e-8, 1e-12, 1e-14]
