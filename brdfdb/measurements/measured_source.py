"""Measured data as a source: samples that are interpolated, or f_r of a file that is known everywhere."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import PrivateAttr

from brdfdb.errors import ParameterError
from brdfdb.geometry import radians, unit_vector
from brdfdb.materials import FunctionSource
from brdfdb.materials.source import Evaluate
from brdfdb.measurements import laws, symmetry
from brdfdb.measurements.colours import rgb_of, spectra_of_colours
from brdfdb.measurements.extent import Extent
from brdfdb.measurements.interpolation import Base, fit, floor_of
from brdfdb.measurements.record import Change, Measured, Noise
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Floats
from brdfdb.spectra import PICTURE_NM

_COLOURS = (("R", "G", "B"), ("X", "Y", "Z"))
_LIGHTS_DEG = (10.0, 20.0, 30.0)  # where the width of a lobe is looked for
_HALF_DEG = np.append(0.0, np.geomspace(0.02, 60.0, 160))  # the half vectors there, crowded where lobes are narrow
MARGIN = 0.003  # of the albedo of data that are made to conserve energy: measured tables exceed them by 0.0012
_NARROWEST = 1e-3  # width [1] of lobes below which grids are those of this width
_CLEAR = 3.0  # a peak so many times as bright as the surface far from it is a lobe
_BETWEEN = 0.05  # share of the pairs of directions outside of the extent of a file that lists all: it has corners
_PROBED = 2000  # pairs at which the share of negative values of a function is counted


class MeasuredSource(FunctionSource):
    """Measured data as a source, which is tabulated, audited, charted and rendered like a material.

    Values are taken as they are: they may break reciprocity and energy. Values below 0 become 0. `of_samples` and
    `of_function` make one. Colours get a spectrum each, as `brdfdb.measurements.colours` says.

    Attributes
    ----------
    measured : Measured
        Origin of the data, what they say of symmetries, their errors, and what was changed.

    Examples
    --------
    >>> import numpy as np
    >>> from brdfdb.measurements import MeasuredSource
    >>> darker = MeasuredSource.of_function(
    ...     lambda wi, wr: 0.2 * wi[:, 2:], ("grey",), None, name="darker", title="Darker at grazing light",
    ...     provenance="made up for this example",
    ... )
    >>> darker.measured.reciprocity.assumed
    False
    >>> round(float(darker.lookup(np.pi / 3, 0.0, 0.0, 0.0)), 6)
    0.1
    """

    _measured: Measured = PrivateAttr()
    _channels_at: Evaluate = PrivateAttr()

    @property
    def measured(self) -> Measured:
        """Return the record of the data."""
        return self._measured

    @classmethod
    def of_samples(
        cls, samples: Samples, *, name: str = "", title: str = "", provenance: str = "", base: Base | None = None
    ) -> Self:
        """Return samples as a source: between them f_r is interpolated as `brdfdb.measurements.interpolation` says.

        Parameters
        ----------
        samples : Samples
            Ten or more. f_r is anisotropic if they have several azimuths of the light.
        name, title, provenance : str
            By default those of the samples.
        base : callable, optional
            f_r [1/sr] (N, C) at unit vectors, such as `Source.brdf_at` of a fit, to which the ratio is interpolated;
            by default Lambert and one lobe.

        Raises
        ------
        ParameterError
            If there are too few samples, no value is above 0, numbers far below 0 stand for holes, or the name has no
            letters or digits.
        """
        fitted = fit(samples, base)
        noise, uncertainty = None, samples.uncertainty
        if uncertainty is not None:
            relative = (uncertainty / np.maximum(np.abs(samples.values), floor_of(samples)))[samples.known]
            noise = Noise(**_named(("median", "p95"), np.nanpercentile(relative, [50.0, 95.0])))
        some = samples.known.any(axis=1)
        extent = Extent.of(samples, turned=samples.turned)
        known = samples.values[samples.known]
        measured = Measured(
            by=samples.instrument.name,
            channels=list(samples.channels),
            samples=int(np.count_nonzero(some)),
            incidences=int(np.unique(samples.incidence).size),
            holes=int(np.count_nonzero(~samples.known)),
            negative=float(f"{np.mean(known < 0.0):.3g}"),
            interpolation=f"asinh of f_r over noise, less that of {fitted.base}, by radial functions of directions",
            reciprocity=symmetry.reciprocity(fitted.f_r, extent, fitted.held_out.p99),
            mirror=None if samples.turned else _mirror_of(samples, fitted.held_out.p99),
            extrapolated=_extrapolated(extent),
            extent=extent,
            held_out=fitted.held_out,
            noise=noise,
        )
        return cls._of(
            fitted.f_r, samples.channels, samples.wavelength_nm, measured, samples.turned,
            name or samples.name, title or samples.name, provenance or samples.provenance or "a file of samples",
        )  # fmt: skip

    @classmethod
    def of_function(
        cls,
        evaluate: Evaluate,
        channels: tuple[str, ...],
        wavelength_nm: NDArray[np.float64] | None,
        *,
        name: str,
        title: str,
        provenance: str,
        noise: Noise | None = None,
        nodes: Samples | None = None,
    ) -> Self:
        """Return measured f_r that is known everywhere, such as that of a file, as a source.

        Parameters
        ----------
        evaluate : callable
            f_r [1/sr] (N, C) at unit vectors (N, 3) of light and viewer above the horizon.
        channels : tuple of str
            ("R", "G", "B"), ("X", "Y", "Z"), ("grey",), or wavelengths.
        wavelength_nm : array (C,) [nm] or None
            Wavelengths of the channels; None of colours and of grey data.
        name, title, provenance : str
            A slug, a line for people, and where the data come from.
        noise : Noise, optional
            Uncertainty of the values.
        nodes : Samples, optional
            Values at the directions that were measured: f_r outside of their `Extent` is marked as extrapolated. By
            default f_r is known everywhere, as it is where nearly all directions lie within.

        Raises
        ------
        ParameterError
            If a value is not finite.
        """
        wi, wr = symmetry.drawn_pairs()
        values = np.asarray(evaluate(wi[:_PROBED], wr[:_PROBED]))
        if not np.all(np.isfinite(values)):
            raise ParameterError("evaluate", f"{name} has values that are not finite", np.nan)

        def f_r(wi: Floats, wr: Floats) -> Floats:
            return np.maximum(evaluate(wi, wr), 0.0)

        known = None if noise is None else 2.6 * noise.p95
        turned = symmetry.is_turned(f_r, known)
        seen = None if turned else symmetry.mirror(f_r, known)
        if seen is not None and not seen.assumed:
            turned = True
        extent = None if nodes is None else Extent.of(nodes, turned=turned)
        if extent is not None and _extrapolated(extent) <= _BETWEEN:
            extent = None
        measured = Measured(
            channels=list(channels),
            samples=0,
            negative=float(f"{np.mean(values < 0.0):.3g}"),
            interpolation="as the tools of the file evaluate it",
            reciprocity=symmetry.reciprocity(f_r, extent, known),
            mirror=seen,
            extrapolated=None if extent is None else _extrapolated(extent),
            extent=extent,
            noise=noise,
        )
        mirrored = _mirrored(f_r) if seen is not None and seen.assumed and _differs(seen) else f_r
        return cls._of(mirrored, channels, wavelength_nm, measured, turned, name, title, provenance)

    @classmethod
    def _of(
        cls,
        f_r: Evaluate,
        channels: tuple[str, ...],
        wavelength_nm: NDArray[np.float64] | None,
        measured: Measured,
        turned: bool,
        name: str,
        title: str,
        provenance: str,
    ) -> Self:
        if channels in _COLOURS:
            wavelength_nm = PICTURE_NM
        elif wavelength_nm is not None:
            order = np.argsort(wavelength_nm)
            given = f_r
            f_r, wavelength_nm = (lambda wi, wr: given(wi, wr)[:, order]), wavelength_nm[order]
        width = _width(_mirrored(f_r) if measured.chiral else f_r) if measured.chiral or not turned else None
        source = cls(
            brdf=_brdf_of(f_r, channels, wavelength_nm),
            name=slug(name),
            title=title,
            provenance=provenance,
            wavelengths_nm=None if wavelength_nm is None else tuple(wavelength_nm.tolist()),
            anisotropic=turned,
            reciprocal=measured.reciprocity.assumed,
            alpha=None if width is None else (width, width),
        )
        source._measured, source._channels_at = measured, f_r
        return source

    def extrapolated(self, wi: Floats, wr: Floats) -> NDArray[np.bool_]:
        """Return which pairs of unit vectors (N, 3) lie outside of the directions that were measured."""
        extent = self._measured.extent
        return np.zeros(len(wi), dtype=bool) if extent is None else extent.outside(wi, wr)

    def recorded(self, **changes: Any) -> Self:
        """Return the source with some entries of its record changed."""
        changed = self.model_copy()
        changed._measured = self._measured.model_copy(update=changes)
        return changed

    def made(self, law: str, margin: float = MARGIN) -> Self:
        """Return the nearest source that keeps a law; its record says what was changed.

        Parameters
        ----------
        law : str
            "reciprocal": the mean of f_r and f_r with light and viewer exchanged. "conserving": f_r times one number
            for each light, the largest up to 1 that keeps the albedo at 1 or below; times that of the viewer, too, if
            it is reciprocal.
        margin : float [1]
            What the albedo stays below 1: room for the error of a table.

        Raises
        ------
        ParameterError
            If there is no such law.
        """
        if law not in ("reciprocal", "conserving"):
            raise ParameterError(
                "law", f"{law!r} is neither reciprocal nor conserving", law, ("reciprocal", "conserving")
            )
        before = self._channels_at
        if law == "reciprocal":
            after = laws.reciprocal(before)
        else:
            after = laws.conserving(before, reciprocal=self.reciprocal, turned=self.anisotropic, margin=margin)
        wi, wr = symmetry.drawn_pairs()
        old, new = before(wi, wr), after(wi, wr)
        floor = np.maximum(1e-3 * old.mean(axis=0), 1e-12)
        change = Change(
            law="reciprocal" if law == "reciprocal" else "conserving",
            changed=symmetry.spread_of(np.abs(new - old) / np.maximum(old, floor)),
        )
        kept = self._measured.reciprocity
        if law == "reciprocal":
            kept = kept.model_copy(update={"assumed": True})
        measured = self._measured.model_copy(update={"changes": [*self._measured.changes, change], "reciprocity": kept})
        at = None if self.wavelengths_nm is None else np.array(self.wavelengths_nm)
        return self._of(
            after, tuple(measured.channels), at, measured, self.anisotropic,
            self.name, self.title, self.provenance,
        )  # fmt: skip

    @cached_property
    def has_colours(self) -> bool:
        """Return True if the data are colours, whose spectra are made up."""
        return tuple(self._measured.channels) in _COLOURS

    def _check_function(self) -> None:
        """Take the data as they are."""


def slug(name: str) -> str:
    """Return a name as lower-case words joined by hyphens; ParameterError if nothing is left of it."""
    words = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
    if not words:
        raise ParameterError("name", f"{name!r} has no letters or digits", name)
    return words


def _extrapolated(extent: Extent) -> float:
    """Return the share of the pairs of directions, evenly over both hemispheres, that lie outside of an extent."""
    return float(f"{np.mean(extent.outside(*symmetry.drawn_pairs(up_to_deg=90.0))):.3g}")


def _named(names: tuple[str, ...], values: Floats) -> dict[str, float]:
    return {name: float(f"{value:.3g}") for name, value in zip(names, values, strict=True)}


def _brdf_of(f_r: Evaluate, channels: tuple[str, ...], wavelength_nm: NDArray[np.float64] | None) -> Callable[..., Any]:
    """Return f_r at wavelengths as `FunctionSource` takes it: straight lines between those of the data."""
    last: list[tuple[Floats, Floats, Floats]] = []  # tables evaluate wavelength after wavelength at the same directions

    def evaluated(wi: Floats, wr: Floats) -> Floats:
        for light, viewer, values in tuple(last):
            if np.array_equal(light, wi) and np.array_equal(viewer, wr):
                return values
        values = np.asarray(f_r(wi, wr))
        last[:] = [(wi, wr, values)]
        return values

    def brdf(wi: Floats, wr: Floats, at: NDArray[np.float64] | None) -> Floats:
        values = evaluated(wi, wr)
        if at is None or wavelength_nm is None:
            return values
        stored = spectra_of_colours() if channels in _COLOURS else np.eye(wavelength_nm.size)
        weights = np.stack([np.interp(at, wavelength_nm, row) for row in stored])
        values = rgb_of(channels, values) if channels in _COLOURS else values
        return np.asarray(np.maximum(np.einsum("nc,cl->nl", values, weights), 0.0))

    return brdf


def _mirrored(f_r: Evaluate) -> Evaluate:
    """Return the mean of f_r and that of the mirror image."""
    return lambda wi, wr: 0.5 * (f_r(wi, wr) + f_r(wi * symmetry.MIRROR, wr * symmetry.MIRROR))


def _differs(seen: Any) -> bool:
    return seen.asymmetry is not None and seen.asymmetry.max > 0.0


def _mirror_of(samples: Samples, noise: float) -> Any:
    """Return the mirror symmetry of samples of one azimuth of the light, by pairs that are mirror images."""
    rows = np.flatnonzero(samples.known.all(axis=1))
    delta = np.mod(samples.phi_r - samples.phi_i + np.pi, 2.0 * np.pi) - np.pi
    keys = np.round(np.stack([samples.theta_i, samples.theta_r, np.abs(delta)], axis=1)[rows], 5)
    _, place = np.unique(keys, axis=0, return_inverse=True)
    place = place.reshape(-1)
    left, right = (np.flatnonzero(side) for side in (delta[rows] > 0.0, delta[rows] < 0.0))
    _, a, b = np.intersect1d(place[left], place[right], return_indices=True)
    return symmetry.mirror_of_samples(samples.values[rows[left[a]]], samples.values[rows[right[b]]], noise)


def _width(f_r: Evaluate) -> float | None:
    """Return the width [1] of the lobe around the mirror direction, or None if there is none that is clear."""
    slopes = []
    for light in _LIGHTS_DEG:
        wi = np.broadcast_to(unit_vector(radians(light), 0.0), (_HALF_DEG.size, 3))
        # half vectors across the plane of incidence: the viewer stays above the horizon longest
        theta = radians(_HALF_DEG)
        along, across = unit_vector(radians(0.0), 0.0), np.array([0.0, 1.0, 0.0])
        half = np.cos(theta)[:, np.newaxis] * along + np.sin(theta)[:, np.newaxis] * across
        wr = 2.0 * np.sum(wi * half, axis=1, keepdims=True) * half - wi
        above = wr[:, 2] > 0.05
        values = f_r(wi[above], wr[above]).mean(axis=1)
        far, peak = float(values.min()), float(values[0])
        if not peak > _CLEAR * far:
            return None
        below = np.flatnonzero(values - far < (peak - far) * np.exp(-1.0))
        slopes.append(np.tan(theta[below[0]]) if below.size else 1.0)
    return float(np.clip(np.median(slopes), _NARROWEST, 3.0))
