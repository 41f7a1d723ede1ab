"""Pictures, pages and files about a result; texts are templates in `assets`."""

from typing import Any

import numpy as np


def render(template: str, /, **values: Any) -> str:
    """Text of a template in `assets`; its filter ``g`` writes numbers to so many digits."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # which figures do not need

    templates = Environment(
        loader=PackageLoader("colloc.pictures", "assets"), autoescape=True,
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    templates.policies["json.dumps_kwargs"] = {"separators": (",", ":")}
    templates.filters["g"] = lambda value, digits=9: " ".join(
        f"{x:.{digits}g}" for x in np.ravel(value)
    )
    return templates.get_template(template).render(**values)
