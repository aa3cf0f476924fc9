"""The papers behind the pages: their groups in the gallery, and the page of literature from ``references.bib``."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

from _site.markup import plain, write_page

_BIBLIOGRAPHY = Path(__file__).parents[2] / "references.bib"
_LETTERS = {
    r"{\"u}": "ü",
    r"{\"a}": "ä",
    r"{\c{c}}": "ç",
    r"{\'a}": "á",
    r"{\'e}": "é",
    r"{\'i}": "í",
    r"{\'o}": "ó",
    r"{\v{r}}": "ř",
    r"\&": "&",
    "--": "–",
}


class Paper(NamedTuple):
    """A group of pages: the file name part, and a short and a long name."""

    slug: str
    short: str
    title: str


PAPERS = {
    "ward1992": Paper("ward", "Ward 1992", "Measured, anisotropic surfaces"),
    "orennayar1994": Paper("oren-nayar", "Oren and Nayar 1994", "Rough diffuse surfaces"),
    "he1991": Paper("he-torrance", "He, Torrance, Sillion and Greenberg 1991", "Physical optics"),
    "walter2007": Paper("microfacets", "Walter et al. 2007", "Microfacets, with later shadowing and energy"),
    "": Paper("others", "Other models", "Lambert, Minnaert, and surfaces seen from satellites"),
}


def paper_of(key: str) -> Paper:
    """Return the group of a key of the bibliography."""
    return PAPERS.get(key, PAPERS[""])


def cited(key: str) -> str:
    """Return a link to an entry of the page of literature."""
    entry = bibliography()[key]
    first, *others = [person.split(", ")[0] for person in entry["author"].split(" and ")]
    names = first if not others else f"{first} and {others[0]}" if len(others) == 1 else f"{first} et al."
    return f"[{plain(names)} {entry['year']}](#bib-{key})"


def reference(key: str) -> str:
    """Return an entry as a line of MyST, with a link where it has one."""
    entry = bibliography()[key]
    venue = next((entry[field] for field in ("journal", "booktitle", "publisher", "institution") if field in entry), "")
    number = f"({entry['number']})" if "number" in entry else ""
    places = [venue, entry.get("volume", "") + number, f"pages {entry['pages']}" if "pages" in entry else ""]
    link = f"https://doi.org/{entry['doi']}" if "doi" in entry else entry.get("url", "")
    parts = [_names(entry), entry["year"], entry["title"], ", ".join(place for place in places if place)]
    return ". ".join(plain(part) for part in parts if part) + "." + (f" <{link}>" if link else "")


@cache
def bibliography() -> dict[str, dict[str, str]]:
    """Return the fields of every entry of ``references.bib``, whose fields stand on a line each."""
    text = _BIBLIOGRAPHY.read_text(encoding="utf-8")
    for written, letter in _LETTERS.items():
        text = text.replace(written, letter)
    entries = re.findall(r"^@\w+\{(\w+),\n(.*?)^\}", text, flags=re.MULTILINE | re.DOTALL)
    fields = {key: re.findall(r"^\s+(\w+)\s*= \{(.*)\},$", body, flags=re.MULTILINE) for key, body in entries}
    return {key: {name: re.sub(r"[{}]", "", value) for name, value in found} for key, found in fields.items()}


def _names(entry: dict[str, str]) -> str:
    """Return the authors, given names last names."""
    people = [" ".join(reversed(person.split(", "))) for person in entry["author"].split(" and ")]
    return f"{', '.join(people[:-1])} and {people[-1]}" if len(people) > 1 else people[0]


def write(docs: Path, _: Path) -> None:
    """Write ``reference/generated/literature.md``."""
    lines = [
        "# Literature\n",
        "The papers behind the models, the materials and the figures, by their keys in the code.\n",
    ]
    for key in sorted(bibliography(), key=lambda key: (bibliography()[key]["year"], key)):
        lines += [f"(bib-{key})=", f"`{key}`\n: {reference(key)}\n"]
    write_page(docs / "reference" / "generated" / "literature.md", "\n".join(lines))
