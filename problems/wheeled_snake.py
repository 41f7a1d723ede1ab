r"""Three links on a passive wheel each: they roll along themselves, and hardly slip sideways.

Wheels that never slip would leave no choice: three conditions decide the three velocities of the
body. Here rolling costs a fiftieth of slipping; as that ratio falls, the motion tends to theirs
(tests/mechanics/test_floor_contact.py).

$$\mathbf n_i \cdot \mathbf v_i \to 0, \quad i = 1, 2, 3$$
"""

from colloc import Chain, Harmonic, Problem, Wheel, solve

PROBLEM = Problem(
    name="wheeled_snake",
    body=Chain(
        (1 / 3, 1 / 3, 1 / 3),
        feet=tuple(Wheel(link, rolling=0.02, sideways=1.0) for link in range(3)),
    ),
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
)


if __name__ == "__main__":
    solution = solve(PROBLEM)
    print(solution)
    print(f"{solution.distance:.4f} body lengths, {solution.work:.4f} weight x length a cycle")
    solution.plot().savefig("wheeled_snake.png")
    solution.animate("wheeled_snake.gif", periods=1, seconds=3, fps=8, width=640)
