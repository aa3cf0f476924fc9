"""Looking into a store from the command line: list, which loads little, show and lookup."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import brdfdb
from brdfdb_pipelines import families, terminal

if TYPE_CHECKING:
    from brdfdb.lookup import Table

ALBEDO_ANGLES_DEG = (0.0, 30.0, 60.0, 80.0)


def list_store(root: Path) -> None:
    """Print a line for each material of a store, and for each family."""
    store = brdfdb.open(root)
    rows = []
    for name in store:
        head = store.summary(name)
        rows.append((name, head["title"], head["model"], head["revision"]))
    terminal.print_table(f"{len(rows)} materials in {root}", ("material", "title", "model", "revision"), rows)
    families.print_list(store)


def list_presets() -> None:
    """Print a line for each built-in material."""
    from brdfdb.materials import presets

    rows = [(m.name, m.title, m.model, m.source) for m in presets().values()]
    terminal.print_table(f"{len(rows)} built-in materials", ("material", "title", "model", "source"), rows)


def show(root: Path, name: str) -> None:
    """Print what a store knows of a material or a family."""
    store = brdfdb.open(root)
    if families.is_family(store, name):
        families.show(store.family(name))
        return
    table = store[name]
    attributes = table.attrs
    print(f"{name}: {attributes['title']}")
    print(
        f"  model       {attributes['model_title']}, {attributes['model_equation']} [{attributes['model_reference']}]"
    )
    print("  parameters")
    for parameter, value in attributes["parameters"].items():
        note = (
            "assumed, see the note"
            if parameter in attributes["assumed"]
            else attributes["parameter_sources"][parameter]
        )
        print(f"    {parameter:<16}{value!s:<8} {note}")
    print(f"  source      {attributes['source']}")
    if attributes["refractive_index"]:
        print(f"  n, k        {attributes['refractive_index']} of refractiveindex.info")
    if attributes["note"]:
        print(f"  note        {attributes['note']}")
    if attributes["known_excess"]:
        print(f"  excess      {attributes['known_excess']['citation']}")
    print("  grid")
    for axis, nodes in table.axes_deg.items():
        print(f"    {axis:<16}{nodes.size} nodes, {nodes[0]:g} to {nodes[-1]:g} degrees")
    if table.wavelength_nm is None:
        print(f"    {'wavelength':<16}none, the table is grey")
    elif table.wavelength_nm.size == 1:
        print(f"    {'wavelength':<16}{table.wavelength_nm[0]:g} nm only")
    else:
        wavelength = table.wavelength_nm
        print(f"    {'wavelength':<16}{wavelength.size} nodes, {wavelength[0]:g} to {wavelength[-1]:g} nm")
    _print_albedo(table)
    print(f"  files       {store.path(name)} (zarr v3, {terminal.size(_stored(store.path(name)))})")


def _print_albedo(table: Table) -> None:
    """Directional albedo of the table at a few angles: the first, the middle and the last wavelength."""
    import numpy as np

    from brdfdb.audit import directional_albedo
    from brdfdb.geometry import radians

    diffuse = directional_albedo(table)
    if table.anisotropic:
        diffuse = diffuse.mean(axis=1)
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
        values = np.interp(ALBEDO_ANGLES_DEG, table.axes_deg["theta_i"], diffuse[:, w]) + specular
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
) -> None:
    """Print f_r at theta_i, phi_i, theta_r, phi_r [degree], and the Dirac part's reflectance if the model has one.

    Of a family, at the parameters of `settings`, each ``name=value``.
    """
    import numpy as np

    from brdfdb.geometry import radians
    from brdfdb.grids import ANISOTROPIC_AXES

    for angle, value in zip(ANISOTROPIC_AXES, angles_deg, strict=True):
        if not math.isfinite(value):
            raise ValueError(f"{angle}: {value} is not a number of degrees")
        if angle.startswith("theta") and not 0.0 <= value <= 180.0:
            raise ValueError(f"{angle}: {value:g} is outside [0, 180] degrees")
    store = brdfdb.open(root)
    if families.is_family(store, name):
        families.lookup(store.family(name), angles_deg, wavelength_nm, settings, as_json=as_json)
        return
    table = store[name]
    if settings:
        raise ValueError(f"--set {settings[0]}: {name} is a material, whose parameters are fixed")
    theta_i, phi_i, theta_r, phi_r = radians(angles_deg)
    brdf = np.atleast_1d(table.lookup(theta_i, phi_i, theta_r, phi_r, wavelength_nm))
    specular = np.atleast_1d(table.specular_reflectance(theta_i, wavelength_nm))
    wavelengths = table.wavelength_nm if wavelength_nm is None else wavelength_nm
    if as_json:
        answer: dict[str, Any] = {
            "material": name,
            "revision": table.revision,
            "unit": "1/sr",
            "wavelength_nm": None if wavelengths is None else list(wavelengths),
            "brdf": brdf.tolist(),
            "specular_reflectance": specular.tolist(),
        }
        print(json.dumps(answer))
        return
    for index, value in enumerate(brdf):
        at = "" if wavelengths is None else f"{wavelengths[index]:g} nm  "
        dirac = (
            f"  and {specular[index]:.6g} of the light in the exact mirror direction"
            if table.specular is not None
            else ""
        )
        print(f"{at}{value:.6g} /sr{dirac}")
