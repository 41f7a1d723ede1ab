"""The program of three_link_in_one_page.py with the forces lifted: they become variables, and the
law of friction a constraint that is scaled like a velocity.

    (2')  f / k + v = 0,   |force| <= mu L,   |couple| <= mu L^2 / 4

in place of f = -k v. The balance (3) is then linear in the forces, and no row is a step function.
Run: python three_link_lifted.py
"""

import casadi as ca
from three_link_in_one_page import L, follow, n


def lifted(opti, v, k):
    """Equation (2'): forces are variables."""
    f = opti.variable(9, n)
    most = ca.repmat(ca.DM([L, L, L**2 / 4] * 3), n)
    opti.subject_to(ca.vec(f / k + v) == 0)
    opti.subject_to(opti.bounded(-most, ca.vec(f), most))
    return f


if __name__ == "__main__":
    follow(lifted)
