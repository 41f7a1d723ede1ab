"""What an argument may be at most and at least is taken, and what lies just beyond is refused."""

import numpy as np
import pytest

from colloc import (
    ArcPath,
    Chain,
    Concertina,
    Corners,
    CrawlerBody,
    Fourier,
    Friction,
    ModalBody,
    PowerLaw,
    ProblemError,
    Wave,
    ellipse,
    replay,
)
from colloc.bounds.sampled import Budget, efficiency_bound
from colloc.smooth.motion import Motion
from colloc.verification.slope import checked_chain
from colloc.verification.trajectory import plan_trajectory

GAIT = ellipse(0.0, 1.2, 0.8)
TINY = 1e-9


def motion(stages, antipodal=False):
    return Motion(lambda s, t: s, lambda s, t: s, stages=stages, antipodal=antipodal)


def replayed(instants):
    return replay(Chain(), Friction(), GAIT, 1e-2, instants=instants, tolerance=10.0)


def samples(count, rate=2.0, limits=None):
    return plan_trajectory(GAIT, rate, period=count / rate, limits=limits)


def bound(limit, **changes):
    budget = Budget(intervals=2, shapes=2, directions=2, rounds=1, starts=1, first=2, **changes)
    return efficiency_bound(Chain((0.5, 0.5)), Friction(), limit, budget=budget)


TAKEN = [
    (ModalBody, {"modes": 1}), (ModalBody, {"modes": 20}), (ModalBody, {"panels": 1}), (ModalBody,
    {"panels": 200}),
    (ModalBody, {"order": 2}), (ModalBody, {"order": 12}), (ModalBody, {"modes": 2,
    "basis": "fourier"}),
    (CrawlerBody, {"epsilon": TINY}), (CrawlerBody, {"epsilon": 0.5 - TINY}), (CrawlerBody,
    {"share": TINY}),
    (CrawlerBody, {"share": 1 - TINY}), (CrawlerBody, {"modes": 2}), (CrawlerBody, {"modes": 12}),
    (Concertina, {"bumps": 1, "epsilon": 0.5 - TINY}), (Concertina, {"bumps": 2,
    "epsilon": 0.25 - TINY}),
    (Concertina, {"epsilon": TINY}), (Concertina, {"share": TINY}), (Concertina,
    {"share": 1 - TINY}),
    (Concertina, {"amplitude": TINY}), (Concertina, {"amplitude": np.pi / 2 - TINY}), (Wave,
    {"profile": "standing"}),
    (Wave, {"steepness": TINY}), (motion, {"stages": (0.0, 0.1, 1.0)}), (motion, {"stages": (0.0,
    0.5), "antipodal": True}),
    (PowerLaw, {"power": 0}), (PowerLaw, {"power": 2}), (replayed, {"instants": 4}), (samples,
    {"count": 4}),
    (samples, {"count": 4, "rate": 0.5}), (samples, {"count": 90, "limits": (9.0, 8.0)}),
    (samples, {"count": 90, "limits": 9.0}),
    (bound, {"limit": np.pi}), (bound, {"limit": 0.2}), (checked_chain, {"body": Chain(),
    "friction": Friction(), "grade": 0}),
    (checked_chain, {"body": Chain(), "friction": Friction(), "grade": 1 - TINY}),
]  # fmt: skip
REFUSED = [
    (ModalBody, {"modes": 0}), (ModalBody, {"modes": 21}), (ModalBody, {"panels": 0}), (ModalBody,
    {"panels": 201}),
    (ModalBody, {"order": 1}), (ModalBody, {"order": 13}), (ModalBody, {"modes": 3,
    "basis": "fourier"}),
    (ModalBody, {"basis": "x"}), (CrawlerBody, {"epsilon": 0}), (CrawlerBody, {"epsilon": 0.5}),
    (CrawlerBody, {"share": 0}),
    (CrawlerBody, {"share": 1}), (CrawlerBody, {"modes": 1}), (CrawlerBody, {"modes": 13}),
    (Concertina, {"bumps": 0}),
    (Concertina, {"bumps": 3}), (Concertina, {"bumps": 1, "epsilon": 0.5}), (Concertina,
    {"bumps": 2, "epsilon": 0.25}),
    (Concertina, {"epsilon": 0}), (Concertina, {"share": 0}), (Concertina, {"share": 1}),
    (Concertina, {"amplitude": 0}),
    (Concertina, {"amplitude": np.pi / 2}), (Wave, {"profile": "x"}), (Wave, {"amplitude": 0}),
    (Wave, {"waves": 0}),
    (Wave, {"steepness": 0}), (motion, {"stages": (0.1, 1.0)}), (motion, {"stages": (0.0, 0.5)}),
    (motion, {"stages": (0.0, 1.0), "antipodal": True}), (motion, {"stages": (0.0, 0.6, 0.6, 1.0)}),
    (PowerLaw, {"power": -TINY}), (PowerLaw, {"power": 2 + TINY}), (replayed, {"instants": 2}),
    (replayed, {"instants": 5}),
    (samples, {"count": 3}), (bound, {"limit": 0.0}), (bound, {"limit": np.pi + 1e-6}),
    (bound, {"limit": 1.0, "harmonics": (1, 2)}), (samples, {"count": 9, "rate": -1.0}),
    (samples, {"count": 9, "rate": np.inf}),
    (samples, {"count": 9, "limits": 0.0}), (samples, {"count": 9, "limits": (1.0, 1.0, 1.0)}),
    (samples, {"count": 9, "limits": 1.0}),
    (checked_chain, {"body": Chain(), "friction": Friction(), "grade": -TINY}),
    (checked_chain, {"body": Chain(), "friction": Friction(), "grade": 1.0}),
    (checked_chain, {"body": Chain(), "friction": Friction(), "grade": True}),
    (checked_chain, {"body": Chain(), "friction": Friction(), "grade": np.inf}),
    (checked_chain, {"body": ModalBody(), "friction": Friction(), "grade": 0.1}),
]  # fmt: skip


def named(case):
    return f"{case[0].__name__} {case[1]}"


@pytest.mark.parametrize("case", TAKEN, ids=named)
def test_the_last_that_is_allowed_is_taken(case):
    made, arguments = case
    assert made(**arguments) is not None


@pytest.mark.parametrize("case", REFUSED, ids=named)
def test_what_lies_beyond_is_refused(case):
    made, arguments = case
    with pytest.raises(ProblemError):
        made(**arguments)


@pytest.mark.parametrize("made", [Corners, ArcPath, Fourier])
def test_a_gait_that_lacks_a_part_or_is_given_one_of_another_kind_is_refused_in_a_sentence(made):
    for given in ((), (np.eye(2), np.eye(2)), (1,) * 9):
        with pytest.raises(ProblemError):
            made(*given)
    with pytest.raises(ProblemError, match="has no argument 'corner'"):
        made(corner=np.eye(2))
