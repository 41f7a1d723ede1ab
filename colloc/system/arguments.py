"""Arguments of the classes that people write by hand: misspelt or unusable ones meet a sentence that says so."""

from __future__ import annotations

import functools
import inspect
import math
from typing import Any, TypeGuard, TypeVar

import numpy as np

from colloc.system.errors import ProblemError

T = TypeVar("T")
STATED_IF_SET = {"stated if set": True}
"""Metadata of a field that statements name only where it is not its default: what was stated before there was one, stays."""


def named_arguments(cls: type[T]) -> type[T]:
    """Make a dataclass refuse arguments it does not have, or lacks, by a `ProblemError` that says which one is meant.

    Examples
    --------
    >>> from colloc import Friction
    >>> Friction(mu_x=1)
    Traceback (most recent call last):
    colloc.system.errors.ProblemError: Friction has no argument 'mu_x'; did you mean mu_t, mu_f or mu_b?
    """
    made = cls.__init__
    _, *taken = inspect.signature(made).parameters.values()  # without self
    known, needed = [each.name for each in taken], [each.name for each in taken if each.default is each.empty]

    @functools.wraps(made)
    def checked(self: T, *given: Any, **named: Any) -> None:
        for name in named:
            if name not in known:
                import difflib

                near = difflib.get_close_matches(name, known, n=3, cutoff=0.6)
                hint = f"did you mean {_either(near)}?" if near else f"it takes {', '.join(known)}."
                raise ProblemError(f"{cls.__name__} has no argument {name!r}; {hint}")
        if len(given) > len(known):
            raise ProblemError(f"{cls.__name__} has {len(known)} arguments, {', '.join(known)}, and {len(given)} were given.")
        if missing := [name for name in needed if name in known[len(given) :] and name not in named]:
            raise ProblemError(f"{cls.__name__} needs {' and '.join(missing)}.")
        made(self, *given, **named)

    cls.__init__ = checked  # type: ignore[assignment]
    return cls


def _either(names: list[str]) -> str:
    return " or ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def is_number(value: object) -> TypeGuard[float]:
    """Whether it is a finite real number, and no truth value; a whole one that NumPy takes."""
    real = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    return real and bool(abs(value) < (2**63 if isinstance(value, int) else math.inf))  # type: ignore[arg-type]


def is_whole(value: object, least: float = -math.inf, most: float = math.inf) -> TypeGuard[int]:
    """Whether it is a whole number between two others, and no truth value."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    return whole and bool(least <= value <= most)  # type: ignore[operator]


def check_finite(positive: bool = False, **numbers: object) -> None:
    """A `ProblemError` for the first of some numbers that is not finite (and positive, if that is asked)."""
    for name, value in numbers.items():
        if not is_number(value) or (positive and not value > 0):
            raise ProblemError(f"{name} must be a {'positive ' * positive}finite number, not {value!r}.")


def check_positive(owner: object, *names: str, of: str = "") -> None:
    """The same for numbers of an object that have to be positive; `of` heads their names."""
    check_finite(positive=True, **{of + name: getattr(owner, name) for name in names})
