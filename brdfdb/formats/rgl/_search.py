"""The smallest file of RGL's format that is as near to a table as was asked for."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.formats._channels import RGB, Channels, channels_of, names_of
from brdfdb.formats.rgl._fields import Array, Fields, Floats32, MixedSlices, Warp, bilinear, of_azimuth, of_polar_angle
from brdfdb.formats.rgl._surface import LAST_THETA, HalfVectorSurface, densities, lights
from brdfdb.parameters import Floats

if TYPE_CHECKING:
    from brdfdb.formats._stated_error import Comparison, FileError
    from brdfdb.tables.table import Table

GREY_NM = 550.0  # the wavelength of grey tables; readers continue a single one to all
_HORIZON = 0.94  # share of rows above the horizon, of warps that end there
# Rungs from small to large: rows and columns, lights, and azimuths of a quarter of anisotropic tables
_SIZES = (10, 14, 20, 28, 36, 44, 52, 58, 64, 72, 80, 88, 96, 106, 116)
_LIGHTS = (8, 11, 15, 22, 28, 34, 40, 45, 50, 56, 62, 69, 76, 84, 92)
_ANISOTROPIC_SIZES = (16, 24, 32, 40, 48, 56, 64, 74, 84)
_ANISOTROPIC_LIGHTS = (8, 12, 16, 19, 23, 26, 30, 35, 40)
_AZIMUTHS = (5, 7, 9, 11, 13, 15, 17, 19, 22)
_FIRST = 5  # rung that is tried first
_STEP = 1.4  # factor by which the error falls, about, from rung to rung
_COARSE = 30  # size below which densities have half of the nodes
_FEW = 3  # channels that rungs are compared by
_OF_SPECTRUM = 0.5  # share of the tolerance that straight lines between wavelengths may take
_REMEMBERED = 3  # files: the search returns to the one before the last
_PAIRS = 4001  # pairs of directions that they are tested with
_PART = {2: "half", 4: "a quarter"}  # of the azimuths of the light, by their reduction
_TOWARDS_GRAZING = 1.5  # power of the spacing of theta_i: nodes are closer at grazing incidence
_LEAST_LUMINANCE = 1e-6  # share of the mean density of samples that each place has at least
# Readers join values by straight lines, which lie above a bend by h**2/8 f''. Values that are lower by a part of that
# leave half of it on either side
_LOWERED = 1.0 / 20.0
# Mitsuba reads a light in the plane y = 0 at the azimuth +pi, and continues the last azimuth to it. Files of a
# quarter therefore have one azimuth more, this far beyond the quarter [rad], with the values of -pi
_BEYOND = 0.2


@dataclass(frozen=True, eq=False)
class RglFit:
    """The fields of a file, its error, the names of its channels, and remarks."""

    fields: Fields
    error: FileError
    channels: tuple[str, ...]
    remarks: tuple[str, ...]


def smallest(table: Table, kind: str, tolerance: float, most_bytes: float, full: bool = False) -> RglFit:
    """Return the smallest file of a kind, "spectral" or "rgb", within a tolerance; else the best one of `most_bytes`.

    If `full`, the file holds all azimuths of the light. ParameterError if the smallest file is larger.
    """
    if table.wavelength_nm is not None:
        return _smallest(table, kind, tolerance, most_bytes, full)
    if kind == "spectral":
        return _smallest_grey(table, tolerance, most_bytes, full)
    copies = len(RGB)
    fit = _smallest_grey(table, tolerance, most_bytes, full)
    if fit.fields.nbytes + (copies - 1) * fit.fields.spectra.nbytes > most_bytes:
        fit = _smallest_grey(table, tolerance, most_bytes, full, copies)
    fields = replace(fit.fields, spectra=np.repeat(fit.fields.spectra, copies, axis=2), wavelength_nm=None)
    return replace(fit, fields=fields, channels=RGB, remarks=(*channels_of(table, "rgb").remarks, *fit.remarks))


@functools.lru_cache(maxsize=2)
def _smallest_grey(table: Table, tolerance: float, most_bytes: float, full: bool, copies: int = 1) -> RglFit:
    """Return the file of a grey table, which holds its values so many times.

    Those for both kinds of renderers have the same values, if both are small enough.
    """
    return _smallest(table, "spectral", tolerance, most_bytes, full, copies)


def _smallest(table: Table, kind: str, tolerance: float, most_bytes: float, full: bool, copies: int = 1) -> RglFit:
    from brdfdb.formats._stated_error import Comparison

    channels = channels_of(table, "" if kind == "spectral" else "rgb")
    remarks = channels.remarks
    search = _RglSearch(table, Comparison(table, channels), kind, tolerance, full)
    if search.surface.reduction > 1:
        remarks += (
            f"the file holds {_PART[search.surface.reduction]} of the azimuths of the light, which Mitsuba 3 mirrors; "
            "for pbrt-v4 and RGL's loader write it with azimuth full",
        )
    ladders = search.ladders(most_bytes, copies)
    first = [search.p99(plans[min(_FIRST, len(plans) - 1)]) for plans in ladders]
    best = search.best(ladders[int(np.argmin(first))])
    names = channels.names if search.nodes is None else names_of(search.nodes)
    return RglFit(best.fields, best.error, names, remarks)


class FittedFields(NamedTuple):
    """The fields of a file, and its error against the table."""

    fields: Fields
    error: FileError


class _RglSearch:
    """Files of one table, compared with it."""

    def __init__(self, table: Table, comparison: Comparison, kind: str, tolerance: float, full: bool) -> None:
        self._comparison = comparison
        self._tolerance = tolerance
        self._name = table.name
        channels = comparison.channels
        at = channels.wavelength_nm if kind == "spectral" else None
        self._kept = np.arange(len(channels.names)) if at is None else _thinned(comparison, at, tolerance)
        self.nodes = None if at is None else at[self._kept]
        self._mixing = None if at is None else _lines(at, at[self._kept])
        self._known: dict[RglPlan, float] = {}
        self._files: dict[RglPlan, Fields] = {}
        self._of_file: Floats32 | None = None
        if kind == "spectral":
            self._of_file = np.array([GREY_NM] if self.nodes is None else self.nodes, np.float32)
        self.surface = HalfVectorSurface(table, _some(channels, self._kept), full)
        few = np.unique(np.linspace(0, self._kept.size - 1, _FEW).astype(np.int64))
        self._few = few
        self._sample = self.surface
        if few.size < self._kept.size:
            self._sample = HalfVectorSurface(table, _some(channels, self._kept[few]), full)

    def ladders(self, most_bytes: float, copies: int = 1) -> list[list[RglPlan]]:
        """Return plans from small to large: of isotropic tables with both kinds of warps.

        The values are held so many times. ParameterError if there is none of at most so many bytes.
        """
        if self.surface.isotropic:
            rungs = list(zip(_SIZES, _LIGHTS, strict=True))
            soft = [RglPlan(s, n, 1, *((33, 65) if s > _COARSE else (17, 33))) for s, n in rungs]
            hard = [RglPlan(s, n, 1, *((65, 65) if s > _COARSE else (33, 33)), _HORIZON) for s, n in rungs]
            ladders = [soft, hard]
        else:
            parts = 4 // self.surface.reduction
            quarters = zip(_ANISOTROPIC_SIZES, _ANISOTROPIC_LIGHTS, _AZIMUTHS, strict=True)
            ladders = [
                [RglPlan(s, n, parts * (p - 1) + 1, *((33, 33) if s > _COARSE else (17, 17))) for s, n, p in quarters]
            ]
        fitting = [[plan for plan in ladder if self._nbytes(plan, copies) <= most_bytes] for ladder in ladders]
        if not any(fitting):
            least = min(self._nbytes(ladder[0], copies) for ladder in ladders)
            raise ParameterError(
                "megabytes",
                f"{most_bytes / 1e6:.3g} MB for the values are too few: the smallest file of {self._name} needs "
                f"{least / 1e6:.3g} MB",
                most_bytes / 1e6,
            )
        return [ladder for ladder in fitting if ladder]

    def best(self, ladder: list[RglPlan]) -> FittedFields:
        """Return the first of a ladder within the tolerance, else the last."""
        low = 0
        high = len(ladder) - 1
        rung = min(_FIRST, len(ladder) - 1)
        while low < high:
            p99 = self.p99(ladder[rung])
            low, high = (low, rung) if p99 <= self._tolerance else (min(rung + 1, high), high)
            steps = round(math.log(max(p99, 1e-9) / self._tolerance) / math.log(_STEP))
            rung = min(max(rung + steps, low), max(low, high - 1))
        for plan in ladder[low:]:
            fields = self._built(plan)
            error = self._comparison.error_of(functools.partial(self._evaluated, fields))
            if error.p99 <= self._tolerance:
                break
        return FittedFields(fields, error)

    def _built(self, plan: RglPlan) -> Fields:
        """Return the fields of a plan with all channels; the fields of the last few plans are cached."""
        if plan not in self._files:
            if len(self._files) >= _REMEMBERED:
                del self._files[next(iter(self._files))]
            self._files[plan] = build(self.surface, plan, self._of_file)
        return self._files[plan]

    def p99(self, plan: RglPlan) -> float:
        """Return p99 of a plan over a few channels."""
        if plan not in self._known:
            whole = self._sample is self.surface
            fields = self._built(plan) if whole else build(self._sample, plan, self._of_file)

            def evaluate(wi: Floats, wr: Floats) -> Floats:
                values = self._comparison.truth.copy()
                values[:, self._kept[self._few]] = fields.evaluate(wi, wr)
                return values

            self._known[plan] = self._comparison.error_of(evaluate).p99
        return self._known[plan]

    def _evaluated(self, fields: Fields, wi: Floats, wr: Floats) -> Floats:
        """Return f_r [1/sr] of a file at the wavelengths of the table."""
        values = fields.evaluate(wi, wr)
        return values if self._mixing is None else np.asarray(values @ self._mixing)

    def _nbytes(self, plan: RglPlan, copies: int) -> int:
        """Return the size of the values of a plan [byte]."""
        texels = (copies * self._kept.size + 1) * plan.size**2 + plan.rows * plan.columns
        azimuths = plan.azimuths + (1 if self.surface.reduction == 4 else 0)  # as `build` adds one
        factors = sum(factor.size for factor in self.surface.factors)
        return 4 * (plan.lights * azimuths * texels + factors)


def _some(channels: Channels, kept: NDArray[np.int64]) -> Channels:
    """Return some of the channels."""
    names = tuple(channels.names[index] for index in kept)
    if channels.wavelength_nm is None:
        return Channels(names, None, None, channels.meaning)
    if channels.weights is None:
        return Channels(names, channels.wavelength_nm[kept], None, channels.meaning)
    return Channels(names, channels.wavelength_nm, channels.weights[:, kept], channels.meaning)


def _thinned(comparison: Comparison, at: Floats, tolerance: float) -> NDArray[np.int64]:
    """Return the numbers of wavelengths [nm] that are enough, because readers join them by straight lines."""
    truth = comparison.truth[:_PAIRS]
    scale = np.maximum(truth, comparison.floor) + 1e-30
    kept = [0, at.size - 1] if at.size > 1 else [0]
    while len(kept) < at.size:
        wrong = np.abs(truth[:, kept] @ _lines(at, at[kept]) - truth) / scale
        p99 = np.percentile(wrong, 99.0, axis=0)
        if p99.max() <= _OF_SPECTRUM * tolerance:
            break
        kept = sorted({*kept, int(np.argmax(p99))})
    return np.array(kept)


def _lines(at: Floats, nodes: Floats) -> Floats:
    """Return the matrix (nodes, wavelengths) of straight lines between nodes."""
    return np.stack([np.interp(at, nodes, one) for one in np.eye(nodes.size)])


@dataclass(frozen=True)
class RglPlan:
    """Numbers of nodes of a file."""

    size: int  #: rows and columns of `spectra` and `luminance`
    lights: int  #: nodes of theta_i
    azimuths: int = 1  #: nodes of phi_i over the part of the circle that the file holds; isotropic tables have one
    #: those of `vndf`
    rows: int = 2
    columns: int = 2
    horizon: float = 0.0  #: share of each row above the horizon, as in `densities`


def build(surface: HalfVectorSurface, plan: RglPlan, wavelength_nm: Floats32 | None) -> Fields:
    """Return the fields of a table, whose channels have these wavelengths, or are R, G, B."""
    part = np.linspace(0.0, 1.0, plan.lights)
    theta_i = (LAST_THETA * (1.0 - (1.0 - part) ** _TOWARDS_GRAZING)).astype(np.float32)
    span = 2.0 * np.pi / surface.reduction
    azimuths = np.zeros(1) if surface.isotropic else np.linspace(-np.pi, -np.pi + span, plan.azimuths)
    phi_i = azimuths.astype(np.float32)
    wi = lights(theta_i, phi_i).reshape(-1, 1, 1, 3)
    ndf, sigma = surface.factors
    horizon = np.round(plan.horizon * (plan.size - 1)) / (plan.size - 1)  # at a node of the values
    vndf = densities(surface, wi, ndf, plan.rows, plan.columns, float(horizon))
    warp = Warp(vndf)
    x, y = warp.forward(plan.size)
    values = surface.values(wi, x, y)
    # The density of each slice at its own points
    numbers = np.repeat(np.arange(len(x)), plan.size**2)
    slices = MixedSlices(numbers[np.newaxis], np.ones((1, numbers.size)))
    density = warp.density(slices, x.reshape(-1), y.reshape(-1)).reshape(x.shape)
    luminance = np.maximum(values.brdf.mean(axis=-1) * values.solid_angle, 0.0) / density
    mean = luminance.mean(axis=(1, 2), keepdims=True)
    luminance = np.maximum(luminance, _LEAST_LUMINANCE * mean) + 1e-30
    u_i = of_polar_angle(np.tile(theta_i.astype(np.float64), phi_i.size)), of_azimuth(np.repeat(phi_i, theta_i.size))
    scale = bilinear(ndf, x, y) / (4.0 * bilinear(sigma, *u_i))[:, np.newaxis, np.newaxis]
    shape = (phi_i.size, theta_i.size)
    spectra = np.moveaxis(values.brdf / scale[..., np.newaxis], -1, 1)
    spectra = spectra.reshape(*shape, *spectra.shape[1:])
    nodes = np.arange(plan.size)
    spectra = spectra - _LOWERED * sum(
        _bend(spectra, axis, at) for axis, at in ((0, phi_i), (1, theta_i), (3, nodes), (4, nodes))
    )
    vndf = vndf.reshape(*shape, *vndf.shape[1:])
    luminance = luminance.reshape(*shape, *luminance.shape[1:])
    if surface.reduction == 4:
        phi_i = np.append(phi_i, np.float32(phi_i[-1] + _BEYOND))
        vndf, luminance, spectra = (np.concatenate([part, part[:1]]) for part in (vndf, luminance, spectra))
    # below the horizon values are 0: renderers reject samples below 0, which lines from there give beside it
    return Fields(
        theta_i=theta_i,
        phi_i=phi_i,
        ndf=ndf,
        sigma=sigma,
        vndf=vndf,
        luminance=luminance.astype(np.float32),
        spectra=np.maximum(spectra, 0.0).astype(np.float32),
        wavelength_nm=wavelength_nm,
    )


def _bend(values: Array, axis: int, nodes: NDArray[Any]) -> Array:
    """Return h**2 times the second derivative of values along an axis; 0 at its ends."""
    bend = np.zeros_like(values)
    if nodes.size >= 3:
        along = np.moveaxis(values, axis, -1)
        result = np.moveaxis(bend, axis, -1)
        h = np.diff(nodes.astype(np.float64))
        second = np.diff(np.diff(along, axis=-1) / h, axis=-1) / (0.5 * (h[1:] + h[:-1]))
        result[..., 1:-1] = second * 0.5 * (h[1:] ** 2 + h[:-1] ** 2)
    return bend
