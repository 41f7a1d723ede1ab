"""Tolerances and heuristics of a search, each with what it trades."""

from dataclasses import asdict, dataclass

import numpy as np


@dataclass(frozen=True)
class Tolerances:
    """Largest values that pass a certificate.

    `kkt` also bounds the balance of forces and the penetration of links [body lengths]; `kink` is
    the radius [rad] of the ball in which gradients are sampled at a suspected kink.
    """

    kkt: float = 1e-6
    violation: float = 1e-8
    closure: float = 1e-9
    work_balance: float = 1e-7
    # collocated against replayed objective, relative. The distance of a body that turns depends to
    # first order on the point of it that is followed, so the rotation is limited by that
    replay_gap: float = 1e-4
    # off the direction asked for on a slope, or turned by a gait that goes nowhere [rad]
    angle: float = 1e-3
    # part of a period at which several motions on a slope may be balanced
    nonunique_fraction: float = 1e-3
    # curvature over the value [1/rad^2]: a tenth of a radian along it gains 5e-5
    saddle: float = 1e-2
    # efficiency times the smallest friction coefficient, below which a gait goes nowhere
    zero_value: float = 1e-4
    kink: float = 1e-5


@dataclass(frozen=True)
class SearchOptions:
    """Heuristics of a search: they decide what it costs and which optimum it meets, not what is
    certified."""

    # tolerances of the KKT error: to tell gaits apart, on the way, and at the end
    coarse_kkt: float = 1e-1
    medium_kkt: float = 1e-3
    fine_kkt: float = 1e-6
    # starts, and without improvement after which the search ends; at most `max_starts` times as
    # many
    starts: int = 32
    patience: int = 8
    max_starts: int = 3
    # distinct gaits followed to the final delta, if they have this part of the best value on the
    # coarse mesh; the whole mesh is for those that close to the best at the final one
    followed: int = 3
    promising: float = 0.8
    close: float = 0.01
    # basin hopping [rad]: at 0.2 a hop mostly falls back, at 0.8 it lands where any start would
    hop: float = 0.4
    # root-mean-square shape speed searched where no optimum is of finite size: five joints that
    # swing by 18 degrees
    min_size: float = 0.5
    # ratio of successive deltas; a gait that loses `lost` of its value at the next one owes it to
    # regularised friction
    delta_ratio: float = 0.2
    lost: float = 0.5
    # trust-region radius [rad]: an optimum moves less, and a step stays in its basin
    radius: float = 1.0
    # subproblems end once the violation or the end of a round changes by less than this part
    stalled: float = 0.1
    # step along negative curvature, over the norm of the parameters; its square where that rises
    saddle_step: float = 0.1
    # meshes, the first ones with the usual aim; points of a mesh over those of the last one
    meshes: int = 8
    meshes_of_first_aim: int = 2
    growth: int = 4
    # panels of a smooth body, and the error they may leave over that of the mesh: every doubling
    # was seen to leave a sixth or less
    max_panels: int = 128
    panel_error: float = 6.0
    # distance [rad] within which IPOPT has to confirm a gait
    confirm_radius: float = 0.01
    # starts of the search for the farthest gait, of which `least_distance` may be a half
    reach_starts: int = 8
    # parameters for which the curvature is measured, at two gradients each
    max_curvature_parameters: int = 150
    # gaits tried until a certificate passes, saddles left, smaller deltas tried
    attempts: int = 3
    # part of the time allowed that is for starts
    exploring: float = 0.6
    # seconds of work left for which another process is begun
    worth_a_process: float = 2.0
    # seconds between writes of the checkpoint
    checkpoint_interval: float = 2.0


TOLERANCES = Tolerances()
OPTIONS = SearchOptions()
COARSE, MEDIUM, FINE = OPTIONS.coarse_kkt, OPTIONS.medium_kkt, OPTIONS.fine_kkt


def objective_accuracy(kkt: float) -> float:
    """Accuracy of the objective [relative] at which SQP stops: it is off by about the square of the
    KKT error."""
    return 1e-3 * kkt**2


def max_rounds(kkt: float) -> int:
    """Subproblems of one optimisation: two a digit."""
    return 2 * round(-np.log10(kkt))


def settings() -> dict[str, dict[str, float]]:
    """The numbers above, as they go into a result: `Tolerances(**settings()["tolerances"])`."""
    return {"tolerances": asdict(TOLERANCES), "options": asdict(OPTIONS)}
