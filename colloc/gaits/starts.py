"""Gaits to start from: a travelling wave, random ones, or a gait of another class or chain.

The wave is ``q_j(t) = a sin(2 pi t - 2 pi w (s_j - 1/2))``, joint j at s_j along the body, tail at
0 and head at 1; w > 0 travels towards the head. It has both symmetries about the middle of a body
whose lengths read the same from both ends.

Admissible shapes stay so when all angles shrink together. So a gait is sampled as a direction in
the space of parameters times a fraction of the largest admissible amplitude. Start number k of a
seed does not depend on the number of starts.
"""

from typing import Any

import numpy as np

from colloc.gaits.gait import symmetric_samples
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.robot import Limit, under_one_limit
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_depth, link_width
from colloc.system.errors import ProblemError

WAVES = -1.0
"""Waves along the body: towards the tail, which carries a body with mu_t > mu_f head first."""
_SHARE, _LARGEST, _MOVING = 0.6, 1.5, 1.05
"""Amplitude: share of the largest, at most [rad], or times the least that moves enough."""
_PHASES, _CHECKED = np.linspace(0.0, 1.0, 201), np.arange(2000) / 2000
SAFE = 1 - 1e-3
"""Shapes as large as may be are scaled by this, to be clearly admissible."""
_BISECTIONS = 21  # to a thousandth of the margin above
_SLACK = 1e-6  # depth of a crossing that a certificate allows
_AT_THE_BOUND = 1e-2
"""Sampling cuts the corners of an optimum on the lower bound of the shape speed."""
_MOVES = 1e-3  # shape speed, of a wave's, below which a class has nothing of the wave
LATIN_HYPERCUBE, PERTURBED = "latin-hypercube", "perturbed"
SAMPLERS = (LATIN_HYPERCUBE, PERTURBED)
BLOCK = 25
"""Starts per Latin hypercube: start k is of hypercube k // BLOCK, which has a seed of its own."""
LARGEST_SEED = 2**63 - 1
"""Files keep seeds and numbers of starts in so many bits."""
_FRACTIONS = (0.2, 0.95)  # of the largest admissible amplitude
_EVENLY = np.arange(200) / 200
_ATTEMPTS = 200
_CLEARLY_MOVING = 1.5  # shape speed, of the smallest
_SPREAD = 0.3  # standard deviation of perturbed coefficients [rad]
_ON_FLOOR = 1e-4
_SHORT = 1.002  # a path on the lower bound of its length is shorter as a polyline
_VISIBLE = np.pi / 20
"""Least swing of a joint to either side [rad] that a person sees."""
_PERIOD = np.linspace(0.0, 1.0, 1001)
_NEAR = 10.0
"""First delta of a search from a known optimum, of the final one: more prefers other gaits."""


def largest_factor(
    body: Body,
    joint_limit: Limit,
    angles: np.ndarray,
    rest: np.ndarray | float = 0.0,
    least: float = 0.0,
) -> float:
    """The largest factor that leaves shapes ``(n_joint, n)`` admissible, 0 if it is below `least`;
    inf for straight ones."""
    angles = angles - rest
    stretched, joint_limit = under_one_limit(angles, joint_limit)
    peak = body.bounded_angles.largest(stretched).max()
    if peak == 0:
        return np.inf

    def crosses(factor):
        return bool(crossing_depth(body, factor * angles + rest).any())

    low, high = 0.0, joint_limit / peak
    if high * SAFE < least or (least > 0 and crosses(least / SAFE)):
        return 0.0
    if not crosses(high):
        return high * SAFE
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if crosses(middle) else (middle, high)
    return low * SAFE


def travelling_wave(
    body: Body, joint_limit: Limit, waves: float = WAVES, least: float = 0.0
) -> Fourier:
    """A wave along a body; where it moves less than `least`, up to each joint's own limit."""
    cos, sin = body.wave(waves)
    unit = Fourier(np.zeros(body.n_joint), cos[:, None], sin[:, None])
    angles = unit.angles(_PHASES)
    wave = unit.grown(min(_SHARE * largest_factor(body, joint_limit, angles), _LARGEST))
    if wave.shape_speed >= least:
        return wave
    stretched = np.abs(under_one_limit(angles, joint_limit)[0]).max(axis=1)
    proportions = np.abs(angles).max(axis=1) / np.maximum(stretched, np.finfo(float).tiny)
    each = unit.transform(np.diag(proportions))
    largest = largest_factor(body, joint_limit, each.angles(_PHASES))
    return each.grown(min(largest, _MOVING * least / each.shape_speed))


def largest_share(gait: Any, speeds: tuple[float, ...]) -> float:
    """Largest ratio of a gait's motor speeds to their limits [rad per period]; 0 without limits."""
    if not speeds:
        return 0.0
    fastest = np.abs(gait.motor_gait.rates(_PHASES)).max(axis=1)
    return float((fastest / np.array(speeds)).max())


def initial_member(gait_class: Any, wave: Fourier) -> Any:
    """A wave in a class: itself, the nearest member as fast, or else all functions at once."""
    if gait_class.relative_delta or not gait_class.free or isinstance(gait_class, Harmonic):
        return wave
    member = gait_class.through(wave)
    if member.shape_speed <= _MOVES * wave.shape_speed:
        member = gait_class.member(np.ones(gait_class.size(wave.n_joint)), wave.n_joint)
    return member.scaled(wave.shape_speed / member.shape_speed)


def checked_member(gait_class: Any, gait: Any) -> tuple[Any, float]:
    """The gait of a class that a guess stands for, and its shape speed."""
    if gait_class.free and not gait_class.relative_delta:
        member = gait_class.member(gait_class.parameters(gait_class.through(gait)), gait.n_joint)
        return member, member.shape_speed
    points = symmetric_samples(gait, gait_class.symmetry)
    length = np.linalg.norm(np.diff(points), axis=0).sum()
    return gait, float(length / (2 * np.pi * gait_class.fraction))


def default_guess(problem: Any) -> Any:
    """A wave in a class, no joint of it faster than allowed. `ProblemError` if it hardly moves."""
    body, limit, least = problem.body, problem.joint_limit, problem.smallest_shape_speed
    gait = initial_member(problem.gait, travelling_wave(body, limit, least=least))
    if gait.joint_map is not None:
        most = largest_factor(body, limit, gait.angles(_PHASES), gait.rest)
        gait = gait.scaled(min(1.0, most))
    if (share := largest_share(gait, problem.largest_speeds)) > 1:
        gait = gait.scaled(1 / share)
    _, rms = checked_member(problem.gait, gait)
    if rms < least * (1 - _AT_THE_BOUND):
        raise ProblemError(
            f"with {'speed_limit' if share > 1 else 'joint_limit'} the usual first gait has a "
            f"root-mean-square shape speed of {rms:.2g}, less than smallest_shape_speed = "
            f"{least:g}: make that smaller, or give a guess."
        )
    return gait


def check_guess(problem: Any) -> None:
    """Raise a `ProblemError` for a gait of another body, at rest, or inadmissible."""
    body, guess, least = problem.body, problem.guess, problem.smallest_shape_speed
    if guess.n_joint != body.n_joint:
        raise ProblemError(
            f"guess has {guess.n_joint} {body.defaults.coordinate}s but the body has "
            f"{body.n_joint}."
        )
    member, rms = checked_member(problem.gait, guess)
    if rms < least * (1 - _AT_THE_BOUND):
        raise ProblemError(
            f"guess hardly moves (root-mean-square shape speed {rms:.3g} < smallest_shape_speed "
            f"{least:g}); does it have the symmetry {problem.gait.symmetry!r} of its "
            f"class?"
        )
    angles, bounded = member.angles(_CHECKED), body.bounded_angles
    stretched, limit = under_one_limit(angles, problem.joint_limit)
    largest, depth, what = bounded.largest(stretched).max(), crossing_depth(body, angles), ""
    if largest > limit + body.defaults.excess:
        each = np.abs(bounded.rows @ stretched).max(axis=1, initial=0.0)
        which = bounded.names[np.argmax(each)] if each.size else "the tangent"
        what = f"{which} reaches {largest:.4g} rad, beyond the limit {limit:.4g}"
    elif depth.max() > _SLACK:
        how = "overlap" if link_width(body) else "cross each other"
        what = f"links {how} at phase {_CHECKED[np.argmax(depth)]:.3f}"
    if what:
        raise ProblemError(f"guess is inadmissible: {what}; make its amplitude smaller.")


def largest_amplitude(problem: Any, gait: Any, least: float = 0.0) -> float:
    """`largest_factor` of a gait that keeps limits of speed, too."""
    angles = gait.angles(_EVENLY)
    largest = largest_factor(problem.body, problem.joint_limit, angles, gait.rest, least)
    share = largest_share(gait, problem.largest_speeds)
    return min(largest, 1 / share) if share else largest


def on_speed_floor(problem: Any, gait: Any) -> bool:
    """True if a gait is as slow as is allowed, which then decided its size."""
    return gait.shape_speed < problem.smallest_shape_speed * (1 + _ON_FLOOR)


def is_visible(gait: Any) -> bool:
    """True if a person sees a gait move: a joint swings by 9 degrees or more to either side."""
    return bool(np.ptp(gait.angles(_PERIOD), axis=1).max() >= 2 * _VISIBLE)


def latin_hypercube(n: int, dimension: int, rng: np.random.Generator) -> np.ndarray:
    """Points ``(n, dimension)`` as of `scipy.stats.qmc`, which takes half a second to load."""
    within, order = rng.uniform(size=(n, dimension)), np.tile(np.arange(1, n + 1), (dimension, 1))
    for coordinate in order:
        rng.shuffle(coordinate)
    return (order.T - within) / n


def latin_hypercube_gait(problem: Any, seed: int, start: int) -> Any:
    """Start of a Latin hypercube over a class that clearly moves, or the fastest of many."""
    block, row = divmod(start, BLOCK)
    seeds, n_joint = problem.gait.start_class, problem.body.n_joint
    least = problem.smallest_shape_speed
    fastest: Any = None
    dimension = seeds.sample_dimension(n_joint) + 1
    rng = np.random.default_rng([seed, block]).spawn(1)[0]  # as newer releases of SciPy do
    unit = latin_hypercube(BLOCK, dimension, rng)[row]
    again = np.random.default_rng([seed, block, row + 1])
    for _ in range(_ATTEMPTS + 1):
        fraction = _FRACTIONS[0] + unit[-1] * (_FRACTIONS[1] - _FRACTIONS[0])
        faster_than = 0.0 if fastest is None else fastest.shape_speed
        gait = _with_amplitude(problem, seeds.sample(unit[:-1], n_joint), fraction, faster_than)
        if fastest is None or gait.shape_speed > faster_than:
            fastest = gait
        if fastest.shape_speed > _CLEARLY_MOVING * least:
            return fastest
        unit = again.random(dimension)
    if fastest.shape_speed > least:
        return fastest
    raise ProblemError(
        f"found no admissible start as fast as smallest_shape_speed {least:g}; make it smaller."
    )


def _with_amplitude(problem: Any, gait: Any, fraction: float, faster_than: float = 0.0) -> Any:
    """The class member nearest to a gait, at a fraction of the largest admissible amplitude; at
    rest unless it is faster then."""
    seeds = problem.gait.start_class
    member = seeds.member(seeds.parameters(gait), problem.body.n_joint)
    speed = fraction * member.shape_speed
    largest = largest_amplitude(problem, member, faster_than / speed if speed else 0.0)
    return member.scaled(fraction * largest) if np.isfinite(largest) else member


def start_gait(problem: Any, sampler: str, seed: int, start: int) -> Any:
    """Start number `start`; with the sampler "perturbed" near the guess, whose coefficients move by
    normals."""
    if sampler != PERTURBED:
        return latin_hypercube_gait(problem, seed, start)
    rng = np.random.default_rng([seed, start])
    for _ in range(_ATTEMPTS):
        member = problem.gait.start_class.perturb(problem.guess, _SPREAD, 0, rng)
        gait = _with_amplitude(problem, member, min(1.0, 1.0 / largest_amplitude(problem, member)))
        if gait.shape_speed > _CLEARLY_MOVING * problem.smallest_shape_speed:
            return gait
    raise ProblemError(f"found no admissible start within {_SPREAD:g} rad of the guess.")


def to_body(gait: Any, body: Chain, other: Body, joint_limit: Limit = float(np.pi)) -> Any:
    """Transfer a gait of a chain: every link gets the mean tangent angle of the part of the body it
    covers, and all angles shrink until they are admissible."""
    matrix = other.from_chain(np.array(body.lengths))
    angles = matrix @ gait.angles(_PERIOD)
    return gait.transform(matrix * min(1.0, largest_factor(other, joint_limit, angles)))


def to_class(problem: Any, gait_class: Any, gait: Any) -> Any:
    """Transfer a gait to a class: a truncated series overshoots, and cuts corners."""
    start = gait_class.through(gait)
    growth = 2 * np.pi * problem.smallest_shape_speed / start.length
    if growth > _SHORT:
        start = start.grown(growth)
    if start is gait or not start.is_series:
        return start
    angles = start.angles(_PERIOD)
    most = largest_factor(problem.body, problem.joint_limit, angles, start.rest)
    return start.scaled(min(1.0, most))


def warm_start(problem: Any, gait: Any, gait_class: Any, **changes: object) -> Any:
    """The problem in another class, from a known optimum, with delta as to the shape speed."""
    relative = problem.delta / (1.0 if problem.gait.relative_delta else problem.guess.length)
    delta = relative * (1.0 if gait_class.relative_delta else gait.length)
    fields = {"gait": gait_class, "delta": delta, "delta_start": _NEAR * delta}
    fields["guess"] = to_class(problem, gait_class, gait)
    return problem.with_(**(fields | changes))
