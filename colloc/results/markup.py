"""HTML and SVG as nested elements: every text and attribute is escaped unless it is itself markup made here."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

VOID = {"meta", "br", "hr", "input", "img", "link"}
"""Elements without an end tag."""


class Markup(str):
    """Text that is markup already, and is not escaped again."""

    __slots__ = ()


def text(value: object) -> Markup:
    """A value as markup: escaped, unless it is markup; None is nothing, lists are joined."""
    if value is None:
        return Markup("")
    if isinstance(value, Markup):
        return value
    if isinstance(value, (list, tuple)):
        return Markup("".join(text(part) for part in value))
    return Markup(escape(str(value), quote=True))


def element(tag: str, *children: object, **attributes: object) -> Markup:
    """``<tag attributes>children</tag>``.

    Parameters
    ----------
    tag : str
    children : str, number, Markup, list of these, or None
        Text is escaped, None left out.
    attributes : str, number, True or None
        ``class_`` stands for class, other underscores for hyphens; None is left out, True is a bare attribute.
    """
    parts = [f"<{tag}"]
    for name, value in attributes.items():
        name = name.rstrip("_").replace("_", "-")
        if value is not None and value is not False:
            parts.append(f' {name}="{escape(name if value is True else str(value), quote=True)}"')
    if tag in VOID:
        return Markup("".join([*parts, " />"]))
    return Markup("".join([*parts, ">", *(text(child) for child in children), f"</{tag}>"]))


def table(rows: Sequence[Sequence[object]], header: Sequence[object] = ()) -> Markup:
    """A table; the first cell of a row heads it."""
    body = [
        element("tr", element("th", row[0], scope="row"), [cell if _is_cell(cell) else element("td", cell) for cell in row[1:]])
        for row in rows
    ]
    head = element("thead", element("tr", [element("th", name, scope="col") for name in header])) if header else None
    return element("table", head, element("tbody", body))


def _is_cell(value: object) -> bool:
    return isinstance(value, Markup) and value.startswith("<td")
