"""The statements of ``pyproject.toml`` on this distribution, with marks where its owner has yet to state something."""

from __future__ import annotations

import importlib.metadata
from email.utils import getaddresses
from typing import NamedTuple

UNSTATED = "to be stated by the owner"  # marks a place for the owner in files that the program writes
NO_LICENCE = f"{UNSTATED}; until then all rights are reserved"


class Distribution(NamedTuple):
    """Metadata of the distribution."""

    version: str
    summary: str
    keywords: tuple[str, ...]
    authors: tuple[str, ...]  # UNSTATED alone where the owner has not stated them
    licence: str  # an SPDX expression; empty where the owner has not stated it
    address: str  # of the project on the web; empty where the owner has not stated it


def distribution() -> Distribution:
    """Return the metadata of the distribution that is installed."""
    known = importlib.metadata.metadata("brdfdb")

    def texts(key: str) -> list[str]:
        return known.get_all(key) or []

    authors = tuple(name or address for name, address in getaddresses([*texts("Author"), *texts("Author-email")]))
    addresses = [text.partition(", ")[2] for text in texts("Project-URL")]
    return Distribution(
        known["Version"],
        known["Summary"],
        tuple(sorted(known["Keywords"].split(","))),
        authors or (UNSTATED,),
        "".join(texts("License-Expression")),
        "".join(addresses[:1]),
    )
