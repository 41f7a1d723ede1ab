"""Collocation schemes of Lobatto IIIA, Gauss-Legendre and Radau IIA type, from their nodes c.

``A[i, j]`` and ``b[j]`` are the integrals of the Lagrange polynomial L_j from 0 to c_i and to 1
(Hairer, Norsett and Wanner, Solving ODEs I, section II.7); up to any tau, the interpolant.
"""

import re
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from colloc.system.errors import ProblemError

_LARGEST = 12


@dataclass(frozen=True, eq=False)
class Scheme:
    """A collocation scheme with nodes c ``(s,)`` in [0, 1], ascending."""

    name: str
    c: np.ndarray
    A: np.ndarray = field(init=False)  # (s, s)
    b: np.ndarray = field(init=False)  # (s,)

    def __post_init__(self) -> None:
        object.__setattr__(self, "A", self.integrals(self.c))
        object.__setattr__(self, "b", self.integrals(np.ones(1))[0])
        for table in (self.c, self.A, self.b):  # shared by all who ask for the scheme
            table.flags.writeable = False

    @property
    def s(self) -> int:
        return len(self.c)

    @property
    def left(self) -> bool:
        """The first node is the left end of the interval: neighbours share their end nodes."""
        return bool(self.c[0] == 0.0)

    @property
    def right(self) -> bool:
        return bool(self.c[-1] == 1.0)

    def lagrange(self, tau: np.ndarray, *, begin: bool = False) -> np.ndarray:
        """Lagrange polynomials at tau ``(k,)``, as ``(k, s)``; with the `begin`, the weights ``(k,
        s + 1)`` of the state there and at the nodes in the collocation polynomial."""
        nodes = np.append(0.0, self.c) if begin else self.c
        others = np.where(np.eye(nodes.size, dtype=bool), np.nan, nodes)
        factors = (np.asarray(tau)[:, None, None] - others) / (nodes[:, None] - others)
        return np.nanprod(factors, axis=2)

    def integrals(self, tau: np.ndarray) -> np.ndarray:
        """Integrals of the Lagrange polynomials from 0 to tau ``(k,)``, as ``(k, s)``."""
        nodes, weights = _gauss_rule(self.s)
        points = 0.5 * tau[:, None] * (nodes + 1.0)
        values = self.lagrange(points.ravel()).reshape(tau.size, self.s, self.s)
        return 0.5 * tau[:, None] * np.einsum("q,kqj->kj", weights, values)


_gauss_rule = lru_cache(np.polynomial.legendre.leggauss)


def scheme(name: str) -> Scheme:
    """The scheme "trapezoid", "hermite-simpson", "gauss-N" or "radau-N" with N nodes;
    `ProblemError` for any other name."""
    known = _known_schemes(name) if isinstance(name, str) else None
    if known is None:
        raise ProblemError(
            f"unknown scheme {name!r}; choose trapezoid, hermite-simpson, gauss-N or radau-N with "
            f"N from 1 to {_LARGEST}."
        )
    return known


@lru_cache
def _known_schemes(name: str) -> Scheme | None:
    if name in ("trapezoid", "hermite-simpson"):
        return Scheme(name, np.linspace(0.0, 1.0, 2 if name == "trapezoid" else 3))
    match = re.fullmatch(r"(gauss|radau)-(\d{1,3})", name)
    if not match or not 1 <= (s := int(match[2])) <= _LARGEST:
        return None
    if match[1] == "gauss":
        return Scheme(name, 0.5 * (_gauss_rule(s)[0] + 1.0))
    # zeros of P_s - P_(s-1), the largest of which is the right end
    difference = np.append(np.zeros(s - 1), [-1.0, 1.0])
    roots = np.sort(np.polynomial.legendre.Legendre(difference).roots().real)
    roots[-1] = 1.0
    return Scheme(name, 0.5 * (roots + 1.0))
