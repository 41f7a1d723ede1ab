"""A zoo of random problems of the kind that people have, solved with default settings and no guess.

    python -m benchmarks.zoo --problems 100
    python -m benchmarks.zoo --laws --problems 20
    python -m benchmarks.zoo --modes --problems 20
    python -m benchmarks.zoo --paced --problems 20
    python -m benchmarks.zoo --feet --problems 100
    python -m benchmarks.zoo --robots --problems 50 [--links 6] [--starts 128]

Bodies of 3 to 6 links, equal or not; mu_t from 0.3 to 10, mu_b equal to mu_f or up to 5 times it; 1
to 4 harmonics, splines and polygons; every symmetry that the body has; joints within pi, 2.5 or
2. With --laws another family: elliptic, viscous, power and own laws beside Coulomb's, other
objectives, links of different weights, motors of limited power, slopes. With --modes a third:
smooth bodies of 2 to 6 bending modes, under the friction of the first. With --paced a fourth:
bodies of 2 to 5 links, a third of them on feet, played at Froude numbers from 0.001 to 1. With
--feet a fifth: bodies of 2 to 6 links on one to three feet or wheels a link, with weights of any
share. For each: whether it is solved, its value over the best ever found for that problem (in
benchmarks/zoo_best.json, which a better answer updates), and the processor time. Failures are
printed with the reason.

With --robots robots in SI units, as `colloc init` states them: 3 to 12 links that lie or stand on
feet, wheels or both, and random limits. Each answer is compared with the best serpenoid of a grid
of amplitude and lag, with the gait that begins from it, and with that of --starts. What is in
benchmarks/zoo_robots.json is not computed again.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from colloc import (
    BSpline,
    Chain,
    Elliptic,
    Foot,
    Friction,
    Harmonic,
    ModalBody,
    OwnLaw,
    Polygon,
    PowerLaw,
    Problem,
    Robot,
    Viscous,
    Wheel,
)
from colloc.gaits.harmonic import Serpenoid, harmonics_within
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.starts import largest_amplitude
from colloc.mechanics.law import Law, rate_independent
from colloc.results.solution import SOLVED
from colloc.search.iterate import Iterate, evaluate_at, space_near
from colloc.search.solve import solve
from colloc.system.errors import CollocError

BEST = Path(__file__).with_name("zoo_best.json")
ROBOTS = Path(__file__).with_name("zoo_robots.json")
GOOD = 0.99
_KNOTS = 24
_ADMISSIBLE = 1e-3  # violation of a wave
SEED = 21


def zoo_problem(number: int) -> Problem:
    """Problem `number` of the zoo; it depends on that number alone."""
    rng = np.random.default_rng([SEED, number])
    body = _drawn_body(rng)
    mu_t, mu_b = (
        float(np.exp(rng.uniform(np.log(0.3), np.log(10.0)))),
        float(rng.choice([1.0, rng.uniform(1.0, 5.0)])),
    )
    symmetry = str(
        rng.choice(["none", "bilateral", "antipodal"] if body.symmetric else ["none", "antipodal"])
    )
    kind, limit = rng.random(), float(rng.choice([np.pi, 2.5, 2.0]))
    gait: Harmonic | BSpline | Polygon
    if kind < 0.7:
        gait = harmonics_within(int(rng.integers(1, 5)), symmetry)
    elif kind < 0.85:
        gait = BSpline(_KNOTS, symmetry=symmetry)
    else:
        gait = Polygon(2 * int(rng.integers(2, 5)), symmetry)
    return Problem(
        f"zoo-{number}",
        body=body,
        friction=Friction(mu_t=mu_t, mu_f=1.0, mu_b=mu_b),
        gait=gait,
        joint_limit=limit,
    )


def _drawn_body(rng: np.random.Generator, most: int = 6) -> Chain:
    links = int(rng.integers(3, most + 1))
    symmetric = rng.random() < 0.6
    lengths = np.full(links, 1.0) if rng.random() < 0.4 else rng.uniform(0.5, 1.5, links)
    return Chain(_parts(lengths + lengths[::-1] if symmetric else lengths))


def _parts(sizes: np.ndarray) -> tuple[float, ...]:
    """Of 1, in the proportion of the sizes."""
    parts = sizes / sizes.sum()
    return (*parts[:-1], 1.0 - parts[:-1].sum())


def law_problem(number: int) -> Problem:
    """Problem `number` of the family of other laws, objectives and limits; it depends on that
    number alone."""
    rng = np.random.default_rng([SEED + 1, number])
    body = _drawn_body(rng, 4)
    if rng.random() < 0.4:
        weights = rng.uniform(0.5, 1.5, body.n_link)
        body = Chain(
            body.lengths, weights=_parts(weights + weights[::-1] if body.symmetric else weights)
        )
    mu_t, mu_b, power = (
        np.exp(rng.uniform(np.log(0.5), np.log(5.0))),
        rng.choice([1.0, 1.5, 3.0]),
        rng.uniform(0.2, 1.6),
    )
    mu = {"mu_t": round(float(mu_t), 3), "mu_f": 1.0, "mu_b": float(mu_b)}
    along, across = f"where(vs > 0, 1, {mu['mu_b']}) * vs/speed", f"{mu['mu_t']} * vn/speed"
    weakening = "(1 + 0.5*exp(-speed))"
    laws: list[tuple[Law, str]] = [
        (Elliptic(**mu), str(rng.choice(["efficiency", "speed", "driven efficiency"]))),
        (Viscous(normal=1.0 + mu["mu_t"], tangential=1.0), "towing"),
        (PowerLaw(round(float(power), 2), **mu), f"distance ** {round(1 + power, 2)} / work"),
        (OwnLaw(f"-{along} * {weakening}", f"-{across} * {weakening}"), "efficiency"),
        (
            Friction(**mu),
            str(rng.choice(["speed", "driven efficiency", "distance / (work + 0.1 * length)"])),
        ),
    ]
    law, objective = laws[number % len(laws)]
    if number % len(laws) == 1:
        body = Chain(body.lengths)  # drag does not ask for the weight
    symmetry = str(
        rng.choice(["none", "bilateral", "antipodal"] if body.symmetric else ["none", "antipodal"])
    )
    limited = (
        {"power_limit": round(float(rng.uniform(0.3, 0.8)), 2)}
        if rng.random() < 0.3 and rate_independent(law)
        else {}
    )
    gait = harmonics_within(int(rng.integers(1, 4)), symmetry)
    if number % 10 == 9:  # on a slope that most gaits of the level still climb
        objective, limited = (
            "efficiency",
            {"grade": round(float(rng.uniform(0.02, 0.2)) * min(mu.values()), 3)},
        )
    return Problem(
        f"zoo-laws-{number}",
        body=body,
        friction=law,
        gait=gait,
        objective=objective,  # type: ignore[arg-type]
        **limited,  # type: ignore[arg-type]
    )


def modal_problem(number: int) -> Problem:
    """Problem `number` of the family of smooth bodies with a few bending modes; it depends on that
    number alone."""
    rng = np.random.default_rng([SEED + 2, number])
    gait = harmonics_within(int(rng.integers(1, 3)), str(rng.choice(["none", "antipodal"])))
    mu_t, mu_b = (
        float(np.exp(rng.uniform(np.log(0.3), np.log(10.0)))),
        float(rng.choice([1.0, rng.uniform(1.0, 5.0)])),
    )
    return Problem(
        f"zoo-modes-{number}",
        body=ModalBody(int(rng.integers(2, 7))),
        friction=Friction(mu_t=mu_t, mu_f=1.0, mu_b=mu_b),
        gait=gait,
    )


def paced_problem(number: int) -> Problem:
    """Problem `number` of the family of bodies with inertia; it depends on that number alone."""
    rng = np.random.default_rng([SEED + 3, number])
    body = _drawn_body(rng, 5)
    if rng.random() < 0.2:
        body = Chain((0.5, 0.5))
    body = Chain(body.lengths, feet=1) if rng.random() < 1 / 3 else body
    mu_t, mu_b = (
        float(np.exp(rng.uniform(np.log(0.3), np.log(5.0)))),
        float(rng.choice([1.0, rng.uniform(1.0, 3.0)])),
    )
    count, symmetry = int(rng.integers(1, 4)), str(rng.choice(["none", "antipodal"]))
    stays = body.n_link == 2 and mu_b == 1.0  # whatever its antipodal gait
    gait = harmonics_within(count, "none" if stays else symmetry)
    froude = float(f"{np.exp(rng.uniform(np.log(1e-3), 0.0)):.3g}")
    return Problem(
        f"zoo-paced-{number}",
        body=body,
        friction=Friction(mu_t=mu_t, mu_f=1.0, mu_b=mu_b),
        gait=gait,
        froude=froude,
    )


def feet_problem(number: int) -> Problem:
    """Problem `number` of the family of bodies on feet and wheels; it depends on that number
    alone."""
    rng = np.random.default_rng([SEED + 4, number])
    body = _drawn_body(rng, 6)
    if rng.random() < 0.15:
        body = Chain((0.5, 0.5))
    mu_t, mu_b = (
        float(np.exp(rng.uniform(np.log(0.3), np.log(10.0)))),
        float(rng.choice([1.0, rng.uniform(1.0, 5.0)])),
    )
    if body.n_link == 2 and mu_b == 1.0:
        mu_b = float(rng.uniform(2.0, 5.0))  # else no gait of one joint goes anywhere
    body = Chain(body.lengths, feet=_drawn_feet(rng, body))
    symmetry = str(
        rng.choice(["none", "bilateral", "antipodal"] if body.symmetric else ["none", "antipodal"])
    )
    gait: Harmonic | BSpline = harmonics_within(int(rng.integers(1, 4)), symmetry)
    if body.n_link > 2 and rng.random() < 0.15:
        rng.choice([1.0, 2.0, 4.0])  # in vain, so that what follows is drawn as it ever was
        gait = BSpline(_KNOTS, symmetry=symmetry)
    limit = float(rng.choice([np.pi, 2.5, 2.0]))
    return Problem(
        f"zoo-feet-{number}",
        body=body,
        friction=Friction(mu_t=mu_t, mu_f=1.0, mu_b=mu_b),
        gait=gait,
        joint_limit=limit,
    )


def _drawn_feet(rng: np.random.Generator, body: Chain) -> tuple[Foot, ...]:
    """One to three a link, feet or wheels, anywhere on it or evenly spread, the same on mirrored
    links of symmetric bodies."""
    kind, spread, each, feet = (
        rng.random(),
        rng.random() < 0.5,
        int(rng.integers(1, 4)),
        list[Foot](),
    )
    # on wheels, the same either way, one joint leads nowhere
    kind = 1.0 if body.n_link == 2 else kind
    shares = rng.uniform(0.5, 1.5, body.n_link)
    shares = shares + shares[::-1] if body.symmetric else shares
    for link in range(body.n_link):
        mirrored = body.symmetric and link > (body.n_link - 1) / 2
        if mirrored:
            feet += [
                foot.from_head(body.n_link) for foot in feet if foot.link == body.n_link - 1 - link
            ]
            continue
        places = (np.arange(each) + 0.5) / each if spread else np.sort(rng.uniform(0.0, 1.0, each))
        if body.symmetric and 2 * link == body.n_link - 1:
            places = 0.5 * (places + 1 - places[::-1])
        wheeled = kind < 0.25 or (kind < 0.4 and rng.random() < 0.5)
        rolling = round(float(np.exp(rng.uniform(np.log(0.01), np.log(0.5)))), 3)
        for place in places:
            foot = (
                Wheel(link, float(place), rolling=rolling) if wheeled else Foot(link, float(place))
            )
            feet.append(replace(foot, weight=shares[link] / shares.sum() / each))
    return tuple(feet)


def robot_problem(number: int) -> Problem:
    """Problem `number` of the family of robots; it depends on that number alone. Among any ten in
    a row are all numbers of links, and among the small ones all floors."""
    rng = np.random.default_rng([SEED + 5, number])
    links = 3 + 3 * number % 10
    floor = (links + number // 10) % 4
    mu, uneven = float(rng.uniform(0.2, 0.8)), rng.random() < 0.5
    rolling = round(float(rng.uniform(0.01, 0.1)), 3)
    on_wheels = rng.permutation(links) < links / 2 if floor == 3 else [floor == 2] * links
    feet = tuple(
        Wheel(k, rolling=rolling, sideways=round(mu, 2)) if rolls else Foot(k)
        for k, rolls in enumerate(on_wheels)
    )
    lengths = _parts(rng.uniform(0.5, 1.5, links) if uneven else np.ones(links))
    length, mass, period = (
        float(f"{np.exp(rng.uniform(np.log(a), np.log(b))):.2g}")
        for a, b in ((0.3, 1.5), (0.3, 5.0), (1.5, 15.0))
    )
    limits: dict[str, Any] = {}
    if rng.random() < 0.5:
        limits["max_speed"] = round(float(rng.uniform(2.0, 8.0)), 1)
    if rng.random() < 0.4:
        limits["max_torque"] = float(f"{rng.uniform(0.1, 0.4) * mu * mass * 9.81 * length:.2g}")
    if idle := rng.random() < 0.6:
        limits["idle_power"] = float(f"{np.exp(rng.uniform(np.log(0.1), np.log(4.0))):.2g}")
    joints = np.radians(np.round(rng.uniform(50.0, 110.0, links - 1)))
    problem = Problem(
        f"zoo-robots-{number}",
        body=Chain(lengths, feet=feet if floor else 0),
        friction=Friction(*[round(mu, 2)] * 3),
        gait=Harmonic(2, "none"),
        joint_limit=tuple(joints) if rng.random() < 0.3 else joints[0],
        robot=Robot(length=length, mass=mass, period=period, **limits),
        least_distance=None if idle else 0.1,
    )
    if problem.froude or lengths != lengths[::-1] or floor == 3:
        return problem
    return problem.with_(gait=Harmonic(2, "bilateral"), guess=None)


def best_serpenoid(problem: Problem) -> Iterate:
    """The best of the serpenoid waves of one harmonic that keep all limits, or else the one that
    exceeds them least, of ten amplitudes and thirty lags. None has an offset, which turns the
    body."""
    waves, n = [], problem.body.n_joint
    for lag in np.linspace(-np.pi, np.pi, 30):
        unit = Serpenoid(1, "antipodal").member(np.array([lag, 1.0]), n)
        for part in np.linspace(0.1, 1.0, 10) * largest_amplitude(problem, unit):
            with suppress(CollocError):
                near = space_near(problem, unit.scaled(part))
                waves.append(evaluate_at(*near, problem.delta))
    return min(waves, key=lambda wave: (max(wave.violation, _ADMISSIBLE), wave.objective))


def compare_robot(number: int, starts: int | None) -> dict[str, Any]:
    """What different ways lead to for a robot: values, 0 of what is not solved, and seconds."""
    problem = robot_problem(number)
    row = _stored(ROBOTS).get(problem.name, {"at least": {}})

    def keep(way: str, compute: Callable[[], Any]) -> Any:
        begin, outcome = time.process_time(), None
        try:
            outcome = compute()
        except CollocError as error:
            print(f"{problem.name}, {way}: {error}")
        if isinstance(outcome, Iterate):
            good = outcome.violation <= _ADMISSIBLE
        else:
            good = outcome is not None and outcome.status == SOLVED
        row[way] = outcome.value if outcome is not None and good else 0.0
        if way == "default" and outcome is not None:
            row["at least"] = {aim.name: least for aim, least in outcome.problem.at_least}
        row[f"{way} [s]"] = round(time.process_time() - begin, 1)
        rows = _stored(ROBOTS) | {problem.name: row}
        ROBOTS.write_text(json.dumps(rows, indent=1, sort_keys=True) + "\n", encoding="utf-8")
        return outcome

    if "default" not in row:
        keep("default", lambda: solve(problem))
    problem = problem.with_(at_least=row["at least"])
    if "begun from it" not in row and (wave := keep("serpenoid", lambda: best_serpenoid(problem))):
        keep("begun from it", lambda: solve(problem.with_(guess=wave.gait), 1))
    if starts and f"{starts} starts" not in row:
        keep(f"{starts} starts", lambda: solve(problem, starts))
    return row


def described(problem: Problem) -> str:
    """In one line."""
    law, best = (
        problem.friction.label,
        "" if problem.objective == EFFICIENCY else f"best {problem.objective.name}, ",
    )
    limit = f", power within {problem.power_limit:g}" if problem.power_limit else ""
    slope = f", on a slope of {problem.grade:g}" if problem.grade else ""
    paced = f", Fr = {problem.froude:g}" if problem.froude else ""
    shapes = f"{problem.gait.describe()}, within {problem.joint_limit:.2f}"
    return f"{best}{problem.body.describe()}, {law} {shapes}{limit}{slope}{paced}"


def _stored(path: Path) -> dict[str, Any]:
    """What is known of problems, by name: the best value ever found, or the ways to it."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def compare_robots(numbers: range, links: int, starts: int | None) -> None:
    """Compare and print robots of at most so many links."""
    ratios = []
    for number in numbers:
        problem = robot_problem(number)
        if problem.body.n_joint >= links:
            continue
        row = compare_robot(number, starts)
        values = {way: row[way] for way in row if f"{way} [s]" in row}
        best = max(values.values())
        ratios.append(values["default"] / best)
        shown = ", ".join(
            f"{x} {v / best:.4f} ({row[f'{x} [s]']:.0f} s)" for x, v in values.items()
        )
        print(f"{number:4d} {best:9.6f} {shown}; {problem.body.describe()}", flush=True)
    n_good = sum(ratio > GOOD for ratio in ratios)
    print(f"{n_good} of {len(ratios)} within 1 % of the best of all")


def main() -> None:
    """Run the zoo and print what came out."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--problems", type=int, default=100, metavar="N")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="begin with this one")
    parser.add_argument("--starts", type=int, metavar="N", help="more look for better answers")
    family = parser.add_mutually_exclusive_group()
    for flag, of, what in (
        ("--laws", law_problem, "other laws, objectives and limits"),
        ("--modes", modal_problem, "smooth bodies of a few bending modes"),
        ("--paced", paced_problem, "bodies with inertia"),
        ("--feet", feet_problem, "bodies on feet and wheels"),
        ("--robots", robot_problem, "robots in SI units, beside serpenoid gaits"),
    ):
        family.add_argument(flag, dest="of", action="store_const", const=of, help=what)
    parser.add_argument("--links", type=int, default=12, metavar="N", help="robots of no more")
    parser.set_defaults(of=zoo_problem)
    options = parser.parse_args()
    if options.of is robot_problem:
        numbers = range(options.first, options.first + options.problems)
        compare_robots(numbers, options.links, options.starts)
        return
    best = _stored(BEST)
    solved, quality, seconds = [], [], []
    for number in range(options.first, options.first + options.problems):
        problem = options.of(number)
        begin = time.process_time()
        try:
            solution = solve(problem, options.starts)
            # the best ever found may be as small as its bound allows
            best_of_both = solution.shrunk or solution
            status, value, message = solution.status, best_of_both.value, solution.message
        except Exception as error:  # whatever goes wrong is what this is looking for
            status, value, message = "error", np.nan, f"{type(error).__name__}: {error}"
        seconds.append(time.process_time() - begin)
        solved.append(status == SOLVED)
        if status == SOLVED and value > best.get(problem.name, 0.0):
            best = {**_stored(BEST), problem.name: value}  # another run may have written meanwhile
            BEST.write_text(json.dumps(best, indent=1, sort_keys=True) + "\n", encoding="utf-8")
        quality.append(value / best[problem.name] if solved[-1] else 0.0)
        line = (
            f"{number:4d} {status:18s} {value:9.6f} {quality[-1]:7.4f} {seconds[-1]:7.2f} s  "
            f"{described(problem)}"
        )
        print(line + (f"\n     {message}" if message else ""), flush=True)
    n = len(solved)
    print(
        f"{sum(solved)} of {n} solved; {sum(q > GOOD for q in quality)} within 1 % of the "
        f"best known"
    )
    print(f"processor time: median {np.median(seconds):.2f} s, largest {max(seconds):.2f} s")


if __name__ == "__main__":
    main()
