r"""The paper's concertina crawler (figure 13, A to D): a bump that travels along a straight body.

The bump, of arc length epsilon, forms behind the middle, moves on to the front and flattens there;
then comes the mirror image. The motion is prescribed. As the bump shrinks, nearly all of the body
rests, and d/W tends to the bound 1 (`python -m scripts.continue_epsilon`).

$$\Theta = a(t)\,h\!\left(\frac{2\,(s - c(t))}{\varepsilon}\right), \qquad
h(x) = -k\,x\,(1 - x^2)^3, \quad |x| \le 1, \; \max h = 1$$
"""

from colloc import Concertina, Problem, Reference, solve

PROBLEM = Problem("concertina", body=Concertina(epsilon=0.1, amplitude=1.3), delta=2.5e-5)
REFERENCE = Reference(
    0.862892,
    2e-6,
    "python -m scripts.continue_epsilon; as epsilon -> 0 it tends to the paper's bound, 1",
)
EPSILONS = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)


if __name__ == "__main__":
    solution = solve(PROBLEM)
    print(solution)
    print(f"{solution.distance:.4f} body lengths, {solution.work:.4f} weight x length a cycle")
    solution.plot().savefig("concertina.png")
    solution.animate("concertina.gif", periods=1, seconds=3, fps=8, width=640)
