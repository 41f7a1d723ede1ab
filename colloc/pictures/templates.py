"""Templates in `assets`."""

from __future__ import annotations

from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined


def environment() -> Environment:
    """Environment with autoescape; the filter ``g`` writes numbers to nine digits."""
    templates = Environment(
        loader=PackageLoader("colloc.pictures", "assets"), autoescape=True,
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    templates.policies["json.dumps_kwargs"] = {"separators": (",", ":")}
    templates.filters["g"] = lambda value: " ".join(f"{x:.9g}" for x in np.ravel(value))
    return templates


def render(template: str, /, **values: Any) -> str:
    return environment().get_template(template).render(**values)
