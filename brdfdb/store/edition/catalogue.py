"""The catalogue of an edition: a table in Parquet, a row a material, with what lists show and where its bytes lie."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Mapping
from typing import Any

from brdfdb.errors import import_extra
from brdfdb.store.edition.groups import EditionGroup
from brdfdb.store.edition.records import RevisionFiles, sha256
from brdfdb.tables.metadata import TableMetadata

# Columns by name: type of Arrow
COLUMNS = {
    "name": "string",
    "title": "string",
    "model": "string",
    "model_version": "int64",
    "paper": "string",
    "source": "string",
    "measured": "bool_",
    "anisotropic": "bool_",
    "first_wavelength_nm": "float64",
    "last_wavelength_nm": "float64",
    "parameters": "string",
    "error_p99": "float64",
    "formula_error_p99": "float64",
    "largest_albedo": "float64",
    "revision": "string",
    "created": "string",
    "bytes": "int64",
    "manifest_sha256": "string",
    "request_sha256": "string",
    "group": "string",
    "place": "int64",
    "values_sha256": "string",
}


def rows_of(group: EditionGroup) -> list[dict[str, Any]]:
    """Return the rows of the members of a group."""
    digest = group.digest
    return [{**_row(member), "group": digest, "place": place} for place, member in enumerate(group.members)]


def _row(member: RevisionFiles) -> dict[str, Any]:
    metadata = TableMetadata.read(member.metadata["attributes"])
    summary: Mapping[str, Any] = member.manifest["summary"]
    formula = summary.get("formula_error") or {}
    albedo = summary.get("largest_albedo") or {}
    spectrum = metadata.wavelength_range_nm or (None, None)
    main = [entry["sha256"] for key, entry in member.manifest["files"].items() if key.startswith(("brdf/c", "parts/c"))]
    return {
        "name": member.name,
        "title": summary["title"],
        "model": summary["model"],
        "model_version": summary["model_version"],
        "paper": metadata.model_reference or "",
        "source": metadata.source or "",
        "measured": metadata.measured is not None,
        "anisotropic": metadata.anisotropic,
        "first_wavelength_nm": spectrum[0],
        "last_wavelength_nm": spectrum[-1],
        "parameters": json.dumps(member.metadata["attributes"].get("parameters", {})),
        "error_p99": summary["error_p99"],
        "formula_error_p99": formula.get("p99"),
        "largest_albedo": albedo.get("albedo"),
        "revision": member.manifest["revision"],
        "created": summary["created"],
        "bytes": summary["bytes"],
        "manifest_sha256": member.digest,
        "request_sha256": summary["request_sha256"],
        "values_sha256": main[0] if len(main) == 1 else sha256("".join(main).encode()),
    }


def encoded_rows(rows: Iterable[Mapping[str, Any]]) -> bytes:
    """Return rows as a file of Parquet; MissingExtraError without pyarrow."""
    arrow: Any = import_extra("pyarrow")
    parquet: Any = import_extra("pyarrow.parquet")
    schema = arrow.schema([(name, getattr(arrow, kind)()) for name, kind in COLUMNS.items()])
    buffer = io.BytesIO()
    parquet.write_table(arrow.Table.from_pylist(list(rows), schema=schema), buffer, compression="zstd")
    return buffer.getvalue()


def merged(parts: Iterable[bytes]) -> bytes:
    """Return files of Parquet as a single one, a row group a part: memory holds one part at a time."""
    arrow: Any = import_extra("pyarrow")
    parquet: Any = import_extra("pyarrow.parquet")
    schema = arrow.schema([(name, getattr(arrow, kind)()) for name, kind in COLUMNS.items()])
    buffer = io.BytesIO()
    with parquet.ParquetWriter(buffer, schema, compression="zstd") as writer:
        for part in parts:
            writer.write_table(parquet.read_table(io.BytesIO(part)))
    return buffer.getvalue()
