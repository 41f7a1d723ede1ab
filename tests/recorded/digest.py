"""What a result says, as a few numbers and texts that differ if any of its parts does."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

_TURN = 0.5 * (np.sqrt(5.0) - 1.0)
_FEW_INSTANTS = 1.6
"""Relative change of a mean of logarithms, times their number, where two instants take four times
as many steps."""


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, np.ndarray | str]]:
    """Arrays and texts in a result, by the names of the fields that lead to them."""
    if value is None or isinstance(value, str):
        yield name, str(value)
    elif isinstance(value, Mapping):
        for key, part in value.items():
            yield from leaves(part, f"{name}.{key}")
    elif hasattr(value, "_fields"):
        for key in value._fields:
            yield from leaves(getattr(value, key), f"{name}.{key}")
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from leaves(getattr(value, field.name), f"{name}.{field.name}")
    elif isinstance(value, (tuple, list)):
        for k, part in enumerate(value):
            yield from leaves(part, f"{name}.{k}")
    else:
        array = np.asarray(value)
        yield name, str(array.tolist()) if array.dtype.kind == "U" else array


def digest(value: Any) -> dict[str, Any]:
    """Texts as they are; of an array its shape, number of finite parts, root mean square, and a sum
    in which each part counts differently."""
    found: dict[str, Any] = {}
    for name, leaf in leaves(value):
        if isinstance(leaf, str):
            found[name] = leaf
            continue
        assert leaf.dtype.kind in "biufc", f"{name} holds {leaf.dtype}"
        flat = leaf.ravel().astype(complex)
        parts = np.concatenate([flat.real, flat.imag]) if leaf.dtype.kind == "c" else flat.real
        finite = np.where(np.isfinite(parts), parts, 0.0)
        weights = np.cos(1.0 + 2 * np.pi * _TURN * np.arange(parts.size))
        size = float(np.sqrt(np.mean(finite**2))) if parts.size else 0.0
        found[name] = [
            list(leaf.shape),
            int(np.isfinite(parts).sum()),
            size,
            float(weights @ finite),
        ]
    return found


def assert_same(
    found: dict[str, Any], known: dict[str, Any], precision: float, floor: float
) -> None:
    """Texts, shapes and numbers; these to a relative precision, and not below a floor.

    Rounding, and so the processor, decides here and there on a fourfold of a method's steps: of
    iterations the mean is compared alone, and two instants may have such a change, however many
    there are.
    """
    assert list(found) == list(known), "other parts"
    for name, (mine, theirs) in {name: (found[name], known[name]) for name in known}.items():
        says = f"{name}: {mine} instead of {theirs}"
        if isinstance(theirs, str):
            assert mine == theirs, says
            continue
        assert mine[:2] == theirs[:2], says
        if name.endswith("iterations"):
            assert abs(mine[2] - theirs[2]) <= _FEW_INSTANTS / theirs[1] * theirs[2], says
            continue
        assert abs(mine[2] - theirs[2]) <= precision * theirs[2] + floor, says
        assert (
            abs(mine[3] - theirs[3]) <= precision * theirs[2] * np.sqrt(max(1, theirs[1])) + floor
        ), says
