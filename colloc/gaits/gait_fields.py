"""Problems, gaits, classes of gaits, bodies and laws as plain dictionaries (JSON), and back."""

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from colloc.gaits.bspline import Basis, BSpline, Corners, Polygon
from colloc.gaits.coupled import Coupled
from colloc.gaits.harmonic import Fourier, Harmonic, Phases, Prescribed, Serpenoid, SerpenoidSeries
from colloc.gaits.linear import Combination
from colloc.gaits.robot import Robot
from colloc.laws.own_law import OwnLaw
from colloc.laws.resistance import Elliptic, PowerLaw, Viscous
from colloc.mechanics.chain import Chain
from colloc.mechanics.floor_contact import FeetLaw, Foot
from colloc.mechanics.friction import Axle, Friction
from colloc.smooth.smooth_body import Concertina, CrawlerBody, ModalBody, Wave
from colloc.system.arguments import STATED_IF_SET
from colloc.system.errors import ProblemError

AnyGait: TypeAlias = Any
"""One of `GAITS`."""
AnyClass: TypeAlias = Any
"""One of `CLASSES`."""
KIND = "kind"
# what files can hold; parts of your own making are added to these lists
GAITS: list[type] = [Fourier, Combination, Corners, Phases, SerpenoidSeries]
CLASSES: list[type] = [Harmonic, BSpline, Basis, Coupled, Polygon, Prescribed, Serpenoid]
BODIES: list[type] = [Chain, ModalBody, CrawlerBody, Concertina, Wave]
LAWS: list[type] = [Friction, Elliptic, Axle, Viscous, PowerLaw, OwnLaw]
MOTIONS: list[type] = []
"""`colloc.gaits.regime.Regime` of one's own."""
PARTS: list[type] = [Foot, FeetLaw]
"""Parts of bodies and laws."""


def check_kind(name: str, value: Any, kinds: Sequence[type], answers: Any = None) -> None:
    """Raise a `ProblemError` for a part of a problem of none of some kinds, or that lacks members
    of `answers`."""
    if not isinstance(value, type) and isinstance(value, answers or tuple(kinds)):
        return
    what = type(value).__name__
    if answers is not None and type(value) in kinds:
        lacks = [each for each in vars(answers) if each[0] != "_" and not hasattr(value, each)]
        raise ProblemError(
            f"{name}: a {what} does not say its {', '.join(lacks)} ({answers.__module__})."
        )
    names = " or ".join(kind.__name__ for kind in kinds)
    raise ProblemError(f"{name} must be a {names}, not {what}.")


def fields(value: Any) -> dict[str, Any]:
    """The kind of a part of a problem, and its fields as numbers, strings and lists."""
    plain = {KIND: type(value).__name__}
    for f in dataclasses.fields(value):
        part = getattr(value, f.name)
        if f.metadata != STATED_IF_SET or part != f.default:
            plain[f.name] = _plain(part)
    return plain


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, tuple) and any(dataclasses.is_dataclass(part) for part in value):
        return [fields(part) for part in value]
    return fields(value) if dataclasses.is_dataclass(value) else value


def _revive(value: Any) -> Any:
    if isinstance(value, list) and any(isinstance(part, dict) for part in value):
        return tuple(map(_revive, value))
    if isinstance(value, dict) and KIND in value:
        return part_from([*LAWS, *PARTS, *CLASSES, *BODIES], value)
    return value


def part_from(kinds: Sequence[type], statement: dict[str, Any]) -> Any:
    """The part that `fields` described. KeyError, TypeError or ProblemError if it did not."""
    values = dict(statement)
    name = values.pop(KIND)
    # of one defined again the last
    kind = next((kind for kind in reversed(kinds) if kind.__name__ == name), None)
    if kind is None:
        raise KeyError(f"{name} is none of {', '.join(kind.__name__ for kind in kinds)}")
    return kind(**{name: _revive(value) for name, value in values.items()})


def gait_from(statement: dict[str, Any]) -> AnyGait:
    return part_from(GAITS, statement)


def kinds_of_parts() -> dict[str, list[type]]:
    """Kinds of the parts of a problem, by the names of its fields."""
    usual = {"guess": GAITS, "body": BODIES, "friction": [*LAWS, FeetLaw], "gait": CLASSES}
    return usual | {"motion": MOTIONS, "robot": [Robot]}


def statement_hash(statement: Any) -> str:
    """SHA-256 of plain numbers, strings, lists and dictionaries."""
    return hashlib.sha256(json.dumps(statement, sort_keys=True).encode()).hexdigest()
