"""Gait classes with an additional static parameter, the last one: initial heading or log period."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from typing import Any, ClassVar

import numpy as np

from colloc.gaits.gait import ClassOfGaits
from colloc.mechanics.bodies import Body


class WithStaticParameter(ClassOfGaits):
    """Base of a class with a static parameter; members whose last parameter is NaN do not state
    it."""

    static_name: ClassVar[str]
    """Attribute of members."""
    _own: ClassVar[tuple[tuple[str, Any], ...]]

    @property
    def static_bounds(self) -> tuple[float, float]:
        """Bounds of the parameter."""
        raise NotImplementedError

    def static_value(self, gait: Any) -> float:
        """The parameter of any gait; NaN if it is unknown."""
        raise NotImplementedError

    @property
    def without(self) -> Any:
        """The class without the parameter."""
        return type(self).__bases__[1](**{f.name: getattr(self, f.name) for f in fields(self)})  # type: ignore[arg-type]

    @property
    def level(self) -> Any:
        return self.without.level

    def __reduce__(self) -> tuple[Any, ...]:
        return _make, (type(self).__bases__[0], self.without, self._own)

    def series(self, harmonics: int) -> Any:
        return self.without.series(harmonics)

    def size(self, n_joint: int) -> int:
        return self.without.size(n_joint) + 1

    def _basis(self, n_joint: int) -> np.ndarray:
        basis = self.without._basis(n_joint)
        return np.column_stack([basis, np.zeros(len(basis))])

    def bounds(self, body: Body, limit: float) -> tuple[np.ndarray, np.ndarray]:
        own = self.without.bounds(body, limit)
        lower, upper = (
            np.append(each, end) for each, end in zip(own, self.static_bounds, strict=True)
        )
        return lower, upper

    def parameters(self, gait: Any) -> np.ndarray:
        return np.append(self.without.parameters(gait), self.static_value(gait))

    def nearest(self, gait: Any) -> np.ndarray:
        return np.append(self.without.nearest(gait), self.static_value(gait))

    def member(self, parameters: np.ndarray, n_joint: int) -> Any:
        gait = self.without.member(parameters[:-1], n_joint)
        return (
            gait
            if np.isnan(parameters[-1])
            else replace(gait, **{self.static_name: float(parameters[-1])})
        )

    def through(self, gait: Any) -> Any:
        near = self.without.through(gait)
        return (
            replace(near, **{self.static_name: getattr(gait, self.static_name)})
            if gait.is_series
            else near
        )


def with_static_parameter(kind: type[WithStaticParameter], gait_class: Any, **own: Any) -> Any:
    return _make(kind, gait_class, tuple(own.items()))


def _make(kind: Any, gait_class: Any, own: tuple[tuple[str, Any], ...]) -> Any:
    without: Any = type(gait_class)
    return _type(kind, without, own)(
        **{f.name: getattr(gait_class, f.name) for f in fields(gait_class)}
    )


@cache
def _type(kind: Any, gait_class: Any, own: tuple[tuple[str, Any], ...]) -> Any:
    return type(
        gait_class.__name__,
        (kind, gait_class),
        {"__doc__": gait_class.__doc__, "_own": own, **dict(own)},
    )
