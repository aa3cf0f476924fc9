"""What the operator of the HTTP layer can set: a store, and two limits, all read from `BRDFDB_*`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self


@dataclass(frozen=True)
class Settings:
    """Settings of one application; each has an environment variable of its name, ``BRDFDB_STORE`` and so on.

    Attributes
    ----------
    store : Path
        Directory that ``brdfdb build --store`` wrote.
    max_points : int
        Points in one JSON answer, at least 1; a .npy answer may hold 100 times as many.
    max_body_bytes : int
        Largest request body [bytes], at least 1. The default takes four lists of a million angles with two decimals.
    """

    store: Path = Path("brdf-store")
    max_points: int = 10_000
    max_body_bytes: int = 32 * 2**20

    @classmethod
    def from_environment(cls, environ: Mapping[str, str] = os.environ) -> Self:
        """Read `environ`; what it does not name keeps its default.

        Raises
        ------
        ValueError
            If a limit is not a positive whole number; the sentence names the variable.
        """
        return cls(
            store=Path(environ.get("BRDFDB_STORE", cls.store)),
            max_points=_positive(environ, "BRDFDB_MAX_POINTS", cls.max_points),
            max_body_bytes=_positive(environ, "BRDFDB_MAX_BODY_BYTES", cls.max_body_bytes),
        )


def _positive(environ: Mapping[str, str], variable: str, default: int) -> int:
    text = environ.get(variable, str(default))
    if not (text.isascii() and text.isdecimal() and int(text) > 0):
        raise ValueError(f"{variable}: {text!r} is not a positive whole number")
    return int(text)
