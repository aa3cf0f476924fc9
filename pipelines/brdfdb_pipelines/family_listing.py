"""Families at the command line: their lines in lists, show, lookup, and parameters as people write them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from brdfdb.errors import ParameterError, StoreError
from brdfdb.store.reader import Store
from brdfdb_pipelines import terminal

if TYPE_CHECKING:
    from brdfdb.store.family import Family


def is_family(store: Store, name: str) -> bool:
    """Whether a name is that of a family; a material of the same name goes first."""
    return name not in store and name in store.families()


def print_list(store: Store) -> list[str]:
    """Print a line for each family of a store from its record alone; return what is damaged."""
    rows = []
    damaged = []
    for name in store.families():
        try:
            record = store.family_content(name)
        except StoreError as error:
            damaged.append(str(error))
            continue
        over = ", ".join(f"{x} {v[0]:g} to {v[-1]:g}" for x, v in record.get("axes", {}).items())
        p99 = record.get("error", {}).get("overall", {}).get("p99")
        rows.append(
            (
                name,
                record.get("title", ""),
                record.get("model", ""),
                str(len(record.get("members", ()))),
                over,
                terminal.error(p99),
            )
        )
    if rows:
        columns = ("family", "title", "model", "tables", "over", "error (p99)")
        terminal.print_table(f"{len(rows)} families", columns, rows, numbers=("tables", "error (p99)"))
    return damaged


def show(family: Family) -> None:
    """Print what a store knows of a family but its error, which is printed as that of a table."""
    record = family.record
    print(terminal.plain(f"{record.name}: {record.title}"))
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


def show_worst(family: Family) -> None:
    """Print where between the members of a family the error is largest, and that of the Dirac part."""
    record = family.record
    at = ", ".join(f"{x} {value:g}" for x, value in record.worst.parameters.items())
    print(f"  worst       {terminal.error(record.worst.p99)} at {at}, of {record.points} sets of parameters")
    if record.specular_error is not None:
        print(f"  Dirac part  within {record.specular_error:.3g} of the model's reflectance")


def written(family: Family, settings: Sequence[str]) -> dict[str, float]:
    """Swept parameters from ``name=value``, each within its range in the unit of files."""
    axes = family.record.axes
    found: dict[str, float] = {}
    for setting in settings:
        name, _, text = setting.partition("=")
        if name not in axes:
            raise ParameterError(
                f"--set {setting}", f"the parameters of {family.name} are {', '.join(axes)}", setting, tuple(axes)
            )
        try:
            found[name] = float(text)
        except ValueError:
            raise ParameterError(f"--set {setting}", f"give a number, such as {name}={axes[name][0]:g}") from None
    for name, values in axes.items():
        low, high = values[0], values[-1]
        if name not in found:
            raise ParameterError("--set", f"{name} is missing, {family.name} needs a value in [{low:g}, {high:g}]")
        if not low <= found[name] <= high:
            raise ParameterError(f"--set {name}={found[name]:.9g}", f"outside [{low:g}, {high:g}] of {family.name}")
    return {name: found[name] for name in axes}


def in_units_of_the_model(family: Family, written: Mapping[str, float]) -> dict[str, float]:
    """Parameters by the names and in the units of the model: angles in radians."""
    from brdfdb.geometry import radians

    return {
        parameter.name: float(radians(written[name])) if parameter.unit == "rad" else written[name]
        for name, parameter in family.record.parameters.items()
    }
