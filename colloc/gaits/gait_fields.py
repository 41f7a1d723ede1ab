"""Problems, gaits, classes of gaits, bodies and laws of friction as plain dictionaries (JSON), and
back.

The names of the fields tell the kind; of laws other than Coulomb's their name does.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from colloc.gaits.bspline import BSpline
from colloc.gaits.columns import Basis
from colloc.gaits.coupled import Coupled
from colloc.gaits.free_path import ArcPath, FreePath
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.linear import Combination
from colloc.gaits.polygon import Corners, Polygon
from colloc.gaits.prescribed import Phases, Prescribed
from colloc.gaits.serpenoid import Serpenoid, SerpenoidSeries
from colloc.laws.elliptic import Elliptic
from colloc.laws.own_law import OwnLaw
from colloc.laws.power_law import PowerLaw
from colloc.laws.viscous import Viscous
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.feet import FeetLaw, Foot
from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law
from colloc.smooth.concertina import Concertina
from colloc.smooth.crawler_body import CrawlerBody
from colloc.smooth.modal_body import ModalBody
from colloc.smooth.prescribed_body import Wave
from colloc.system.arguments import STATED_IF_SET
from colloc.system.errors import ProblemError

AnyGait: TypeAlias = Any
"""One of `GAITS`. Each function says which kinds it takes; a problem checks that gait and class are
of some kind."""
AnyClass: TypeAlias = Any
"""One of `CLASSES`."""
KIND = "kind"
# what files can hold, and is asked for; parts of your own making are added to these lists
GAITS: list[type] = [Fourier, ArcPath, Combination, Corners, Phases, SerpenoidSeries]
CLASSES: list[type] = [
    Harmonic, BSpline, Basis, Coupled, FreePath, Polygon, Prescribed, Serpenoid
]  # fmt: skip
BODIES: list[type] = [Chain, ModalBody, CrawlerBody, Concertina, Wave]
LAWS: list[type] = [Friction, Elliptic, Viscous, PowerLaw, OwnLaw]
MOTIONS: list[type] = []
"""Kinds of motion, `colloc.gaits.regime.Regime`, other than those that a grade and a Froude number
ask for."""
PARTS: list[type] = [Foot, FeetLaw]
"""What bodies and laws hold."""


def check_kind(name: str, value: Any, kinds: Sequence[type], answers: Any = None) -> None:
    """A `ProblemError` for a part of a problem that is of none of some kinds, or does not answer
    what they do."""
    if isinstance(value, type) or not isinstance(value, answers or tuple(kinds)):
        what = type(value).__name__
        if answers is not None and type(value) in kinds:
            lacks = [each for each in vars(answers) if each[0] != "_" and not hasattr(value, each)]
            raise ProblemError(
                f"{name}: a {what} does not say its {', '.join(lacks)} ({answers.__module__})."
            )
        raise ProblemError(
            f"{name} must be a {' or '.join(kind.__name__ for kind in kinds)}, not {what}."
        )


def fields(value: Any) -> dict[str, Any]:
    """The kind of a gait, a class of gaits, a body or a law, and its fields as numbers, strings and
    lists."""
    stated = [
        f
        for f in dataclasses.fields(value)
        if f.metadata != STATED_IF_SET or getattr(value, f.name) != f.default
    ]
    found = {f.name: getattr(value, f.name) for f in stated}
    return {KIND: type(value).__name__, **{name: _plain(own) for name, own in found.items()}}


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, tuple) and any(dataclasses.is_dataclass(part) for part in value):
        return [fields(part) for part in value]
    return fields(value) if dataclasses.is_dataclass(value) else value


def _revived(value: Any) -> Any:
    """A part of a body, a law or a gait, such as a foot, from what `fields` made of it; anything
    else as it is."""
    if isinstance(value, list) and any(isinstance(part, dict) for part in value):
        return tuple(_revived(part) for part in value)
    return (
        _from([*LAWS, *PARTS, *CLASSES, *BODIES], value)
        if isinstance(value, dict) and KIND in value
        else value
    )


def _from(kinds: Sequence[type], given: dict[str, Any]) -> Any:
    values = dict(given)
    name = values.pop(KIND)
    # of one defined again the last
    kind = next((kind for kind in reversed(kinds) if kind.__name__ == name), None)
    if kind is None:
        raise KeyError(f"{name} is none of {', '.join(kind.__name__ for kind in kinds)}")
    return kind(**{name: _revived(value) for name, value in values.items()})


def gait_from(given: dict[str, Any]) -> AnyGait:
    """The gait that `fields` described. KeyError, TypeError or ProblemError if it did not."""
    return _from(GAITS, given)


def class_from(given: dict[str, Any]) -> AnyClass:
    """The class of gaits that `fields` described; as `gait_from`."""
    return _from(CLASSES, given)


def law_from(given: dict[str, Any]) -> Law:
    """The law that `fields` described; as `gait_from`."""
    return _from([*LAWS, FeetLaw], given)


def body_from(given: dict[str, Any]) -> Body:
    """The body that `fields` described; as `gait_from`."""
    return _from(BODIES, given)


def problem_fields(problem: Any) -> dict[str, Any]:
    """All fields of a problem; what is usual of what it asks for is left out."""
    stated = {f.name: getattr(problem, f.name) for f in dataclasses.fields(problem)}
    usual = [
        f.name
        for f in dataclasses.fields(problem)
        if f.metadata == STATED_IF_SET and stated[f.name] == f.default
    ]
    stated["gait"] = problem.gait.level  # the grade says that it is on a slope
    stated |= {name: fields(stated[name]) for name in ("guess", "gait", "body", "friction")}
    stated |= {
        "objective": problem.objective.fields(),
        "at_least": [[aim.fields(), least] for aim, least in problem.at_least],
    }
    if problem.motion is not None:
        stated["motion"] = fields(problem.motion)
    stated["limits"] = [limit.fields() for limit in problem.limits]
    return {name: value for name, value in stated.items() if name not in usual}


def problem_arguments(stated: dict[str, Any]) -> dict[str, Any]:
    """The arguments of the problem that `problem_fields` described; as `gait_from`."""
    kinds = {"guess": gait_from, "body": body_from, "friction": law_from, "gait": class_from}
    own = {"motion": _from(MOTIONS, stated["motion"])} if "motion" in stated else {}
    return {**stated, **{name: kind(stated[name]) for name, kind in kinds.items()}, **own}


def statement_hash(stated: Any) -> str:
    """SHA-256 of plain numbers, strings, lists and dictionaries, such as `problem_fields` gives."""
    return hashlib.sha256(json.dumps(stated, sort_keys=True).encode()).hexdigest()
