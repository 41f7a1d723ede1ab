"""Checks of arguments: misspelt or unusable ones raise a `ProblemError` in one sentence."""

from __future__ import annotations

import functools
import inspect
import math
import reprlib
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import NoneType, UnionType
from typing import Any, ParamSpec, TypeGuard, TypeVar, Union, get_args, get_origin

import numpy as np

from colloc.system.errors import OrderWarning, ProblemError

T = TypeVar("T")
P = ParamSpec("P")
MOST_PERIODS = 10_000  # simulated one by one
STATED_IF_SET = {"stated if set": True}
"""Metadata of a dataclass field that is left out of statements while it has its default."""


def named_arguments(cls: type[T]) -> type[T]:
    """Make a dataclass check its arguments, and convert numbers to the type of their field.

    Positional ones among `by_name`, if the class has it, cause an `OrderWarning` if they differ.

    >>> from colloc import Friction
    >>> Friction(mu_x=1)
    Traceback (most recent call last):
    colloc.system.errors.ProblemError: Friction has no argument 'mu_x'; did you mean mu_t, mu_f or
    mu_b?
    >>> Friction(1) == Friction(1.0)
    True
    """
    init, owner = cls.__init__, cls.__name__
    _, *parameters = inspect.signature(init).parameters.values()  # without self
    known = [each.name for each in parameters]
    required = [each.name for each in parameters if each.default is each.empty]

    @functools.wraps(init)
    def checked(self: T, *values: Any, **named: Any) -> None:
        for name in named:
            if name not in known:
                import difflib

                close = difflib.get_close_matches(name, known, n=3, cutoff=0.6)
                hint = f"did you mean {_or(close)}?" if close else f"it takes {', '.join(known)}."
                raise ProblemError(f"{owner} has no argument {name!r}; {hint}")
        if (count := len(values)) > len(known):
            raise ProblemError(
                f"{owner} has {len(known)} arguments, {', '.join(known)}, and {count} were given."
            )
        if missing := [x for x in required if x in known[count:] and x not in named]:
            raise ProblemError(f"{owner} needs {' and '.join(missing)}.")
        stated = {**dict(zip(known, values, strict=False)), **named}
        if len(stated) < count + len(named):
            raise ProblemError(
                f"{owner} was given {known[count - 1]} twice, by its place and by its name."
            )
        scalars = {x: types for x, types in _types(init).items() if set(types) <= _SCALARS}
        try:
            init(self, **{x: _plain(value, scalars.get(x, ())) for x, value in stated.items()})
        except ProblemError:
            raise
        except Exception:
            _check_types(scalars, stated)
            raise
        _check_types(scalars, stated)  # last: the class knows better what is wrong
        order = {name: getattr(self, name) for name in getattr(cls, "by_name", ())}
        if len(set(order.values())) > 1 and order.keys() & known[:count]:
            read = ", ".join(f"{name}={value:g}" for name, value in order.items())
            warnings.warn(
                "coefficients by their place, which others write in another order, are read as "
                f"{owner}({read}): name them, as here.",
                OrderWarning,
                stacklevel=2,
            )

    cls.__init__ = checked  # type: ignore[assignment]
    return cls


def checked_arguments(function: Callable[P, T]) -> Callable[P, T]:
    """Make a function check its arguments against their annotations."""

    @functools.wraps(function)
    def checked(*values: P.args, **named: P.kwargs) -> T:
        try:
            stated = inspect.signature(function).bind(*values, **named).arguments
        except TypeError as error:
            raise ProblemError(f"{function.__name__}: {error}.") from None
        _check_types(_types(function), stated)
        return function(*values, **named)

    return checked


@functools.cache
def _types(function: Callable[..., Any]) -> dict[str, tuple[Any, ...]]:
    """Allowed types by argument; without those that only type checkers can resolve."""
    types = {}
    for name, each in inspect.signature(function).parameters.items():
        try:
            types[name] = _alternatives(eval(each.annotation, function.__globals__))
        except (NameError, TypeError):
            continue
        if each.default is None:
            types[name] = *types[name], NoneType
    return types


def _alternatives(kind: Any) -> tuple[Any, ...]:
    if get_origin(kind) in (Union, UnionType):
        return get_args(kind)
    return (NoneType if kind is None else kind,)


def _check_types(types: Mapping[str, tuple[Any, ...]], stated: Mapping[str, Any]) -> None:
    for name, value in stated.items():
        allowed = types.get(name, (Any,))
        if not any(_fits(value, kind) for kind in allowed):
            words = _or(list(dict.fromkeys(map(_words, allowed))))
            raise ProblemError(f"{name} must be {words}, not {shown(value)}.")


def _fits(value: Any, kind: Any) -> bool:
    if kind is float:  # infinite ones are checked elsewhere
        return is_number(value) or (isinstance(value, (float, np.floating)) and not np.isnan(value))
    if kind is int:
        return is_whole(value, -(2**63), 2**63)
    if kind is bool:
        return isinstance(value, (bool, np.bool_))
    if kind is np.ndarray:
        try:
            array = np.asarray(value)
        except ValueError:  # rows of different lengths
            return False
        if array.ndim == 1 and array.size and array.dtype.kind in "iuf":
            return bool(np.isfinite(array).all())
        return (array.dtype.kind in "iuf" or not array.size) and array.ndim >= 1
    kind, (item, *_) = get_origin(kind) or kind, (*get_args(kind), Any)
    if kind is Callable:
        return callable(value)
    if kind in _SEQUENCES:
        if not isinstance(value, Iterable) or isinstance(value, (str, bytes, Mapping)):
            return False
        items = _alternatives(item)
        return hasattr(value, "__len__") and all(any(_fits(x, t) for t in items) for x in value)
    if kind is Any or not isinstance(kind, type):
        return True
    return not isinstance(value, type) and isinstance(value, kind)


_SEQUENCES = tuple, list, Sequence, Iterable
_SCALARS = {float, int, bool, str, NoneType}
_WORDS = {
    float: "a number", int: "a whole number", bool: "True or False", str: "text", NoneType: "None",
    np.ndarray: "numbers", Callable: "a function",
}  # fmt: skip


def _words(kind: Any) -> str:
    kind, items = get_origin(kind) or kind, get_args(kind)
    if kind in _SEQUENCES:
        return "a sequence of numbers" if float in items else "a sequence"
    return _WORDS.get(kind) or f"a {kind.__name__.removeprefix('PathLike') or 'path'}"


def _plain(value: Any, types: tuple[Any, ...]) -> Any:
    """Convert a number to the scalar type of its field; leave all else."""
    scalars = (each(value) for each in types if each in (float, int, bool) and _fits(value, each))
    return next(scalars, value)


def shown(value: object) -> str:
    """Short text of a value for a message."""
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


def check_finite(positive: bool = False, **numbers: object) -> None:
    """Raise a `ProblemError` for the first number that is not finite (and positive)."""
    for name, value in numbers.items():
        if not is_number(value) or (positive and not value > 0):
            raise ProblemError(
                f"{name} must be a {'positive ' * positive}finite number, not {shown(value)}."
            )


def check_count(most: float = math.inf, **numbers: object) -> None:
    """Raise a `ProblemError` for the first value that is no whole number in [1, most]."""
    for name, value in numbers.items():
        if not is_whole(value, 1, most):
            ends = "of at least 1" if most == math.inf else f"from 1 to {most}"
            raise ProblemError(f"{name} must be a whole number {ends}, not {shown(value)}.")


def check_positive(owner: object, *names: str, of: str = "") -> None:
    """`check_finite` for attributes that must be positive; `of` precedes their names."""
    check_finite(positive=True, **{of + name: getattr(owner, name) for name in names})
