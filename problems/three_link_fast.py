r"""The best gait for the pace at hand: a robot of one metre that takes two seconds a cycle.

Inertia counts at this pace: the best slow gait, of efficiency 0.26, keeps 0.157. One number decides
how much, the Froude number: 2 s on a floor of mu = 0.5 are as 1.41 s on one of mu = 1.

$$\mathrm{Fr}\,\ddot{\mathbf x} = \int_0^1 \mathbf f\,ds, \qquad \mathrm{Fr} = \frac{L}{\mu g T^2}$$
"""

from colloc import Harmonic, Problem, solve

LENGTH, PERIOD, MU, GRAVITY = 1.0, 2.0, 0.5, 9.81
"""[m], [s], the friction of the floor where the problem says 1, and [m/s^2]."""

PROBLEM = Problem(
    name="three_link_fast", gait=Harmonic(1), froude=LENGTH / (GRAVITY * PERIOD**2) / MU
)


if __name__ == "__main__":
    solution = solve(PROBLEM)
    print(solution)
    print(f"{100 * LENGTH * solution.distance / PERIOD:.2f} cm/s; d/W {solution.efficiency:.4f}")
    solution.plot().savefig("three_link_fast.png")
    solution.animate("three_link_fast.gif", periods=1, seconds=3, fps=8, width=640)
