"""The numbers of a problem that nobody knows exactly or that could be chosen otherwise, each with
the problem where it differs.

Friction, lengths, weights, masses, feet, what limits the gait. What has to stay alike stays so:
lengths, weights, and masses add up to 1, and where the class of gaits asks for a body that reads
the same from both ends, mirrored links and feet change together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

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
    return [*_of_friction(problem), *_of_body(problem), *_of_limits(problem)]


def _with(problem: Problem, **changes: Any) -> Problem:
    """The problem with some fields changed; its guess need not fit them."""
    return problem.with_(guess=None, **changes)


def _of_friction(problem: Problem) -> Iterator[Parameter]:
    feet = _feet(problem)
    if not feet or any(foot.friction is None for foot in feet):
        for field, value in _coefficients(problem.friction):
            yield Parameter(_COEFFICIENTS[field], value, partial(_with_friction, problem, field))
    for law in dict.fromkeys(foot.friction for foot in feet if foot.friction is not None):
        standing = [k for k, foot in enumerate(feet) if foot.friction == law]
        for field, value in _coefficients(law):
            name = f"{_COEFFICIENTS[field]} of {_counted('foot', standing)}"
            yield Parameter(name, value, partial(_with_friction_of_feet, problem, law, field))


def _coefficients(law: Law) -> list[tuple[str, float]]:
    """Fields of a law that are coefficients, with their values; those of a law of formulas may bear
    the same names."""
    own = {field.name: getattr(law, field.name) for field in fields(law)}  # type: ignore[arg-type]
    return [(field, float(own[field])) for field in _COEFFICIENTS if is_number(own.get(field))]


def _scaled(part: Any, field: str, by: float) -> Any:
    return replace(part, **{field: getattr(part, field) * (1 + by)})


def _with_friction(problem: Problem, field: str, by: float) -> Problem:
    return _with(problem, friction=_scaled(problem.friction, field, by))


def _with_friction_of_feet(problem: Problem, law: Law, field: str, by: float) -> Problem:
    feet = [
        replace(foot, friction=_scaled(law, field, by)) if foot.friction == law else foot
        for foot in _feet(problem)
    ]
    return _with_chain(problem, feet=tuple(feet))


def _chain(problem: Problem) -> Chain | None:
    """The chain that the body is; None for smooth ones."""
    return problem.body if isinstance(problem.body, Chain) else None


def _with_chain(problem: Problem, **changes: Any) -> Problem:
    """The problem with some fields of that chain changed."""
    chain = _chain(problem)
    assert chain is not None  # whoever asks has looked
    return _with(problem, body=replace(chain, **changes))


def _feet(problem: Problem) -> tuple[Foot, ...]:
    chain = _chain(problem)
    return chain.standing_on if chain else ()


def _of_body(problem: Problem) -> Iterator[Parameter]:
    body = _chain(problem)
    if body is None:
        return
    mirrored = problem.gait.symmetry == BILATERAL
    for field, words in (("lengths", "length"), ("weights", "weight"), ("masses", "mass")):
        own = getattr(body, field)
        for links in _mirror_sets(len(own), mirrored):
            if len(links) < len(own):
                name = f"{words} of {_counted('link', links)}"
                yield Parameter(name, own[links[0]], partial(_with_shares, problem, field, links))
    if body.width:
        yield Parameter(
            "width", body.width, lambda by: _with_chain(problem, width=body.width * (1 + by))
        )
    feet = body.standing_on
    for group in _feet_alike(feet, body.n_link, mirrored):
        which = _counted("foot", sorted(group))
        if any(group.values()):
            yield Parameter(
                f"place of {which}",
                feet[min(group)].place,
                partial(_with_places, problem, group),
                relative=False,
            )
        if len(group) < len(feet):
            weight = feet[min(group)].weight
            assert weight is not None  # a body's feet have their weights
            yield Parameter(f"weight of {which}", weight, partial(_with_weights, problem, group))


def _mirror_sets(count: int, mirrored: bool) -> list[list[int]]:
    """Links that change together."""
    if not mirrored:
        return [[k] for k in range(count)]
    return [sorted({k, count - 1 - k}) for k in range((count + 1) // 2)]


def _counted(what: str, which: Sequence[int]) -> str:
    """ "link 2" or "links 1 and 3", counted from 1 at the tail."""
    numbers = [str(k + 1) for k in which]
    many = {"foot": "feet"}.get(what, f"{what}s")
    return (
        f"{what} {numbers[0]}"
        if len(numbers) == 1
        else f"{many} {', '.join(numbers[:-1])} and {numbers[-1]}"
    )


def _changed_shares(shares: Sequence[float], which: Sequence[int], by: float) -> tuple[float, ...]:
    """Parts of 1, some of them larger by a part of themselves, the others smaller in proportion."""
    kept = sum(shares[k] for k in which)
    factor = (1 - kept * (1 + by)) / (1 - kept)
    return tuple(share * (1 + by if k in which else factor) for k, share in enumerate(shares))


def _with_shares(problem: Problem, field: str, which: list[int], by: float) -> Problem:
    return _with_chain(
        problem, **{field: _changed_shares(getattr(_chain(problem), field), which, by)}
    )


def _feet_alike(feet: tuple[Foot, ...], n_link: int, mirrored: bool) -> list[dict[int, float]]:
    """Feet that change together, and which way each moves when they do: left and right ones, and
    where the body has to read the same from both ends those at both; 0 for one in the very middle,
    which cannot move."""
    groups: list[dict[int, float]] = []
    for k, foot in enumerate(feet):
        if any(k in group for group in groups):
            continue
        turned = foot.from_head(n_link)
        ahead, back = ([foot, foot.mirrored], [turned, turned.mirrored] if mirrored else [])
        group = {}
        for j, other in enumerate(feet):
            side = any(other.is_like(one) for one in ahead) - any(
                other.is_like(one) for one in back
            )
            if side or any(other.is_like(one) for one in ahead):
                group[j] = float(side)
        groups.append(group)
    return groups


def _with_places(problem: Problem, group: dict[int, float], by: float) -> Problem:
    feet = [
        replace(foot, place=foot.place + by * group.get(k, 0.0))
        for k, foot in enumerate(_feet(problem))
    ]
    return _with_chain(problem, feet=tuple(feet))


def _with_weights(problem: Problem, group: dict[int, float], by: float) -> Problem:
    feet = _feet(problem)
    weights = _changed_shares([foot.weight or 0.0 for foot in feet], list(group), by)
    borne = tuple(replace(foot, weight=weight) for foot, weight in zip(feet, weights, strict=True))
    return _with_chain(problem, feet=borne)


def _of_limits(problem: Problem) -> Iterator[Parameter]:
    for field, words in _NUMBERS.items():
        stated = getattr(problem, field)
        if stated:
            yield Parameter(words, _first(stated), partial(_with_number, problem, field))
    for k, (aim, least) in enumerate(problem.at_least):
        if least:
            yield Parameter(f"least {aim.name}", least, partial(_with_least, problem, k))
    if problem.rotation:
        yield Parameter(
            "net rotation", problem.rotation, partial(_with_number, problem, "rotation")
        )
    if hasattr(problem.gait, "curvature"):
        bent = problem.gait.curvature
        yield Parameter(
            "curvature of paths",
            bent,
            lambda by: _with(problem, gait=_scaled(problem.gait, "curvature", by)),
        )


def _first(stated: Any) -> float:
    """The first number of a limit, which may be one for all joints, one each, or a least and a
    largest angle of each."""
    return _first(stated[0]) if isinstance(stated, tuple) else abs(float(stated))


def _grown(stated: Any, by: float) -> Any:
    return (
        tuple(_grown(each, by) for each in stated)
        if isinstance(stated, tuple)
        else stated * (1 + by)
    )


def _with_number(problem: Problem, field: str, by: float) -> Problem:
    return _with(problem, **{field: _grown(getattr(problem, field), by)})


def _with_least(problem: Problem, which: int, by: float) -> Problem:
    least = [
        (aim, value * (1 + by) if k == which else value)
        for k, (aim, value) in enumerate(problem.at_least)
    ]
    return _with(problem, at_least=tuple(least))
