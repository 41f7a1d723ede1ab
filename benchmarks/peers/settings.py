"""Mesh and IPOPT options, the same for every tool."""

INTERVALS, DEGREE = 24, 3
"""On half a period; three Radau points an interval."""
MESHES = {6: 1e-3, 12: 2e-4, 24: 3e-5, 48: 3e-6, 96: 3e-7}
"""Intervals of the meshes, with the tolerance that colloc refines to instead."""
OPTIONS = {
    "tol": 1e-9,
    "linear_solver": "mumps",
    "print_level": 0,
    "sb": "yes",
    "max_cpu_time": 20.0,
    "mu_strategy": "monotone",
    "mu_init": 1e-6,
    "bound_push": 1e-7,
    "bound_frac": 1e-7,
    "theta_max_fact": 1.0,
    "alpha_for_y": "full",
    "max_iter": 300,
}
"""The time limit is per level of the continuation. From `mu_strategy` on, found by trial on 24
intervals: with IPOPT's own settings 0 of 5 starts end in rockit and 3 of 20 in YAPSS (commit
f6308821). On 12, YAPSS ends with those of that commit, not with these."""
