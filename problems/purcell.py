r"""Purcell's swimmer: three links, one harmonic, viscous drag; which stroke is best?

Drag is linear in the velocity, so a retraced stroke leads nowhere at any pace: two joints are the
fewest that swim. What counts is the work of towing the straight body over the work spent.

$$\mathbf f = -(v_s\,\mathbf s + 2\,v_n\,\mathbf n), \qquad \max \frac{d^2}{W}$$
"""

from colloc import Harmonic, Problem, Viscous, ellipse, solve

PROBLEM = Problem(
    name="purcell",
    friction=Viscous(normal=2.0, tangential=1.0),
    gait=Harmonic(harmonics=1, symmetry="none"),
    guess=ellipse(A0=0, A1=0.7, B1=0.7),
    objective="towing",
)


if __name__ == "__main__":
    solution = solve(PROBLEM)
    print(solution)
    print(f"{solution.distance:.4f} body lengths a stroke, towing at {100 * solution.value:.3f} %")
    solution.plot().savefig("purcell.png")
    solution.animate("purcell.gif", periods=1, seconds=3, fps=8, width=640)
