"""Settings of the HTTP layer: a store, limits, who may ask; all read from `BRDFDB_*`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from brdfdb.errors import ParameterError, sentence_of
from brdfdb.place import path_of
from brdfdb.store.summary_words import REPORT_OF_ALL, REPORT_OF_SOME

LogLevel = Literal["info", "warning", "error"]


def _origins(value: Any) -> Any:
    return tuple(filter(None, map(str.strip, value.split(",")))) if isinstance(value, str) else value


Place = Annotated[Path, BeforeValidator(path_of)]
Positive = Annotated[int, Field(gt=0)]
Origin = Annotated[str, Field(pattern=r"^(\*|https?://[^/]+)$")]


class Settings(BaseSettings):
    """Settings of one application; each has an environment variable of its name, ``BRDFDB_STORE`` and so on."""

    model_config = SettingsConfigDict(env_prefix="BRDFDB_", frozen=True)

    store: Place = Field(default=Path("brdf-store"), description="directory that ``brdfdb build --store`` wrote")
    audit: Place | None = Field(default=None, description="what ``brdfdb audit`` wrote as JSON; None: where it puts it")
    max_points: Positive = Field(default=10_000, description="points in one JSON answer; .npy holds 100 times as many")
    max_body_bytes: Positive = Field(default=64 * 2**20, description="largest body [bytes]: a million points as .npy")
    cache_bytes: Positive = Field(default=256 * 2**20, description="decoded tables that each worker keeps [bytes]")
    cors_origins: Annotated[tuple[Origin, ...], NoDecode, BeforeValidator(_origins)] = Field(
        default=(), description="pages of these origins may ask, ``*`` for all; separated by commas in the environment"
    )
    log_level: LogLevel = Field(
        default="info", description='"info" logs each request, "warning" those refused, "error" those that failed here'
    )
    snapshot: Annotated[str | None, AfterValidator(lambda name: name or None)] = Field(
        default=None, description="name of the snapshot of the store that is served; None: what is current"
    )

    @property
    def audit_files(self) -> tuple[Path, ...]:
        """Paths of the audit reports: the one that was named, or those on all materials and on some in the store."""
        in_store = (self.store / REPORT_OF_ALL, self.store / REPORT_OF_SOME)
        return in_store if self.audit is None else (self.audit,)

    @classmethod
    def from_environment(cls) -> Self:
        """Read the environment; what it does not name keeps its default.

        Raises
        ------
        ParameterError
            If a limit is not a positive whole number, the level of the log none, or an origin none; the sentence names
            the variable.
        """
        try:
            return cls()
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            raise ParameterError(f"BRDFDB_{first['loc'][0]}".upper(), sentence_of(first), first["input"]) from None
