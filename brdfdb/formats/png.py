"""PNG: pictures of a table, its lit sphere and its slices.

A picture shows the sphere in the light of one lamp, or a slice of f_r. All tables have the same exposure. The colours
have 8 bits, so that no values can be read back, and no error is stated.

Spectral tables are shown in sRGB. A slice of an anisotropic table has one azimuth of the light. The specular part is
left out.
"""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from brdfdb.errors import import_extra
from brdfdb.formats._interface import FormatOption
from brdfdb.formats._record import record
from brdfdb.formats._written import Written, whole
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

SPHERE = "sphere"
suffix = ".png"
media_type = "image/png"
summary = "lit spheres and slices of tables as PNG files"
tools = "every viewer of pictures; the numbers are in the other formats"
kinds = (SPHERE, "lobe", "half_difference", "in_plane")
options = (
    FormatOption("size", 160.0, "width and height of a sphere [pixels]", low=16.0, high=2048.0, most_served=512.0),
    FormatOption("theta_i", 45.0, "polar angle of the light of a lobe [degrees]", low=0.0, high=90.0),
    FormatOption("phi_i", 0.0, "azimuth of the light, or of the half vector [degrees]", low=-720.0, high=720.0),
)

_TONES = "sRGB of x / (1 + x), x = pi f_r: a white Lambertian surface is half as bright as the brightest light"
_LIT = "sRGB of a lit sphere; a white Lambertian one has 80 % of the screen's white where it is brightest"


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    kind: str = SPHERE,
    size: float = 160.0,
    theta_i: float = 45.0,
    phi_i: float = 0.0,
    verdict: str | None = None,
) -> Written:
    """Write a picture of a table as a PNG file of 8 bits.

    The sphere is that of `brdfdb.scenes.lit_sphere`, the slices are those of `brdfdb.tables.slices`. All tables have
    the same exposure. Values of slices are compressed, x / (1 + x) of x = pi f_r, so that a diffuse surface and a
    highlight a thousand times brighter are both seen. Texts in the file are the record, and how its colours were made.
    """
    from brdfdb.formats._pictures import rgb_of, slice_of
    from brdfdb.scenes.lit_sphere import lit_sphere
    from brdfdb.spectra import colour_science

    imsave = import_extra("matplotlib.image").imsave
    if kind == SPHERE:
        pixels = lit_sphere(table, round(size))
        tones = _LIT
    else:
        image = slice_of(table, kind, theta_i, phi_i)
        values, meaning = rgb_of(image)
        bright = np.pi * np.maximum(values, 0.0).astype(np.float64)
        pixels = np.asarray(colour_science().cctf_encoding(bright / (1.0 + bright), function="sRGB"))
        tones = f"{_TONES}; {meaning}; {image.description}"
    texts: dict[str, Any] = {
        "Software": "brdfdb",
        "Title": f"{table.name}: {kind}",
        "Description": tones,
        "Comment": json.dumps(record(table, None, verdict, holds=tones)),
    }
    with whole(path) as (temporary,):
        imsave(temporary, np.round(255.0 * pixels).astype(np.uint8), format="png", metadata=texts)
    return Written((path_of(path),))
