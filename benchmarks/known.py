"""The best gaits that are known, as a table that a referee checks from the gaits alone, and that
anyone can beat (``python -m benchmarks.referee``).

A row states a problem, a member of its class of gaits by its decision variables, and what the
gait achieves. Nothing that a solver said is in it: `Known.certificate` replays the gait, and that
is what counts.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from colloc.dynamics.control_problem import control_problem
from colloc.gaits.gait import delta_per_period
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.results.checks import Certificate
from colloc.results.solution import Solution
from colloc.search.certify import gait_certificate
from colloc.system.environment import version_of
from colloc.system.errors import ProblemError, StoreError
from colloc.system.files import replaced_file
from colloc.verification.dry_friction import dry_friction

TABLE = Path(__file__).with_name("known.json")
_HOW = (
    "name",
    "guess",
    "delta_start",
    "intervals",
    "scheme",
    "formulation",
    "mesh_tolerance",
    "shrinking",
)
"""Of a problem: how its answer is sought. The rest is the question."""
_AGREEMENT = 3.0
"""A replay may differ from a row by so many times the sum of their estimated errors, and by
`_ROUNDING`."""
_ROUNDING = 1e-9
_DRY_AGREEMENT = 1e-6
"""Relative: bounds under dry friction are made on the same instants, and differ by rounding
alone."""
_NUMBERS = "value", "value_error", "value_at_zero_delta", "value_error_at_zero_delta"


@dataclass(frozen=True)
class Known:
    """One row: the best gait that is known of a problem."""

    statement: dict[str, Any]
    parameters: tuple[float, ...]
    value: float
    value_error: float
    value_at_zero_delta: float
    value_error_at_zero_delta: float
    dry: tuple[float, float] | None
    command: str
    version: str

    @property
    def problem(self) -> Problem:
        return Problem.from_dict(self.statement)

    @property
    def gait(self) -> AnyGait:
        return control_problem(self.problem).admissible.member(np.array(self.parameters))

    @property
    def question(self) -> str:
        """What is asked, however it is answered: rows of equal questions are rivals."""
        stated = self.problem.to_dict()  # with numbers as they are written now
        return json.dumps(
            {name: value for name, value in stated.items() if name not in _HOW}, sort_keys=True
        )

    def certificate(self) -> Certificate:
        """The verdict of an independent replay of the gait as it stands here."""
        gait = self.gait
        problem = self.problem.with_(guess=gait)  # which has to be admissible
        return gait_certificate(
            problem, gait, delta_per_period(problem.gait, gait, problem.delta), gait.corner_phases
        )

    def complaint(self, certificate: Certificate) -> str:
        """What a certificate has against the row, in a sentence; empty if it holds."""
        if not certificate.passed:
            return f"the gait fails on {', '.join(check.name for check in certificate.failures)}"
        allowed = _AGREEMENT * (self.value_error + certificate.value_error) + _ROUNDING
        if not abs(certificate.value - self.value) <= allowed:
            return (
                f"the table says {self.value:.8f}, the replay {certificate.value:.8f} +- "
                f"{certificate.value_error:.0e}"
            )
        return ""

    def dry_complaint(self) -> str:
        """What bounds made anew have against those in the row; empty if they hold, or if there are
        none."""
        if self.dry is None:
            return ""
        problem, gait = self.problem, self.gait
        now = dry_friction(
            problem.body, problem.law, gait, breaks=gait.corner_phases, turn=problem.rotation or 0.0
        ).efficiency
        if np.allclose(self.dry, now, rtol=_DRY_AGREEMENT, atol=0):
            return ""
        return (
            f"dry friction: the table says {self.dry[0]:.8f} to {self.dry[1]:.8f}, and it is "
            f"{now[0]:.8f} to {now[1]:.8f}"
        )

    def __repr__(self) -> str:
        return (
            f"<Known {self.statement['name']}: {self.value:.8g} +- {self.value_error:.0e}, by "
            f"{self.command}>"
        )


def known(table: str | os.PathLike[str] | None = None) -> tuple[Known, ...]:
    """The best gaits that are known, one a question."""
    path = TABLE if table is None else Path(table)
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
        return tuple(_row(row) for row in rows)
    except OSError as error:
        raise StoreError(f"cannot read {path}: {error.strerror or error}.") from None
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise StoreError(f"{path} is no table of known gaits: {error}.") from None


def _row(fields: dict[str, Any]) -> Known:
    """A row that has a gait, whatever that achieves."""
    dry = None if fields["dry"] is None else tuple(map(float, fields["dry"]))
    given = {"parameters": tuple(map(float, fields["parameters"])), "dry": dry}
    row = Known(**fields | given | {name: float(fields[name]) for name in _NUMBERS})
    if not np.isfinite(row.gait.angles(np.zeros(1))).all():
        raise ValueError(f"the gait of {row.statement['name']} has no finite angles")
    return row


def row_of(solution: Solution, command: str) -> Known:
    """A solution as a row."""
    problem, answer = solution.problem, solution.answer
    if not solution.success or not problem.gait.free:
        raise ProblemError(
            f"{problem.name} is not the certified gait of a class: a row of the table has to be."
        )
    return Known(
        problem.with_(guess=None).to_dict(),
        tuple(answer.x[answer.layout.decisions].tolist()),
        **{name: float(getattr(solution.certificate, name)) for name in _NUMBERS},
        dry=solution.certificate.dry,
        command=command,
        version=version_of("colloc"),
    )


def with_row(rows: Sequence[Known], new: Known) -> tuple[Known, ...]:
    """A table with one more row, in place of the rival that it beats."""
    if why := new.complaint(new.certificate()):
        raise ProblemError(f"{new.statement['name']} is not accepted: {why}.")
    rival = next((row for row in rows if row.question == new.question), None)
    if rival is None:
        return (*rows, new)
    if not new.value - rival.value > new.value_error + rival.value_error + _ROUNDING:
        raise ProblemError(
            f"{new.statement['name']} is not accepted: {rival.value:.8f} +- "
            f"{rival.value_error:.0e} is known already "
            f"({rival.command}), and {new.value:.8f} +- {new.value_error:.0e} is not better."
        )
    return tuple(new if row is rival else row for row in rows)


def save_known(rows: Iterable[Known], table: str | os.PathLike[str]) -> None:
    """Write a table, a row a line; an existing one is replaced only once the new one is
    complete."""
    lines = ",\n".join(json.dumps(asdict(row), sort_keys=True) for row in rows)
    with replaced_file(Path(table)) as temporary:
        Path(temporary).write_text(f"[\n{lines}\n]\n", encoding="utf-8")


def markdown(rows: Iterable[Known]) -> str:
    """The table as people read it."""
    heads = "| problem | what is asked | best known | under dry friction |\n|---|---|---|---|\n"

    def line(row: Known) -> str:
        problem = row.problem
        asked = repr(problem).partition(": ")[2].rpartition(", delta")[0]
        asked = asked.replace("friction (1, 1, 1)", "isotropic")
        asked = asked.replace("symmetry none", "no symmetry").replace("symmetry ", "")
        told = f"{row.value:.6f} ± {row.value_error:.0e}"
        limit = (
            f"{row.value_at_zero_delta:.6f} ± {row.value_error_at_zero_delta:.0e}"
            if problem.law.regularised
            else ""
        )
        limit = (
            limit
            if row.dry is None or problem.objective != EFFICIENCY
            else "{:.6f} to {:.6f}".format(*row.dry)
        )
        return f"| {problem.name} | {asked} | {told} | {limit} |\n"

    return heads + "".join(map(line, rows))
