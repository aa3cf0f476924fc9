"""Places as users name them: a path, the address of a file, or that of a service."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TypeGuard
from urllib.parse import urlsplit
from urllib.request import url2pathname

from brdfdb.errors import ParameterError

_SCHEME = re.compile(r"\s*([A-Za-z][A-Za-z0-9+.-]+):(?=[/:])")  # two letters or more: C:/ is a drive
_SERVICES = ("http", "https")
_BUCKETS = ("s3", "gs", "az")


def is_service(place: object) -> TypeGuard[str]:
    """Return True if a place is the address of a service, such as ``http://127.0.0.1:8000``."""
    return isinstance(place, str) and _scheme(place) in _SERVICES


def is_bucket(place: object) -> TypeGuard[str]:
    """Return True if a place is the address of objects in a bucket, such as ``s3://bucket/prefix``."""
    return isinstance(place, str) and _scheme(place) in _BUCKETS


def path_of(place: str | os.PathLike[str], parameter: str = "path") -> Path:
    """Return the path that a place is.

    Parameters
    ----------
    place : path or text
        A path, or the address of a file such as ``file:///data/store``, whose %20 is a space. ``~/`` is the home
        directory. Text that begins with another scheme, such as ``s3://``, is no path; ``./s3:/`` is a directory.
    parameter : str
        Name of the argument, for the error.

    Raises
    ------
    ParameterError
        If it is empty, the address of a service, of a file of another machine, or has a scheme that is not ``file``.
    """
    text = os.fspath(place)
    scheme = _scheme(text)
    if not text or "\0" in text:
        raise ParameterError(parameter, f"{text!r} is not a path", place)
    if scheme == "file" and isinstance(place, str):
        try:
            parts = urlsplit(place.strip())
        except ValueError as error:
            raise ParameterError(parameter, f"{place!r} is not an address: {error}", place) from None
        if parts.netloc not in ("", "localhost") or not parts.path.startswith("/"):
            raise ParameterError(parameter, f"{place!r} is not an address such as file:///data/store", place)
        if parts.query or parts.fragment or "%00" in parts.path:
            sentence = f"{place!r} has a query, a fragment or %00, which no path has; write %3F for ? and %23 for #"
            raise ParameterError(parameter, sentence, place)
        return Path(url2pathname(parts.path))
    if scheme in _SERVICES:
        sentence = f"{text!r} is the address of a service, which brdfdb.open reads; a path is needed here"
        raise ParameterError(parameter, sentence, place)
    if scheme:
        sentence = f"{text!r} is neither a path nor an address file:///...; a directory of this name is './{text}'"
        raise ParameterError(parameter, sentence, place)
    path = Path(text).expanduser() if text.startswith(("~/", "~\\")) else Path(text)
    return path.absolute() if _scheme(str(path)) else path  # ./s3:/a, which Path writes s3:/a


def tables_place(place: str | os.PathLike[str], parameter: str = "store") -> Path | str:
    """Return the path of a store or of an edition, or an address ``https://``, ``s3://``, ``gs://`` or ``az://``."""
    return place if is_service(place) or is_bucket(place) else path_of(place, parameter)


def _scheme(text: str) -> str:
    """Return the scheme that a text begins with, in lower case; empty without one."""
    match = _SCHEME.match(text)
    return match[1].lower() if match else ""
