"""Settings of the HTTP layer from the environment variables `BRDFDB_*`: the store, limits, origins and the log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from brdfdb.errors import ParameterError, sentence_of
from brdfdb.place import path_of, tables_place
from brdfdb.store.summary_words import REPORT_OF_ALL, REPORT_OF_SOME

LogLevel = Literal["info", "warning", "error"]


def _separated(value: Any) -> Any:
    return tuple(filter(None, map(str.strip, value.split(",")))) if isinstance(value, str) else value


Place = Annotated[Path, BeforeValidator(path_of)]
TablesPlace = Annotated[Path | str, BeforeValidator(tables_place)]
Positive = Annotated[int, Field(gt=0)]
Origin = Annotated[str, Field(pattern=r"^(\*|https?://[^/]+)$")]


class Settings(BaseSettings):
    """Settings of an application; each has an environment variable, such as ``BRDFDB_STORE``."""

    model_config = SettingsConfigDict(env_prefix="BRDFDB_", frozen=True)

    store: TablesPlace = Field(
        default=Path("brdf-store"),
        description="directory that ``brdfdb build --store`` or ``brdfdb publish`` wrote, or the address of an edition",
    )
    audit: Place | None = Field(default=None, description="file that ``brdfdb audit`` wrote; None: that in the store")
    max_points: Positive = Field(
        default=10_000, description="points in one JSON answer; .npy may have 100 times as many"
    )
    max_body_bytes: Positive = Field(default=64 * 2**20, description="largest body [bytes]: a million points as .npy")
    cache_bytes: Positive = Field(default=256 * 2**20, description="memory of each worker for decoded tables [bytes]")
    cors_origins: Annotated[tuple[Origin, ...], NoDecode, BeforeValidator(_separated)] = Field(
        default=(), description="origins whose pages may send requests, separated by commas; ``*``: all"
    )
    log_level: LogLevel = Field(
        default="info", description='"info" logs all requests, "warning" refused and failed ones, "error" failed ones'
    )
    snapshot: Annotated[str | None, AfterValidator(lambda name: name or None)] = Field(
        default=None, description="name of the snapshot to serve; None: the current revisions"
    )

    @property
    def audit_files(self) -> tuple[Path, ...]:
        """Paths of the audit reports: the given one, or those in the store on all and on some materials."""
        if self.audit is not None:
            return (self.audit,)
        return () if isinstance(self.store, str) else (self.store / REPORT_OF_ALL, self.store / REPORT_OF_SOME)

    @classmethod
    def from_environment(cls) -> Self:
        """Return the settings of the environment.

        Raises
        ------
        ParameterError
            If a variable has a value that is not allowed; the sentence names the variable.
        """
        try:
            return cls()
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            raise ParameterError(f"BRDFDB_{first['loc'][0]}".upper(), sentence_of(first), first["input"]) from None
