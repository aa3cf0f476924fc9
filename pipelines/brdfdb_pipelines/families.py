"""Families at the command line: their lines in lists, show, lookup, and parameters as people write them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from brdfdb.manifest import read_json
from brdfdb.store import Store
from brdfdb_pipelines import terminal

if TYPE_CHECKING:
    from brdfdb.family import Family


def is_family(store: Store, name: str) -> bool:
    """Whether a name is that of a family; a material of the same name goes first."""
    return name not in store and name in store.families()


def print_list(store: Store) -> None:
    """Print a line for each family of a store, if it has any: what its record says, without a look at the members."""
    rows = []
    for name in store.families():
        record = read_json(store.root / "families" / f"{name}.json")
        over = ", ".join(f"{x} {v[0]:g} to {v[-1]:g}" for x, v in record.get("axes", {}).items())
        p99 = record.get("error", {}).get("overall", {}).get("p99", float("nan"))
        rows.append(
            (
                name,
                record.get("title", ""),
                record.get("model", ""),
                str(len(record.get("members", ()))),
                over,
                f"{p99:.2g}",
            )
        )
    if rows:
        columns = ("family", "title", "model", "tables", "over", "error p99")
        terminal.print_table(f"{len(rows)} families", columns, rows, numbers=("tables", "error p99"))


def show(family: Family) -> None:
    """Print what a store knows of a family."""
    record = family.record
    print(f"{record.name}: {record.title}")
    print(f"  model       {record.model}")
    print(f"  tables      {len(record.members)}, {record.members[0]} to {record.members[-1]}")
    print("  over")
    for written, values in record.axes.items():
        print(f"    {written:<16}{len(values)} values, {values[0]:g} to {values[-1]:g}")
    how = record.interpolation
    what = "f_r" if how.offset is None else f"logarithms of f_r + {how.offset:.3g}/sr"
    along = ", ".join({0: f"ln {x}", 1: x}.get(power, f"{x}^{power}") for x, power in how.powers.items())
    print(f"  between     {how.method} in {what} along {along}")
    print(f"  measured    {how.reason}")
    overall = record.error.overall
    print(
        f"  error       p99 {overall.p99:.3g}, p95 {overall.p95:.3g}, median {overall.median:.3g}, l1 {overall.l1:.3g} "
        f"against the model at {record.points} sets of parameters and {record.error.directions} directions"
    )
    for low, high, row in zip(record.error.theta_i_deg, record.error.theta_i_deg[1:], record.error.p99, strict=False):
        print(f"    theta_i {low:g} to {high:g}: p99 {max(row):.3g}")
    at = ", ".join(f"{x} {value:g}" for x, value in record.worst.parameters.items())
    print(f"  worst       p99 {record.worst.p99:.3g} at {at}")
    if record.specular_error is not None:
        print(f"  Dirac part  within {record.specular_error:.3g} of the model's reflectance")


def lookup(
    family: Family,
    angles_deg: Sequence[float],
    wavelength_nm: Sequence[float] | None,
    settings: Sequence[str],
    *,
    as_json: bool,
) -> None:
    """Print f_r and its error at angles [degree] and parameters, each written ``name=value`` as in files."""
    import numpy as np

    from brdfdb.geometry import radians

    written = _parameters(family, settings)
    own = {
        parameter.name: float(radians(written[name])) if parameter.unit == "rad" else written[name]
        for name, parameter in family.record.parameters.items()
    }
    angles = radians(angles_deg)
    brdf, error = family.lookup(angles[0], angles[1], angles[2], angles[3], wavelength_nm, with_error=True, **own)
    brdf, error = np.atleast_1d(brdf), np.atleast_1d(error)
    specular = np.atleast_1d(family.specular_reflectance(angles[0], wavelength_nm, **own))
    wavelengths = family.wavelength_nm if wavelength_nm is None else wavelength_nm
    if as_json:
        answer: dict[str, Any] = {
            "family": family.name,
            "parameters": written,
            "unit": "1/sr",
            "wavelength_nm": None if wavelengths is None else list(wavelengths),
            "brdf": brdf.tolist(),
            "error": error.tolist(),
            "specular_reflectance": specular.tolist(),
        }
        print(json.dumps(answer))
        return
    for index, value in enumerate(brdf):
        at = "" if wavelengths is None else f"{wavelengths[index]:g} nm  "
        dirac = (
            ""
            if family.record.specular_error is None
            else f"  and {specular[index]:.6g} of the light in the exact mirror direction"
        )
        print(f"{at}{value:.6g} ± {error[index]:.2g} /sr{dirac}")


def _parameters(family: Family, settings: Sequence[str]) -> dict[str, float]:
    """Swept parameters from ``name=value``, each within its range in the unit of files."""
    axes = family.record.axes
    found: dict[str, float] = {}
    for setting in settings:
        name, _, text = setting.partition("=")
        if name not in axes:
            raise ValueError(f"--set {setting}: the parameters of {family.name} are {', '.join(axes)}")
        try:
            found[name] = float(text)
        except ValueError:
            raise ValueError(f"--set {setting}: give a number, such as {name}={axes[name][0]:g}") from None
    for name, values in axes.items():
        low, high = values[0], values[-1]
        if name not in found:
            raise ValueError(f"--set: {name} is missing, {family.name} needs a value in [{low:g}, {high:g}]")
        if not low <= found[name] <= high:
            raise ValueError(f"--set {name}={found[name]:.9g}: outside [{low:g}, {high:g}] of {family.name}")
    return {name: found[name] for name in axes}
