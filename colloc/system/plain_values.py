"""Values as JSON and back, exact to the last bit.

Arrays become base64 text; dataclasses and named tuples their fields and the name of their class, of
which only listed ones are made again, without calling ``__init__``, which could change a last bit.
"""

from __future__ import annotations

import base64
import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

KIND, ARRAY = "kind", "array"


class Encoding(NamedTuple):
    """Encoder and decoder of a class whose fields are not what should be stored."""

    encode: Callable[[Any], Any]
    decode: Callable[[Any], Any]


class Codec:
    """Encoder and decoder of values of listed classes; those of `own` have their own encoding.

    >>> from colloc.system.plain_values import Codec
    >>> from colloc.mechanics.friction import Friction
    >>> codec = Codec([Friction])
    >>> codec.decode(codec.encode((Friction(mu_t=2.0), 0.1)))
    (Friction(mu_t=2.0, mu_f=1.0, mu_b=1.0), 0.1)
    """

    def __init__(self, kinds: Iterable[type], own: Mapping[type, Encoding] | None = None) -> None:
        self._kinds = {kind.__name__: kind for kind in kinds}
        self._own = {kind.__name__: how for kind, how in (own or {}).items()}

    def encode(self, value: Any) -> Any:
        """Encode a value as plain JSON. `TypeError` for a class that is not listed."""
        name = type(value).__name__
        if name in self._own:
            return {KIND: name, "of": self._own[name].encode(value)}
        if name in self._kinds:
            if isinstance(value, tuple):
                named = value._asdict()  # type: ignore[attr-defined]
            else:
                named = {x.name: getattr(value, x.name) for x in dataclasses.fields(value)}
            return {KIND: name, "of": {key: self.encode(part) for key, part in named.items()}}
        if isinstance(value, np.ndarray):
            data = np.ascontiguousarray(value)
            return {
                ARRAY: base64.b64encode(data.tobytes()).decode(),
                "type": data.dtype.str,
                "shape": list(value.shape),
            }
        if isinstance(value, np.generic):
            return value.item()
        if isinstance(value, tuple):
            return {KIND: "tuple", "of": [self.encode(part) for part in value]}
        if isinstance(value, list):
            return [self.encode(part) for part in value]
        if isinstance(value, dict):
            items = [[self.encode(k), self.encode(v)] for k, v in value.items()]
            return {KIND: "dict", "of": items}
        if value is None or isinstance(value, (bool, int, float, str)):
            return value
        raise TypeError(f"cannot write a {name}.")

    def decode(self, plain: Any) -> Any:
        """Decode. `KeyError`, `TypeError` or `ValueError` if `encode` did not make it."""
        if isinstance(plain, list):
            return [self.decode(part) for part in plain]
        if not isinstance(plain, dict):
            return plain
        if ARRAY in plain:
            data = np.frombuffer(base64.b64decode(plain[ARRAY]), dtype=np.dtype(plain["type"]))
            return data.reshape(plain["shape"]).copy()
        name, of = plain[KIND], plain["of"]
        if name == "tuple":
            return tuple(self.decode(part) for part in of)
        if name == "dict":
            return {self.decode(k): self.decode(v) for k, v in of}
        if name in self._own:
            return self._own[name].decode(of)
        kind, values = self._kinds[name], {key: self.decode(part) for key, part in of.items()}
        if issubclass(kind, tuple):
            return kind(**values)
        made: Any = object.__new__(kind)
        for key, value in values.items():
            object.__setattr__(made, key, value)
        return made
