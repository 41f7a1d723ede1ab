"""The associated elliptic law: dry friction with unequal coefficients and one balance.

Its dissipation ``D = sqrt((mu_s vs)^2 + (mu_t vn)^2)``, with mu_s = mu_f or mu_b as vs > 0 or < 0,
is convex, and the force minus its gradient (principle of maximal dissipation; Goyal, Ruina and
Papadopoulos, Wear 143, 1991). Along or across itself that is Coulomb friction; oblique sliding
differs. With the tangential velocity stretched by mu_s/mu_t the closed forms of equal coefficients
hold on links.
"""

from __future__ import annotations

from dataclasses import dataclass

from colloc.mechanics.friction import Friction
from colloc.numerics.arrays import Array
from colloc.system.arguments import named_arguments


@named_arguments
@dataclass(frozen=True)
class Elliptic(Friction):
    """Associated friction with an elliptic dissipation; a law of friction.

    Parameters
    ----------
    mu_t, mu_f, mu_b : float
        Friction on sliding across the body, forwards and backwards, in units of the weight; all
        positive.

    Examples
    --------
    >>> from colloc import Elliptic
    >>> Elliptic(mu_t=1.7, mu_f=1.0, mu_b=1.3).associated
    True
    """

    associated = True

    @property
    def label(self) -> str:
        """A short name with its numbers."""
        return f"elliptic {super().label}"

    def describe(self) -> str:
        return f"{super().describe()}, elliptic"

    def stretch(self, vs: Array) -> Array:
        return self.tangential(vs) / self.mu_t
