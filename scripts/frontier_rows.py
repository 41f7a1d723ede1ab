"""Rows of the table of `scripts.frontier`: what is asked, what is kept of it, and which of that holds for which row."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import gap
from colloc.mechanics.friction import Friction
from colloc.system.replaced_file import replaced_file

STORE, GAITS = Path("results/curated/frontier.json"), Path("results/frontier")
PROVED = Path("results/curated/guaranteed.json")
"""By `research.guarantee`."""


class Row(NamedTuple):
    """What is asked of a row."""

    mu: tuple[float, ...]
    limit: float
    links: int
    width: float

    @property
    def name(self) -> str:
        return "-".join(f"{x:g}" for x in (*self.mu, round(self.limit, 4), self.links, self.width))

    @property
    def body(self) -> Chain:
        return Chain((1 / self.links,) * self.links, width=self.width)

    @property
    def friction(self) -> Friction:
        mu_t, mu_f, mu_b = self.mu
        return Friction(mu_t=mu_t, mu_f=mu_f, mu_b=mu_b)

    def file(self, part: str) -> Path:
        return GAITS / f"{self.name}-{part}.h5"


def read() -> dict[str, dict[str, Any]]:
    """What is known, by row and part."""
    return json.loads(STORE.read_text()) if STORE.exists() else {}


def put(key: str, value: dict[str, Any]) -> None:
    """Keep a part; what others have kept in the meantime stays."""
    with replaced_file(STORE) as temporary:
        Path(temporary).write_text(json.dumps(read() | {key: value}, indent=1, sort_keys=True) + "\n")


def row_of(key: str) -> tuple[Row, str]:
    """The row and the part that a number is kept under."""
    name, part = key.split()
    *mu, limit, links, width = (float(x) for x in name.split("-"))
    return Row(tuple(mu), limit, int(links), width), part


def room(row: Row, of: dict) -> tuple[float, float]:
    """Of a gait that is kept: its largest joint angle, and how far links stay apart."""
    if "angle" in of:
        return of["angle"], of["apart"]
    return float(np.abs(of["shape"]).max()), float(gap(row.body, np.array(of["shape"])[:, None])[0])


def best_held(row: Row, part: str, known: dict) -> dict:
    """Of the gaits that hold for a row (law, links, limit and width) the best; a certified one if there is."""
    holds = [known.get(f"{row.name} {part}", {})]
    for key, value in known.items():
        other, kind = row_of(key)
        if (kind, other.mu, other.links) == (part, row.mu, row.links):
            angle, apart = room(other, value)
            if angle <= row.limit + 1e-4 and apart >= row.width:
                holds.append(value)
    return max(holds, key=lambda value: (bool(value), value.get("passed", True), value.get("efficiency", -np.inf)))


def smallest_bound(row: Row, known: dict) -> float:
    """Of the bounds that hold for a row: those for its limit or a larger one, its width or a smaller one, and for every body 1
    over the smallest coefficient, which is the least friction on its centre of mass."""
    holds = [1 / min(row.mu)]
    for key, value in known.items():
        other, part = row_of(key)
        of_row = part == "bound" and (other.mu, other.links) == (row.mu, row.links)
        if of_row and other.limit >= round(row.limit, 4) and other.width <= row.width:
            holds.append(value["sampled"])
    return min(holds)


def guaranteed_bound(row: Row) -> float:
    """Of the bounds that are proved for its law and body, and its limit or a larger one, the smallest; inf if there is none."""
    parts: dict[tuple[float, float, int], list[float]] = {}
    for proof in json.loads(PROVED.read_text()):
        of_body = len(proof["lengths"]) == row.links and np.allclose(proof["lengths"], 1 / row.links)
        of_law = proof["law"] == "Friction" and tuple(proof["mu"]) == row.mu
        if of_body and of_law and round(proof["joint_limit"], 4) >= round(row.limit, 4) and not proof["open_cells"]:
            parts.setdefault((proof["joint_limit"], proof["target"], proof["part"][1]), []).append(proof["guaranteed"])
    return min((max(found) for (*_, count), found in parts.items() if len(found) == count), default=np.inf)
