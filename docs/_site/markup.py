"""Generated pages and their parts: text for MyST, raw HTML, tables and grids of cards."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from brdfdb.audit.finding import LEVELS, Word

# Begins a page without a list of its sections: plots need the room
WIDE = "---\nhtml_theme.sidebar_secondary.remove: true\n---\n"


class Card(NamedTuple):
    """A card of an index: the page it opens, and what it shows. `picture` is HTML."""

    target: str
    title: str
    text: str
    picture: str = ""


def write_page(path: Path, text: str) -> None:
    """Write a page; a file with the same text is not written, so that Sphinx does not read it again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def remove_others(folder: Path, names: set[str]) -> None:
    """Remove the files of a folder whose names are not among `names`."""
    for path in folder.iterdir():
        if path.is_file() and path.name not in names:
            path.unlink()


def plain(text: object) -> str:
    """Return a text that MyST shows letter by letter, in one line."""
    return re.sub(r"([!-/:-@\[-`{-~])", r"\\\1", " ".join(str(text).split()))


def raw(text: str) -> str:
    """Return HTML as part of a page."""
    fence = "`" * 3
    return f"{fence}{{raw}} html\n{text}\n{fence}\n"


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table. Cells are MyST; bars in them are escaped here."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join("| " + " | ".join(_cell(cell) for cell in line) + " |" for line in lines) + "\n"


def _cell(text: str) -> str:
    return re.sub(r"(?<!\\)\|", r"\\|", " ".join(text.split()))


def code(text: str, language: str = "") -> str:
    """Return a block of code."""
    fence = "`" * 4
    return f"{fence}{language}\n{text.rstrip()}\n{fence}\n"


def toctree(pages: Iterable[str], options: str = ":hidden:") -> str:
    """Return the pages below a page."""
    fence = "`" * 3
    listed = "\n".join(pages)
    return f"{fence}{{toctree}}\n{options}\n\n{listed}\n{fence}\n"


def cards(shown: Iterable[Card]) -> str:
    """Return a grid of cards. Pictures are decoration: the title describes them."""
    parts = []
    for card in shown:
        picture = f'<span class="picture" aria-hidden="true">{card.picture}</span>' if card.picture else ""
        text = f"<span>{html.escape(card.text)}</span>" if card.text else ""
        parts.append(f'<a class="card" href="{card.target}">{picture}<b>{html.escape(card.title)}</b>{text}</a>')
    return raw('<div class="cards">\n' + "\n".join(parts) + "\n</div>")


def chip(word: Word, text: str = "") -> str:
    """Return a verdict, or a text in its place, as HTML in the colours of the audit's page."""
    return f'<span class="chip {LEVELS[word]}">{html.escape(text or word)}</span>'
