r"""Three equal links on a dry floor: the paper's best gait.

Friction is the same in all directions, and no link leaves the floor: each step ahead is paid for by
links that slide back. The paper finds 0.259 at A0 = 0 (section V, figure 12 D); the guess is
deliberately poor, a third of that.

$$\int_0^1 \mathbf f\,ds = 0, \quad \int_0^1 \mathbf x \times \mathbf f\,ds = 0,
\qquad \mathbf f = -\frac{\mathbf v}{|\mathbf v|},
\qquad q_{1,2} = \pm(A_0 + A_1 \cos 2\pi t) + B_1 \sin 2\pi t$$
"""

from colloc import Friction, Harmonic, Problem, Reference, ellipse, solve

PROBLEM = Problem(
    name="three_link",
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
    guess=ellipse(A0=0.3, A1=1.0, B1=0.5),
    delta=1e-4,
    intervals=24,
)

REFERENCE = Reference(
    0.259,
    0.0015,
    "S. Alben (2019), section V: 'the global maximum is found at A0 = 0, has efficiency 0.259'",
)


if __name__ == "__main__":
    solution = solve(PROBLEM)
    print(solution)
    print(f"{solution.distance:.4f} body lengths, {solution.work:.4f} weight x length a cycle")
    solution.plot().savefig("three_link.png")
    solution.animate("three_link.gif", periods=1, seconds=3, fps=8, width=640)
