"""The photograph job: pictures of a material by a simulated gonioreflectometer, one a direction of the light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from brdfdb.errors import ParameterError, WriteError
from brdfdb.formats.gonioreflectometer import write_picture
from brdfdb.geometry import check_azimuth_deg, radians
from brdfdb.measurements.gonioreflectometer import Gonioreflectometer, photograph
from brdfdb_pipelines import terminal
from brdfdb_pipelines.named_source import named_source

# Lights [degrees]: the grain of an anisotropic surface is seen along, across and between
LIGHTS = ((15.0, 0.0), (30.0, 45.0), (45.0, 90.0), (60.0, 20.0))


def run(
    name: str,
    lights: Sequence[Sequence[float]],
    out: Path,
    *,
    store: Path | None = None,
    recipe_path: Path | None = None,
    wavelength_nm: float = 550.0,
    settings: Sequence[str] = (),
    seed: int = 1,
) -> list[Path]:
    """Write a picture for each direction of the light, and print the paths.

    Parameters
    ----------
    name : str
        A material of the recipe (by default every preset) or of the store.
    lights : sequence of (float, float) [degree]
        theta_i in [0, 90) and phi_i.
    out : path
        The directory; it is made if it is missing.
    store, recipe_path : path, optional
        Store and recipe whose materials are known.
    wavelength_nm : float [nm]
        Wavelength at which a spectral material is seen.
    settings : sequence of str
        Settings of the instrument, ``name=value``.
    seed : int
        Seed of the noise.

    Raises
    ------
    ParameterError
        If the material, a light or a setting is not allowed.
    WriteError
        If a file cannot be written.
    """
    source, _ = named_source(name, store, recipe_path)
    instrument = instrument_of(settings)
    brdf = source.brdf_at(np.array([wavelength_nm]) if source.spectral else None)
    for theta, phi in lights:
        check_azimuth_deg("--light", phi)
        if not 0.0 <= theta < 90.0:
            raise ParameterError("--light", f"{theta:g} degrees is not in [0, 90)", theta, (0.0, 90.0))
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WriteError(f"cannot write to {out}: {error.strerror or error}") from error
    paths = []
    with terminal.progress(counted=True, transient=True) as bar:
        task = bar.add_task(name, total=len(lights))
        for number, (theta, phi) in enumerate(lights):
            picture = photograph(brdf, instrument, float(radians(theta)), float(radians(phi)), seed + number, name)
            paths.append(out / f"{name}_{theta:g}_{phi:g}.exr")
            write_picture(picture, paths[-1])
            bar.advance(task)
    for path in paths:
        print(path)
    return paths


def instrument_of(settings: Sequence[str]) -> Gonioreflectometer:
    """Return the instrument with settings ``name=value``; ParameterError if one is not allowed."""
    known = {field.name: getattr(Gonioreflectometer(), field.name) for field in fields(Gonioreflectometer)}
    values: dict[str, Any] = {}
    for setting in settings:
        name, _, text = setting.partition("=")
        if name not in known:
            raise ParameterError(f"--set {setting}", f"the settings are {', '.join(known)}", name, tuple(known))
        kind = type(known[name])
        try:
            values[name] = tuple(map(float, text.split(","))) if kind is tuple else kind(text)
        except ValueError:
            raise ParameterError(
                f"--set {setting}", f"{text!r} is no {'list of numbers' if kind is tuple else 'number'}", text
            ) from None
    return Gonioreflectometer(**values)
