r"""A smooth body with friction much larger sideways (paper, figure 5B): which wave is best?

It hardly slips sideways, so it follows its own track. The paper's wave, Theta = sin(2 pi (s + t)),
reaches 0.737; six bending modes, each with a sine in time, do better.

$$\Theta(s, t) = \sum_{m=1}^6 (a_m \cos 2\pi t + b_m \sin 2\pi t)\,P_m(2s - 1)$$
"""

from colloc import Friction, Harmonic, ModalBody, Problem, solve

PROBLEM = Problem(
    name="smooth_low_mode",
    body=ModalBody(modes=6, basis="legendre"),
    friction=Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0),
    gait=Harmonic(1, "antipodal"),
)


if __name__ == "__main__":
    solution = solve(PROBLEM)
    print(solution)
    print(f"{solution.distance:.4f} body lengths, {solution.work:.4f} weight x length a cycle")
    solution.plot().savefig("smooth_low_mode.png")
    solution.animate("smooth_low_mode.gif", periods=1, seconds=3, fps=8, width=640)
