"""Low-mode gaits of a smooth body, from the paper's wave and from chains of links: python -m scripts.optimise_smooth.

With problem files as arguments, each one's PROBLEM is solved; otherwise a table over friction, modes and harmonics.
Results go to results/smooth/NAME.h5.
"""

import argparse
import runpy
import sys
import time
from pathlib import Path

import numpy as np

from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.problem import Problem
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction
from colloc.search.modal_optimum import ModalOptimum, optimise_modal
from colloc.search.optimise import optimum
from colloc.smooth.modal_body import ModalBody
from colloc.smooth.modal_problem import ModalProblem
from colloc.smooth.period import measured_period
from colloc.system.errors import CollocError
from scripts.paper.array_store import write_arrays

FRICTIONS = [Friction(100.0, 1.0, 1.0), Friction(10.0, 1.0, 1.0), Friction(), Friction(1.0, 1.0, 3.0), Friction(1.0, 3.0, 3.0)]
CLASSES = [(4, 1), (6, 1), (6, 3)]
LINKS = 5
OUT = Path("results/smooth")


def chain_start(body: ModalBody, friction: Friction) -> Fourier:
    """The optimum of a chain of equal links, from a wave along it, on the modes of a smooth body."""
    s = np.arange(1, LINKS) / LINKS
    guess = Fourier(np.zeros(LINKS - 1), 0.8 * np.cos(2 * np.pi * s)[:, None], -0.8 * np.sin(2 * np.pi * s)[:, None])
    chain = Chain((1.0 / LINKS,) * LINKS)
    problem = Problem("chain", guess, chain, friction, Harmonic(1, "antipodal"), delta=1e-2, mesh_tolerance=0)
    return body.prolonged(np.array(chain.lengths), optimum(problem).gait)


def admissible(problem: ModalProblem, guess: Fourier) -> Fourier:
    """The guess, with smaller amplitudes if it bends the body too far."""
    scale = min(1.0, 0.95 * problem.largest_angle / problem.steepest(problem.member(problem.gait.parameters(guess))))
    return Fourier(guess.mean, scale * guess.cos, scale * guess.sin)


def stored(found: ModalOptimum) -> None:
    """Write the gait, the replayed period and the checks."""
    arrays = {
        "mean": found.gait.mean,
        "cos": found.gait.cos,
        "sin": found.gait.sin,
        "efficiency": found.efficiency,
        "d": found.period.d,
        "W": found.period.W,
        "checks/name": [c.name for c in found.checks],
        "checks/value": [c.value for c in found.checks],
        "checks/threshold": [c.threshold for c in found.checks],
        "levels/delta": [delta for delta, _ in found.levels],
        "levels/iterations": [result.iterations for _, result in found.levels],
    }
    problem = found.problem
    described = {"body": repr(problem.body), "friction": repr(problem.friction), "gait": repr(problem.gait)}
    write_arrays(OUT / f"{problem.name}.h5", arrays, units={"mean": "rad", "cos": "rad", "sin": "rad"}, attributes=described)


def row(problem: ModalProblem, starts: dict[str, Fourier], reference: float) -> None:
    """Solve from every start, store the best and print a line."""
    results, clock = {}, time.process_time()
    for name, guess in starts.items():
        try:
            results[name] = optimise_modal(problem.with_(guess=admissible(problem, guess)))
        except CollocError as error:
            print(f"  from the {name}: {error}", file=sys.stderr)
    seconds = time.process_time() - clock
    if not results:
        return
    best = max(results, key=lambda name: (results[name].certified, results[name].efficiency))
    found, friction = results[best], problem.friction
    stored(found)
    failed = ", ".join(c.name for c in found.checks if not c.passed) or "certified"
    print(
        f"({friction.mu_t:g}, {friction.mu_f:g}, {friction.mu_b:g}) | {problem.body.modes} {problem.body.basis} | "
        f"{problem.gait.harmonics} | {reference:.4f} | {found.efficiency:.6f} | {found.period.errors['efficiency']:.0e} | "
        f"{best} ({sum(r.certified for r in results.values())}/{len(starts)}) | {found.iterations} | {seconds:.0f} | {failed}",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("problems", nargs="*", help="problem files; by default a table over frictions and numbers of modes")
    options = parser.parse_args()
    print(
        "mu_t, mu_f, mu_b | modes | harmonics | wave | optimised | +- | best start (certified) | iterations | CPU s | verdict"
    )
    print("--- | --- | --- | --- | --- | --- | --- | --- | --- | ---")
    if options.problems:
        problems = [runpy.run_path(name)["PROBLEM"] for name in options.problems]
        cases = [(p, {"guess": p.guess}) for p in problems]
    else:
        cases = []
        for friction in FRICTIONS:
            for modes, harmonics in CLASSES:
                body = ModalBody(modes)
                name = f"smooth_{friction.mu_t:g}_{friction.mu_f:g}_{friction.mu_b:g}_{modes}_{harmonics}"
                problem = ModalProblem(name, body.wave(1.0), body, friction, Harmonic(harmonics, "antipodal"))
                backward = Fourier(problem.guess.mean, problem.guess.cos, -problem.guess.sin)
                chained = chain_start(body, friction)
                cases.append((problem, {"wave": problem.guess, "backward wave": backward, "chain": chained}))
    for problem, starts in cases:
        waves = (problem.body.motion(guess, True) for guess in (problem.body.wave(1.0), starts.get("backward wave")) if guess)
        reference = max(measured_period(wave, problem.friction, problem.delta).efficiency for wave in waves)
        row(problem, starts, reference)


if __name__ == "__main__":
    main()
