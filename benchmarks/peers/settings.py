"""Mesh and IPOPT options, the same for every tool."""

INTERVALS, DEGREE = 24, 3
"""On half a period; three Radau points an interval."""
DEFAULT = {"tol": 1e-9, "linear_solver": "mumps", "print_level": 0, "sb": "yes", "max_cpu_time": 20.0}
"""The time limit is per level of the continuation."""
TUNED = {
    "mu_strategy": "monotone",
    "mu_init": 1e-4,
    "bound_push": 1e-5,
    "bound_frac": 1e-5,
    "theta_max_fact": 0.1,
    "max_iter": 300,
}
"""The options under which colloc's own lifted formulation converges."""
