"""A line of a list in words: colours, error of the formula, and the answers of the last audit to its two questions."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from brdfdb.errors import counted, near_90, percent
from brdfdb.microgeometry.model_errors import has_map, surface_error_of
from brdfdb.store.files import sha256_of
from brdfdb.store.paths import NAME, manifest_path, number_of, revision_path

NOT_MEASURED = "not measured"
NOT_AUDITED = "not audited"
# Explains the two errors of a list in a line below it
ERRORS_EXPLAINED = (
    "table error: of the table relative to its formula, or to the data if it is measured; formula error: of the "
    "formula relative to the exact form of the same model; 0, exact form: the formula is exact"
)
SURFACE_EXPLAINED = "surface error: of the formula relative to rays on surfaces that suit the material"
COLUMNS = ("as published or measured?", "conserves energy?")  # headings of the two answers

REPORT_OF_ALL = "audit.json"  # in a store: the report on all its materials
REPORT_OF_SOME = "audit-part.json"  # on those that were named or imported


class Audited(NamedTuple):
    """The answers of an audit in a few words: does the table agree with the paper, does its model conserve energy.

    `samples` are the errors of a table of measured data at its samples, and its glints; empty of other tables.
    """

    as_published: str
    conserves_energy: str
    samples: str = ""


def last_audit(root: Path | str) -> dict[tuple[str, str], Audited]:
    """Return the answers of the last audit by material and revision; none where there is no readable report.

    Audits of older programs have one verdict, which stands for the first answer.
    """
    answers: dict[tuple[str, str], Audited] = {}
    for entry in audited_materials(root):
        audited = Audited(str(entry["verdict"]), "")
        if "as_published" in entry:
            audited = Audited(str(entry["as_published"]["text"]), str(entry["conserves_energy"]["text"]))
            audited = audited._replace(samples=_samples((entry.get("findings") or {}).get("glints") or {}))
        answers[entry["material"], entry["revision"]] = audited
    return answers


def _samples(finding: Mapping[str, Any]) -> str:
    worst = finding.get("worst") or {}
    shares = {"held out (p95)": finding.get("held_out_p95"), "worst sample": worst.get("error")}
    parts = [f"{name} {percent(share)}" for name, share in shares.items() if share is not None]
    if glints := finding.get("glints"):
        parts.append(counted(len(glints), "glint"))
    return ", ".join(parts)


def audited_materials(root: Path | str) -> list[dict[str, Any]]:
    """Return the entries of the reports in a store, on all materials and on a part of them, the newer report last.

    Entries of other tables are left out, as of a store that was built anew: see `is_of_store`.
    """
    entries: list[dict[str, Any]] = []
    if isinstance(root, str):  # an address has no reports
        return entries
    paths = [path for name in (REPORT_OF_ALL, REPORT_OF_SOME) if (path := root / name).exists()]
    for path in sorted(paths, key=lambda path: path.stat().st_mtime_ns):
        try:
            of_report = json.loads(path.read_bytes())["materials"]
            complete = [entry for entry in of_report if {"material", "revision", "verdict"} <= entry.keys()]
            entries += [entry for entry in complete if is_of_store(root, entry)]
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            continue
    return entries


def is_of_store(root: Path | str, entry: Mapping[str, Any]) -> bool:
    """Return True if the entry of a report is of a table of this store; by its revision alone if it has no digest."""
    if not entry.get("manifest_sha256"):
        return True
    if isinstance(root, str) or not (NAME.fullmatch(entry["material"]) and number_of(entry["revision"])):
        return False
    try:
        manifest = manifest_path(revision_path(root, entry["material"], entry["revision"]))
        return sha256_of(manifest) == str(entry["manifest_sha256"])
    except OSError:
        return False


def colours(head: Mapping[str, Any]) -> str:
    """Return the wavelengths of a table in words: grey, one wavelength, or a range; empty if its pointer is older."""
    at = head.get("wavelength_range_nm")
    if at is None:
        return ""
    if not at:
        return "grey"
    return f"{at[0]:g} nm" if at[0] == at[-1] else f"{at[0]:g}-{at[-1]:g} nm"


def kind(head: Mapping[str, Any]) -> str:
    """Return the model of a table; without a model, measured or function."""
    return head["model"] or ("measured" if head.get("measured") else "function")


def formula_error(head: Mapping[str, Any], percent: Callable[[float], str]) -> str:
    """Return the error of a formula against the highest rung of its surface, in words."""
    if head.get("measured"):
        return "no formula"
    stated = head.get("formula_error")
    if stated is None:
        return NOT_MEASURED
    if stated["against"] == "measured":
        return percent(stated["p99"])
    return "0, exact form" if stated["against"] == "highest rung" else "no exact form"


def surface_error(head: Mapping[str, Any], attributes: Callable[[], Mapping[str, Any]]) -> str:
    """Return the error of a formula against rays on the surface that suits a material, in words; empty without a map.

    It is computed from the parameters in the pointer, or in the `attributes` of the table if the pointer is older, and
    never stored: a newer map is shown at once.
    """
    if not has_map(head["model"]):
        return ""
    parameters = head["parameters"] if "parameters" in head else attributes().get("parameters", {})
    error = surface_error_of(head["model"], parameters)
    return "" if error is None else error.in_lists


def energy(head: Mapping[str, Any], audited: Audited | None) -> str:
    """Return the answer of the audit on energy; without one, that it is missing and an albedo above 1."""
    if audited is not None:
        return audited.conserves_energy
    above = excess(head)
    largest = head.get("largest_albedo") or {}
    passes = (largest.get("grazing") or {}).get("passes_1_at_theta_i_deg")
    if not above and passes is not None:
        above = f"albedo of the {_whose(largest)} exceeds 1 above {near_90(passes)}°"
    return f"{NOT_AUDITED}: {above}" if above else NOT_AUDITED


def _whose(largest: Mapping[str, Any]) -> str:
    return "model" if largest.get("of") == "source" else "table"


def excess(head: Mapping[str, Any]) -> str:
    """Return an albedo above 1 and its place in words; empty without one."""
    largest = head.get("largest_albedo")
    if largest is None:
        return ""
    value = largest["albedo"]
    if value is not None and value <= 1.0 + largest["tolerance"]:
        return ""
    at = f"{largest['theta_i_deg']:g}°"
    at += "" if largest["wavelength_nm"] is None else f", {largest['wavelength_nm']:g} nm"
    return f"albedo of the {_whose(largest)} {'not finite' if value is None else f'{value:.3g}'} at {at}"
