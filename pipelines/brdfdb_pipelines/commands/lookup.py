"""The command `brdfdb lookup`."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from brdfdb.errors import ParameterError
from brdfdb.store import open_tables
from brdfdb_pipelines.commands._arguments import add_snapshot, add_tables

if TYPE_CHECKING:
    from brdfdb.store.family import Family
    from brdfdb.tables.table import Table

HELP = "Print f_r [1/sr] of a material or a family at one pair of directions."

_STOKES = ("reflected", "specular")
_LIKE_RADIANS = 3.2  # angles below it, with a fraction among them, may be radians
_ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the material, the directions, the wavelengths and the form of the answer."""
    parser.add_argument("name", metavar="NAME", help="material or family")
    for angle in _ANGLES:
        parser.add_argument(angle, type=float, metavar=angle.upper(), help="degrees")
    add_tables(parser)
    parser.add_argument(
        "--wavelength-nm",
        type=float,
        nargs="+",
        metavar="NM",
        help="wavelengths in nanometres (default: all of the table)",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="X=VALUE",
        help="value of a parameter of a family, with the name and unit of recipes; may be repeated",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--with-error", action="store_true", help="also print the stated error of each value")
    parser.add_argument(
        "--stokes",
        metavar="I,Q,U,V",
        help="Stokes vector of the incident light: also print that of the reflected light",
    )
    add_snapshot(parser)


def run(options: argparse.Namespace) -> int:
    """Print f_r [1/sr] at the directions [degree], and the specular reflectance [1] where there is a specular part."""
    import numpy as np

    from brdfdb.geometry import radians
    from brdfdb.tables.table import Table

    angles_deg = _checked_angles(options)
    store = open_tables(options.store, snapshot=options.snapshot)
    source: Table | Family
    point: dict[str, Any] = {}
    if options.name not in store and options.name in store.families():
        source = store.family(options.name)
        written = _swept(source, options.set)
        point = source.record.in_model_units(written)
        head: dict[str, Any] = {"family": options.name, "parameters": written}
        specular_part = source.record.specular_error is not None
    else:
        source = store[options.name]
        if options.set:
            raise ParameterError(
                f"--set {options.set[0]}", f"{options.name} is a material; only a family has parameters to set"
            )
        head = {"material": options.name, "revision": source.revision}
        specular_part = source.specular is not None
    theta_i, phi_i, theta_r, phi_r = radians(angles_deg)
    light = _reflected(source, angles_deg, options)
    error = None
    outside = isinstance(source, Table) and bool(source.extrapolated(theta_i, phi_i, theta_r, phi_r))
    glint = isinstance(source, Table) and bool(source.in_glint(theta_i, phi_i, theta_r, phi_r))
    if options.with_error:
        stated = source.lookup_with_error(theta_i, phi_i, theta_r, phi_r, options.wavelength_nm, **point)
        brdf, error = (np.atleast_1d(values) for values in stated)
    else:
        brdf = np.atleast_1d(source.lookup(theta_i, phi_i, theta_r, phi_r, options.wavelength_nm, **point))
    specular = np.atleast_1d(source.specular_reflectance(theta_i, options.wavelength_nm, **point))
    wavelengths = source.wavelength_nm if options.wavelength_nm is None else options.wavelength_nm
    if options.json:
        answer = {
            **head,
            "unit": "1/sr",
            "wavelength_nm": None if wavelengths is None else list(wavelengths),
            "brdf": brdf.tolist(),
            **({} if error is None else {"error": [None if math.isnan(one) else one for one in error.tolist()]}),
            **({"extrapolated": outside, "glint": glint} if isinstance(source, Table) else {}),
            "specular_reflectance": specular.tolist(),
            **({} if light is None else {"stokes": {**light, **{key: _known(light[key]) for key in _STOKES}}}),
        }
        print(json.dumps(answer))
        return 0
    for index, value in enumerate(brdf):
        at = "" if wavelengths is None else f"{wavelengths[index]:g} nm  "
        mirrored = f"  and {specular[index]:.6g} of the light in the exact mirror direction" if specular_part else ""
        within = "" if error is None or outside else f" +- {error[index]:.2g}"
        print(f"{at}{value:.6g}{within} /sr{mirrored}")
        if light is not None:
            reflected = np.atleast_2d(light["reflected"])[index]
            numbers = ", ".join("not measured" if math.isnan(number) else f"{number:.6g}" for number in reflected)
            print(f"{at}I, Q, U, V: {numbers} /sr")
    if light is not None:
        print(f"{light['convention']}. {light['basis']}")
        if error is not None:
            stated = light["element_error"]
            within = "not stated" if stated is None else f"99 of 100 are within {stated:.2g}"
            print(f"error of the elements m_ij / m_00 of the Mueller matrix: {within}")
    if glint:
        print("a glint is in it: a peak that the grid cannot hold, kept beside it")
        if error is not None and np.any(error > 0.5 * brdf):
            print("its shape is not known well between samples: the error is more than half of f_r")
    if outside:
        print("extrapolated: these directions were not measured, and the error is unknown")
    return 0


def _checked_angles(options: argparse.Namespace) -> list[float]:
    """Return the angles [degree]; ParameterError if one is outside its range, and a warning if they may be radians."""
    from brdfdb.geometry import check_azimuth_deg

    angles_deg = [getattr(options, angle) for angle in _ANGLES]
    for angle, value in zip(_ANGLES, angles_deg, strict=True):
        if not math.isfinite(value):
            raise ParameterError(angle, f"{value} is not a number of degrees", value)
        if angle.startswith("theta") and not 0.0 <= value <= 180.0:
            raise ParameterError(angle, f"{value:g} is outside [0, 180] degrees", value, (0.0, 180.0))
        if angle.startswith("phi"):
            check_azimuth_deg(angle, value)
    if all(abs(value) < _LIKE_RADIANS for value in angles_deg) and not all(map(float.is_integer, angles_deg)):
        shown = " ".join(f"{value:g}" for value in angles_deg)
        print(f"brdfdb: angles are in degrees, but these look like radians: {shown}", file=sys.stderr)
    return angles_deg


def _known(numbers: Any) -> Any:
    """Return nested lists of numbers with null for what was not measured."""
    if isinstance(numbers, list):
        return [_known(number) for number in numbers]
    return None if math.isnan(numbers) else numbers


def _reflected(source: Table | Family, angles_deg: list[float], options: argparse.Namespace) -> dict[str, Any] | None:
    """Return the reflected Stokes vectors as the service answers them; None if no incident light is given."""
    import numpy as np

    from brdfdb.geometry import radians
    from brdfdb.tables.evaluation import LookupPoints, read_stokes, stokes_document
    from brdfdb.tables.table import Table

    if options.stokes is None:
        return None
    incident = read_stokes(options.stokes)
    if not isinstance(source, Table):
        raise ParameterError("stokes", f"{options.name} is a family, which has no Mueller matrices", options.stokes)
    at = None if options.wavelength_nm is None else np.array(options.wavelength_nm)
    document = stokes_document(source, LookupPoints.of(tuple(radians(angles_deg)), at), incident)
    return {key: np.asarray(value).tolist() if key in _STOKES else value for key, value in document.items()}


def _swept(family: Family, settings: Sequence[str]) -> dict[str, float]:
    """Return the swept parameters from ``name=value``, each within its range and in the unit of recipes."""
    axes = family.record.axes
    values: dict[str, float] = {}
    for setting in settings:
        name, _, text = setting.partition("=")
        if name not in axes:
            raise ParameterError(
                f"--set {setting}", f"the parameters of {family.name} are {', '.join(axes)}", setting, tuple(axes)
            )
        try:
            values[name] = float(text)
        except ValueError:
            raise ParameterError(f"--set {setting}", f"give a number, such as {name}={axes[name][0]:g}", text) from None
    for name, nodes in axes.items():
        low = nodes[0]
        high = nodes[-1]
        if name not in values:
            raise ParameterError("--set", f"{name} is missing; give a value in [{low:g}, {high:g}]")
        if not low <= values[name] <= high:
            raise ParameterError(
                f"--set {name}={values[name]:.9g}",
                f"is outside [{low:g}, {high:g}], the range of {family.name}",
                values[name],
                (low, high),
            )
    return {name: values[name] for name in axes}
