"""Mesh and IPOPT options, the same for every tool."""

INTERVALS, DEGREE = 24, 3
"""On half a period; three Radau points an interval."""
DEFAULT = {
    "tol": 1e-9,
    "linear_solver": "mumps",
    "print_level": 0,
    "sb": "yes",
    "max_cpu_time": 20.0,
}
"""The time limit is per level of the continuation."""
TUNED = {
    "mu_strategy": "monotone",
    "mu_init": 1e-4,
    "bound_push": 1e-5,
    "bound_frac": 1e-5,
    "theta_max_fact": 0.1,
    "alpha_for_y": "full",
    "max_iter": 300,
}
"""Found by trial on the raw balance: `alpha_for_y` decides (without it 7 and 8 of 20 starts end,
with it 20 and 19)."""
