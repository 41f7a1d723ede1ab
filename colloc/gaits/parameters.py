"""The numbers of a problem that nobody knows exactly or that could be chosen otherwise, each with
the problem where it differs.

Friction, lengths, weights, masses, feet, what limits the gait. What has to stay alike stays so:
lengths, weights, and masses add up to 1, and where the class of gaits asks for a body that reads
the same from both ends, mirrored links and feet change together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any, NamedTuple

from colloc.gaits.problem import Problem
from colloc.gaits.symmetry import BILATERAL
from colloc.mechanics.chain import Chain
from colloc.mechanics.feet import Foot
from colloc.mechanics.law import Law
from colloc.system.arguments import is_number

_COEFFICIENTS = {
    "mu_t": "friction sideways",
    "mu_f": "friction forwards",
    "mu_b": "friction backwards",
    "normal": "drag sideways",
    "tangential": "drag along",
    "power": "power of the speed in friction",
}
_SHARES = {"lengths": "length", "weights": "weight", "masses": "mass"}
_NUMBERS = {
    "joint_limit": "joint limit",
    "speed_limit": "speed limit",
    "torque_limit": "torque limit",
    "power_limit": "power limit",
    "smallest_shape_speed": "smallest shape speed",
    "grade": "grade",
    "froude": "Froude number",
    "delta": "delta",
}


@dataclass(frozen=True, eq=False)
class Parameter:
    """A number of a problem.

    Attributes
    ----------
    name : str
    value : float
        What it is; the first, where several change together.
    changed : callable
        The problem where it differs by a part of itself (0.1: a tenth more), or if it is not
        relative by so much. `ProblemError` where it cannot.
    relative : bool
        False for places of feet, which move by parts of their links towards the head.
    """

    name: str
    value: float
    changed: Callable[[float], Problem]
    relative: bool = True


def parameters(problem: Problem) -> list[Parameter]:
    """The numbers of a problem that a sensitivity is asked for.

    Examples
    --------
    >>> import colloc
    >>> from colloc.gaits.parameters import parameters
    >>> for each in parameters(colloc.Problem("mine", gait=colloc.Harmonic(1, "bilateral")))[:4]:
    ...     print(each.name, round(each.value, 3))
    friction sideways 1.0
    friction forwards 1.0
    friction backwards 1.0
    length of links 1 and 3 0.333
    """
    chain = problem.body if isinstance(problem.body, Chain) else None
    numbers = [*_of_floor(problem, chain.standing_on if chain else ())]
    if chain:
        numbers += _of_chain(chain, problem.gait.symmetry == BILATERAL)
    numbers += _of_limits(problem)
    return [
        Parameter(x.name, x.value, partial(_with, problem, x.path, x.new), x.relative)
        for x in numbers
    ]


class _Number(NamedTuple):
    """A number, the fields that lead to where it stands, and what stands there if it differs by so
    much."""

    name: str
    value: float
    path: tuple[str, ...]
    new: Callable[[float], Any]
    relative: bool = True


def _with(part: Any, path: tuple[str, ...], new: Callable[[float], Any], by: float) -> Any:
    """A part of a problem with another value in a field, or in a field of a field; a guess need not
    fit it."""
    if not path:
        return new(by)
    field, *deeper = path
    value = {field: _with(getattr(part, field), tuple(deeper), new, by)}
    return part.with_(guess=None, **value) if isinstance(part, Problem) else replace(part, **value)


def _scale(stated: Any, by: float) -> Any:
    """A limit may be one number, one for each joint, or a least and a largest angle of each."""
    if isinstance(stated, tuple):
        return tuple(_scale(each, by) for each in stated)
    return stated * (1 + by)


def _first(stated: Any) -> float:
    return _first(stated[0]) if isinstance(stated, tuple) else abs(float(stated))


def _of_floor(problem: Problem, feet: tuple[Foot, ...]) -> Iterator[_Number]:
    if not feet or any(foot.friction is None for foot in feet):
        for field, value in _coefficients(problem.friction):
            path = ("friction", field)
            yield _Number(_COEFFICIENTS[field], value, path, partial(_scale, value))
    for law in dict.fromkeys(foot.friction for foot in feet if foot.friction is not None):
        standing = [k for k, foot in enumerate(feet) if foot.friction == law]
        for field, value in _coefficients(law):
            name = f"{_COEFFICIENTS[field]} of {_counted('foot', standing)}"
            on_other = partial(_on_other_friction, feet, law, field)
            yield _Number(name, value, ("body", "feet"), on_other)


def _on_other_friction(feet: tuple[Foot, ...], law: Any, field: str, by: float) -> tuple[Foot, ...]:
    other = replace(law, **{field: _scale(getattr(law, field), by)})
    return tuple(replace(foot, friction=other) if foot.friction == law else foot for foot in feet)


def _coefficients(law: Law) -> list[tuple[str, float]]:
    """Fields of a law that are coefficients, with their values; those of a law of formulas may bear
    the same names."""
    stated = {field.name: getattr(law, field.name) for field in fields(law)}  # type: ignore[arg-type]
    return [
        (field, float(stated[field])) for field in _COEFFICIENTS if is_number(stated.get(field))
    ]


def _of_chain(chain: Chain, mirrored: bool) -> Iterator[_Number]:
    for field, words in _SHARES.items():
        shares = getattr(chain, field)
        count = len(shares)
        for k in range((count + 1) // 2 if mirrored else count):
            links = sorted({k, count - 1 - k}) if mirrored else [k]
            if len(links) < count:
                name = f"{words} of {_counted('link', links)}"
                changed = partial(_change_shares, shares, links)
                yield _Number(name, shares[k], ("body", field), changed)
    if chain.width:
        yield _Number("width", chain.width, ("body", "width"), partial(_scale, chain.width))
    feet = chain.standing_on
    weights = [foot.weight or 0.0 for foot in feet]

    def move(group: dict[int, float], by: float) -> tuple[Foot, ...]:
        places = (foot.place + by * group.get(k, 0.0) for k, foot in enumerate(feet))
        return _with_each(feet, "place", places)

    def reweigh(group: dict[int, float], by: float) -> tuple[Foot, ...]:
        return _with_each(feet, "weight", _change_shares(weights, [*group], by))

    for group in _feet_alike(feet, chain.n_link, mirrored):
        which, first = _counted("foot", sorted(group)), min(group)
        at = ("body", "feet")
        if any(group.values()):
            place = feet[first].place
            yield _Number(f"place of {which}", place, at, partial(move, group), relative=False)
        if len(group) < len(feet):
            yield _Number(f"weight of {which}", weights[first], at, partial(reweigh, group))


def _with_each(feet: tuple[Foot, ...], field: str, values: Iterable[Any]) -> tuple[Foot, ...]:
    return tuple(replace(foot, **{field: x}) for foot, x in zip(feet, values, strict=True))


def _counted(what: str, which: Sequence[int]) -> str:
    """ "link 2" or "links 1 and 3", counted from 1 at the tail."""
    *others, last = (str(k + 1) for k in which)
    many = {"foot": "feet"}.get(what, f"{what}s")
    return f"{many} {', '.join(others)} and {last}" if others else f"{what} {last}"


def _change_shares(shares: Sequence[float], which: Sequence[int], by: float) -> tuple[float, ...]:
    """Parts of 1, some of them larger by a part of themselves, the others smaller in proportion."""
    whole = sum(shares[k] for k in which)
    factor = (1 - whole * (1 + by)) / (1 - whole)
    return tuple(share * (1 + by if k in which else factor) for k, share in enumerate(shares))


def _feet_alike(feet: tuple[Foot, ...], n_link: int, mirrored: bool) -> list[dict[int, float]]:
    """Feet that change together, and which way each moves when they do: left and right ones, and
    where the body has to read the same from both ends those at both; 0 for one in the very middle,
    which cannot move."""
    groups: list[dict[int, float]] = []
    for k, foot in enumerate(feet):
        if any(k in group for group in groups):
            continue
        turned, group = foot.from_head(n_link), {}
        for j, other in enumerate(feet):
            ahead = any(map(other.is_like, (foot, foot.mirrored)))
            back = mirrored and any(map(other.is_like, (turned, turned.mirrored)))
            if ahead or back:
                group[j] = float(ahead - back)
        groups.append(group)
    return groups


def _of_limits(problem: Problem) -> Iterator[_Number]:
    for field, words in _NUMBERS.items():
        if stated := getattr(problem, field):
            yield _Number(words, _first(stated), (field,), partial(_scale, stated))
    for k, (aim, least) in enumerate(problem.at_least):
        if least:
            changed = partial(_with_least, problem.at_least, k)
            yield _Number(f"least {aim.name}", least, ("at_least",), changed)
    if problem.rotation:
        turned = partial(_scale, problem.rotation)
        yield _Number("net rotation", problem.rotation, ("rotation",), turned)
    if bent := getattr(problem.gait, "curvature", None):
        yield _Number("curvature of paths", bent, ("gait", "curvature"), partial(_scale, bent))


def _with_least(at_least: Sequence[Any], which: int, by: float) -> tuple[Any, ...]:
    return tuple(
        (aim, _scale(least, by) if k == which else least) for k, (aim, least) in enumerate(at_least)
    )
