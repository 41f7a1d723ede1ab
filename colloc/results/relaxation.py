"""What stands beside the answer to a problem of relaxed gaits: the relaxed gait, and the finite ones that come near it.

The relaxed value is the limit of ever smaller loops, which no gait attains. So the answer is the best of the finite gaits that
repeat its directions so and so often (`colloc.gaits.relaxed.Mixture.realised`), each certified like any other gait.
"""

from __future__ import annotations

from dataclasses import dataclass

from colloc.gaits.polygon import Corners
from colloc.gaits.relaxed import Mixture
from colloc.results.checks import Certificate


@dataclass(frozen=True, eq=False)
class Realised:
    """A finite gait that repeats the directions of a relaxed one.

    Attributes
    ----------
    repeats, sense : int
        See `colloc.gaits.relaxed.Mixture.realised`.
    gait : Corners
    certificate : Certificate
    """

    repeats: int
    sense: int
    gait: Corners
    certificate: Certificate

    @property
    def corners(self) -> int:
        """Over the whole period."""
        return self.gait.n_corner

    def line(self) -> str:
        """Repeats, what they lead to, and whether it is certified."""
        found = self.certificate
        verdict = "certified" if found.passed else "FAILED: " + ", ".join(c.name for c in found.failures)
        return (
            f"{self.repeats} repeats: {found.efficiency:.6f}, {self.corners} corners, distance {found.distance:.4f}, {verdict}"
        )


@dataclass(frozen=True, eq=False)
class Optimality:
    """What the search says of a relaxed gait.

    Attributes
    ----------
    efficiency : float
        As collocated.
    kkt_error, violation : float
        Of the program in the gait's parameters.
    price : float
        The smallest slope of -d/W in the time spent in any direction, on any piece that has not used all directions that the
        class allows: none should be negative.
    iterations : int
    """

    efficiency: float
    kkt_error: float
    violation: float
    price: float
    iterations: int


@dataclass(frozen=True, eq=False)
class Relaxation:
    """A relaxed gait and what comes near it.

    Attributes
    ----------
    gait : Mixture
    optimality : Optimality
    certificate : Certificate
        Of the relaxed gait: its replay is an integral over the mixture.
    realised : tuple of Realised
        By number of repeats.
    """

    gait: Mixture
    optimality: Optimality
    certificate: Certificate
    realised: tuple[Realised, ...]

    @property
    def best(self) -> Realised:
        """The finite gait of largest efficiency whose certificate holds, or, if none does, of all."""
        held = [r for r in self.realised if r.certificate.passed] or self.realised
        return max(held, key=lambda r: r.certificate.efficiency)

    @property
    def message(self) -> str:
        """What is not as it should be with the relaxed gait; empty if it is a local optimum and its replay confirms it."""
        failed = ", ".join(check.name for check in self.certificate.failures)
        return f"the relaxed gait is not certified ({failed}): the best may be better." if failed else ""

    @property
    def certificates(self) -> dict[str, Certificate]:
        """Of all gaits, by name."""
        return {"relaxed": self.certificate} | {f"{r.corners} corners": r.certificate for r in self.realised}

    def lines(self) -> list[str]:
        """What a person wants to know."""
        found = self.certificate
        limit = f"{found.efficiency:.6f} +- {found.efficiency_error:.0e} ({found.efficiency_at_zero_delta:.6f} for delta -> 0)"
        return [f"{limit}: what finite gaits tend to, and none attains", *(r.line() for r in self.realised)]
