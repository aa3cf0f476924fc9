"""The error of a table against its model, measured at directions that are not its nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.error import Error, Overall
from brdfdb.geometry import radians, unit_vector
from brdfdb.grids import Grid
from brdfdb.layout import Layout
from brdfdb.lookup import Table, points
from brdfdb.materials import Material
from brdfdb.parameters import Floats, Lobe
from brdfdb.sampling import lobe_of, mirrored_in_lobe, mixture_density

BANDS_DEG = np.linspace(0.0, 90.0, 10)  # of theta_i
FLOOR = 1e-3  # of the Lambertian BRDF with the albedo of the material
WIDTHS = (1.0, 2.0)  # of the lobes that directions are drawn in, of the material's own
DIRECTIONS = 4000  # of each band; of more than _FEW wavelengths, each with errors of its own, fewer
_FEW, _FEWER_DIRECTIONS = 4, 3000
SEED = 1991
_WINDOW = 1 << 21  # values of a table that are held at a time
_MODEL = 1 << 16  # directions at which the model is evaluated at a time


class Draw(NamedTuple):
    """Pairs of directions: unit vectors (N, 3), the band of theta_i of each, and what an integral weighs it with.

    `weight` is cos theta_r over the density with which the viewer was drawn; 0 below the horizon. `in_lobe` says which
    viewers were drawn in the lobe.
    """

    wi: Floats
    wr: Floats
    band: NDArray[np.int64]
    weight: Floats
    in_lobe: NDArray[np.bool_]

    @property
    def above(self) -> NDArray[np.bool_]:
        """Which viewers are above the horizon."""
        return np.asarray(self.weight > 0.0)


def draw(material: Material, wavelength_nm: NDArray[np.float64] | None, count: int, seed: int) -> Draw:
    """`count` pairs of directions a band, half of the viewers over the hemisphere and half in the lobe.

    theta_i is uniform in its band, phi_i in the circle. Over the hemisphere the solid angle is uniform; in the lobe the
    light is mirrored in half vectors that follow `ModelSpec.lobe`, of the wavelengths in turn, or a lobe twice as wide:
    its own Gaussian hardly ever reaches the shoulder where the lobe ends. Viewers of a model without a lobe are all
    drawn over the hemisphere.
    """
    rng = np.random.default_rng(seed)
    band = np.repeat(np.arange(BANDS_DEG.size - 1), count)
    theta_i = radians(BANDS_DEG[band] + rng.random(band.size) * np.diff(BANDS_DEG)[band])
    wi = unit_vector(theta_i, rng.uniform(0.0, 2.0 * np.pi, band.size))
    u, angle = 1.0 - rng.random(band.size), rng.uniform(0.0, 2.0 * np.pi, band.size)
    over = unit_vector(np.arccos(u), angle)
    if material.spec.lobe is None:
        return Draw(wi, over, band, over[:, 2] * (2.0 * np.pi), np.zeros(band.size, dtype=bool))
    turns = np.arange(band.size) % (1 if wavelength_nm is None else wavelength_nm.size)
    spectrum = material.arguments(wavelength_nm)
    lobe = lobe_of(material.spec, wi, {name: v[turns] if np.ndim(v) else v for name, v in spectrum.items()})
    lobes = [Lobe(np.ones(1), width * lobe.alpha_x, width * lobe.alpha_y) for width in WIDTHS]
    which = rng.random(band.size) * 2 * len(lobes)  # one half over the hemisphere, the other among the lobes
    wr = over
    for number, drawn in enumerate(lobes):
        chosen = (which >= number) & (which < number + 1)
        wr = np.where(chosen[:, np.newaxis], mirrored_in_lobe(u, angle, wi, drawn), wr)
    density = 0.5 / (2.0 * np.pi) + 0.5 * np.mean([mixture_density(drawn, wi, wr) for drawn in lobes], axis=0)
    return Draw(wi, wr, band, np.where(wr[:, 2] > 0.0, wr[:, 2], 0.0) / density, which < len(lobes))


def model_values(material: Material, wavelength_nm: NDArray[np.float64] | None, wi: Floats, wr: Floats) -> Floats:
    """f_r [1/sr] of the model, of shape (N, L), L = 1 for a grey material."""
    brdf = material.brdf_at(wavelength_nm)
    values = np.empty((len(wi), 1 if wavelength_nm is None else wavelength_nm.size))
    for start in range(0, len(wi), _MODEL):
        some = slice(start, start + _MODEL)
        values[some] = brdf(wi[some], wr[some])
    return values


def floor_of(truth: Floats, drawn: Draw) -> Floats:
    """The floor [1/sr] of relative errors at each wavelength: `FLOOR` of the Lambertian BRDF of the same albedo."""
    return np.asarray(FLOOR / np.pi * np.mean(drawn.weight[:, np.newaxis] * truth, axis=0))


def relative(found: Floats, truth: Floats, floor: Floats) -> Floats:
    """abs(found - truth) / max(truth, floor); 0 where nothing is and nothing was found."""
    scale = np.maximum(truth, floor)
    error = np.abs(found - truth)
    return np.divide(error, scale, out=np.where(error > 0.0, np.inf, 0.0), where=scale > 0.0)


def mean_error(found: Floats, truth: Floats, weight: Floats) -> Floats:
    """Weighted mean of abs(found - truth) over that of truth, for each row of weights and each wavelength; or 0."""
    wrong, whole = weight @ np.abs(found - truth), weight @ truth
    return np.divide(wrong, whole, out=np.zeros_like(wrong), where=whole > 0.0)


def classes(drawn: Draw) -> dict[str, NDArray[np.bool_]]:
    """Which viewers of a draw look forward or back, within 45 degrees of azimuth, and which pairs graze, beyond 75."""
    wi, wr = drawn.wi, drawn.wr
    along = np.sum(wi[:, :2] * wr[:, :2], axis=1)
    across = np.hypot(*wi[:, :2].T) * np.hypot(*wr[:, :2].T)
    return {
        "forward": along < -np.sqrt(0.5) * across,
        "back": along > np.sqrt(0.5) * across,
        "grazing": np.minimum(wi[:, 2], wr[:, 2]) < np.cos(radians(75.0)),
    }


def measure(
    layout: Layout, read: Callable[[slice], NDArray[np.float32]], count: int | None = None, seed: int = SEED
) -> Error:
    """Measure the error of a table.

    Parameters
    ----------
    layout : Layout
        Of the table.
    read : callable
        Gives some rows of the first axis of the stored array. Large tables are read piece by piece.
    count : int, optional
        Directions a band of theta_i, by default 4000, or 3000 of more than four wavelengths.
    seed : int
        Of the directions.

    Returns
    -------
    Error
        For each band and wavelength, and overall, to three digits.
    """
    if count is None:
        several = layout.wavelength_nm is not None and layout.wavelength_nm.size > _FEW
        count = _FEWER_DIRECTIONS if several else DIRECTIONS
    drawn = draw(layout.material, layout.wavelength_nm, count, seed)
    truth = model_values(layout.material, layout.wavelength_nm, drawn.wi, drawn.wr)
    return compare(_looked_up(layout, read, drawn).reshape(truth.shape), truth, drawn, seed)


def compare(found: Floats, truth: Floats, drawn: Draw, seed: int = SEED) -> Error:
    """The error of values of f_r, shape (N, L), against the truth at the directions of a draw."""
    floor = floor_of(truth, drawn)
    count = BANDS_DEG.size - 1
    # rows of weights: each band of theta_i, then all of them
    weights = np.concatenate(
        [np.where(drawn.band == np.arange(count)[:, np.newaxis], drawn.weight, 0.0), [drawn.weight]]
    )
    l1 = mean_error(found, truth, weights)
    error = np.ascontiguousarray(relative(found, truth, floor).T)
    chosen = [drawn.above & (drawn.band == band) for band in range(count)] + [drawn.above]
    percentiles = [np.percentile(error[:, rows], [50.0, 95.0, 99.0, 100.0], axis=1) for rows in chosen]
    # [statistic][band][wavelength]
    bands = np.stack([l1[:-1], *np.moveaxis(np.stack(percentiles[:-1]), 1, 0)])
    worst = np.concatenate([[l1[-1].max()], percentiles[-1].max(axis=-1)])
    names = tuple(Overall.model_fields)
    return Error(
        theta_i_deg=BANDS_DEG.tolist(),
        directions=int(np.count_nonzero(drawn.above)),
        seed=seed,
        floor=_short(floor),
        overall=Overall(**dict(zip(names, _short(worst), strict=True))),
        **{name: [_short(row) for row in rows] for name, rows in zip(names, bands, strict=True)},
    )


def _looked_up(layout: Layout, read: Callable[[slice], NDArray[np.float32]], drawn: Draw) -> Floats:
    """The values of a table at the directions of a draw, read in windows of rows with one more on either side."""
    rows = layout.shape[0]
    step = max(2, min(rows, _WINDOW // (layout.size // rows)))
    if step >= rows:
        return Table.of(layout, read(slice(0, rows))).lookup_vectors(drawn.wi, drawn.wr)
    grid = layout.grid
    x = points(grid, drawn.wi, drawn.wr)
    row = np.clip(np.searchsorted(radians(next(iter(grid.axes.values()))), x[0], side="right") - 1, 0, rows - 2)
    found = np.zeros((len(drawn.wi), 1 if layout.wavelength_nm is None else layout.wavelength_nm.size))
    for start in range(0, rows - 1, step):
        here = (row >= start) & (row < start + step)
        window = slice(max(start - 1, 0), min(start + step + 2, rows))
        table = Table.of(layout, read(window), Grid.part(grid, window))
        found[here] = table.lookup_vectors(drawn.wi[here], drawn.wr[here]).reshape(-1, found.shape[1])
    return found


def _short(values: Floats) -> list[float]:
    """Numbers to three digits."""
    return [float(f"{value:.3g}") for value in values.tolist()]
