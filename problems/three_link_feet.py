r"""Three links on a foot each: what touches the floor matters more than the gait.

Lying on its links this body gets 0.26. For most of the cycle one foot holds while the other two are
swung ahead; it can as long as their forces add up to no more than its own.

$$\left|\frac{\mathbf v_i}{|\mathbf v_i|} + \frac{\mathbf v_j}{|\mathbf v_j|}\right| \le 1
\quad \text{while foot } k \text{ holds}$$
"""

from colloc import Chain, Friction, Harmonic, Problem, solve

PROBLEM = Problem(
    name="three_link_feet",
    body=Chain((1 / 3, 1 / 3, 1 / 3), feet=1),
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=1),
)


if __name__ == "__main__":
    solution = solve(PROBLEM)
    print(solution)
    print(
        f"{solution.distance:.4f} body lengths a cycle; the feet hold {solution.share_held} of it"
    )
    solution.plot().savefig("three_link_feet.png")
    solution.animate("three_link_feet.gif", periods=1, seconds=3, fps=8, width=640)
