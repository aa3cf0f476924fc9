"""Tables: f_r at any direction and wavelength, interpolated from the numbers stored on a grid."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray
from pydantic import PrivateAttr

from brdfdb.arrays import FLOAT_TYPES, PLAIN_TYPES, array_lookup
from brdfdb.errors import ParameterError
from brdfdb.geometry import (
    HALF_PI,
    Directions,
    asked_for,
    checked_angles,
    checked_vectors,
    radians,
    shape_of_angles,
    spherical_angles,
    unit_vector,
)
from brdfdb.materials import FunctionRecord, FunctionSource, Material, Source
from brdfdb.materials.source import FourAngles
from brdfdb.measurements.glints import Glints
from brdfdb.measurements.record import Measured
from brdfdb.models.large_calls import array_for_result, filled
from brdfdb.notebook import polar_sketch
from brdfdb.parameters import Floats
from brdfdb.tables import _coordinates, _kernels
from brdfdb.tables._interpolation import Axes, prepared
from brdfdb.tables.grids import Axis, Grid, Located, axes_among, check_wavelengths
from brdfdb.tables.layout import PLAIN, Interpolation, Layout, rebuilt
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.mueller_field import MuellerField, checked_field
from brdfdb.tables.polarisation import MuellerFacets, checked_facets, facets_of
from brdfdb.tables.sampler import Sampler
from brdfdb.tables.table_base import BaseTable

# The cut that notebooks show
_SKETCHED_DEG = np.linspace(-88.0, 88.0, 177)  # angles of the viewer
_SKETCHED_LIGHT_DEG = 45.0
_SKETCHED_NM = 550.0
# Variance of f_r over its mean square, for directions that follow the cosine. Up to it, the cosine has less noise than
# cells of a table: see docs/results/environments.json
_EVEN = 0.1
_LIGHTS_DEG = (0.0, 25.0, 50.0, 70.0)  # lights at which this variance is measured
_DRAWN = 1024  # directions of each of them
_TURN = (np.sqrt(5.0) - 1.0) / 2.0  # the golden section
_BLACK = 1e-100  # least albedo


class _Arrays(NamedTuple):
    """A table as kernels read it.

    `rule` is the way from numbers to f_r. `channels` numbers at each node make up a spectrum by `spectra`. `uniform` is
    the uniform part [1/sr] of each wavelength.
    """

    rule: _coordinates.Rule
    axes: Axes
    numbers: NDArray[np.float32]
    channels: int
    spectra: NDArray[np.float64]
    uniform: NDArray[np.float64]


class _Specular(NamedTuple):
    """Nodes [rad] of the specular part, and its values there, a row a node."""

    theta_i: NDArray[np.float64]
    rows: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Table(BaseTable):
    """A decoded table: the values of one revision of one material, in memory."""

    #: name, revision: name of the material, and its revision
    name: str
    revision: str
    attrs: Mapping[str, Any] = field(repr=False)  #: the attributes as stored; `metadata` is the typed record of them
    grid: Grid = field(repr=False)  #: the angular axes, in the order of the dimensions
    #: wavelengths of a spectral table; None for a grey one, which holds at any wavelength, (L,) [nm]
    wavelength_nm: Axis | None = field(repr=False)
    #: numbers over the angular axes and, last, the wavelengths, or the coefficients of a factored spectrum
    values: NDArray[np.float32] = field(repr=False)
    #: reflectance of the specular part; None if the source has none, (theta_i[, L]) [1]
    specular: NDArray[np.float32] | None = field(repr=False)
    #: nodes of the specular part; by default those of the axis theta_i, [degree]
    specular_theta_deg: Axis | None = field(default=None, repr=False)
    #: the way from the numbers to f_r between nodes; by default they are f_r, interpolated linearly
    interpolation: Interpolation = PLAIN
    #: the basis of a factored spectrum: of logarithms, or of f_r itself if `part_nm` is given, (coefficients, L)
    spectra: NDArray[np.float64] | None = field(default=None, repr=False)
    #: the uniform part of f_r, which is not in `values`, (L,) or (1,) [1/sr]
    uniform: NDArray[np.float64] | None = field(default=None, repr=False)
    digest: str = ""  #: sha256 of the manifest of the revision; empty of a table that was not read from a store
    #: wavelengths at which the parts of such a table are f_r, (coefficients,) [nm]
    part_nm: Axis | None = field(default=None, repr=False)
    #: n, k: refractive index and extinction coefficient that the store says the table was computed with. Lookups do not
    #: read them, (L,) [1]
    n: Axis | None = field(default=None, repr=False)
    k: Axis | None = field(default=None, repr=False)
    #: the polarisation, of a model or as it was measured; None of an unpolarised table
    facets: MuellerFacets | MuellerField | None = field(default=None, repr=False)
    #: peaks of f_r that are not in `values`, and that lookups add; None without any
    glints: Glints | None = field(default=None, repr=False)

    @classmethod
    def of(cls, layout: Layout, values: NDArray[np.float32], grid: Grid | None = None) -> Table:
        """Make the table of a layout, or part of its grid, before it is stored: without specular part and glints."""
        return cls(
            name=layout.source.name,
            revision="",
            attrs={"reason": layout.reason} if layout.reason else {},
            grid=layout.grid if grid is None else grid,
            wavelength_nm=layout.wavelength_nm,
            values=values,
            specular=None,
            interpolation=layout.interpolation,
            spectra=layout.spectra,
            uniform=layout.uniform,
            part_nm=layout.part_nm,
            facets=layout.field or facets_of(layout),
        )

    def laid_out(self, source: Source) -> Layout:
        """Return the layout of the table, as a tabulation of a source; errors are those of `Layout`."""
        return Layout(
            source,
            self.grid,
            self.wavelength_nm,
            self.interpolation,
            self.spectra,
            self.metadata.bits,
            self.metadata.reason,
            self.part_nm,
            self.facets.theta_d_deg if isinstance(self.facets, MuellerFacets) else None,
            self.facets if isinstance(self.facets, MuellerField) else None,
        )

    @property
    def axes_deg(self) -> Mapping[str, Axis]:
        """Nodes of the angular axes [degree] by name."""
        return self.grid.axes

    @property
    def anisotropic(self) -> bool:
        """True if the table has an axis for the azimuth of the surface."""
        return self.grid.anisotropic

    @property
    def straight(self) -> bool:
        """True if f_r is joined by straight lines between the wavelengths of the table."""
        return self.interpolation.straight

    @functools.cached_property
    def brdf(self) -> NDArray[np.float32]:
        """f_r [1/sr] at the nodes: over the angular axes and, last, the wavelengths; 0 below the horizon."""
        if self.values_are_brdf:
            return self.values
        numbers = self.values.reshape(*self.grid.shape, -1)
        mixed = self.part_nm is not None
        f_r = rebuilt(
            numbers, self.interpolation, self.spectra, self.uniform, *self.grid.directions()[::2], mixed=mixed
        )
        return f_r.astype(np.float32).reshape(self.grid.shape if self.wavelength_nm is None else f_r.shape)

    def _sketch(self) -> str:
        """Return a cut in the plane of incidence as SVG, at 550 nm or the wavelength closest to it."""
        stored = self.wavelength_nm
        wavelength = None if stored is None else float(np.clip(_SKETCHED_NM, stored[0], stored[-1]))
        phi_r = np.where(_SKETCHED_DEG > 0.0, np.pi, 0.0)
        f_r = self.lookup(radians(_SKETCHED_LIGHT_DEG), 0.0, radians(np.abs(_SKETCHED_DEG)), phi_r, wavelength)
        return polar_sketch(_SKETCHED_DEG.tolist(), np.asarray(f_r).tolist(), _SKETCHED_LIGHT_DEG)

    @property
    def nbytes(self) -> int:
        """Size [byte] of the arrays that lookups read."""
        arrays = (self.values, self.specular, self.spectra, self.uniform)
        return sum(array.nbytes for array in (*arrays, self.facets) if array is not None)

    @property
    def values_are_brdf(self) -> bool:
        """True if the stored numbers are f_r itself."""
        return self.spectra is None and self.uniform is None and self.interpolation.plain

    def lookup(
        self,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_r: ArrayLike,
        phi_r: ArrayLike,
        wavelength_nm: ArrayLike | None = None,
        *,
        out: Floats | None = None,
        threads: int = 1,
    ) -> Floats:
        """Interpolate f_r [1/sr] at angles.

        Parameters
        ----------
        theta_i, phi_i, theta_r, phi_r : array_like [rad]
            Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi]; broadcast.
        wavelength_nm : float or array_like (M,) [nm], optional
            Within the range of a spectral table; by default its wavelengths. Grey tables take any.
        out : array, optional
            Writable, C-contiguous, in the shape and dtype of the result: it is written there and returned.
        threads : int
            Number of threads that share a large call, at least 1; by default 1. Values are the same bit for bit.

        Returns
        -------
        array [1/sr]
            In the shape of the angles, with a last axis for the wavelengths of a spectral table, or M if an array of
            wavelengths was given; a single wavelength adds no axis. 0 below the horizon, nan where an angle is nan.
            float32 arrays in give float32 out.

        Raises
        ------
        ParameterError
            If an argument is outside its range.
        """
        angles = (theta_i, phi_i, theta_r, phi_r)
        if PLAIN_TYPES.issuperset(map(type, angles)):  # a call of the gate takes a tenth of the lookup of one point
            return self._at_angles(angles, wavelength_nm, out, threads)
        return self._of_arrays(*angles, wavelength_nm, out=out, threads=threads)

    @array_lookup
    def _of_arrays(self, theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, wavelength_nm: Any, **more: Any) -> Floats:
        return self._at_angles((theta_i, phi_i, theta_r, phi_r), wavelength_nm, **more)

    def _at_angles(
        self, angles: FourAngles, wavelength_nm: ArrayLike | None, out: Floats | None = None, threads: int = 1
    ) -> Floats:
        located = self._wavelengths(wavelength_nm)
        shape: tuple[int, ...] = ()
        flat: NDArray[Any] | list[NDArray[Any]]  # a row for each angle
        if FLOAT_TYPES.issuperset(map(type, angles)):  # broadcasting takes longer than the lookup of one point
            flat = np.array(angles).reshape(4, 1)
            flat.flags.writeable = False  # as by `_flat`
            dtype = flat.dtype
        else:
            arrays = [np.asarray(angle) for angle in angles]
            dtype = asked_for(*angles)
            if any(angle.dtype.kind not in "iuf" for angle in arrays):
                checked_angles(*angles)
            shape = shape_of_angles(*arrays)
            flat = [_flat(angle, shape, dtype) for angle in arrays]
        horizon = float(dtype.type(HALF_PI))
        unusual = []

        def write(part: slice, values: NDArray[Any]) -> None:
            theta_i, phi_i, theta_r, phi_r = (angle[part] for angle in flat)
            if not _kernels.by_angles(
                *self._kernel, located.nodes, located.weight, theta_i, phi_i, theta_r, phi_r, horizon, values
            ):
                unusual.append(part)

        arguments = dict(zip(("theta_i", "phi_i", "theta_r", "phi_r"), angles, strict=True))
        values = filled(write, array_for_result(out, shape + located.tail, dtype, arguments), located.size, threads)
        if unusual:
            checked_angles(*angles)  # raises an error or warns
        if self.glints is not None:
            self._add_glints(values, checked_angles(*angles), located)
        return values[()] if out is None else values

    @array_lookup
    def lookup_vectors(
        self,
        wi: ArrayLike,
        wr: ArrayLike,
        wavelength_nm: ArrayLike | None = None,
        *,
        out: Floats | None = None,
        threads: int = 1,
    ) -> Floats:
        """Interpolate f_r [1/sr] for unit vectors `wi` of the light and `wr` of the viewer, each of shape (..., 3).

        Wavelengths, `out`, `threads`, result and errors are those of `lookup`.
        """
        located = self._wavelengths(wavelength_nm)
        vectors = checked_vectors(wi, wr)
        shape = np.broadcast_shapes(vectors.w_i.shape, vectors.w_r.shape)
        w_i, w_r = (_flat(w, shape, vectors.dtype) for w in (vectors.w_i, vectors.w_r))

        def write(part: slice, values: NDArray[Any]) -> None:
            numbers = slice(3 * part.start, 3 * part.stop)
            _kernels.by_vectors(*self._kernel, located.nodes, located.weight, w_i[numbers], w_r[numbers], values)

        result = array_for_result(out, shape[:-1] + located.tail, vectors.dtype, {"wi": wi, "wr": wr})
        values = filled(write, result, located.size, threads)
        if self.glints is not None:
            self._add_glints(values, vectors, located)
        return values[()] if out is None else values

    @array_lookup
    def smooth_vectors(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        return self.without_glints().lookup_vectors(wi, wr, wavelength_nm)

    def without_glints(self) -> Table:
        """Return the table whose lookups leave out the glints, the part of f_r that grids and quadratures can hold."""
        return self if self.glints is None else self._smooth

    @functools.cached_property
    def _smooth(self) -> Table:
        return replace(self, glints=None)

    def _add_glints(self, values: Floats, directions: Directions, located: Located) -> None:
        f_r = self.glint_values(directions, located)
        values += f_r if located.tail else f_r[..., 0]

    @functools.cached_property
    def _kernel(self) -> _Arrays:
        """The table as kernels read it."""
        grid = self.grid
        how = self.interpolation
        # a cubic, and what continues beyond the horizon; a sum of positive numbers does not
        overshoots = how.logarithm or how.cubic or grid.half_difference
        rule = _coordinates.Rule(
            grid.half_difference,
            grid.reciprocal,
            grid.copies,
            how.logarithm,
            float(how.offset),
            float(how.power),
            overshoots,
            self.part_nm is not None,
            how.straight,
        )
        axes = prepared([radians(nodes) for nodes in grid.axes.values()], grid.ends, cubic=how.cubic)
        channels = self.values.size // int(np.prod(grid.shape))
        spectra = np.empty((0, 0)) if self.spectra is None else np.ascontiguousarray(self.spectra)  # else a kernel more
        count = 1 if self.wavelength_nm is None else self.wavelength_nm.size
        uniform = np.zeros(count) if self.uniform is None else np.broadcast_to(self.uniform, (count,)).copy()
        return _Arrays(rule, axes, self.values.reshape(-1), channels, spectra, uniform)

    @array_lookup
    def specular_reflectance(self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        located = self._wavelengths(wavelength_nm)
        given = np.asarray(theta_i)
        dtype = asked_for(theta_i)
        if given.dtype.kind not in "iuf":
            checked_angles(theta_i, 0.0, 0.0, 0.0)
        values = np.zeros(given.size * located.size, dtype)
        horizon = float(dtype.type(HALF_PI))
        nodes, rows = self._specular_rows
        if not _kernels.specular(
            nodes, rows, located.nodes, located.weight, _flat(given, given.shape, dtype), horizon, values
        ):
            checked_angles(theta_i, 0.0, 0.0, 0.0)
        return values.reshape(given.shape + located.tail)[()]

    def _mueller_at(self, angles: FourAngles, wavelength_nm: ArrayLike | None) -> Floats:
        facets = self._polarised
        located = self._wavelengths(wavelength_nm)
        f_r = self._at_angles(angles, wavelength_nm)
        values = np.asarray(f_r if located.tail else np.asarray(f_r)[..., np.newaxis])
        normalised = facets.of_surface(angles, values, located)
        matrix = np.where(values == 0.0, 0.0, values)[..., np.newaxis, np.newaxis] * normalised
        return np.asarray(matrix if located.tail else matrix[..., 0, :, :], dtype=np.asarray(f_r).dtype)

    @array_lookup
    def mueller_vectors(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Interpolate the Mueller BRDF [1/sr] for unit vectors (..., 3), as `mueller`. The azimuth of a pole is 0."""
        vectors = checked_vectors(wi, wr)
        angles = (*spherical_angles(vectors.w_i), *spherical_angles(vectors.w_r))
        matrix = self.mueller(*angles, wavelength_nm)
        return matrix.astype(vectors.dtype)

    @array_lookup
    def mueller_in_plane(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Interpolate the Mueller BRDF [1/sr] between bases of the plane of light and viewer; as `mueller_vectors`."""
        facets = self._polarised
        located = self._wavelengths(wavelength_nm)
        vectors = checked_vectors(wi, wr)
        f_r = np.asarray(self.lookup_vectors(wi, wr, wavelength_nm))
        values = f_r if located.tail else f_r[..., np.newaxis]
        w_i, w_r = np.broadcast_arrays(*(w.astype(np.float64) for w in (vectors.w_i, vectors.w_r)))
        matrix = values[..., np.newaxis, np.newaxis] * facets.in_plane(w_i, w_r, values, located)
        return np.asarray(matrix if located.tail else matrix[..., 0, :, :], dtype=vectors.dtype)

    @array_lookup
    def facet_mueller(self, theta_d: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Interpolate the Mueller matrix [1] of a facet over its first element, between bases of the plane.

        `theta_d` [rad] is half the angle between light and viewer, in [0, pi/2]. Shaped as by `lookup`, and (4, 4).
        """
        facets = self._of_model
        located = self._wavelengths(wavelength_nm)
        matrix = facets.facet(np.asarray(theta_d, np.float64), located)
        return matrix if located.tail else matrix[..., 0, :, :]

    def depolarised(self, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Interpolate the depolarised part of f_r [1/sr], which is uniform, shape (M,); () for one wavelength."""
        located = self._wavelengths(wavelength_nm)
        return self._of_model.depolarised_at(located).reshape(located.tail)

    @array_lookup
    def specular_mueller(self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Interpolate the Mueller matrix [1] of the specular part, towards the mirror direction at phi_i + pi.

        Parameters, errors and shape are those of `specular_reflectance`, with (4, 4) added; bases are those of the
        surface, which are those of the plane. ParameterError, too, if the table is unpolarised.
        """
        specular = np.asarray(self.specular_reflectance(theta_i, wavelength_nm))
        if self.specular is None and isinstance(self._polarised, MuellerField):
            return np.zeros((*specular.shape, 4, 4), specular.dtype)
        matrix = specular[..., np.newaxis, np.newaxis] * self.facet_mueller(theta_i, wavelength_nm)
        return np.asarray(matrix, dtype=specular.dtype)

    @property
    def _of_model(self) -> MuellerFacets:
        if isinstance(self._polarised, MuellerField):
            text = f"the matrices of {self.name} are measured, and depend on all angles: they have no facet"
            raise ParameterError("polarised", text)
        return self._polarised

    @property
    def _polarised(self) -> MuellerFacets | MuellerField:
        if self.facets is None:
            raise ParameterError(
                "polarised", f"the table of {self.name} is unpolarised; build it with polarised = true in its recipe"
            )
        return self.facets

    @functools.cached_property
    def _specular_rows(self) -> _Specular:
        """The specular part as kernels read it; empty arrays where there is none."""
        if self.specular is None:
            return _Specular(np.empty(0), np.empty((0, 0), np.float32))
        nodes_deg = self.specular_theta_deg
        nodes = radians(self.axes_deg["theta_i"] if nodes_deg is None else nodes_deg)
        expected = (nodes.size,) if self.wavelength_nm is None else (nodes.size, self.wavelength_nm.size)
        if self.specular.shape != expected or nodes.size < 2:  # kernels do not look
            raise ParameterError(
                "specular", f"shape {self.specular.shape} of {self.name} is not {expected}, two nodes or more"
            )
        return _Specular(nodes, np.ascontiguousarray(self.specular.reshape(nodes.size, -1)))


def _flat(array: NDArray[Any], shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Return a flat array that is never writable: kernels are compiled anew for arrays that are, 10 s each time."""
    whole = array if array.shape == shape else np.broadcast_to(array, shape)
    flat = np.ascontiguousarray(whole, dtype=dtype).reshape(-1)
    flat.flags.writeable = False
    return flat


def points(grid: Grid, wi: Floats, wr: Floats) -> NDArray[np.float64]:
    """Return the coordinates [rad] on a grid, of shape (axes, N), of unit vectors of shape (N, 3)."""
    x = np.empty((len(grid.axes), len(wi)))
    mu = np.empty(len(wi))
    scratch = np.empty((6, len(wi)))
    rule = _coordinates.Rule(grid.half_difference, grid.reciprocal, grid.copies, False, 0.0, 0.0, False, False, False)
    flat = [_flat(w, np.shape(w), np.float64) for w in (wi, wr)]
    _coordinates.points_of_vectors(rule, flat[0], flat[1], len(wi), x, mu, scratch)
    return x


def table_from(name: str, revision: str, arrays: Mapping[str, NDArray[Any]], attrs: Mapping[str, Any]) -> Table:
    """Return the table that the arrays and attributes of a stored group describe; ValueError if they do not fit."""
    metadata = TableMetadata.read(attrs)
    interpolation = metadata.known_interpolation()
    measured = metadata.known_measured()
    variable = "brdf" if "brdf" in arrays else "parts"
    if variable not in arrays:
        raise ParameterError("brdf", f"neither it nor parts is among the arrays {', '.join(arrays) or 'none'}")
    grid = Grid({axis: arrays[axis] for axis in axes_among(arrays)})
    specular = arrays.get("specular_reflectance")
    uniform = arrays.get("uniform")
    wavelength_nm = arrays.get("wavelength")
    part_nm = np.array(metadata.part_wavelengths_nm) if metadata.part_wavelengths_nm else None
    basis = "mixture" if "mixture" in arrays else "spectra"
    spectra = arrays.get(basis)
    spectrum = () if wavelength_nm is None else check_wavelengths(wavelength_nm).shape
    channels = spectrum if spectra is None else spectra.shape[:1]
    if arrays[variable].shape != (*grid.shape, *channels):  # kernels do not look
        raise ParameterError(variable, f"shape {arrays[variable].shape} is not {(*grid.shape, *channels)}, of its axes")
    if spectra is not None and spectra.shape != (*channels, *spectrum):
        raise ParameterError(basis, f"shape {spectra.shape} is not {(*channels, *spectrum)}, of parts and wavelengths")
    if (part_nm is not None) != ("mixture" in arrays) or (part_nm is not None and part_nm.shape != channels):
        raise ParameterError("part_wavelengths_nm", "needs the array mixture, and one wavelength for each of its parts")
    if variable == "brdf" and not (interpolation.plain and spectra is uniform is None):
        raise ParameterError("brdf", "the attributes say that f_r is rebuilt from parts; rename the array to parts")
    if uniform is not None and uniform.size not in (1, *spectrum):
        raise ParameterError("uniform", f"{uniform.size} values are neither one nor one for each wavelength")
    glints = None if measured is None else measured.glints
    if glints is not None and glints.channels != (1 if wavelength_nm is None else wavelength_nm.size):
        raise ParameterError("glints", f"they have {glints.channels} wavelengths, and the table others")
    return Table(
        name=name,
        revision=revision,
        attrs=attrs,
        grid=grid,
        wavelength_nm=wavelength_nm,
        values=arrays[variable],
        specular=None if specular is None else specular.astype(np.float32),
        specular_theta_deg=arrays.get("specular_theta_i"),
        interpolation=interpolation,
        spectra=spectra,
        uniform=None if uniform is None else np.atleast_1d(uniform).astype(np.float64),
        part_nm=part_nm,
        n=arrays.get("n"),
        k=arrays.get("k"),
        facets=checked_field(arrays, wavelength_nm, metadata.polarisation)
        or checked_facets(arrays, 1 if wavelength_nm is None else wavelength_nm.size),
        glints=glints,
    )


class TableSource(FunctionSource):
    """A table as a source: the values of its lookups are its f_r, without glints.

    With `known_nm` (L,) [nm], increasing, the source is known at these wavelengths, too: beyond the range of a table of
    two or more wavelengths f_r is that of its first or last one. By default the source has the range of the table.
    """

    _table: Table = PrivateAttr()

    def __init__(self, table: Table, known_nm: NDArray[np.float64] | None = None) -> None:
        table = table.without_glints()
        recorded = table.source
        wavelength_nm = table.wavelength_nm
        metadata = table.metadata
        if known_nm is not None and wavelength_nm is not None and wavelength_nm.size > 1:
            wavelength_nm = np.union1d(wavelength_nm, known_nm)
        stated = metadata.source or "source not stated"
        record: dict[str, Any] = {
            "name": table.name,
            "title": metadata.title or table.name,
            "provenance": f"{stated}; by way of the table {table.name} {table.revision}",
            "wavelengths_nm": None if wavelength_nm is None else tuple(wavelength_nm.tolist()),
            "anisotropic": table.anisotropic,
            "elliptical": table.anisotropic and table.grid.copies == 4,
        }
        if isinstance(recorded, FunctionRecord):
            record |= {name: getattr(recorded, name) for name in ("reciprocal", "grazing_pole", "alpha")}

        def brdf(wi: Floats, wr: Floats, asked_nm: NDArray[np.float64] | None) -> Floats:
            return table.lookup_vectors(wi, wr, _in_range(table, asked_nm))

        super().__init__(brdf=brdf, **record)
        self._table = table

    @property
    def measured(self) -> Measured | None:
        """Return the record of the data if the table is measured, or None."""
        return self._table.metadata.measured

    @property
    def glints(self) -> Glints | None:
        """Return the peaks of f_r that the source leaves out; None if there are none."""
        return None if self.measured is None else self.measured.glints

    @functools.cached_property
    def sampler(self) -> Sampler | None:
        """The sampler of the table; None if f_r hardly varies, where the cosine draws directions with less noise."""
        number = np.arange(_DRAWN)
        wi = unit_vector(radians(_LIGHTS_DEG)[:, np.newaxis], 0.0)
        drawn = self._table.sample((number + 0.5) / _DRAWN, number * _TURN % 1.0, wi)
        weight, pdf = (np.reshape(values, (*drawn.wr.shape[:2], -1)) for values in (drawn.weight, drawn.pdf))
        mean = weight.mean(axis=-1)
        density = pdf[..., 0]
        cosine = np.maximum(drawn.wr[..., 2], 0.0)
        square = np.divide(np.pi * mean**2 * density, cosine, out=np.zeros(cosine.shape), where=cosine > 0.0)
        albedo = np.maximum(mean.mean(axis=1), _BLACK)
        varies = np.mean(square.mean(axis=1) / albedo**2 - 1.0) > _EVEN
        return self._table.sampler if varies else None

    @property
    def has_specular(self) -> bool:
        """Return True if the table holds the reflectance of a specular part."""
        return self._table.specular is not None

    def evaluated_at(self, wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the same wavelengths [nm], or the only one of the table; None if grey."""
        stored = self._table.wavelength_nm
        return wavelength_nm if stored is not None and stored.size > 1 else stored

    def specular_reflectance(self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Return the reflectance [1] of the specular part at theta_i [rad], 0 without one; shaped as by `lookup`."""
        return self._table.specular_reflectance(theta_i, _in_range(self._table, wavelength_nm))

    def _check_function(self) -> None:
        """Take the table as it is: between its nodes the two halves of a symmetry differ by its error."""


def _in_range(table: Table, wavelength_nm: ArrayLike | None) -> ArrayLike | None:
    """Return wavelengths [nm], those outside of the range of a table moved to its end."""
    stored = table.wavelength_nm
    return wavelength_nm if wavelength_nm is None or stored is None else np.clip(wavelength_nm, stored[0], stored[-1])


def source_of_table(table: Table, known_nm: NDArray[np.float64] | None = None) -> Source:
    """Return the material that a table was tabulated from, or else the table as a source, as of `TableSource`.

    ParameterError if the table holds what no f_r can be, or its name is not that of a material.
    """
    return table.source if isinstance(table.source, Material) else TableSource(table, known_nm)
