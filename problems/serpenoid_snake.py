r"""An eight-link snake with the gait of most snake robots: one wave that runs along the body.

Friction across the links is ten times that along them, as of scales. The class has two parameters,
amplitude and lag, whatever the number of joints.

$$q_j(t) = a \sin(2\pi t - j\,\lambda), \qquad j = 1, \dots, 7$$
"""

from colloc import Chain, Friction, Problem, Serpenoid, solve

PROBLEM = Problem(
    name="serpenoid_snake",
    body=Chain((1 / 8,) * 8),
    friction=Friction(mu_t=10, mu_f=1, mu_b=1),
    gait=Serpenoid(symmetry="antipodal"),
)


if __name__ == "__main__":
    solution = solve(PROBLEM)
    print(solution)
    print(f"{solution.distance:.4f} body lengths a cycle; {solution.gait.lines()[0]}")
    solution.plot().savefig("serpenoid_snake.png")
    solution.animate("serpenoid_snake.gif", periods=1, seconds=3, fps=8, width=640)
