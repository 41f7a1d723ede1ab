"""Values as JSON and back, exact to the last bit.

Arrays become base64 text; dataclasses and named tuples their fields and the name of their class, of
which only listed ones are made again, without calling ``__init__``, which could change a last bit.
"""

from __future__ import annotations

import base64
import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np


class Codec:
    """Encoder and decoder of values of listed classes, or by the pairs of `custom` functions."""

    def __init__(self, kinds: Iterable[type], custom: Mapping[type, Any]) -> None:
        self._kinds = {kind.__name__: kind for kind in kinds}
        self._custom = {kind.__name__: pair for kind, pair in custom.items()}

    def encode(self, value: Any) -> Any:
        """Encode a value as plain JSON. `TypeError` for a class that is not listed."""
        name = type(value).__name__
        if isinstance(value, np.generic):
            return value.item()
        if value is None or isinstance(value, (bool, int, float, str)):
            return value
        if isinstance(value, list):
            return [self.encode(part) for part in value]
        if isinstance(value, np.ndarray):
            text = base64.b64encode(np.ascontiguousarray(value).tobytes()).decode()
            return {"array": text, "type": value.dtype.str, "shape": list(value.shape)}
        if name in self._custom:
            of = self._custom[name][0](value)
        elif name in self._kinds:
            names = getattr(value, "_fields", None) or [x.name for x in dataclasses.fields(value)]
            of = {each: self.encode(getattr(value, each)) for each in names}
        elif name == "tuple":
            of = [self.encode(part) for part in value]
        elif name == "dict":
            of = [[self.encode(k), self.encode(v)] for k, v in value.items()]
        else:
            raise TypeError(f"cannot write a {name}.")
        return {"kind": name, "of": of}

    def decode(self, plain: Any) -> Any:
        """Decode. `KeyError`, `TypeError` or `ValueError` if `encode` did not make it."""
        if isinstance(plain, list):
            return [self.decode(part) for part in plain]
        if not isinstance(plain, dict):
            return plain
        if "array" in plain:
            data = np.frombuffer(base64.b64decode(plain["array"]), dtype=np.dtype(plain["type"]))
            return data.reshape(plain["shape"]).copy()
        name, of = plain["kind"], plain["of"]
        if name == "tuple":
            return tuple(self.decode(part) for part in of)
        if name == "dict":
            return {self.decode(k): self.decode(v) for k, v in of}
        if name in self._custom:
            return self._custom[name][1](of)
        kind, values = self._kinds[name], {key: self.decode(part) for key, part in of.items()}
        if issubclass(kind, tuple):
            return kind(**values)
        made: Any = object.__new__(kind)
        for key, value in values.items():
            object.__setattr__(made, key, value)
        return made
