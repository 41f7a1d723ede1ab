r"""An inchworm: four links whose ends stand on feet that slide more easily forwards.

Bending draws the hind feet up, stretching drives the front ones on. Nothing slides back, so each
half of the weight is pulled along the way once: the least that friction allows.

$$W = \mu_f \left(\tfrac12 d + \tfrac12 d\right) \;\Rightarrow\; \frac dW = \frac1{\mu_f},
\qquad \text{if } \mu_f < \mu_b$$
"""

from colloc import Chain, Foot, Friction, Harmonic, Problem, solve

PROBLEM = Problem(
    name="inchworm",
    body=Chain(
        (0.25, 0.25, 0.25, 0.25),
        feet=tuple(Foot(link, 0.5, 0.25, y) for link in (0, 3) for y in (-0.05, 0.05)),
    ),
    friction=Friction(mu_t=1, mu_f=1, mu_b=3),
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
    joint_limit=1.5,
)


if __name__ == "__main__":
    solution = solve(PROBLEM)
    print(solution)
    print(
        f"{solution.distance:.4f} body lengths a cycle; the feet hold {solution.share_held} of it"
    )
    solution.plot().savefig("inchworm.png")
    solution.animate("inchworm.gif", periods=1, seconds=3, fps=8, width=640)
