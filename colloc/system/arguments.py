"""Arguments of what people call by hand: misspelt or unusable ones meet a sentence that says so."""

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
MOST_PERIODS = 10_000
"""That are followed one by one."""
STATED_IF_SET = {"stated if set": True}
"""Metadata of a field that statements name only where it is not its default: what was stated before
there was one, stays."""


def named_arguments(cls: type[T]) -> type[T]:
    """Make a dataclass refuse arguments it does not have, or lacks, by a `ProblemError` that says
    which one is meant.

    Numbers become Python's own, of the kind that the field has: equal values have equal hashes.
    Those of `by_name`, if the class has it, are to be given so where they differ: else an
    `OrderWarning` says how they are read.

    Examples
    --------
    >>> from colloc import Friction
    >>> Friction(mu_x=1)
    Traceback (most recent call last):
    colloc.system.errors.ProblemError: Friction has no argument 'mu_x'; did you mean mu_t, mu_f or
    mu_b?
    >>> Friction(1) == Friction(1.0)
    True
    """
    made = cls.__init__
    _, *taken = inspect.signature(made).parameters.values()  # without self
    known, needed = (
        [each.name for each in taken],
        [each.name for each in taken if each.default is each.empty],
    )

    @functools.wraps(made)
    def checked(self: T, *given: Any, **named: Any) -> None:
        for name in named:
            if name not in known:
                import difflib

                near = difflib.get_close_matches(name, known, n=3, cutoff=0.6)
                hint = f"did you mean {_either(near)}?" if near else f"it takes {', '.join(known)}."
                raise ProblemError(f"{cls.__name__} has no argument {name!r}; {hint}")
        if len(given) > len(known):
            raise ProblemError(
                f"{cls.__name__} has {len(known)} arguments, {', '.join(known)}, and {len(given)} "
                f"were given."
            )
        if missing := [
            name for name in needed if name in known[len(given) :] and name not in named
        ]:
            raise ProblemError(f"{cls.__name__} needs {' and '.join(missing)}.")
        stated = {**dict(zip(known, given, strict=False)), **named}
        if len(stated) < len(given) + len(named):
            raise ProblemError(
                f"{cls.__name__} was given {known[len(given) - 1]} twice, by its place and by "
                f"its name."
            )
        scalars = _scalars(made)
        try:
            made(
                self,
                **{name: _plain(value, scalars.get(name, ())) for name, value in stated.items()},
            )
        except ProblemError:
            raise
        except Exception:
            _check_kinds(scalars, stated)
            raise
        _check_kinds(scalars, stated)  # last, as its own checks know better what is wrong
        order = {name: getattr(self, name) for name in getattr(cls, "by_name", ())}
        if len(set(order.values())) > 1 and order.keys() & known[: len(given)]:
            read = ", ".join(f"{name}={value:g}" for name, value in order.items())
            warnings.warn(
                f"coefficients by their place, which others write in another order, are read as "
                f"{cls.__name__}({read}): name "
                "them, as here.",
                OrderWarning,
                stacklevel=2,
            )

    cls.__init__ = checked  # type: ignore[assignment]
    return cls


def checked_arguments(function: Callable[P, T]) -> Callable[P, T]:
    """The same function, which refuses arguments that are of no kind its annotations name, by a
    `ProblemError`."""

    @functools.wraps(function)
    def checked(*given: P.args, **named: P.kwargs) -> T:
        try:
            stated = inspect.signature(function).bind(*given, **named).arguments
        except TypeError as error:
            raise ProblemError(f"{function.__name__}: {error}.") from None
        _check_kinds(_kinds(function), stated)
        return function(*given, **named)

    return checked


@functools.cache
def _kinds(function: Callable[..., Any]) -> dict[str, tuple[Any, ...]]:
    """What the annotations of a function allow; not those that only type checkers can resolve."""
    found = {}
    for name, each in inspect.signature(function).parameters.items():
        try:
            found[name] = _alternatives(eval(each.annotation, function.__globals__))
        except (NameError, TypeError):
            continue
        if each.default is None:
            found[name] = *found[name], NoneType
    return found


@functools.cache
def _scalars(function: Callable[..., Any]) -> dict[str, tuple[Any, ...]]:
    return {name: kinds for name, kinds in _kinds(function).items() if set(kinds) <= _SCALARS}


def _alternatives(kind: Any) -> tuple[Any, ...]:
    return (
        get_args(kind)
        if get_origin(kind) in (Union, UnionType)
        else (NoneType if kind is None else kind,)
    )


def _check_kinds(kinds: Mapping[str, tuple[Any, ...]], stated: Mapping[str, Any]) -> None:
    for name, value in stated.items():
        allowed = kinds.get(name, (Any,))
        if not any(_fits(value, kind) for kind in allowed):
            words = _either(list(dict.fromkeys(map(_words, allowed))))
            raise ProblemError(f"{name} must be {words}, not {shown(value)}.")


def _fits(value: Any, kind: Any) -> bool:
    if kind is float:  # whether infinite ones will do is for others to say
        return is_number(value) or (isinstance(value, (float, np.floating)) and not np.isnan(value))
    if kind is int:
        return is_whole(value, -(2**63), 2**63)
    if kind is bool:
        return isinstance(value, (bool, np.bool_))
    if kind is np.ndarray:
        return _are_numbers(value)
    kind, (item, *_) = get_origin(kind) or kind, (*get_args(kind), Any)
    if kind is Callable:
        return callable(value)
    if kind in _SEQUENCES:
        many = (
            isinstance(value, Iterable)
            and hasattr(value, "__len__")
            and not isinstance(value, (str, bytes, Mapping))
        )
        return many and all(
            any(_fits(part, each) for each in _alternatives(item)) for part in value
        )
    return (
        kind is Any
        or not isinstance(kind, type)
        or (not isinstance(value, type) and isinstance(value, kind))
    )


def _are_numbers(value: Any) -> bool:
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        return False
    numbers = array.dtype.kind in "iuf" or not array.size
    # of tables others know more
    return numbers and (bool(np.isfinite(array).all()) if array.ndim == 1 else array.ndim > 1)


_SEQUENCES = tuple, list, Sequence, Iterable
_SCALARS = {float, int, bool, str, NoneType}
_WORDS = {
    float: "a number", int: "a whole number", bool: "True or False", str: "text", NoneType: "None",
    np.ndarray: "numbers",
    Callable: "a function",
}  # fmt: skip


def _words(kind: Any) -> str:
    kind, items = get_origin(kind) or kind, get_args(kind)
    if kind in _SEQUENCES:
        return "a sequence of numbers" if float in items else "a sequence"
    return _WORDS.get(kind) or f"a {kind.__name__.removeprefix('PathLike') or 'path'}"


def _plain(value: Any, kinds: tuple[Any, ...]) -> Any:
    """A number as a field of its kind stores it; all else as it is."""
    found = (each(value) for each in kinds if each in (float, int, bool) and _fits(value, each))
    return next(found, value)


def shown(value: object) -> str:
    """A value as a message shows it, in one short line."""
    try:
        return reprlib.repr(value)
    except Exception:  # of a `__repr__` of somebody's own
        return f"<{type(value).__name__}>"


def _either(names: list[str]) -> str:
    return " or ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def is_number(value: object) -> TypeGuard[float]:
    """Whether it is a finite real number, and no truth value; a whole one that NumPy takes."""
    real = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    return real and (abs(value) < 2**63 if isinstance(value, int) else math.isfinite(float(value)))  # type: ignore[arg-type]


def is_whole(value: object, least: float = -math.inf, most: float = math.inf) -> TypeGuard[int]:
    """Whether it is a whole number between two others, and no truth value."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    return whole and bool(least <= value <= most)  # type: ignore[operator]


def check_finite(positive: bool = False, **numbers: object) -> None:
    """A `ProblemError` for the first of some numbers that is not finite (and positive, if that is
    asked)."""
    for name, value in numbers.items():
        if not is_number(value) or (positive and not value > 0):
            raise ProblemError(
                f"{name} must be a {'positive ' * positive}finite number, not {shown(value)}."
            )


def check_count(most: float = math.inf, **numbers: object) -> None:
    """A `ProblemError` for the first of some numbers that is not whole, at least 1 and at most
    another."""
    for name, value in numbers.items():
        if not is_whole(value, 1, most):
            ends = "of at least 1" if most == math.inf else f"from 1 to {most}"
            raise ProblemError(f"{name} must be a whole number {ends}, not {shown(value)}.")


def check_positive(owner: object, *names: str, of: str = "") -> None:
    """The same for numbers of an object that have to be positive; `of` heads their names."""
    check_finite(positive=True, **{of + name: getattr(owner, name) for name in names})
