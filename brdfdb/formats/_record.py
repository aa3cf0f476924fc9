"""The record that goes with an exported table: what it is, where it comes from, and how far it can be trusted."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brdfdb.distribution import NO_LICENCE, distribution

if TYPE_CHECKING:
    from brdfdb.formats._stated_error import FileError
    from brdfdb.measurements.instrument import Instrument
    from brdfdb.tables.table import Table

NOT_STATED = "not stated"
_LITERAL = re.compile(r'"(?:[^"\\]|\\.)*"')  # a string in JSON
_FORMULA = re.compile(r'(?<=[,;"])(\s*)([=+@-])')  # where a spreadsheet may cut, and the sign
CONVENTION = "f_r [1/sr], the BRDF without the cosine; unit vectors of light and viewer point away from the surface"
U_AXIS = "that along which the texture coordinate u grows, dp/du; a mesh needs texture coordinates"
_MEASURED = "refractive index and extinction: refractiveindex.info, CC0 1.0"
_LARGEST = 1 << 20  # byte of a record


def record(
    table: Table,
    error: FileError | None,
    verdict: str | None,
    *,
    holds: str = CONVENTION,
    remarks: tuple[str, ...] = (),
    tolerance: float | None = None,
) -> dict[str, Any]:
    """Return the record of an exported table as JSON: the same keys in every format.

    `error` is that of the file against the table, None if the file holds values of the table as they are. `holds` says
    quantity, unit and cosine convention of the numbers in the file, and `remarks` what the format cannot hold of this
    table. `tolerance` is the largest p99 that was asked for.
    """
    from brdfdb.formats._stated_error import of_table

    known = table.metadata
    statement = of_table(table) if error is None else error.statement
    document = known.model_dump(mode="json", include={"model", "model_version", "parameters", "refractive_index"})
    origin = known.source or "a source that is not stated"
    licence = f"measured: {origin}" if known.measured else f"computed from parameters published in {origin}"
    return {
        "name": table.name,
        "title": known.title or "",
        **document,
        "source": known.source or "",
        "measured": None if known.measured is None else known.measured.model_dump(mode="json", exclude={"extent"}),
        "note": known.note,
        "revision": table.revision,
        "digest": table.digest,
        "audit": verdict or NOT_STATED,
        "holds": holds,
        "error_of_file": None if error is None else {"against": "the table", **error.document()},
        "tolerance": tolerance,
        "error": None if statement is None else statement.model_dump(mode="json"),
        "remarks": [*remarks, *extrapolated_remark(table), *glint_remark(table)],
        "licence": f"{licence}; {_MEASURED}" if known.refractive_index else licence,
        "program": f"brdfdb {version('brdfdb')}",
    }


def specular_remark(table: Table) -> tuple[str, ...]:
    """Return a sentence on the specular part of a table for a file that has no place for it; none if it has none."""
    if table.specular is None or not table.specular.any():
        return ()
    share = f"up to {table.specular.max():.4g} of the light"
    return (f"not in the file: the specular part, {share} in the exact mirror direction",)


def history_of(document: Mapping[str, Any]) -> str:
    """Return the history of a file with a record, which netCDF files have by the CF conventions."""
    return f"{document['program']}: exported from revision {document['revision']}"


def discovery(document: Mapping[str, Any]) -> dict[str, str]:
    """Return the attributes that ACDD, the conventions for the discovery of data, adds to a record and to those of CF.

    What the record does not have is left out: a table that no store holds has no digest. ACDD also lists attributes for
    places on Earth and for times, which no table has.
    """
    from brdfdb.tables.xarray_view import CF_VERSION

    stated = distribution()
    creator = ", ".join(stated.authors)
    title = document["title"] or document["name"]
    found = {
        "Conventions": f"{CF_VERSION}, ACDD-1.3",
        "title": title,
        "summary": f"BRDF of the material {document['name']} ({title}) over directions of light and viewer",
        "keywords": ", ".join(stated.keywords),
        "id": document["digest"] or "",
        "naming_authority": "SHA-256 of the manifest of the revision" if document["digest"] else "",
        "comment": "; ".join([document["holds"], *document["remarks"]]),
        "processing_level": "measured" if document["measured"] else "computed from a model",
        "standard_name_vocabulary": "CF Standard Name Table",
        "license": stated.licence or NO_LICENCE,
        "project": "brdfdb",
        "product_version": document["revision"] or "",
        "creator_name": creator,
        "creator_url": stated.address,
        "publisher_name": creator,
        "publisher_url": stated.address,
    }
    return {key: value for key, value in found.items() if value}


def frame_remark(table: Table, x_axis: str) -> tuple[str, ...]:
    """Return a sentence on the x axis that programs give an anisotropic table; none for an isotropic table."""
    return (f"anisotropic: the x axis of the table is {x_axis}",) if table.anisotropic else ()


def extrapolated_remark(table: Table) -> tuple[str, ...]:
    """Return a sentence on the directions of a measured table that were not measured; none if all were."""
    known = table.metadata.measured
    if known is None or not known.extrapolated:
        return ()
    share = f"{100.0 * known.extrapolated:.3g} % of all pairs of directions"
    return (f"{share} were not measured: f_r is extrapolated there, and its error is not known",)


def glint_remark(table: Table) -> tuple[str, ...]:
    """Return a sentence on the glints of a table that an export leaves out; none if there are none.

    The record of a file lists them under measured, so that its reader can add them.
    """
    measured = table.metadata.measured
    return () if measured is None or measured.glints is None else (measured.glints.left_out("the values of the file"),)


def lines(document: dict[str, Any]) -> list[str]:
    """Return a record as printable lines of text, "key: value", which `of_lines` reads back exactly.

    Values are JSON; strings stand as they are if they are read back so. A spreadsheet cuts such lines into cells: signs
    with which formulas begin are escaped where a cell begins.
    """
    return [f"{key}: {_line(value)}" for key, value in document.items()]


def _line(value: Any) -> str:
    plain = isinstance(value, str) and value.isprintable() and value == value.strip() != ""
    if plain and '"' not in value and not _FORMULA.search(value) and of_lines([f"key: {value}"]) == {"key": value}:
        return str(value)
    return _LITERAL.sub(
        lambda literal: _FORMULA.sub(lambda sign: f"{sign[1]}\\u{ord(sign[2]):04x}", literal[0]), json.dumps(value)
    )


def one_line(text: str) -> str:
    """Return a text in one printable line: other characters and runs of spaces are a space."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def document_of(text: str | bytes) -> dict[str, Any]:
    """Return the record in a text of JSON; empty if the text is not a JSON object."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return document if isinstance(document, dict) else {}


def of_lines(texts: list[str]) -> dict[str, Any]:
    """Return the record that `lines` wrote; other lines are left out."""
    document: dict[str, Any] = {}
    for text in texts:
        key, colon, value = text.partition(": ")
        if colon:
            try:
                document[key] = json.loads(value)
            except (ValueError, RecursionError):
                document[key] = value
    return document


def note(document: dict[str, Any], sentence: str) -> None:
    """Add a sentence to the notes of a record, which statements on samples repeat."""
    if sentence not in (notes := document.get("notes", ())):
        document["notes"] = [*notes, sentence]


_UM = r"um|\u00b5m|\u03bcm|microns?"
_LENGTH = (  # a comma before three digits of nm may part thousands
    rf"(?P<number>\d+(?:\.\d+|,\d\d?(?!\d)|,\d+(?= ?(?:{_UM})))?) ?"
    rf"(?P<unit>nm|{_UM}|cm ?(?:\^? ?-1|\u207b\u00b9)|1 ?/ ?cm)(?!\w)"
)
_WAVELENGTHS = tuple(  # of light, not of a layer or a band; the first that a text has are taken
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        r"(?:wavelengths?|wave ?numbers?|laser|lambda|\u03bb|wellenl\w{0,2}\W?ngen?|wellenzahl|longueurs? d.onde"
        r"|nombres? d.onde)"
        rf"(?:[\s:=,(]|\b(?:is|was|are|of|at|lambda|light|source|ist|des|lasers?|lichts|du|de|est)\b)*{_LENGTH}",
        rf"{_LENGTH} (?:wavelength|laser|light)",
        rf"(?:\b(?:at|bei|\u00e0)|@)\s*{_LENGTH}",
    )
)
_SPOT = re.compile(r"(\d+(?:\.\d+)?) ?mm spot")
_INSTRUMENTS = ("Instrument", "Scatterometer", "Gonioreflectometer", "Goniophotometer")


def of_comments(document: Mapping[str, Any]) -> tuple[Instrument, float | None]:
    """Return the instrument that comments of a file name, and its wavelength [nm] if they name one and no other.

    Parameters
    ----------
    document : mapping
        Comments by the words before their colons, as `of_lines` gives them.
    """
    text = "\n".join(f"{key}: {value}" for key, value in document.items() if isinstance(value, str))
    matches = next((matches for one in _WAVELENGTHS if (matches := list(one.finditer(text)))), [])
    numbers = ((float(at["number"].replace(",", ".")), at["unit"].lower()) for at in matches)
    lengths = {_in_nm(number, unit) for number, unit in numbers if number}
    spots = set(_SPOT.findall(text))
    name = next((str(document[key]) for key in _INSTRUMENTS if key in document), "")
    spot = float(spots.pop()) if len(spots) == 1 else None
    from brdfdb.measurements.instrument import Instrument

    return Instrument(name, spot_mm=spot or None), lengths.pop() if len(lengths) == 1 else None


def _in_nm(number: float, unit: str) -> float:
    """Return the wavelength [nm] of a length, or of a wavenumber in cm^-1."""
    return round(number if unit == "nm" else 1e7 / number if "cm" in unit else 1e3 * number, 6)


def beside(path: Path) -> Path:
    """Return the path of the record that goes with a file."""
    return path.with_name(f"{path.name}.json")


def record_beside(path: Path) -> dict[str, Any]:
    """Return the record next to a file; empty if it is missing or damaged."""
    there = beside(path)
    try:
        if not there.is_file() or there.stat().st_size > _LARGEST:
            return {}
        return document_of(there.read_bytes())
    except OSError:
        return {}
