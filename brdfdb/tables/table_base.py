"""The base of tables, in memory or behind a service: lookups, wavelengths, metadata and stated error."""

from __future__ import annotations

import functools
from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.arrays import array_lookup
from brdfdb.errors import BrdfdbError, ParameterError, percent
from brdfdb.geometry import Directions, checked_angles, checked_vectors, common_shape
from brdfdb.materials import FunctionRecord, Material, source_of
from brdfdb.materials.source import FourAngles, Lookups
from brdfdb.measurements.glints import Glints
from brdfdb.notebook import card, listed, spectrum
from brdfdb.parameters import Floats, check_nanometres
from brdfdb.tables._interpolation import weights_of_nodes
from brdfdb.tables.grids import Axis, Located
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.plot import Plot
from brdfdb.tables.sampler import Sampler, cells_of
from brdfdb.tables.stated_error import Error, stated

if TYPE_CHECKING:
    from brdfdb.integrals.sampling import Sample

_MOST_KNOWN = 64  # largest number of single wavelengths whose places are cached
_NORMAL_99 = 2.6  # standard deviations within which 99 of 100 values of normal noise lie
_SAMPLED = 5  # number of wavelengths whose mean decides how directions are drawn


class _UnitPairs(NamedTuple):
    """Unit vectors of lights and viewers, (N, 3) each, and the shape that their angles broadcast to."""

    w_i: NDArray[np.float64]
    w_r: NDArray[np.float64]
    shape: tuple[int, ...]


def _pairs(directions: Directions) -> _UnitPairs:
    shape = np.broadcast_shapes(*(given.shape for given in directions.given))
    columns = [
        np.broadcast_to(getattr(directions, name), shape).ravel()
        for name in ("x_i", "y_i", "cos_i", "x_r", "y_r", "cos_r")
    ]
    return _UnitPairs(np.stack(columns[:3], axis=1), np.stack(columns[3:], axis=1), shape)


class Stated(NamedTuple):
    """Values of f_r with the error that their table states for them."""

    brdf: Floats  #: values as by `Table.lookup`, [1/sr]
    #: in the same shape. At a wavelength of the table 99 of 100 values in this band of theta_i are within that of the
    #: source, or of what was measured if it is a measurement, whose uncertainty is added; nan outside of the directions
    #: that were measured, where nothing is known. In a glint that one sample shows, next to this sample, it covers all
    #: from 0 to the peak. Between wavelengths, and in the places of
    #: `brdfdb.tables.stated_error.Places`, 98 of 100 are, [1/sr]
    error: Floats


class BaseTable(Lookups):
    """A table of one revision of a material, in memory or behind a service: lookups, metadata and stated error.

    Beyond the last theta node of its grid f_r is that of the node. Between the wavelengths of the table the numbers
    that are stored are interpolated, cubic (Catmull-Rom) in nanometres; or f_r itself, by straight lines, if the
    parameters are spectra.
    """

    name: str
    revision: str
    attrs: Mapping[str, Any]
    wavelength_nm: Axis | None

    #: peaks of f_r that lookups add to the values of the grid; None without any
    glints: Glints | None

    @property
    @abstractmethod
    def axes_deg(self) -> Mapping[str, Axis]:
        """Nodes of the angular axes [degree] by name."""

    @property
    @abstractmethod
    def anisotropic(self) -> bool:
        """True if the table has an axis for the azimuth of the surface."""

    @property
    def plot(self) -> Plot:
        """Plots of the table with matplotlib: `Plot.lobe`, `Plot.cuts`, `Plot.albedo` and `Plot.slices`."""
        return Plot(self)

    @array_lookup
    def sample(self, u1: ArrayLike, u2: ArrayLike, wi: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Sample:
        """Draw a viewer for each light `wi` from the table alone. By reciprocity it is also the next light of a path.

        Parameters
        ----------
        u1, u2 : array_like
            Uniform random numbers in [0, 1]. Stratified numbers give stratified directions.
        wi : array_like
            Unit vectors of the light, of shape (..., 3).
        wavelength_nm : float or array_like (M,) [nm], optional
            As in `lookup`, of the weights. Directions do not depend on it.

        Returns
        -------
        Sample
            (wr, pdf, weight), float64: unit vectors, their density [1/sr] over the sphere, and f_r cos theta_r / pdf
            [1], shaped as f_r is by `lookup_vectors`. They are nan where an argument is nan.

        Raises
        ------
        ParameterError
            If an argument is outside its range.

        Notes
        -----
        Half vectors are drawn from cells of constant density in (theta_h, phi_h), by marginal and conditional
        distributions. Cells hold the reflected light for 17 lights from the normal to the horizon. In between, the
        distributions of the two next lights are mixed. A fifth of the directions follows the cosine, so that no weight
        is above 5 pi f_r. A light with glints draws from them in proportion to their power. The specular part is not
        drawn: add `specular_reflectance` in the mirror direction.
        """
        from brdfdb.integrals.sampling import Sample, check_uniform

        v1 = check_uniform("u1", u1)
        v2 = check_uniform("u2", u2)
        i = checked_vectors(wi, wi).w_i.astype(np.float64)
        common_shape("u1, u2, wi without its last axis", v1, v2, i[..., 0])
        v1, v2 = np.broadcast_arrays(v1, v2)
        wr = self.sampler.draw(v1, v2, i)
        density = self.sampler.density(i, wr)
        f_r = self.lookup_vectors(np.broadcast_to(i, wr.shape), wr, wavelength_nm)
        tail = (1,) * (np.ndim(f_r) - density.ndim)
        cosine = np.maximum(wr[..., 2], 0.0).reshape(density.shape + tail)
        pdf = np.broadcast_to(density.reshape(density.shape + tail), np.shape(f_r))
        return Sample(wr, density[()], np.divide(f_r * cosine, pdf, out=np.zeros(pdf.shape), where=pdf != 0.0)[()])

    @array_lookup
    def pdf(self, wi: ArrayLike, wr: ArrayLike) -> Floats:
        """Return the density [1/sr] with which `sample` draws `wr` for the light `wi`; unit vectors (..., 3)."""
        vectors = checked_vectors(wi, wr)
        return self.sampler.density(vectors.w_i.astype(np.float64), vectors.w_r.astype(np.float64))[()]

    @functools.cached_property
    def sampler(self) -> Sampler:
        """The sampler of `sample`, computed from lookups when it is first used."""
        wavelength_nm = self.wavelength_nm
        if wavelength_nm is not None:
            last = wavelength_nm.size - 1
            wavelength_nm = wavelength_nm[np.unique(np.linspace(0, last, _SAMPLED).astype(np.int64))]

        def mean(wi: NDArray[np.float64], wr: NDArray[np.float64]) -> NDArray[np.float64]:
            values = np.asarray(self.smooth_vectors(wi, wr, wavelength_nm), dtype=np.float64)
            return values if wavelength_nm is None else np.asarray(values.mean(axis=-1))

        return Sampler(cells_of(mean, anisotropic=self.anisotropic), self.glints)

    @abstractmethod
    def specular_reflectance(self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Interpolate the reflectance [1] of the specular part at theta_i [rad] in [0, pi]; 0 without it.

        Wavelengths, shape and errors are those of `lookup`.
        """

    @array_lookup
    def mueller(
        self,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_r: ArrayLike,
        phi_r: ArrayLike,
        wavelength_nm: ArrayLike | None = None,
    ) -> Floats:
        """Interpolate the Mueller BRDF [1/sr], f_r times the normalised Mueller matrix, shaped as by `lookup`, (4, 4).

        It gives the Stokes vector of the reflected radiance from that of the irradiance, between bases of the surface,
        in the convention of `brdfdb.tables.stokes`. Element [0, 0] is `lookup`. 0 below the horizon, nan where an angle
        is nan. Parameters and errors are those of `lookup`; ParameterError, too, if the table is unpolarised.
        """
        return self._mueller_at((theta_i, phi_i, theta_r, phi_r), wavelength_nm)

    @abstractmethod
    def _mueller_at(self, angles: FourAngles, wavelength_nm: ArrayLike | None) -> Floats:
        """Return the Mueller BRDF [1/sr] as by `mueller`; the angles are not checked yet."""

    @array_lookup
    def lookup_with_error(
        self,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_r: ArrayLike,
        phi_r: ArrayLike,
        wavelength_nm: ArrayLike | None = None,
    ) -> Stated:
        """Interpolate f_r [1/sr], and give the error [1/sr] that the table states for each value.

        Parameters and errors are those of `lookup`. ParameterError, too, if the table states no error, or a wavelength
        is between those of a table that did not measure its error there (before version 3).
        """
        brdf = self.lookup(theta_i, phi_i, theta_r, phi_r, wavelength_nm)
        return Stated(brdf, self._stated(checked_angles(theta_i, phi_i, theta_r, phi_r), brdf, wavelength_nm))

    @array_lookup
    def lookup_vectors_with_error(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Stated:
        """Interpolate f_r [1/sr] for unit vectors, and give the stated error [1/sr]; as `lookup_with_error`."""
        brdf = self.lookup_vectors(wi, wr, wavelength_nm)
        return Stated(brdf, self._stated(checked_vectors(wi, wr), brdf, wavelength_nm))

    @array_lookup
    def extrapolated(
        self, theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike
    ) -> NDArray[np.bool_]:
        """Return which pairs of directions, above the horizon, lie outside of those that were measured.

        f_r is made up there, and its error not known. Tables of models have no such directions. The angles [rad] are
        those of `lookup`; the result has the shape that they broadcast to. ParameterError, too, if the record of
        measured data is one that this program does not know.
        """
        return self._extrapolated(checked_angles(theta_i, phi_i, theta_r, phi_r))

    def _extrapolated(self, directions: Directions) -> NDArray[np.bool_]:
        pairs = _pairs(directions)
        outside = np.zeros(pairs.shape, dtype=bool)
        measured = self.metadata.known_measured()
        if measured is not None and measured.extent is not None:
            outside = measured.extent.outside(pairs.w_i, pairs.w_r).reshape(pairs.shape)
        if self.glints is not None:
            outside = outside | self.glints.near(pairs.w_i, pairs.w_r, extrapolated=True).reshape(pairs.shape)
        return outside & ~directions.below

    @array_lookup
    def in_glint(self, theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike) -> NDArray[np.bool_]:
        """Return for which pairs of directions a lookup has a glint in it; angles and shape as of `extrapolated`."""
        directions = checked_angles(theta_i, phi_i, theta_r, phi_r)
        pairs = _pairs(directions)
        if self.glints is None:
            return np.zeros(pairs.shape, dtype=bool)
        return self.glints.near(pairs.w_i, pairs.w_r).reshape(pairs.shape) & ~directions.below

    @array_lookup
    def smooth_vectors(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Interpolate f_r [1/sr] without glints, for quadratures and pictures that would miss them or make them noise.

        Arguments, result and errors are those of `lookup_vectors`.
        """
        values = self.lookup_vectors(wi, wr, wavelength_nm)
        if self.glints is None:
            return values
        located = self._wavelengths(wavelength_nm)
        of_glints = self.glint_values(checked_vectors(wi, wr), located)
        return np.asarray(np.maximum(values - (of_glints if located.tail else of_glints[..., 0]), 0.0))

    @array_lookup
    def glint_power(self, wi: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Interpolate the share of light [1] that glints reflect, for unit vectors (..., 3); 0 without glints.

        Wavelengths are those of `lookup`, which add an axis as they do there.
        """
        w_i = checked_vectors(wi, wi).w_i.astype(np.float64)
        located = self._wavelengths(wavelength_nm)
        power: Floats = np.zeros((w_i[..., 0].size, located.size))
        if self.glints is not None:
            power = located.mixed(self.glints.power(w_i.reshape(-1, 3)))
        return np.asarray(power.reshape(w_i.shape[:-1] + located.tail))[()]

    def glint_values(self, directions: Directions, located: Located) -> Floats:
        """Return f_r [1/sr] of the glints alone, shaped as the directions and (M,), the wavelengths."""
        pairs = _pairs(directions)
        assert self.glints is not None
        f_r = located.mixed(self.glints.f_r(pairs.w_i, pairs.w_r)).reshape(*pairs.shape, located.size)
        return np.asarray(np.where(directions.below[..., np.newaxis], 0.0, f_r))

    @functools.cached_property
    def metadata(self) -> TableMetadata:
        """The attributes as a typed record."""
        return TableMetadata.read(self.attrs)

    @functools.cached_property
    def source(self) -> Material | FunctionRecord | None:
        """The source that the table was tabulated from, as the table keeps it: exact parameters, radians as they were.

        A function comes back without its callable. None where the table does not say, or where this program does not
        have the model.
        """
        document = self.metadata.source_record or self.metadata.request  # of builds before tables kept their source
        try:
            return None if document is None else source_of(document)
        except BrdfdbError:
            return None

    @property
    def straight(self) -> bool:
        """True if f_r is joined by straight lines between the wavelengths of the table."""
        return self.metadata.interpolation.straight

    @property
    def error(self) -> Error | None:
        """The error that the table states; None if none was measured."""
        return self.metadata.error

    def _repr_html_(self) -> str:
        """Return the table for notebooks: its metadata, and a sketch of its lobe unless that needs a service."""
        known = self.metadata
        error = self.error
        axes = " × ".join(f"{name} {nodes.size}" for name, nodes in self.axes_deg.items())
        wavelengths = None if self.wavelength_nm is None else self.wavelength_nm.tolist()
        facts = [
            ("model", known.model_title or known.model or ""),
            ("parameters", listed(known.parameters)),
            ("source", known.source or ""),
            ("wavelengths", spectrum(wavelengths)),
            ("grid", axes),
            ("interpolation", known.interpolation.method + (" of logarithms" if known.interpolation.logarithm else "")),
            *([] if self.glints is None else [("glints", self.glints.sentence)]),
            ("stated error", "" if error is None else f"{percent(error.overall.p99)} (99 of 100 values)"),
            ("revision", self.revision),
        ]
        return card("Table", self.name, known.title or "", facts, self._sketch())

    def _sketch(self) -> str:
        """Return a picture of the lobe as SVG; empty where its values are not at hand."""
        return ""

    def _stated(self, directions: Directions, brdf: Floats, wavelength_nm: ArrayLike | None) -> Floats:
        if self.error is None:
            raise ParameterError("error", f"the table of {self.name} states no error; build it anew")
        return self.stated_by(self.error, directions, brdf, wavelength_nm)

    def stated_by(
        self, error: Error, directions: Directions, brdf: Floats, wavelength_nm: ArrayLike | None = None
    ) -> Floats:
        """Return the error [1/sr] that is stated for values, in their shape.

        ParameterError if a wavelength is between those of the table, and the error was not measured there.
        """
        located = self._wavelengths(wavelength_nm)
        if error.between is None and located.size and located.column.max() >= len(error.floor):
            assert self.wavelength_nm is not None
            below = int(located.column.max()) - len(error.floor)
            raise ParameterError(
                "error",
                f"the error of {self.name} was not measured between its wavelengths of "
                f"{self.wavelength_nm[below]:g} and {self.wavelength_nm[below + 1]:g} nm; build it anew",
            )
        values = np.asarray(brdf if located.tail else np.asarray(brdf)[..., np.newaxis])
        if self.glints is not None:  # whose error is their own
            values = np.maximum(values - self.glint_values(directions, located), 0.0)
        errors = stated(error.limits[:, located.column], error.floors[located.column], directions, values)
        measured = self.metadata.known_measured()
        if measured is not None:
            pairs = _pairs(directions)
            flat = np.broadcast_to(values, errors.shape).reshape(len(pairs.w_i), -1)
            of_data = measured.error_of(flat, pairs.w_i, pairs.w_r, error.floors[located.column])
            errors = errors + of_data.reshape(errors.shape)
        if self.glints is not None:
            assert measured is not None
            pairs = _pairs(directions)
            noise = measured.uncertainty if measured.noise is None else _NORMAL_99 * measured.noise.median
            smooth = np.broadcast_to(values, errors.shape).reshape(len(pairs.w_i), -1).mean(axis=1)
            of_glints = self.glints.error(pairs.w_i, pairs.w_r, smooth, noise or 0.0)
            errors = errors + located.mixed(of_glints).reshape(errors.shape)
        if measured is not None and measured.extent is not None:
            errors = np.where(self._extrapolated(directions)[..., np.newaxis], np.nan, errors)
        return np.asarray(errors if located.tail else errors[..., 0])[()]

    def columns_of(self, wavelength_nm: ArrayLike | None) -> NDArray[np.int64]:
        """Return the columns of `Error.limits` for wavelengths [nm], by default those of the table."""
        return self._wavelengths(wavelength_nm).column

    @functools.cached_property
    def _all_wavelengths(self) -> Located:
        stored_nm = np.zeros(1) if self.wavelength_nm is None else self.wavelength_nm
        return self._on_axis(stored_nm, stored_nm, () if self.wavelength_nm is None else (stored_nm.size,))

    @functools.cached_property
    def _known_wavelengths(self) -> dict[float, Located]:
        return {}

    def _wavelengths(self, wavelength_nm: ArrayLike | None) -> Located:
        """Locate wavelengths [nm] on the axis of the table; ParameterError if one is not allowed."""
        if wavelength_nm is None:
            return self._all_wavelengths
        if not isinstance(wavelength_nm, float):
            return self._located(wavelength_nm)
        known = self._known_wavelengths  # the checks of one wavelength take as long as the lookup of one point
        located = known.get(wavelength_nm)
        if located is None:
            located = self._located(wavelength_nm)
            if len(known) >= _MOST_KNOWN:
                known.clear()
            known[wavelength_nm] = located
        return located

    def _located(self, wavelength_nm: ArrayLike) -> Located:
        stored_nm = self.wavelength_nm
        asked_nm = check_nanometres("wavelength_nm", wavelength_nm)
        if asked_nm.ndim > 1:
            raise ParameterError("wavelength_nm", f"{asked_nm.ndim} axes; allowed are a number and a list of numbers")
        shape = asked_nm.shape
        asked_nm = asked_nm.reshape(-1)
        if stored_nm is None:
            return self._on_axis(np.zeros(1), np.zeros(asked_nm.size), shape)
        outside = (asked_nm < stored_nm[0]) | (asked_nm > stored_nm[-1])
        if np.any(outside):
            wrong = float(asked_nm[outside][0])
            low = float(stored_nm[0])
            high = float(stored_nm[-1])
            range_nm = f"outside [{low:g}, {high:g}] nm of" if low < high else f"not {low:g} nm, the one wavelength of"
            raise ParameterError("wavelength_nm", f"{wrong:.9g} is {range_nm} {self.name}", wrong, (low, high))
        return self._on_axis(stored_nm, asked_nm, shape)

    def _on_axis(self, stored_nm: Axis, asked_nm: Axis, tail: tuple[int, ...]) -> Located:
        """Locate wavelengths [nm] among those of the table."""
        below = np.searchsorted(stored_nm, asked_nm, side="right") - 1
        column = np.where(stored_nm[below] == asked_nm, below, stored_nm.size + below)
        return Located(*weights_of_nodes(stored_nm, asked_nm, cubic=not self.straight), column, tail)
