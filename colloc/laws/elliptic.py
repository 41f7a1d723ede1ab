r"""The associated elliptic law: dry friction with unequal coefficients whose balance has exactly
one solution.

Its dissipation at velocity (vs, vn) is ``D = sqrt((mu_s vs)^2 + (mu_t vn)^2)``, with mu_s = mu_f or
mu_b as vs > 0 or < 0: a convex function, since its level line, two half ellipses that share an
axis, bounds a convex set. The force is minus its gradient (principle of maximal dissipation; Goyal,
Ruina and Papadopoulos, Wear 143, 1991). Where the body slides straight along or across itself it is
that of Coulomb friction with the same coefficients; oblique sliding differs.

With the tangential velocity stretched by mu_s/mu_t, D is mu_t times a speed: so on links the closed
forms of equal coefficients hold, at stretched velocities.
"""

from __future__ import annotations

from dataclasses import dataclass

from colloc.mechanics.friction import Friction
from colloc.numerics.arrays import Array
from colloc.system.arguments import named_arguments


@named_arguments
@dataclass(frozen=True)
class Elliptic(Friction):
    """Associated friction with an elliptic dissipation; a `colloc.mechanics.law.Law`.

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
        return f"elliptic {super().label}"

    def describe(self) -> str:
        return f"{super().describe()}, elliptic"

    def stretch(self, vs: Array) -> Array:
        return self.tangential(vs) / self.mu_t
