"""The maps of the error of models against rays on surfaces that the program has, and their table."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.figure import listed
from brdfdb_pipelines import terminal

Document = dict[str, Any]
Row = dict[str, Any]


def shipped() -> Document:
    """Return the maps that the program has."""
    text = resources.files("brdfdb.microgeometry").joinpath("model_errors.json").read_text(encoding="utf-8")
    document: Document = json.loads(text)
    return document


def chosen(document: Document, models: Sequence[str]) -> list[str]:
    """Return the names of the maps of models, of all if none is given; ParameterError if a model has no map."""
    entries = document["models"]
    for model in models:
        if model not in entries and model not in {entry["model"] for entry in entries.values()}:
            known = ", ".join(dict.fromkeys(entry["model"] for entry in entries.values()))
            raise ParameterError("MODEL", f"{model} has no map of its error; models with a map: {known}", model)
    return [name for name, entry in entries.items() if not models or name in models or entry["model"] in models]


def print_maps(document: Document, names: Sequence[str]) -> None:
    """Print the errors of maps at each slope: the median, and those of 95 % of the viewers."""
    slopes = sorted({row["slope"] for row in rows_of(document, names[0])})
    last = document["lights_deg"][-2]
    rows = []
    for name in names:
        entry = document["models"][name]
        cells = []
        for slope in slopes:
            median, error = (float(np.median(errors_at(entry, slope, name))) for name in ("median", "noise"))
            p95 = errors_at(entry, slope, "p95")
            limits = f"({percent(np.max(p95[:, :-1]))}, {percent(np.max(p95))})"
            cells.append(f"{percent(median) if median > error else f'<{percent(error)}'} {limits}")
        rows.append((name, entry["bounces"], *cells, *(_reach(entry, slopes, limit) for limit in (0.05, 0.2))))
    heads = [f"slope {slope:g}" for slope in slopes]
    columns = ("model", "bounces", *heads, "5 % up to", "20 % up to")
    title = "Error against rays on Gaussian surfaces [%]"
    terminal.print_table(title, columns, rows, numbers=columns[2:], less=(columns[-1], columns[-2], columns[1]))
    made = document["provenance"]
    noise = " and ".join(f"{100.0 * error:.2g} % ({facets})" for facets, error in made["standard_error"].items())
    print(f"slope: standard deviation along each axis; lights at {listed(document['lights_deg'])} degrees")
    print(f"cells: median; in brackets the error of 95 % of the viewers, for lights up to {last} degrees and for all")
    print("median: over viewers, lights and albedos; error of 95 % of the viewers: at the worst light and albedo")
    print("<: the median is below the standard error of the rays, or an error rounds to 0")
    print(f"5 % and 20 % up to: largest slope at which 95 % of the viewers keep to it, for lights up to {last} degrees")
    print(f"{made['realisations']} realisations of each surface; the standard error of the rays is at most {noise}")


def rows_of(document: Document, name: str) -> list[Row]:
    """Return the rows of a map, without that of the flat surface."""
    return [row for row in document["models"][name]["rows"] if row["slope"] > 0.0]


def errors_at(entry: Row, slope: float, statistic: str, rho: float | None = None) -> NDArray[np.float64]:
    """Return a statistic at a slope for each albedo and light; of one albedo, where errors depend on it."""
    rows = [row for row in entry["rows"] if row["slope"] == slope]
    return np.array([row[statistic] for row in rows if rho is None or row["rho"] in (None, rho)])


def _reach(entry: Row, slopes: Sequence[float], limit: float) -> str:
    """Return the largest slope up to which 95 % of viewers are within a limit at all but the steepest light."""
    inside = ""
    for slope in slopes:
        if np.max(errors_at(entry, slope, "p95")[:, :-1]) > limit:
            break
        inside = f"{slope:g}"
    return inside or "-"


def percent(value: float) -> str:
    """Return a relative error in percent, without the sign for it; the maps have three decimals of it."""
    if value == 0.0:
        return "<0.1"
    return f"{100.0 * value:.2g}" if value < 0.995 else f"{100.0 * value:.0f}"
