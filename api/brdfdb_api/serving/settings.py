"""Settings of the HTTP layer: a store, limits, who may ask; all read from `BRDFDB_*`."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Self, cast, get_args

from brdfdb.errors import ParameterError

LogLevel = Literal["info", "warning", "error"]


@dataclass(frozen=True)
class Settings:
    """Settings of one application; each has an environment variable of its name, ``BRDFDB_STORE`` and so on.

    Attributes
    ----------
    store : Path
        Directory that ``brdfdb build --store`` wrote.
    audit : Path or None
        What ``brdfdb audit`` wrote as JSON; by default ``audit.json`` in the store, where that command puts it.
    max_points : int
        Points in one JSON answer, at least 1; a .npy answer may hold 100 times as many.
    max_body_bytes : int
        Largest request body [bytes], at least 1. The default takes a million points as .npy.
    cache_bytes : int
        How much of decoded tables each worker keeps [bytes], at least 1.
    cors_origins : tuple of str
        Web pages of these origins may ask (CORS): ``https://example.org``, or ``*`` for all. By default none but our
        own. Separated by commas in the environment.
    log_level : str
        "info" logs each request as a line of JSON, "warning" those that were refused, "error" those that failed here.
    snapshot : str or None
        Name of the snapshot of the store that is served; by default what is current.
    """

    store: Path = Path("brdf-store")
    audit: Path | None = None
    max_points: int = 10_000
    max_body_bytes: int = 64 * 2**20
    cache_bytes: int = 256 * 2**20
    cors_origins: tuple[str, ...] = ()
    log_level: LogLevel = "info"
    snapshot: str | None = None

    @property
    def audit_file(self) -> Path:
        """Path of the audit report."""
        return self.store / "audit.json" if self.audit is None else self.audit

    @classmethod
    def from_environment(cls, environ: Mapping[str, str] = os.environ) -> Self:
        """Read `environ`; what it does not name keeps its default.

        Raises
        ------
        ValueError
            If a limit is not a positive whole number, the level of the log none, or an origin none; the sentence names
            the variable.
        """
        level = environ.get("BRDFDB_LOG_LEVEL", cls.log_level)
        if level not in get_args(LogLevel):
            raise ParameterError(
                "BRDFDB_LOG_LEVEL",
                f"{level!r} is not one of {', '.join(get_args(LogLevel))}",
                level,
                get_args(LogLevel),
            )
        origins = [origin.strip() for origin in environ.get("BRDFDB_CORS_ORIGINS", "").split(",")]
        for origin in origins:
            if origin not in ("", "*") and not re.fullmatch("https?://[^/]+", origin):
                raise ParameterError(
                    "BRDFDB_CORS_ORIGINS", f"{origin!r} is neither * nor an origin such as https://example.org", origin
                )
        return cls(
            store=Path(environ.get("BRDFDB_STORE", cls.store)),
            audit=Path(environ["BRDFDB_AUDIT"]) if "BRDFDB_AUDIT" in environ else None,
            max_points=_positive(environ, "BRDFDB_MAX_POINTS", cls.max_points),
            max_body_bytes=_positive(environ, "BRDFDB_MAX_BODY_BYTES", cls.max_body_bytes),
            cache_bytes=_positive(environ, "BRDFDB_CACHE_BYTES", cls.cache_bytes),
            cors_origins=tuple(origin for origin in origins if origin),
            log_level=cast(LogLevel, level),
            snapshot=environ.get("BRDFDB_SNAPSHOT") or None,
        )


def _positive(environ: Mapping[str, str], variable: str, default: int) -> int:
    text = environ.get(variable, str(default))
    if not (text.isascii() and text.isdecimal() and int(text) > 0):
        raise ParameterError(variable, f"{text!r} is not a positive whole number", text)
    return int(text)
