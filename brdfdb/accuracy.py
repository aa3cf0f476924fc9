"""The error of a table against its model, measured at directions that are not its nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import unit_vector
from brdfdb.layout import Layout
from brdfdb.lookup import Table
from brdfdb.materials import Material
from brdfdb.parameters import Floats
from brdfdb.sampling import lobe_of, mirrored_in_lobe, mixture_density

BANDS_DEG = np.linspace(0.0, 90.0, 10)  # of theta_i
FLOOR = 1e-3  # of the Lambertian BRDF with the albedo of the material: errors of smaller values are relative to this
DIRECTIONS = 8000  # of each band
SEED = 1991


class Draw(NamedTuple):
    """Pairs of directions: unit vectors (N, 3), the band of theta_i of each, and what an integral weighs it with.

    `weight` is cos theta_r over the density with which the viewer was drawn; 0 below the horizon.
    """

    wi: Floats
    wr: Floats
    band: NDArray[np.int64]
    weight: Floats


def draw(material: Material, wavelength_nm: NDArray[np.float64] | None, count: int, seed: int) -> Draw:
    """`count` pairs of directions a band, half of the viewers over the hemisphere and half in the lobe.

    theta_i is uniform in its band, phi_i in the circle. Over the hemisphere the solid angle is uniform; in the lobe the
    light is mirrored in half vectors that follow `ModelSpec.lobe`, of wavelengths in turn. Viewers of a model without a
    lobe are all drawn over the hemisphere.
    """
    rng = np.random.default_rng(seed)
    bands = BANDS_DEG.size - 1
    band = np.repeat(np.arange(bands), count)
    theta_i = np.deg2rad(BANDS_DEG[band] + rng.random(band.size) * np.diff(BANDS_DEG)[band])
    wi = unit_vector(theta_i, rng.uniform(0.0, 2.0 * np.pi, band.size))
    u, angle = 1.0 - rng.random(band.size), rng.uniform(0.0, 2.0 * np.pi, band.size)
    over = unit_vector(np.arccos(u), angle)
    density = np.where(over[:, 2] >= 0.0, 1.0 / (2.0 * np.pi), 0.0)
    if material.spec.lobe is None:
        return Draw(wi, over, band, over[:, 2] / density)
    spectrum = material.arguments(wavelength_nm)
    turns = np.arange(band.size) % (1 if wavelength_nm is None else wavelength_nm.size)
    of_each = {name: np.asarray(v)[turns] if np.ndim(v) else v for name, v in spectrum.items()}
    lobe = lobe_of(material.spec, wi, of_each)
    lobe = lobe._replace(share=np.ones(1))
    in_lobe = np.arange(band.size) // 2 % 2 == 0
    wr = np.where(in_lobe[:, np.newaxis], mirrored_in_lobe(u, angle, wi, lobe), over)
    above = wr[:, 2] > 0.0
    mixed = 0.5 * mixture_density(lobe, wi, wr) + 0.5 / (2.0 * np.pi)
    return Draw(wi, wr, band, np.where(above, wr[:, 2], 0.0) / mixed)


def measured(layout: Layout, read: Callable[[slice], NDArray[np.float32]]) -> dict[str, Any]:
    return compare(Table.of(layout, read(slice(0, layout.shape[0]))), layout, draw(layout.material, layout.wavelength_nm, DIRECTIONS, SEED))


def model_values(material: Material, wavelength_nm: NDArray[np.float64] | None, wi: Floats, wr: Floats) -> Floats:
    """f_r [1/sr] of the model, of shape (N, L), L = 1 for a grey material."""
    spectrum = [material.arguments()] if wavelength_nm is None else [material.arguments(w) for w in wavelength_nm]
    return np.stack([material.spec.vectors(wi, wr, **arguments) for arguments in spectrum], axis=-1)


def relative(found: Floats, truth: Floats, drawn: Draw) -> tuple[Floats, Floats]:
    floor = FLOOR / np.pi * np.mean(drawn.weight[:, np.newaxis] * truth, axis=0)
    error = np.abs(found - truth) / np.maximum(np.maximum(truth, floor), 1e-300)
    return error, floor


def compare(table: Table, layout: Layout, drawn: Draw) -> dict[str, Any]:
    truth = model_values(layout.material, layout.wavelength_nm, drawn.wi, drawn.wr)
    found = table.lookup_vectors(drawn.wi, drawn.wr).reshape(truth.shape)
    error, floor = relative(found, truth, drawn)
    above = drawn.weight > 0.0
    q = lambda e: np.percentile(e, [50, 95, 99, 100], axis=0)
    return {"all": q(error[above]), "bands": np.stack([q(error[above & (drawn.band == b)]) for b in range(9)]), "floor": floor}
