"""Looking into a store from the command line: list, which loads little, show and lookup."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import brdfdb
from brdfdb.errors import ParameterError, StoreError
from brdfdb_pipelines import family_listing, terminal

if TYPE_CHECKING:
    from brdfdb.materials.provenance import Assumption
    from brdfdb.store.family import Family
    from brdfdb.tables.metadata import TableMetadata
    from brdfdb.tables.stated_error import Error
    from brdfdb.tables.table import Table

ALBEDO_ANGLES_DEG = (0.0, 30.0, 60.0, 80.0)


def list_store(root: Path, *, snapshot: str | None = None) -> None:
    """Print a line for each material of a store, or of a snapshot of it, and for each family."""
    store = brdfdb.open(root, snapshot=snapshot)
    rows, damaged, incomplete = [], [], []
    for name in store:
        try:
            head = store.summary(name)
            if not (head["title"] and head["model"]):  # the pointer of a whole table has both
                incomplete.append(f"{name} {head['revision']} {store.metadata(name).gaps}")
        except StoreError as error:
            damaged.append(str(error))
            continue
        rows.append((name, head["title"], head["model"], terminal.error(head.get("error_p99")), head["revision"]))
    terminal.print_table(
        f"{len(rows)} materials in {root}",
        ("material", "title", "model", "error (p99)", "revision"),
        rows,
        numbers=("error (p99)",),
    )
    for sentence in incomplete:
        print(terminal.plain(sentence))
    damaged += family_listing.print_list(store)
    if damaged:
        raise StoreError("; ".join(damaged))


def list_presets() -> None:
    """Print a line for each built-in material."""
    from brdfdb.materials import presets

    rows = [(m.name, m.title, m.model, m.source) for m in presets().values()]
    terminal.print_table(f"{len(rows)} built-in materials", ("material", "title", "model", "source"), rows)


def show(root: Path, name: str, *, snapshot: str | None = None) -> None:
    """Print what a store, or a snapshot of it, knows of a material or a family."""
    store = brdfdb.open(root, snapshot=snapshot)
    if family_listing.is_family(store, name):
        family = store.family(name)
        family_listing.show(family)
        _print_error(family.error)
        family_listing.show_worst(family)
        return
    table = store[name]
    print(terminal.plain("\n".join([f"{name}: {table.metadata.title or 'no title'}", *_origin(table.metadata)])))
    if table.metadata.gaps:
        print(terminal.plain(f"  incomplete  the table {table.metadata.gaps}"))
    _print_grid(table)
    _print_error(table.error)
    _print_albedo(table)
    print(f"  files       {store.path(name)} (zarr v3, {terminal.size(_stored(store.path(name)))})")


def _origin(metadata: TableMetadata) -> list[str]:
    """Return lines on the model, its parameters and where they come from, as far as a table states them."""
    lines = []
    if metadata.model is not None:
        named = ", ".join(part for part in (metadata.model_title or metadata.model, metadata.model_equation) if part)
        reference = f" [{metadata.model_reference}]" if metadata.model_reference else ""
        lines.append(f"  model       {named}{reference}")
    if metadata.parameters:
        lines.append("  parameters")
    for parameter, value in metadata.parameters.items():
        note = metadata.parameter_sources.get(parameter, "")
        if parameter in metadata.assumed:
            note = f"assumed, see {'the note' if metadata.assumed[parameter] is None else 'below'}"
        lines.append(f"    {parameter:<16}{value!s:<8} {note}".rstrip())
    if metadata.source is not None:
        lines.append(f"  source      {metadata.source}")
    if metadata.refractive_index:
        lines.append(f"  n, k        {metadata.refractive_index} of refractiveindex.info")
    if metadata.note:
        lines.append(f"  note        {metadata.note}")
    for parameter, assumption in metadata.assumed.items():
        lines += [] if assumption is None else _assumption(parameter, assumption)
    if metadata.known_excess is not None:
        lines.append(f"  excess      {metadata.known_excess.citation}")
    return lines


def _assumption(parameter: str, assumption: Assumption) -> list[str]:
    """Return lines on why an assumed value was chosen, with the largest albedo [1] of it and its alternatives."""
    lines = [f"  assumed     {parameter}: {assumption.why}"]
    if assumption.max_albedo is not None:
        lines.append(f"    {'largest albedo':<16}{assumption.max_albedo:.3f} as tabulated")
    for other in assumption.alternatives:
        values = ", ".join(f"{name} = {value}" for name, value in other.parameters.items())
        excess = ", more than arrives" if other.max_albedo > 1.0 else ""
        lines.append(f"    {'':<16}{other.max_albedo:.3f} with {values}{excess}")
    return lines


def _print_grid(table: Table) -> None:
    """Axes, how many values are stored and how, and how f_r comes of them."""
    metadata, wavelength = table.metadata, table.wavelength_nm
    print("  grid")
    for axis, nodes in table.axes_deg.items():
        print(f"    {axis:<16}{nodes.size} nodes, {nodes[0]:g} to {nodes[-1]:g} degrees")
    if wavelength is None:
        print(f"    {'wavelength':<16}none, the table is grey")
    elif wavelength.size == 1:
        print(f"    {'wavelength':<16}{wavelength[0]:g} nm only")
    else:
        print(f"    {'wavelength':<16}{wavelength.size} nodes, {wavelength[0]:g} to {wavelength[-1]:g} nm")
    if table.spectra is not None:
        print(f"    {'parts':<16}{table.spectra.shape[0]}, of which each spectrum is a sum")
    bits = metadata.bits
    stored = "all 23 bits of their mantissas" if bits == 23 else f"{bits} of 23 bits of their mantissas"
    print(f"    {'values':<16}{table.values.size}, {stored}")
    print(f"    {'interpolation':<16}{_interpolation(table)}")
    if metadata.reason:
        print(terminal.plain(f"    {'reason':<16}{metadata.reason}"))
    if metadata.reconstruction:
        print(terminal.plain(f"  f_r         {metadata.reconstruction}"))


def _interpolation(table: Table) -> str:
    """How a table is interpolated, in words."""
    how = table.interpolation
    what = "f_r" if how.power == 0.0 else f"f_r (cos theta_i cos theta_r)^{how.power:g}"
    if table.uniform is not None:
        what = what.replace("f_r", "(f_r - uniform)", 1)
    if how.logarithm:
        what = f"the logarithm of {what} + {how.offset:.3g}"
    return f"{how.method}, of {what}"


def _print_error(error: Error | None) -> None:
    """Print the error that is stated: overall, and by bands and places at the wavelength where it is largest."""
    from brdfdb.tables.places import RINGS_DEG

    if error is None:
        print("  error       not measured")
        return
    overall = error.overall
    print(
        f"  error       {terminal.error(overall.p99)} of f_r against the model, in 99 of 100 of {error.directions} "
        f"directions (median {overall.median:.2g}, largest {overall.max:.2g}, of what is reflected {overall.l1:.2g})"
    )
    edges = error.theta_i_deg
    rows = [("99 of 100", error.p99), ("reflected", error.l1)]
    if error.places is not None:
        rows.append(("alongside", error.places.alongside))
    if error.between is not None:
        rows.append(("between", error.between.bands))
    print("    theta_i     " + "".join(f"{f'{a:g}-{b:g}°':>9}" for a, b in itertools.pairwise(edges)))
    for label, bands in rows:
        print(f"    {label:<12}" + "".join(f"{max(row):9.2g}" for row in bands))
    said = [] if error.places is None else ["alongside: theta_r within 10° of theta_i, delta_phi within 90°"]
    said += [] if error.between is None else ["between: any wavelength between those of the table"]
    if said:
        print(f"    {'; '.join(said)}")
        print("    98 of 100 values are within these limits, and within those next to the horizon, if given")
    if error.places is None:
        return
    print("    horizon     " + "".join(f"{f'{a:g}-{b:g}°':>9}" for a, b in itertools.pairwise(RINGS_DEG)))
    for label, rings in (("one there", error.places.one_grazing), ("both beyond", error.places.both_grazing)):
        print(f"    {label:<12}" + "".join(f"{max(row):9.2g}" for row in rings))


def _print_albedo(table: Table) -> None:
    """Directional albedo of the table at a few angles: the first, the middle and the last wavelength."""
    import numpy as np

    from brdfdb.geometry import radians
    from brdfdb.tables.albedo import directional_albedo

    found = directional_albedo(table)
    diffuse = found.mean
    wavelength = table.wavelength_nm
    columns = sorted({0, diffuse.shape[1] // 2, diffuse.shape[1] - 1})
    print(
        "  albedo, as tabulated "
        + "".join(f"{f'{angle:g}°':>9}" for angle in ALBEDO_ANGLES_DEG)
        + "  (theta_i; with the Dirac part)"
    )
    for w in columns:
        at = None if wavelength is None else float(wavelength[w])
        specular = table.specular_reflectance(radians(ALBEDO_ANGLES_DEG), at)
        values = np.interp(ALBEDO_ANGLES_DEG, found.theta_i_deg, diffuse[:, w]) + specular
        print(f"    {'grey' if at is None else f'{at:g} nm':<10}" + "".join(f"{value:9.4f}" for value in values))


def _stored(path: Path) -> int:
    return sum(file.stat().st_size for file in path.rglob("*") if file.is_file())


def lookup(
    root: Path,
    name: str,
    angles_deg: Sequence[float],
    wavelength_nm: Sequence[float] | None,
    *,
    settings: Sequence[str] = (),
    as_json: bool,
    with_error: bool = False,
    snapshot: str | None = None,
) -> None:
    """Print f_r at theta_i, phi_i, theta_r, phi_r [degree], and the Dirac part's reflectance if the model has one.

    With the error that the table states beside each value, if asked for. Of a family, at the parameters of `settings`,
    each ``name=value``.
    """
    import numpy as np

    from brdfdb.geometry import radians
    from brdfdb.tables.grids import ANISOTROPIC_AXES

    for angle, value in zip(ANISOTROPIC_AXES, angles_deg, strict=True):
        if not math.isfinite(value):
            raise ParameterError(angle, f"{value} is not a number of degrees", value)
        if angle.startswith("theta") and not 0.0 <= value <= 180.0:
            raise ParameterError(angle, f"{value:g} is outside [0, 180] degrees", value, (0.0, 180.0))
    store = brdfdb.open(root, snapshot=snapshot)
    source: Table | Family
    point: dict[str, Any] = {}
    if family_listing.is_family(store, name):
        source = store.family(name)
        written = family_listing.written(source, settings)
        point = family_listing.in_units_of_the_model(source, written)
        head: dict[str, Any] = {"family": name, "parameters": written}
        dirac = source.record.specular_error is not None
    else:
        source = store[name]
        if settings:
            raise ParameterError(f"--set {settings[0]}", f"{name} is a material, whose parameters are fixed")
        head = {"material": name, "revision": source.revision}
        dirac = source.specular is not None
    theta_i, phi_i, theta_r, phi_r = radians(angles_deg)
    error = None
    if with_error:
        stated = source.lookup_with_error(theta_i, phi_i, theta_r, phi_r, wavelength_nm, **point)
        brdf, error = (np.atleast_1d(values) for values in stated)
    else:
        brdf = np.atleast_1d(source.lookup(theta_i, phi_i, theta_r, phi_r, wavelength_nm, **point))
    specular = np.atleast_1d(source.specular_reflectance(theta_i, wavelength_nm, **point))
    wavelengths = source.wavelength_nm if wavelength_nm is None else wavelength_nm
    if as_json:
        answer = {
            **head,
            "unit": "1/sr",
            "wavelength_nm": None if wavelengths is None else list(wavelengths),
            "brdf": brdf.tolist(),
            **({} if error is None else {"error": error.tolist()}),
            "specular_reflectance": specular.tolist(),
        }
        print(json.dumps(answer))
        return
    for index, value in enumerate(brdf):
        at = "" if wavelengths is None else f"{wavelengths[index]:g} nm  "
        mirrored = f"  and {specular[index]:.6g} of the light in the exact mirror direction" if dirac else ""
        within = "" if error is None else f" +- {error[index]:.2g}"
        print(f"{at}{value:.6g}{within} /sr{mirrored}")
