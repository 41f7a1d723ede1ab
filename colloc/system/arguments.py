"""Checks of arguments: misspelt or unusable ones raise a `ProblemError` in one sentence."""

from __future__ import annotations

import functools
import inspect
import math
import reprlib
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import NoneType, UnionType
from typing import Any, TypeGuard, TypeVar, Union, cast, get_args, get_origin

import numpy as np

from colloc.system.errors import OrderWarning, ProblemError

T = TypeVar("T")
Function = TypeVar("Function", bound=Callable[..., Any])
MOST_PERIODS = 10_000  # simulated one by one
STATED_IF_SET = {"stated if set": True}
"""Metadata of a dataclass field that is left out of statements while it has its default."""
_signature = functools.cache(inspect.signature)


def named_arguments(cls: type[T]) -> type[T]:
    """Make a dataclass check its arguments, and convert numbers to the type of their field.

    Positional ones among `by_name`, if the class has it, cause an `OrderWarning` if they differ.
    """
    init, owner, ordered = cls.__init__, cls.__name__, getattr(cls, "by_name", ())

    @functools.wraps(init)
    def init_checked(self: T, *values: Any, **named: Any) -> None:
        arguments = _bind(owner, init, (self, *values), named)
        by_place = list(arguments)[1 : len(values) + 1]
        del arguments["self"]
        scalars, plain = _scalars(init), dict(arguments)
        for name, kinds in scalars.items():
            for kind in (float, int, bool):
                if kind in kinds and name in arguments and _fits(arguments[name], kind):
                    plain[name] = kind(arguments[name])
                    break
        try:
            init(self, **plain)
        except ProblemError:
            raise
        except Exception:
            _check_types(scalars, arguments)
            raise
        _check_types(scalars, arguments)  # last: the class knows better what is wrong
        order = {name: getattr(self, name) for name in ordered}
        if len(set(order.values())) > 1 and order.keys() & by_place:
            read = ", ".join(f"{name}={value:g}" for name, value in order.items())
            warnings.warn(
                "coefficients by their place, which others write in another order, are read as "
                f"{owner}({read}): name them, as here.",
                OrderWarning,
                stacklevel=2,
            )

    cls.__init__ = init_checked  # type: ignore[assignment]
    return cls


def checked_arguments(function: Function) -> Function:
    """Make a function check its arguments against their annotations."""

    @functools.wraps(function)
    def call(*values: Any, **named: Any) -> Any:
        _check_types(_types(function), _bind(function.__name__, function, values, named))
        return function(*values, **named)

    return cast(Function, call)


def _bind(owner: str, function: Callable[..., Any], values: Any, named: Any) -> dict[str, Any]:
    try:
        return _signature(function).bind(*values, **named).arguments
    except TypeError as error:
        parameters = _signature(function).parameters
        names = [name for name in parameters if name != "self"]
        unknown = next((name for name in named if name not in names), "")
        if not unknown or any(each.kind is each.VAR_KEYWORD for each in parameters.values()):
            raise ProblemError(f"{owner}: {error}.") from None
        import difflib

        close = difflib.get_close_matches(unknown, names, n=3, cutoff=0.6)
        hint = f"did you mean {_or(close)}?" if close else f"it takes {', '.join(names)}."
        raise ProblemError(f"{owner} has no argument {unknown!r}; {hint}") from None


@functools.cache
def _types(function: Callable[..., Any]) -> dict[str, tuple[Any, ...]]:
    """Allowed types by argument, annotated by strings; without those that only type checkers can
    resolve."""
    types = {}
    for name, each in _signature(function).parameters.items():
        try:
            types[name] = _alternatives(eval(each.annotation, function.__globals__))
        except (NameError, TypeError):
            continue
        if each.default is None:
            types[name] = *types[name], NoneType
    return types


@functools.cache
def _scalars(function: Callable[..., Any]) -> dict[str, tuple[Any, ...]]:
    return {name: kinds for name, kinds in _types(function).items() if set(kinds) <= _SCALARS}


def _alternatives(kind: Any) -> tuple[Any, ...]:
    if get_origin(kind) in (Union, UnionType):
        return get_args(kind)
    return (NoneType if kind is None else kind,)


def _check_types(types: Mapping[str, tuple[Any, ...]], arguments: Mapping[str, Any]) -> None:
    for name, value in arguments.items():
        if (allowed := types.get(name)) is not None and not any(
            _fits(value, kind) for kind in allowed
        ):
            words = _or(list(dict.fromkeys(map(_words, allowed))))
            raise ProblemError(f"{name} must be {words}, not {shown(value)}.")


def _are_numbers(value: Any) -> bool:
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        return False
    numbers = array.dtype.kind in "iuf"
    if array.ndim == 1 and array.size and numbers:
        return bool(np.isfinite(array).all())
    return (numbers or not array.size) and array.ndim >= 1


_SEQUENCES = tuple, list, Sequence, Iterable
_SCALARS = {float, int, bool, str, NoneType}
_KINDS: dict[Any, tuple[str, Callable[[Any], bool]]] = {
    # infinite numbers are checked elsewhere
    float: ("a number", lambda x: is_number(x) or (isinstance(x, (float, np.floating)) and x == x)),
    int: ("a whole number", lambda x: is_whole(x, -(2**63), 2**63)),
    bool: ("True or False", lambda x: isinstance(x, (bool, np.bool_))),
    str: ("text", lambda x: isinstance(x, str)),
    NoneType: ("None", lambda x: x is None),
    np.ndarray: ("numbers", _are_numbers),
    Callable: ("a function", callable),
}


def _fits(value: Any, kind: Any) -> bool:
    kind, (item, *_) = get_origin(kind) or kind, (*get_args(kind), Any)
    if kind in _KINDS:
        return _KINDS[kind][1](value)
    if kind in _SEQUENCES:
        listed = isinstance(value, Iterable) and not isinstance(value, (str, bytes, Mapping))
        items = _alternatives(item) if listed and hasattr(value, "__len__") else ()
        return bool(items) and all(any(_fits(x, t) for t in items) for x in value)
    if kind is Any or not isinstance(kind, type):
        return True
    return not isinstance(value, type) and isinstance(value, kind)


def _words(kind: Any) -> str:
    kind, items = get_origin(kind) or kind, get_args(kind)
    if kind in _KINDS:
        return _KINDS[kind][0]
    if kind in _SEQUENCES:
        return "a sequence of numbers" if float in items else "a sequence"
    return f"a {kind.__name__.removeprefix('PathLike') or 'path'}"


def shown(value: object) -> str:
    try:
        return reprlib.repr(value)
    except Exception:  # of somebody's `__repr__`
        return f"<{type(value).__name__}>"


def _or(names: list[str]) -> str:
    return " or ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def is_number(value: object) -> TypeGuard[float]:
    """True for a finite real number, not a bool, that NumPy can hold."""
    real = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    return real and (abs(value) < 2**63 if isinstance(value, int) else math.isfinite(float(value)))  # type: ignore[arg-type]


def is_whole(value: object, least: float = -math.inf, most: float = math.inf) -> TypeGuard[int]:
    """True for a whole number in [least, most], not a bool."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    return whole and bool(least <= value <= most)  # type: ignore[operator]


def finite_array(name: str, value: object, ndim: int) -> np.ndarray:
    """Convert to an array of so many dimensions. `ProblemError` unless all squares are finite."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ProblemError(f"{name} must be numbers, not {shown(value)}.") from None
    largest = np.sqrt(np.finfo(float).max) / (array.size + 1)
    if array.ndim != ndim or not (np.abs(array) < largest).all():
        raise ProblemError(f"{name} must be a finite {ndim}-D array.")
    return array


def check_finite(positive: bool = False, **numbers: object) -> None:
    """Raise a `ProblemError` for the first number that is not finite (and positive)."""
    for name, value in numbers.items():
        if not is_number(value) or (positive and not value > 0):
            raise ProblemError(
                f"{name} must be a {'positive ' * positive}finite number, not {shown(value)}."
            )


def check_range(least: float, most: float = math.inf, **numbers: object) -> None:
    """Raise a `ProblemError` for the first value that is no number in [least, most]."""
    for name, value in numbers.items():
        if not is_number(value) or not least <= value <= most:
            ends = f"of at least {least:g}" if most == math.inf else f"from {least:g} to {most:g}"
            raise ProblemError(f"{name} must be a number {ends}, not {shown(value)}.")


def check_choice(choices: Sequence[str], **values: object) -> None:
    """Raise a `ProblemError` for the first value that is none of some."""
    for name, value in values.items():
        if value not in choices:
            raise ProblemError(f"{name} must be one of {', '.join(choices)}, not {shown(value)}.")


def check_count(most: float = math.inf, least: int = 1, **numbers: object) -> None:
    """Raise a `ProblemError` for the first value that is no whole number in [least, most]."""
    for name, value in numbers.items():
        if not is_whole(value, least, most):
            ends = f"of at least {least}" if most == math.inf else f"from {least} to {most}"
            raise ProblemError(f"{name} must be a whole number {ends}, not {shown(value)}.")


def check_positive(owner: object, *names: str, of: str = "") -> None:
    """`check_finite` for attributes that must be positive; `of` precedes their names."""
    check_finite(positive=True, **{of + name: getattr(owner, name) for name in names})
