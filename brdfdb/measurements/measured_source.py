"""Measured data as a source: interpolated samples, or f_r of a file; and changes that make them keep a law."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import PrivateAttr

from brdfdb.errors import ParameterError
from brdfdb.gauss import gauss_rule
from brdfdb.geometry import radians, unit_vector
from brdfdb.materials import FunctionSource
from brdfdb.materials.source import Evaluate
from brdfdb.measurements import symmetry
from brdfdb.measurements.colours import rgb_of, spectra_of_colours
from brdfdb.measurements.extent import Extent
from brdfdb.measurements.glints import Glints
from brdfdb.measurements.interpolation import fit
from brdfdb.measurements.lobe_base import Base
from brdfdb.measurements.record import Change, Measured, Noise
from brdfdb.measurements.samples import Samples
from brdfdb.measurements.usable_values import without_filled
from brdfdb.parameters import Floats
from brdfdb.spectra import PICTURE_NM

_NORMAL_99 = 2.6  # standard deviations within which 99 of 100 values of normal noise lie
_COLOURS = (("R", "G", "B"), ("X", "Y", "Z"))
_LOBE_LIGHTS_DEG = (10.0, 20.0, 30.0)  # lights at which the width of a lobe is measured
_HALF_DEG = np.append(0.0, np.geomspace(0.02, 60.0, 160))  # half vectors of these lights, dense at narrow lobes
MARGIN = 0.003  # of the albedo of data that are made to conserve energy: measured tables exceed them by 0.0012
_NARROWEST = 1e-3  # width [1] of lobes below which grids are those of this width
_CLEAR = 3.0  # smallest ratio of a peak to f_r far from it that makes a lobe
_BETWEEN = 0.05  # share of the pairs of directions outside of the extent of a file that lists all: it has corners
_PROBED = 2000  # pairs at which the share of negative values of a function is counted
LIGHTS_DEG = np.concatenate([np.arange(0.0, 80.0, 2.5), np.arange(80.0, 90.0, 1.0), [89.5, 89.9]])
_AZIMUTHS = 16  # azimuths of the lights of an anisotropic surface
# Half vectors over which an albedo is summed
_RINGS = 64
_SPOKES = 96
_CROWDED = 8.0  # rings next to the normal are so many e-folds closer than those at the horizon
_DARKEST = 0.99  # largest part of the light that glints and margin leave no room for
_ROUNDS = 40  # iterations of the factors of a reciprocal f_r, each of which counts for light and viewer


class _Label(NamedTuple):
    """Name of a source, its title for people, and the origin of its data in words."""

    name: str
    title: str
    provenance: str


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
    _samples: Samples | None = PrivateAttr(default=None)

    @property
    def measured(self) -> Measured:
        """Return the record of the data."""
        return self._measured

    @property
    def glints(self) -> Glints | None:
        """Return the peaks of f_r that its lookups leave out, at the wavelengths of the source; None without any."""
        return self._measured.glints

    @property
    def samples(self) -> Samples | None:
        """Return the samples that f_r is interpolated between, or the nodes of a file; None if f_r is a function."""
        return self._samples

    @classmethod
    def of_samples(
        cls,
        samples: Samples,
        *,
        name: str = "",
        title: str = "",
        provenance: str = "",
        base: Base | None = None,
        reciprocal: bool | None = None,
    ) -> Self:
        """Return ten samples or more as a source, by the fit of `brdfdb.measurements.interpolation`.

        f_r is anisotropic if the samples have several azimuths of the light. Name, title and provenance are by default
        those of the samples. `base` is f_r [1/sr] (N, C) at unit vectors, such as `Source.brdf_at` of a fit, to which
        the ratio is interpolated; by default Lambert and one lobe. Of `reciprocal` data each sample counts with light
        and viewer exchanged, too; by default they are reciprocal if samples that were held out follow better then.
        ParameterError if there are too few samples, no value is above 0, numbers
        far below 0 stand for holes, or the name has no letters or digits.
        """
        samples, filled = without_filled(samples)
        fitted = fit(samples, base, reciprocal=reciprocal)
        some = samples.known.any(axis=1)
        extent = Extent.of(samples, turned=samples.turned)
        known = samples.values[samples.known]
        noise_p99 = fitted.held_out.p99
        noise = None if fitted.noise is None else _NORMAL_99 * fitted.noise.p95
        measured = Measured(
            by=samples.instrument.name,
            channels=list(samples.channels),
            samples=int(np.count_nonzero(some)),
            incidences=int(np.unique(samples.incidence).size),
            holes=int(np.count_nonzero(~samples.known)),
            negative=float(f"{np.mean(known < 0.0):.3g}"),
            interpolation=f"asinh of f_r over noise, less that of {fitted.base}, by radial functions of directions",
            reciprocity=symmetry.RECIPROCAL
            if fitted.f_r.reciprocal
            else symmetry.reciprocity(fitted.f_r, extent, noise),
            mirror=None if samples.turned else _mirror_of(samples, noise_p99),
            extrapolated=_extrapolated(extent),
            extent=extent,
            held_out=fitted.held_out,
            noise=fitted.noise,
            outliers=filled + fitted.outliers,
            doubts=list(samples.record.get("doubts", ())),
        )
        origin = provenance or samples.provenance or "a file of samples"
        label = _Label(name or samples.name, title or samples.name, origin)
        source = cls._of(fitted.f_r, samples.wavelength_nm, measured, label, turned=samples.turned)
        source._samples = samples
        return source._with_glints(fitted.glints)

    def _with_glints(self, glints: Glints | None) -> Self:
        """Return the source with glints whose powers are those of its channels."""
        if glints is None:
            return self
        known_nm = None if self.wavelengths_nm is None else np.array(self.wavelengths_nm)
        samples = self._samples
        assert samples is not None
        if known_nm is not None and samples.channels in _COLOURS:
            glints = glints.mixed(rgb_of(samples.channels, np.eye(3)) @ spectra_of_colours())
        elif known_nm is not None and samples.wavelength_nm is not None:
            glints = glints.mixed(np.eye(known_nm.size)[:, np.argsort(samples.wavelength_nm)])
        return self.recorded(glints=glints)

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

        `evaluate` gives f_r [1/sr] (N, C) at unit vectors (N, 3) of light and viewer above the horizon; ParameterError
        if a value is not finite. Channels are ("R", "G", "B"), ("X", "Y", "Z"), ("grey",), or wavelengths, with
        `wavelength_nm` (C,) [nm]. Name, title and provenance are a slug, a line for people, and the origin of the data.
        `noise` is the uncertainty of the values. f_r outside of the `Extent` of `nodes`, the values at the measured
        directions, is marked as extrapolated; by default f_r is known everywhere, as it is if nearly all directions lie
        within.
        """
        wi, wr = symmetry.drawn_pairs()
        values = np.asarray(evaluate(wi[:_PROBED], wr[:_PROBED]))
        if not np.all(np.isfinite(values)):
            raise ParameterError("evaluate", f"{name} has values that are not finite", np.nan)

        def positive(wi: Floats, wr: Floats) -> Floats:
            return np.maximum(evaluate(wi, wr), 0.0)

        f_r: Evaluate = positive
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
        if seen is not None and seen.assumed and seen.asymmetry is not None and seen.asymmetry.max > 0.0:
            f_r = _mirrored(f_r)
        source = cls._of(f_r, wavelength_nm, measured, _Label(name, title, provenance), turned=turned)
        if nodes is not None:
            source._samples, filled = without_filled(nodes)
            return source.recorded(outliers=filled)
        return source

    @classmethod
    def _of(
        cls,
        f_r: Evaluate,
        wavelength_nm: NDArray[np.float64] | None,
        measured: Measured,
        label: _Label,
        *,
        turned: bool,
    ) -> Self:
        """Return the source of f_r in the channels of its record, at their wavelengths [nm]."""
        channels = tuple(measured.channels)
        if channels in _COLOURS:
            wavelength_nm = PICTURE_NM
        elif wavelength_nm is not None:
            order = np.argsort(wavelength_nm)
            wavelength_nm = wavelength_nm[order]
            f_r = _ordered(f_r, order)
        chiral = measured.chiral
        # half vectors across the plane of incidence show the width along x of a light from y
        azimuths = (0.5 * np.pi, 0.0) if turned else (0.0,)
        widths = [_width(_mirrored(f_r) if chiral else f_r, phi) for phi in azimuths]
        known = [width for width in widths if width is not None]
        source = cls(
            brdf=_brdf_of(f_r, channels, wavelength_nm),
            name=slug(label.name),
            title=label.title,
            provenance=label.provenance,
            wavelengths_nm=None if wavelength_nm is None else tuple(wavelength_nm.tolist()),
            anisotropic=turned,
            reciprocal=measured.reciprocity.assumed,
            alpha=(known[0], known[-1]) if len(known) == len(azimuths) else None,
        )
        source._measured = measured
        source._channels_at = f_r
        return source

    def extrapolated(self, wi: Floats, wr: Floats) -> NDArray[np.bool_]:
        """Return which pairs of unit vectors (N, 3) lie outside of the directions that were measured."""
        extent = self._measured.extent
        return np.zeros(len(wi), dtype=bool) if extent is None else extent.outside(wi, wr)

    def samples_at(self, wavelength_nm: NDArray[np.float64] | None) -> Samples | None:
        """Return the samples with values (N, L) at wavelengths [nm] of a table, or grey; None without samples."""
        samples = self._samples
        if samples is None or wavelength_nm is None:
            return samples
        values = samples.values
        known_nm = np.array(self.wavelengths_nm)
        if samples.channels not in _COLOURS:
            assert samples.wavelength_nm is not None
            values = values[:, np.argsort(samples.wavelength_nm)]
        holes = _spectra(np.isnan(values).astype(np.float64), samples.channels, known_nm, wavelength_nm) != 0.0
        values = np.where(holes, np.nan, _spectra(np.nan_to_num(values), samples.channels, known_nm, wavelength_nm))
        names = tuple(f"{nm:g}nm" for nm in wavelength_nm)
        return replace(
            samples, values=values, channels=names, wavelength_nm=wavelength_nm, uncertainty=None, bandwidth_nm=None
        )

    def recorded(self, **changes: Any) -> Self:
        """Return the source with some entries of its record changed."""
        changed = self.model_copy()
        changed._measured = self._measured.model_copy(update=changes)
        return changed

    def made(self, law: str, margin: float | Floats = MARGIN) -> Self:
        """Return the nearest source that keeps a law; its record says what was changed.

        "reciprocal" is the mean of f_r and f_r with light and viewer exchanged; glints stay as they are. "conserving"
        is f_r times one number for each light, the largest up to 1 that keeps the albedo at most 1 - `margin`; times
        that of the viewer, too, if f_r is reciprocal. Glints then keep to what is left of 1: one that is not resolved
        becomes narrower, which leaves its f_r at the sample, and others lose power. The margin [1] is room for the
        error of a table: a number, or one for each of the polar angles `LIGHTS_DEG` of the light.
        """
        if law not in ("reciprocal", "conserving"):
            text = f"{law!r} is neither reciprocal nor conserving"
            raise ParameterError("law", text, law, ("reciprocal", "conserving"))
        before = self._channels_at
        if law == "reciprocal":
            after = _made_reciprocal(before)
        else:
            after = _made_conserving(before, reciprocal=self.reciprocal, turned=self.anisotropic, margin=margin)
        wi, wr = symmetry.drawn_pairs()
        old, new = before(wi, wr), after(wi, wr)
        floor = np.maximum(1e-3 * old.mean(axis=0), 1e-12)
        change = Change(
            law="reciprocal" if law == "reciprocal" else "conserving",
            changed=symmetry.spread_of(np.abs(new - old) / np.maximum(old, floor)),
        )
        reciprocity = self._measured.reciprocity
        if law == "reciprocal":
            reciprocity = reciprocity.model_copy(update={"assumed": True})
        changes = [*self._measured.changes, change]
        measured = self._measured.model_copy(update={"changes": changes, "reciprocity": reciprocity})
        wavelength_nm = None if self.wavelengths_nm is None else np.array(self.wavelengths_nm)
        label = _Label(self.name, self.title, self.provenance)
        source = self._of(after, wavelength_nm, measured, label, turned=self.anisotropic)
        source._samples = self._samples
        if law == "conserving" and self.glints is not None:
            glints = self.glints.limited(source._room(self.glints, margin))
            darker = np.minimum(margin + _largest_power(glints), _DARKEST)
            return self.recorded(glints=None).made(law, darker).recorded(glints=glints)
        return source

    def _room(self, glints: Glints, margin: float | Floats) -> Floats:
        """Return what glints may reflect [1] of their lights, (glints, wavelengths): 1 less margin and albedo."""
        f_r = self.brdf_at(None if self.wavelengths_nm is None else np.array(self.wavelengths_nm))
        theta_i_deg = [glint.theta_i_deg for glint in glints.glints]
        lights = unit_vector(radians(theta_i_deg), radians([glint.phi_i_deg for glint in glints.glints]))
        albedos = []
        for light in lights:
            viewers, weight = _viewers(light, whole=self.anisotropic)
            albedos.append(weight @ f_r(np.broadcast_to(light, viewers.shape), viewers))
        margins = np.interp(theta_i_deg, LIGHTS_DEG, np.broadcast_to(margin, LIGHTS_DEG.shape))
        return np.asarray(np.maximum(1.0 - margins[:, np.newaxis] - np.array(albedos), 0.0))

    def _check_function(self) -> None:
        """Take the data as they are."""


def _largest_power(glints: Glints) -> Floats:
    """Return the largest power [1] of glints over wavelengths and azimuths of the light, for `LIGHTS_DEG`."""
    azimuths = np.arange(_AZIMUTHS) * (2.0 * np.pi / _AZIMUTHS) if glints.turned else np.zeros(1)
    wi = unit_vector(radians(LIGHTS_DEG)[:, np.newaxis], azimuths)
    return np.asarray(glints.power(wi.reshape(-1, 3)).reshape(LIGHTS_DEG.size, -1).max(axis=1))


def slug(name: str) -> str:
    """Return a name as lower-case words joined by hyphens; ParameterError if nothing is left of it."""
    words = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
    if not words:
        raise ParameterError("name", f"{name!r} has no letters or digits", name)
    return words


def _extrapolated(extent: Extent) -> float:
    """Return the share of the pairs of directions, evenly over both hemispheres, that lie outside of an extent."""
    return float(f"{np.mean(extent.outside(*symmetry.drawn_pairs(up_to_deg=90.0))):.3g}")


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
        values = _spectra(evaluated(wi, wr), channels, wavelength_nm, at)
        return values if at is None or wavelength_nm is None else np.maximum(values, 0.0)

    return brdf


def _spectra(
    values: Floats, channels: tuple[str, ...], wavelength_nm: NDArray[np.float64] | None, at: NDArray[np.float64] | None
) -> Floats:
    """Return values (N, C) of channels at other wavelengths [nm], by straight lines, or colours as spectra."""
    if at is None or wavelength_nm is None:
        return values
    stored = spectra_of_colours() if channels in _COLOURS else np.eye(wavelength_nm.size)
    weights = np.stack([np.interp(at, wavelength_nm, row) for row in stored])
    values = rgb_of(channels, values) if channels in _COLOURS else values
    return np.asarray(np.einsum("nc,cl->nl", values, weights))


def _ordered(f_r: Evaluate, order: NDArray[np.intp]) -> Evaluate:
    """Return f_r with its channels in another order."""
    return lambda wi, wr: f_r(wi, wr)[:, order]


def _mirrored(f_r: Evaluate) -> Evaluate:
    """Return the mean of f_r and that of the mirror image."""
    return lambda wi, wr: 0.5 * (f_r(wi, wr) + f_r(wi * symmetry.MIRROR, wr * symmetry.MIRROR))


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


def _width(f_r: Evaluate, phi: float) -> float | None:
    """Return the width [1] of the lobe across the plane of incidence at an azimuth [rad]; None: no lobe is clear."""
    slopes = []
    for light in _LOBE_LIGHTS_DEG:
        wi = np.broadcast_to(unit_vector(radians(light), phi), (_HALF_DEG.size, 3))
        # half vectors across the plane of incidence: the viewer stays above the horizon longest
        theta = radians(_HALF_DEG)
        along = np.array([0.0, 0.0, 1.0])
        across = np.array([-np.sin(phi), np.cos(phi), 0.0])
        half = np.cos(theta)[:, np.newaxis] * along + np.sin(theta)[:, np.newaxis] * across
        wr = 2.0 * np.sum(wi * half, axis=1, keepdims=True) * half - wi
        above = wr[:, 2] > 0.05
        values = f_r(wi[above], wr[above]).mean(axis=1)
        far = float(values.min())
        peak = float(values[0])
        if not peak > _CLEAR * far:
            return None
        below = np.flatnonzero(values - far < (peak - far) * np.exp(-1.0))
        slopes.append(np.tan(theta[below[0]]) if below.size else 1.0)
    return float(np.clip(np.median(slopes), _NARROWEST, 3.0))


def _made_reciprocal(f_r: Evaluate) -> Evaluate:
    """Return the mean of f_r and f_r with light and viewer exchanged: the nearest in the mean square."""
    return lambda wi, wr: 0.5 * (f_r(wi, wr) + f_r(wr, wi))


def _made_conserving(f_r: Evaluate, *, reciprocal: bool, turned: bool, margin: float | Floats) -> Evaluate:
    """Return f_r scaled so that no light has an albedo above 1 - margin: one factor for each polar angle and channel.

    The factor is the largest up to 1, so that the relative change of a light is as small as it can be. Of a reciprocal
    f_r it is a product of a factor for the light and one for the viewer, each of which is 1 or makes the albedo of its
    light 1 - margin. f_r of a surface that may not be turned is taken as that of its mirror image, too.
    """
    theta = radians(LIGHTS_DEG)
    azimuths = np.arange(_AZIMUTHS) * (2.0 * np.pi / _AZIMUTHS) if turned else np.zeros(1)
    shares = np.stack([_shares(f_r, unit_vector(t, phi), theta, whole=turned) for t in theta for phi in azimuths])
    limit = 1.0 - np.broadcast_to(margin, theta.shape)[:, np.newaxis]

    def reflected(of_viewer: Floats) -> Floats:
        albedo = np.einsum("lkc,kc->lc", shares, of_viewer)
        return np.asarray(albedo.reshape(theta.size, azimuths.size, -1).max(axis=1))

    factors = np.minimum(1.0, limit / np.maximum(reflected(np.ones(shares.shape[1:])), limit))
    if reciprocal:
        for _ in range(_ROUNDS):  # the mean of the old and the new factor, in the logarithm: they would swing otherwise
            factors = np.minimum(1.0, np.sqrt(factors * limit / np.maximum(reflected(factors), 1e-12)))
        albedo = factors * reflected(factors)
        factors *= np.sqrt(np.minimum(1.0, np.min(limit / np.maximum(albedo, 1e-12), axis=0)))

    def scaled(wi: Floats, wr: Floats) -> Floats:
        light = _at(factors, theta, np.arccos(np.clip(wi[:, 2], -1.0, 1.0)))
        viewer = _at(factors, theta, np.arccos(np.clip(wr[:, 2], -1.0, 1.0))) if reciprocal else 1.0
        return np.asarray(f_r(wi, wr) * light * viewer)

    return scaled


def _at(factors: Floats, theta: Floats, wanted: Floats) -> Floats:
    return np.stack([np.interp(wanted, theta, column) for column in factors.T], axis=1)


def _shares(f_r: Evaluate, light: Floats, theta: Floats, *, whole: bool) -> Floats:
    """Return the shares (K, C) of the albedo of a light (3,) that go to the polar angles (K,) [rad] of the viewer.

    A viewer between two of the angles counts for both, as straight lines between factors at these angles do.
    """
    viewers, weight = _viewers(light, whole=whole)
    reflected = weight[:, np.newaxis] * f_r(np.broadcast_to(light, viewers.shape), viewers)
    theta_r = np.clip(np.arccos(np.clip(viewers[:, 2], 0.0, 1.0)), theta[0], theta[-1])
    below = np.clip(np.searchsorted(theta, theta_r, side="right") - 1, 0, theta.size - 2)
    part = (theta_r - theta[below]) / (theta[below + 1] - theta[below])
    return np.stack(
        [
            np.bincount(below, (1.0 - part) * column, theta.size) + np.bincount(below + 1, part * column, theta.size)
            for column in reflected.T
        ],
        axis=1,
    )


def _viewers(light: Floats, *, whole: bool) -> tuple[Floats, Floats]:
    """Return viewers (N, 3), and weights (N,) that sum f_r to the albedo of a light (3,); half of them if not `whole`.

    They are the mirror images of the light in half vectors, on spokes from the normal to where the viewer is at the
    horizon: tan(2 theta_h) = -cos(theta_i) / (sin(theta_i) cos(phi_h - phi_i)). Half vectors crowd around the normal:
    the rule of Gauss and Legendre in u, for theta_h in proportion to sinh(k u), and that of the midpoint in phi_h. A
    half vector of d omega_h makes viewers of 4 cos(theta_d) d omega_h.
    """
    x, w = gauss_rule(_RINGS)
    u = 0.5 * (x + 1.0)
    spokes = _SPOKES if whole else _SPOKES // 2
    turn = 2.0 * np.pi if whole else np.pi
    phi_h = (np.arange(spokes) + 0.5) * (turn / spokes) + np.arctan2(light[1], light[0])
    last = 0.5 * np.arctan2(light[2], -(light[0] * np.cos(phi_h) + light[1] * np.sin(phi_h)))
    theta_h = np.outer(np.sinh(_CROWDED * u) / np.sinh(_CROWDED), last)
    width = np.outer(0.5 * w * _CROWDED * np.cosh(_CROWDED * u) / np.sinh(_CROWDED), last)
    half = unit_vector(theta_h, phi_h)
    cos_d = half @ light
    viewers = 2.0 * cos_d[..., np.newaxis] * half - light
    weight = 4.0 * cos_d * np.maximum(viewers[..., 2], 0.0) * np.sin(theta_h) * width * (2.0 * np.pi / spokes)
    return viewers.reshape(-1, 3), weight.ravel()
