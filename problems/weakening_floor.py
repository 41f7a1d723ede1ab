r"""A friction law of your own: half as much again at rest as when sliding fast.

Parts that rest hold on by more than sliding parts have to pay, so crawling is easier than with the
same friction at all speeds (0.260). The cycle takes 1: here friction knows the pace.

$$\mathbf f = -\frac{\mathbf v}{|\mathbf v|}\left(1 + \tfrac12 e^{-|\mathbf v|}\right)$$
"""

from colloc import Harmonic, OwnLaw, Problem, solve

PROBLEM = Problem(
    name="weakening_floor",
    friction=OwnLaw(
        tangential="-vs/speed * (1 + 0.5*exp(-speed))",
        normal="-vn/speed * (1 + 0.5*exp(-speed))",
    ),
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
)
STARTS = 1  # formulas take 70 times as long as `Friction`


if __name__ == "__main__":
    solution = solve(PROBLEM, starts=STARTS)
    print(solution)
    print(f"{solution.distance:.4f} body lengths, {solution.work:.4f} weight x length a cycle")
    solution.plot().savefig("weakening_floor.png")
    solution.animate("weakening_floor.gif", periods=1, seconds=3, fps=8, width=640)
