"""Sealed JSON: small files whose first line is the digest of the other lines."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from brdfdb.errors import (
    StoreError,
)
from brdfdb.store.files import regular_bytes, sync_directory, write_file

_SEAL = re.compile(rb'\{"sha256": "([0-9a-f]{64})",\n')


def sealed(content: Mapping[str, Any]) -> bytes:
    """Return a JSON object as bytes whose first line holds the sha256 of all lines below it.

    ``tail -n +2 FILE | sha256sum`` prints the digest that the first line must hold.
    """
    body = json.dumps(content, indent=1).encode()[2:]
    return b'{"sha256": "%s",\n' % hashlib.sha256(body).hexdigest().encode() + body


def unsealed(data: bytes, where: str, file: str) -> dict[str, Any]:
    """Return the content of a sealed JSON object.

    Parameters
    ----------
    data : bytes
        The file, as `sealed` made it.
    where, file : str
        The material, family or snapshot and the name of the file, for the sentence of an error.

    Raises
    ------
    StoreError
        If any byte of it changed.
    """
    seal = _SEAL.match(data)
    if seal is None:
        raise StoreError(f"{where} is damaged: the first line of {file} is not its digest")
    body = data[seal.end() :]
    if hashlib.sha256(body).hexdigest().encode() != seal[1]:
        raise StoreError(f"{where} is damaged: the content of {file} changed")
    try:
        return cast(dict[str, Any], json.loads(b"{" + body))
    except ValueError as error:
        raise StoreError(f"{where} is damaged: {file} is not JSON: {error}") from error


def bytes_of(path: Path, where: str) -> bytes:
    """Return the content of a file of the store; StoreError, which names `where`, if it cannot be read."""
    try:
        return regular_bytes(path)
    except FileNotFoundError:
        raise StoreError(f"{where} is damaged: {path.name} is missing") from None
    except OSError as error:
        raise StoreError(f"{where} is damaged: {path.name} cannot be read: {error.strerror}") from error


def seal_of(path: Path) -> str:
    """Return the digest in the first line of a sealed file; empty if it has none."""
    seal = _SEAL.match(bytes_of(path, path.name))
    return "" if seal is None else seal[1].decode()


def read_sealed(path: Path, where: str) -> dict[str, Any]:
    """Return the content of a sealed file; errors as by `unsealed`, also if it cannot be read."""
    return unsealed(bytes_of(path, where), where, path.name)


def check_fields(content: Any, fields: Mapping[str, Any], where: str, file: str) -> None:
    """Raise StoreError unless `content` has all fields, each of its type."""
    for key, kind in fields.items():
        if not (isinstance(content, dict) and isinstance(content.get(key, ...), kind)):
            raise StoreError(f"{where} is damaged: {file} has no valid {key!r}")


def json_object(path: Path, data: bytes) -> dict[str, Any]:
    """Return the JSON object that a file holds; StoreError, naming the file, if it holds anything else."""
    try:
        content = json.loads(data)
    except ValueError as error:
        raise StoreError(f"cannot read {path}: {error}") from error
    if not isinstance(content, dict):
        raise StoreError(f"cannot read {path}: not a JSON object")
    return content


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object; StoreError, naming the file, if it cannot be read or is none."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise StoreError(f"cannot read {path}: {error.strerror or error}") from error
    return json_object(path, data)


def write_json(path: Path, content: Mapping[str, Any], temporary: Path | None = None, *, sync: bool = True) -> str:
    """Write a JSON file as `write_file` does, by default by way of its own directory; return its sha256."""
    return write_file(path, json.dumps(content, indent=1).encode(), temporary or path.parent, sync=sync)["sha256"]


def write_sealed(path: Path, content: Mapping[str, Any], temporary: Path | None = None) -> str:
    """Write a sealed JSON file as `write_file` does; return the sha256 of the whole file."""
    return write_file(path, sealed(content), temporary or path.parent)["sha256"]


def swap_sealed(path: Path, content: Mapping[str, Any]) -> None:
    """Write a sealed JSON file so that a reader sees the old content or the new, whatever happens in between."""
    write_sealed(path, content)
    sync_directory(path.parent)
