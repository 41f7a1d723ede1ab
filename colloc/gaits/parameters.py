"""The numbers of a problem that are uncertain or could be chosen otherwise, with the problem where
each differs. Lengths, weights and masses keep adding up to 1, and if the class of gaits asks for a
body that reads the same from both ends, mirrored links and feet change together."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

from colloc.gaits.gait import BILATERAL
from colloc.gaits.problem import Problem
from colloc.mechanics.chain import Chain
from colloc.mechanics.floor_contact import Foot
from colloc.mechanics.law import Law
from colloc.system.arguments import is_number

COEFFICIENTS = {
    "mu_t": "friction sideways",
    "mu_f": "friction forwards",
    "mu_b": "friction backwards",
    "normal": "drag sideways",
    "tangential": "drag along",
    "rolling": "rolling resistance",
    "sideways": "slip resistance",
    "power": "power of the speed in friction",
}
_SHARES = {"lengths": "length", "weights": "weight", "masses": "mass"}
_OF_CHAIN = (*_SHARES, "width", "feet")
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
    name: str
    value: float  # the first, if several change together
    changed: Callable[[float], Problem]
    """The problem where it differs by a part of itself, or by so much if it is not relative."""
    relative: bool = True
    """False for places of feet, which move by parts of their links towards the head."""


def parameters(problem: Problem) -> list[Parameter]:
    """The numbers of a problem that a sensitivity is asked for."""
    problem = problem.without_robot
    chain = problem.body if isinstance(problem.body, Chain) else None
    numbers = []

    def add(name, value, field, new, relative=True):
        def change(by):
            part: dict[str, Any] = {field: new(by)}
            if chain and field in _OF_CHAIN:
                part = {"body": replace(chain, **part)}
            return problem.with_(**{"guess": None} | part)  # a guess need not fit

        numbers.append(Parameter(name, value, change, relative))

    feet = chain.standing_on if chain else ()
    if not feet or any(foot.friction is None for foot in feet):
        for field, value in _coefficients(problem.friction):
            new = partial(_change_coefficient, problem.friction, field)
            add(COEFFICIENTS[field], value, "friction", new)
    for law in dict.fromkeys(foot.friction for foot in feet if foot.friction is not None):
        which = _count_from("foot", [k for k, foot in enumerate(feet) if foot.friction == law])
        for field, value in _coefficients(law):
            new = partial(_change_friction_of_feet, feet, law, field)
            add(f"{COEFFICIENTS[field]} of {which}", value, "feet", new)
    if chain:
        mirrored = problem.gait.symmetry == BILATERAL
        _add_links(chain, mirrored, add)
        if chain.width:
            add("width", chain.width, "width", partial(_scale, chain.width))
        _add_feet(feet, chain.n_link, mirrored, add)
    for field, words in _NUMBERS.items():
        if value := getattr(problem, field):
            add(words, _first(value), field, partial(_scale, value))
    for k, (aim, least) in enumerate(problem.at_least):
        if least:
            add(f"least {aim.name}", least, "at_least", partial(_scale_least, problem.at_least, k))
    if problem.rotation:
        add("net rotation", problem.rotation, "rotation", partial(_scale, problem.rotation))
    return numbers


def _coefficients(law: Law) -> list[tuple[str, float]]:
    values = {field.name: getattr(law, field.name) for field in fields(law)}  # type: ignore[arg-type]
    return [(field, float(values[field])) for field in COEFFICIENTS if is_number(values.get(field))]


def _add_links(chain: Chain, mirrored: bool, add: Callable[..., None]) -> None:
    for field, words in _SHARES.items():
        shares = getattr(chain, field)
        count = len(shares)
        for k in range((count + 1) // 2 if mirrored else count):
            links = sorted({k, count - 1 - k}) if mirrored else [k]
            if len(links) < count:
                new = partial(_change_shares, shares, links)
                add(f"{words} of {_count_from('link', links)}", shares[k], field, new)


def _add_feet(
    feet: tuple[Foot, ...], n_link: int, mirrored: bool, add: Callable[..., None]
) -> None:
    weights = [foot.weight or 0.0 for foot in feet]

    def move(group, by):
        return tuple(
            replace(foot, place=foot.place + by * group.get(k, 0.0)) for k, foot in enumerate(feet)
        )

    def reweigh(group, by):
        each = zip(feet, _change_shares(weights, [*group], by), strict=True)
        return tuple(replace(foot, weight=weight) for foot, weight in each)

    for group in _feet_alike(feet, n_link, mirrored):
        which, first = _count_from("foot", sorted(group)), min(group)
        if any(group.values()):
            new = partial(move, group)
            add(f"place of {which}", feet[first].place, "feet", new, relative=False)
        if len(group) < len(feet):
            add(f"weight of {which}", weights[first], "feet", partial(reweigh, group))


def _feet_alike(feet: tuple[Foot, ...], n_link: int, mirrored: bool) -> list[dict[int, float]]:
    """Feet that change together, left and right ones, if mirrored at both ends, and the direction
    in which each moves; 0 for one in the very middle, which cannot move."""
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


def _scale(value: Any, by: float) -> Any:
    if isinstance(value, tuple):
        return tuple(_scale(each, by) for each in value)
    return value * (1 + by)


def _first(value: Any) -> float:
    return _first(value[0]) if isinstance(value, tuple) else abs(float(value))


def _scale_least(at_least: Sequence[Any], which: int, by: float) -> tuple[Any, ...]:
    return tuple(
        (aim, _scale(least, by) if k == which else least) for k, (aim, least) in enumerate(at_least)
    )


def _change_coefficient(law: Any, field: str, by: float) -> Any:
    return replace(law, **{field: getattr(law, field) * (1 + by)})


def _change_friction_of_feet(
    feet: tuple[Foot, ...], law: Any, field: str, by: float
) -> tuple[Foot, ...]:
    other = _change_coefficient(law, field, by)
    return tuple(replace(foot, friction=other) if foot.friction == law else foot for foot in feet)


def _change_shares(shares: Sequence[float], which: Sequence[int], by: float) -> tuple[float, ...]:
    whole = sum(shares[k] for k in which)
    factor = (1 - whole * (1 + by)) / (1 - whole)
    return tuple(share * (1 + by if k in which else factor) for k, share in enumerate(shares))


def _count_from(what: str, which: Sequence[int]) -> str:
    *others, last = (str(k + 1) for k in which)
    many = {"foot": "feet"}.get(what, f"{what}s")
    return f"{many} {', '.join(others)} and {last}" if others else f"{what} {last}"
