"""The HTTP layer of brdfdb: ``uvicorn --factory brdfdb_api:create_app``, or ``brdfdb serve``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from brdfdb_api.http.app import create_app

__all__ = ["create_app"]


def __getattr__(name: str) -> Any:
    if name == "create_app":
        from brdfdb_api.http.app import create_app

        return create_app
    raise AttributeError(f"module 'brdfdb_api' has no attribute {name!r}")
