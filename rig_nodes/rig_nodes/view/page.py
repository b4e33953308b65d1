# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Self-contained HTML pages of words, tables and figures, light or dark as the reader's screen; they print on A4.

view.page_of_report makes one; the markup is in templates/page.html.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import MAKER
from .palette import DARK, LIGHT, variables

if TYPE_CHECKING:
    from jinja2 import Template

    from .figure import Description

Cell = str | tuple[str, str]  # the text of a cell, or its text and its class; what follows a line break is written small


@dataclass(frozen=True)
class Part:
    """A part of a page.

    Attributes
    ----------
    kind : str
        ``words``, ``lines``, ``table`` or ``figure``; the functions below make one.
    text, css : str
        Its text and its class.
    head, rows
        Of a table: headings, and rows of (text, class).
    wide, stacked : str
        Of a figure: its SVG for a wide window and for a phone.
    """

    kind: str
    text: str = ""
    css: str = ""
    head: Sequence[str] = ()
    rows: Sequence[Sequence[tuple[str, str]]] = ()
    wide: str = ""
    stacked: str = ""


def page(title: str, sections: Iterable[tuple[str, Iterable[Part]]]) -> str:
    """Return a page of HTML; a section, (heading, parts), without parts is left out."""
    kept = [(heading, found) for heading, parts in sections if (found := list(parts))]
    return _template().render(maker=MAKER, title=title, sections=kept, light=variables(LIGHT), dark=variables(DARK))


@cache
def _template() -> Template:
    from jinja2 import Environment, FileSystemLoader

    return Environment(loader=FileSystemLoader(Path(__file__).parent / "templates"), autoescape=True).get_template("page.html")


def words(texts: Iterable[str], css: str = "") -> list[Part]:
    """Return a paragraph for each text that is not empty."""
    return [Part("words", text, css) for text in texts if text]


def lines(texts: Sequence[str]) -> list[Part]:
    """Return lines whose columns stay below each other."""
    return [Part("lines", "\n".join(texts))] if texts else []


def table(head: Sequence[str], rows: Iterable[Sequence[Cell]], css: str = "") -> list[Part]:
    """Return a table, ``css`` "text" for one of words, "text cards" for long ones; nothing without rows."""
    found = [[(one, "") if isinstance(one, str) else one for one in row] for row in rows]
    return [Part("table", css=css, head=head, rows=found)] if found else []


def figures(descriptions: Sequence[Description], name: str, count: int = 0) -> list[Part]:
    """Return figures as :func:`view.draw.draw_figure` draws them under a name of their own, with a note where ``count`` is more."""
    from .draw import PHONE, inline

    note = f"Figures of the first {len(descriptions)} of {count} {name}s." if count > len(descriptions) else ""
    drawn = [
        Part("figure", one.title, wide=inline(one, f"{name}{n}"), stacked=inline(one, f"{name}{n}p", PHONE))
        for n, one in enumerate(descriptions)
    ]
    return drawn + words([note], "note")
