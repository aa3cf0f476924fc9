"""The summary of imported tables: asymmetry, albedos and verdicts of all of them, on screen and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from brdfdb.audit import AuditReport
from brdfdb.audit.energy import Energy
from brdfdb.audit.reciprocity import Reciprocity
from brdfdb.errors import counted
from brdfdb.store.reader import Store
from brdfdb_pipelines import terminal

NOT_JUDGED = "not judged"
_NAMED = 12  # materials that a sentence names


@dataclass(frozen=True)
class Line:
    """Figures of one imported table.

    Attributes
    ----------
    material, revision : str
        Name and revision.
    error_p95 : float [1]
        Relative error of the table that 95 of 100 values keep to, against the data: the one that a tolerance bounds.
    measured : float [1]
        Share of all pairs of directions that were measured; 1 if f_r is known everywhere.
    asymmetry_median, asymmetry_p99 : float [1] or None
        abs(f - f') / (abs(f) + abs(f')) of f_r that the table is made of, interpolated between samples, f' with light
        and viewer exchanged; None: the data cannot tell.
    uncertainty : float [1] or None
        Relative uncertainty that 99 of 100 values keep to; None if nothing is known of it.
    asymmetric : bool or None
        True if the asymmetry of the table is larger than the uncertainty explains; None without an uncertainty.
    albedo : float [1] or None
        Largest directional albedo of the table; None: not finite.
    albedo_error : float [1] or None
        Part of it that the stated error of the table, and that at samples held out, may make; None: not known.
    at_theta_i_deg : float [degree]
        Polar angle of the light there.
    above_1 : bool
        True if an albedo is above 1.
    verdict : str
        Verdict of the audit; "not judged" where the error of the albedo does not tell whether it is above 1.
    """

    material: str
    revision: str
    error_p95: float
    measured: float
    asymmetry_median: float | None
    asymmetry_p99: float | None
    uncertainty: float | None
    asymmetric: bool | None
    albedo: float | None
    albedo_error: float | None
    at_theta_i_deg: float
    above_1: bool
    verdict: str


def lines_of(root: Path, report: AuditReport) -> list[Line]:
    """Return the figures of the audited tables of a store."""
    store = Store(root)
    lines = []
    for audited in report.materials:
        measured, error = store.metadata(audited.material).measured, store[audited.material].error
        assert measured is not None
        seen, uncertainty = measured.reciprocity.asymmetry, measured.uncertainty
        energy, reciprocity = audited.of(Energy).table, audited.of(Reciprocity)
        wrong = energy.uncertainty
        if wrong is not None and energy.max_albedo is not None and measured.held_out is not None:
            wrong += measured.held_out.l1 * energy.max_albedo
        judged = energy.max_albedo is None or energy.max_albedo + (wrong or 0.0) <= 1.0
        lines.append(
            Line(
                audited.material,
                audited.revision,
                math.nan if error is None else error.overall.p95,
                1.0 if measured.extrapolated is None else 1.0 - measured.extrapolated,
                None if seen is None else seen.median,
                None if seen is None else seen.p99,
                uncertainty,
                None if uncertainty is None else reciprocity.verdict == "violates",
                energy.max_albedo,
                wrong,
                energy.max_at_theta_i_deg,
                energy.exceeds_1_from_theta_i_deg is not None,
                audited.verdict if judged or audited.verdict != "passes" else NOT_JUDGED,
            )
        )
    return lines


def document(lines: Sequence[Line], report: AuditReport) -> dict[str, Any]:
    """Return figures of all tables, and the summary, as JSON."""
    medians = [line.asymmetry_median for line in lines if line.asymmetry_median is not None]
    return {
        "tables": [asdict(line) for line in lines],
        "summary": {
            "materials": len(lines),
            "asymmetry_median": float(np.median(medians)) if medians else None,
            "asymmetric": [line.material for line in lines if line.asymmetric],
            "without_uncertainty": sum(line.uncertainty is None for line in lines),
            "above_1": [line.material for line in lines if line.above_1],
            "passes": sum(line.verdict == "passes" for line in lines),
            "not_judged": [line.material for line in lines if line.verdict == NOT_JUDGED],
            "violates": report.violations,
        },
    }


def show(lines: Sequence[Line], report: AuditReport, tolerance: float) -> None:
    """Print a line for each table, the problems of tables, and the summary."""
    print()
    numbers = ("table error", "measured", "asymmetry, median", "99 of 100", "uncertainty", "albedo up to")
    terminal.print_table(
        f"Measured tables in {report.store}",
        ("material", *numbers, "audit"),
        [
            (
                line.material,
                *map(
                    _percent,
                    (line.error_p95, line.measured, line.asymmetry_median, line.asymmetry_p99, line.uncertainty),
                ),
                _albedo(line),
                line.verdict,
            )
            for line in lines
        ],
        numbers=numbers,
    )
    print("table error: 95 of 100 values of a table are so near to the data, interpolated, where these were measured")
    print("measured: share of all pairs of directions; in others f_r is extrapolated, and its error not known")
    print("asymmetry: |f - f'| / (|f| + |f'|) of f_r that tables are made of, interpolated between samples, over")
    print("directions up to 80 degrees; f' has light and viewer exchanged, and the faintest pairs do not count")
    print("albedo: of the table, with what its stated error may make; not judged where this does not tell it from 1")
    for audited in report.materials:
        for problem in audited.problems():
            print(f"{audited.material}: {problem}")
    for sentence in sentences(lines, tolerance):
        print(sentence)
    counts = ", ".join(
        f"{verdict} {count}"
        for verdict in ("passes", NOT_JUDGED, *sorted({line.verdict for line in lines} - {"passes", NOT_JUDGED}))
        if (count := sum(line.verdict == verdict for line in lines)) or verdict == "passes"
    )
    print(f"{counted(len(lines), 'table')} audited: {counts}")


def sentences(lines: Sequence[Line], tolerance: float) -> list[str]:
    """Return the summary of errors, asymmetries and albedos in sentences."""
    far = [f"{line.material}: {_percent(line.error_p95)}" for line in lines if not line.error_p95 <= tolerance]
    missed = f"table error beyond the tolerance of {_percent(tolerance)}, on the finest grid: {_named(far)}"
    medians = [line.asymmetry_median for line in lines if line.asymmetry_median is not None]
    asymmetry = "reciprocity asymmetry: the data cannot tell"
    if medians:
        spread = f", from {_percent(min(medians))} to {_percent(max(medians))}" if len(medians) > 1 else ""
        asymmetry = (
            f"reciprocity asymmetry of f_r, interpolated: median over materials {_percent(np.median(medians))}{spread}"
        )
    beyond = [line.material for line in lines if line.asymmetric]
    unknown = sum(line.uncertainty is None for line in lines)
    judged = f"asymmetric beyond their uncertainty: {_named(beyond)}"
    if unknown:
        judged += f"; {unknown} of {len(lines)} state no uncertainty, and are not judged"
    return [missed, asymmetry, judged, f"albedo above 1: {_named([line.material for line in lines if line.above_1])}"]


def _albedo(line: Line) -> str:
    """Return the largest albedo of a table with its error, and no more digits than this leaves."""
    if line.albedo is None:
        return "not finite"
    where = f"at {line.at_theta_i_deg:g}°"
    if not line.albedo_error:
        return f"{line.albedo:.4f} {where}"
    digits = int(np.clip(math.ceil(-math.log10(line.albedo_error)), 1, 4))
    return f"{line.albedo:.{digits}f} ± {line.albedo_error:.1g} {where}"


def _named(names: Sequence[str]) -> str:
    """Return the number of names, and the first of them."""
    if not names:
        return "none"
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return f"{len(names)} ({', '.join(names[:_NAMED])}{more})"


def _percent(value: float | np.floating[Any] | None) -> str:
    """Return a share as text in percent with two digits, a hyphen if it is not known."""
    if value is None:
        return "-"
    return f"{100.0 * value:.2g} %" if value < 0.0995 else f"{100.0 * value:.0f} %"
