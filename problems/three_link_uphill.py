r"""Three links climb a slope of one in ten at the least work of their joints.

Friction has to hold the weight as well, so where the body points is sought with the gait. The best
gait of the level, put there, gets 0.087.

$$\int_0^1 \mathbf f\,ds = \gamma\,\mathbf e, \qquad \gamma = \tan(\text{inclination}),
\quad \mathbf e \text{ uphill}$$
"""

from colloc import Harmonic, Problem, ellipse, solve

PROBLEM = Problem(
    name="three_link_uphill",
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
    guess=ellipse(A0=0, A1=2.8, B1=1.3),
    grade=0.1,
)


if __name__ == "__main__":
    solution = solve(PROBLEM)
    print(solution)
    print(
        f"climbs {solution.distance:.4f} body lengths, {solution.work:.4f} weight x length a cycle"
    )
    solution.plot().savefig("three_link_uphill.png")
    solution.animate("three_link_uphill.gif", periods=1, seconds=3, fps=8, width=640)
