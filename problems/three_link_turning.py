r"""Three links turn by 30 degrees a cycle with the least work.

No symmetry closes the rotation: it is a constraint of the problem, and the certificate checks it by
an independent replay.

$$\theta(1) - \theta(0) = \frac\pi6, \qquad \max \frac{\theta(1) - \theta(0)}{W}$$
"""

import numpy as np

from colloc import Fourier, Friction, Harmonic, Problem, solve

PROBLEM = Problem(
    name="three_link_turning",
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=1, symmetry="none"),
    guess=Fourier(np.array([0.5, 0.5]), np.array([[1.0], [0.2]]), np.array([[0.0], [1.0]])),
    objective="turning",
    rotation=np.pi / 6,
)


if __name__ == "__main__":
    solution = solve(PROBLEM)
    print(solution)
    print(
        f"{np.degrees(solution.rotation):.3f} degrees, {solution.work:.4f} weight x length a cycle"
    )
    solution.plot().savefig("three_link_turning.png")
    solution.animate("three_link_turning.gif", periods=1, seconds=3, fps=8, width=640)
