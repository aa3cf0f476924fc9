"""Tables of a store or a service in Dr.Jit: interpolated as `Table.lookup` does, and sampled from the table alone."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import radians, unit_vector
from brdfdb.mitsuba._buffers import Buffer, whole
from brdfdb.mitsuba._grid import CellPlace, GridAxis, GridValues, points
from brdfdb.mitsuba._surface import DIFFUSE, GLOSSY, SPECULAR, Facet, Formula, Values
from brdfdb.mitsuba._wavelengths import Columns, projection
from brdfdb.store import open as open_store
from brdfdb.tables._interpolation import prepared, weights_of_nodes
from brdfdb.tables.mueller_field import MuellerField
from brdfdb.tables.polarisation import MuellerFacets
from brdfdb.tables.sampler import LOBE_SHARE, Cells
from brdfdb.tables.table import Table, table_from

Array = NDArray[np.float64]

_LEAST_COS = 6.1e-17  # cosine of the horizon, as of `Table.lookup`
_LARGEST = 1e38  # f_r [1/sr] stays below
_DRAWN = 256  # directions from which the albedo of the table is estimated, to share samples with the specular part
_TURN = (np.sqrt(5.0) - 1.0) / 2.0  # the golden section
_LEAST = 1e-6  # albedo
_FLAT = 1e-30  # z of a half vector up to which the density counts as 0
_LEAST_SQUARE = 1e-20


def loaded(name: str, store: str | None) -> Table:
    """Return a table of a store or a service, with all its numbers in memory."""
    opened = open_store(store)
    table = opened[name]
    if isinstance(table, Table):
        return table
    dataset = opened.dataset(name, table.revision).load()
    arrays = {str(key): np.asarray(variable.values) for key, variable in dataset.variables.items()}
    return table_from(name, table.revision, arrays, table.attrs)


class TableFormula(Formula):
    """The plugin ``brdfdb_table``: the table of a `material` in a `store`, a directory or the address of a service.

    Without `store` it is that of the environment variable ``BRDFDB_STORE``. Its parts are the tabulated one, the
    uniform one and the specular one.

    RGB variants project the spectrum on linear sRGB, as ``export rgl --kind rgb`` does. If `channels` is "wavelengths",
    their channels have `WAVELENGTHS_NM`, as mono has. `wavelength_nm` sets one wavelength for all channels.
    """

    def __init__(self, props: Any) -> None:
        if "material" not in props:
            raise ParameterError("material", "the name of a material in the store is missing")
        table = loaded(props["material"], props.get("store", None))
        if table.glints is not None:
            mi.Log(mi.LogLevel.Warn, f"{table.name}: {table.glints.left_out('the values of the plugin')}")
            table = table.without_glints()
        self.name, self.anisotropic = table.name, table.anisotropic
        self._grid, self._how = table.grid, table.interpolation
        self._mixed = table.part_nm is not None or table.straight  # f_r is interpolated between wavelengths
        single_nm = props.get("wavelength_nm", 0.0)
        self._projection = projection(props, None if single_nm else table.wavelength_nm)
        self._least = 0.0 if self._projection is None else -_LARGEST  # of a part in a channel [1/sr]
        self._columns = Columns(table.wavelength_nm, single_nm)
        axes = prepared([radians(nodes) for nodes in table.axes_deg.values()], table.grid.ends, cubic=self._how.cubic)
        numbers: NDArray[Any] = table.values.reshape(*table.grid.shape, -1)
        weights = self._weights(table)
        basis = table.spectra
        if table.straight and basis is not None and table.part_nm is None:
            numbers, basis = numbers @ basis, None
        mixing = weights.T if basis is None else basis @ weights.T
        self._spectrum: Array | None = None  # numbers that are logarithms, at the wavelengths of a projection
        if self._projection is not None:
            weights = self._projection.weights.T @ weights
            self._spectrum = None if self._mixed or not self._how.logarithm else mixing
            mixing = mixing @ self._projection.weights
        # Linear in the numbers: the channels of the variant take the place of those of the table
        self._whole = not mi.is_spectral and not self._mixed and self._spectrum is None
        self._values = GridValues(axes, np.asarray(numbers @ mixing, np.float32) if self._whole else numbers)
        self._rows = Buffer(mixing)
        if mi.is_polarized and isinstance(table.facets, MuellerField):
            text = f"the Mueller matrices of {table.name} are measured, and the plugin reads those of models alone"
            raise ParameterError("polarised", f"{text}; use an unpolarised variant, or look the table up")
        self._facets = None
        if mi.is_polarized and isinstance(table.facets, MuellerFacets):
            self._facets = _TableFacets(table.facets, table, self._columns)
        self._lobe = CellsLobe(table.sampler.cells)
        self.components = (GLOSSY,)
        if table.uniform is not None and np.any(table.uniform > 0.0):
            self.components = (*self.components, DIFFUSE)
            uniform = weights @ np.broadcast_to(table.uniform, weights.shape[1])
            self._uniform = Buffer(np.maximum(uniform, self._least))
        if table.specular is not None and np.any(table.specular > 0.0):
            self.components = (*self.components, SPECULAR)
            self._read_specular(table)

    def _weights(self, table: Table) -> Array:
        """Return the weights (columns, L) of the wavelengths of the table, or (M, L) at those of the projection."""
        at_nm = self._columns.at_nm if self._projection is None else self._projection.wavelength_nm
        if table.wavelength_nm is None or at_nm is None:
            return np.ones((1, 1))
        index, weight = weights_of_nodes(table.wavelength_nm, at_nm, cubic=not table.straight)
        matrix = np.zeros((at_nm.size, table.wavelength_nm.size))
        np.add.at(matrix, (np.arange(at_nm.size)[:, np.newaxis], index), weight)
        return matrix

    def _read_specular(self, table: Table) -> None:
        nodes = table.specular_theta_deg
        theta = radians(table.axes_deg["theta_i"] if nodes is None else nodes)
        self._specular_axis = GridAxis(prepared([theta], [("open", "open")], cubic=False), 0)
        if self._projection is None:
            reflectance = table.specular_reflectance(theta, self._columns.at_nm)
        else:
            spectra = table.specular_reflectance(theta, self._projection.wavelength_nm)
            reflectance = np.maximum(spectra @ self._projection.weights, 0.0)
        self._specular = Buffer(reflectance)
        number = np.arange(_DRAWN)
        wi = unit_vector(theta, np.zeros(theta.size))[:, np.newaxis]
        drawn = table.sample((number + 0.5) / _DRAWN, number * _TURN % 1.0, wi)
        self._albedo = Buffer(drawn.weight.reshape(theta.size, _DRAWN, -1).mean(axis=(1, 2)))

    def at(self, interaction: Any, active: Any) -> Values:  # noqa: ARG002  # a table is the same all over the surface
        """Return the places of the wavelengths in the table."""
        return {"places": self._columns.places(interaction)}

    def parts(self, values: Values, wi: Any, wo: Any) -> dict[str, Any]:
        """Return f_r [1/sr] of the tabulated part and of the uniform part."""
        numbers = self._values(points(self._grid, wi, wo))
        if self._mixed:
            numbers = [self._f_r(number) for number in numbers]
        places = values["places"]
        if self._spectrum is not None:
            totals = self._projected(numbers, self._spectrum)
        else:
            totals = [numbers[int(place)] if self._whole else self._total(numbers, place) for place in places]
            if not self._mixed:
                totals = [self._f_r(total) for total in totals]
        glossy = dr.maximum(mi.UnpolarizedSpectrum(totals), self._least) * self._off_the_pole(wi, wo)
        parts = {GLOSSY: dr.minimum(glossy, _LARGEST)}
        if DIFFUSE in self.components:
            uniform = [self._columns.read(self._uniform, 0, place) for place in places]
            parts[DIFFUSE] = mi.UnpolarizedSpectrum(uniform)
        return parts

    def _total(self, numbers: list[Any], place: Any) -> Any:
        """Return the number at a wavelength, from those of the channels of the table."""
        rows = (self._columns.read(self._rows, channel, place) for channel in range(len(numbers)))
        return sum(number * row for number, row in zip(numbers, rows, strict=True))

    def _projected(self, numbers: list[Any], spectrum: Array) -> list[Any]:
        """Return linear sRGB of f_r at the wavelengths of the projection."""
        assert self._projection is not None
        values = [self._f_r(_combined(numbers, mixing)) for mixing in spectrum.T]
        return [_combined(values, weights) for weights in self._projection.weights.T]

    def _f_r(self, number: Any) -> Any:
        return dr.maximum(dr.exp(number) - self._how.offset, 0.0) if self._how.logarithm else number

    def _off_the_pole(self, wi: Any, wo: Any) -> Any:
        cos_i, cos_r = dr.maximum(wi.z, _LEAST_COS), dr.maximum(wo.z, _LEAST_COS)
        if self._how.power == 0.5:
            return dr.rsqrt(cos_i) * dr.rsqrt(cos_r)
        return 1.0 / cos_i / cos_r if self._how.power == 1.0 else 1.0

    def facet(self, values: Values, wi: Any, wo: Any) -> Facet | None:
        """Return the Mueller matrix of a facet; None if the table is unpolarised."""
        return None if self._facets is None else self._facets.at(values["places"], wi, wo)

    def depolarised(self, values: Values) -> Any:
        """Return the depolarised part [1/sr] of the tabulated one: a uniform part that it includes."""
        return 0.0 if self._facets is None else self._facets.inside(values["places"])

    def lobe(self, values: Values, wi: Any) -> CellsLobe:  # noqa: ARG002  # the lobe of other models depends on them
        """Return the cells of the table."""
        return self._lobe

    def specular(self, values: Values, wi: Any) -> Any:
        """Return the specular reflectance [1]."""
        row, share = self._specular_place(wi)
        read = self._columns.read
        rows = [
            read(self._specular, row, place) * (1.0 - share) + read(self._specular, row + 1, place) * share
            for place in values["places"]
        ]
        return mi.UnpolarizedSpectrum(rows)

    def specular_share(self, values: Values, wi: Any) -> Any:
        """Return the share [1] of samples in the mirror direction, that of the light."""
        row, share = self._specular_place(wi)
        scattered = self._albedo.at(row) * (1.0 - share) + self._albedo.at(row + 1) * share
        specular = dr.mean(self.specular(values, wi))
        return specular / dr.maximum(specular + scattered, _LEAST)

    def _specular_place(self, wi: Any) -> CellPlace:
        return self._specular_axis.place(dr.atan2(dr.sqrt(dr.square(wi.x) + dr.square(wi.y)), wi.z))

    def traverse(self, callback: Any) -> None:
        """Show the numbers of the table to the scene as differentiable parameters."""
        for channel, numbers in enumerate(self._values.nodes):
            callback.put(f"values_{channel}", numbers.loaded(), mi.ParamFlags.Differentiable)

    def parameters_changed(self) -> None:
        """Take numbers that the scene has changed."""
        self._values.refresh()

    @property
    def description(self) -> list[str]:
        """The lines of a text about the plugin."""
        return [f"material = {self.name}"]


def _combined(numbers: list[Any], weights: Array) -> Any:
    return sum(number * float(weight) for number, weight in zip(numbers, weights, strict=True) if weight)


class _TableFacets:
    """The polarisation of a table: `brdfdb.tables.polarisation.MuellerFacets`."""

    def __init__(self, facets: MuellerFacets, table: Table, columns: Columns) -> None:
        assert columns.at_nm is not None  # of all tables with Mueller matrices
        assert table.wavelength_nm is not None
        nodes = [radians(facets.theta_d_deg), *([table.wavelength_nm] if table.wavelength_nm.size > 1 else [])]
        axes = prepared(nodes, [("open", "open")] * len(nodes), cubic=True)
        if table.straight and axes.width.size > 1:
            axes.width[1] = 2
        self._elements = GridValues(axes, facets.elements.reshape(*(axis.size for axis in nodes), -1))
        self._columns = columns
        beside = 0.0 if table.uniform is None else table.uniform
        inside = np.broadcast_to(np.maximum(facets.depolarised - beside, 0.0), table.wavelength_nm.shape)
        self._inside = Buffer(np.interp(columns.at_nm, table.wavelength_nm, inside))

    def at(self, places: list[Any], wi: Any, wo: Any) -> Facet:
        """Return the matrix of each channel."""
        theta_d = dr.atan2(dr.norm(wi - wo), dr.norm(wi + wo))
        channels = [self._elements([theta_d, self._columns.nm(place)]) for place in places]
        return Facet(*(mi.UnpolarizedSpectrum([elements[k] for elements in channels]) for k in range(3)))

    def inside(self, places: list[Any]) -> Any:
        """Return the depolarised part [1/sr] that the numbers of the table include."""
        return mi.UnpolarizedSpectrum([self._columns.read(self._inside, 0, place) for place in places])


# Samples from the cells of a table: `brdfdb.tables.sampler`, with alias tables in place of searches


class _RandomChoice(NamedTuple):
    """A choice between two by a random number: whether it is the second, and a random number for the next choice."""

    second: Any
    number: Any

    @classmethod
    def of(cls, number: Any, weight: Any) -> _RandomChoice:
        """Choose the second of two with a probability."""
        second = number < weight
        low, width = dr.select(second, 0.0, weight), dr.select(second, weight, 1.0 - weight)
        return cls(second, (number - low) / dr.maximum(width, _LEAST_SQUARE))


class _Turn(NamedTuple):
    """The numbers of the azimuths of lights before and behind a direction, and the weight of the second."""

    before: Any
    behind: Any
    weight: Any


class _Alias:
    """Rows of probabilities, from which one number draws a cell and the place in it (Walker 1977)."""

    def __init__(self, probability: Array) -> None:
        """Take probabilities (rows, cells) whose sums are 1."""
        rows, self._count = probability.shape
        left = probability * self._count
        begin, alias = np.ones_like(left), np.zeros_like(left)
        settled = np.zeros(left.shape, bool)
        every = np.arange(rows)
        for _ in range(self._count):
            # What a cell lacks to 1 comes from the fullest one
            poor = np.argmin(np.where(settled, np.inf, left), axis=1)
            rich = np.argmax(np.where(settled, -np.inf, left), axis=1)
            begin[every, poor], alias[every, poor] = np.clip(left[every, poor], 0.0, 1.0), rich
            left[every, rich] -= 1.0 - begin[every, poor]
            settled[every, poor] = True
        self._rows = Buffer(np.stack([begin, alias], axis=-1))

    def draw(self, row: Any, u: Any) -> CellPlace:
        """Return the cell of a row that a random number chooses, and the place in it."""
        scaled = u * self._count
        own = whole(scaled, self._count)
        rest = scaled - own
        begin, alias = self._rows.row(row * self._count + own, 2)
        kept = rest < begin
        place = dr.select(kept, rest, rest - begin) / dr.maximum(dr.select(kept, begin, 1.0 - begin), _LEAST_SQUARE)
        return CellPlace(dr.select(kept, own, mi.UInt32(alias)), dr.clip(place, 0.0, 1.0))


class CellsLobe:
    """The cells of half vectors of a table as the lobe of a sampler."""

    share = alone = LOBE_SHARE

    def __init__(self, cells: Cells) -> None:
        lights, self._rings, self._columns = cells.probability.shape
        self._turns = cells.turns
        self._theta_i = _axis(cells.theta_i)
        # Rings are found by the logarithm: those of a narrow lobe differ in size by orders of magnitude
        self._log_edges = _axis(np.log(np.append(0.5 * cells.edges[1], cells.edges[1:])))
        self._edges = Buffer(np.stack([cells.edges[:-1], np.diff(cells.edges)], axis=1))
        self._along_theta = _Alias(cells.rings)
        self._along_phi = _Alias(cells.along_phi.reshape(-1, self._columns))
        # The cells of two adjacent lights
        density = cells.density.reshape(lights // self._turns, self._turns, self._rings, self._columns)
        self._density = Buffer(np.stack([density[:-1], density[1:]], axis=-1))

    def draw(self, wi: Any, choice: Any, sample: Any) -> Any:
        """Return the direction `wi` mirrored in a half vector of the cells."""
        light, weight = self._light(wi)
        chosen = _RandomChoice.of(choice, weight)
        row = (light + dr.select(chosen.second, mi.UInt32(1), mi.UInt32(0))) * self._turns
        if self._turns > 1:
            turn = self._turn(wi)
            second = _RandomChoice.of(chosen.number, turn.weight).second
            row = row + dr.select(second, turn.behind, turn.before)
        ring, u = self._along_theta.draw(row, sample.x)
        low, width = self._edges.row(ring, 2)
        versine = low + width * u
        column, v = self._along_phi.draw(row * self._rings + ring, sample.y)
        sin_phi, cos_phi = dr.sincos((mi.Float(column) + v) * (dr.two_pi / self._columns))
        sin = dr.sqrt(dr.maximum(versine * (2.0 - versine), 0.0))
        h = self._turned(mi.Vector3f(sin * cos_phi, sin * sin_phi, 1.0 - versine), wi, 1.0)
        return mi.reflect(wi, h)

    def density(self, wi: Any, wo: Any) -> Any:
        """Return the density [1/sr] of the directions that `draw` gives, for directions above the horizon."""
        h = wi + wo
        inverse = dr.rsqrt(dr.maximum(dr.squared_norm(h), _LEAST_SQUARE))
        local = self._turned(h * inverse, wi, -1.0)
        versine = (dr.square(local.x) + dr.square(local.y)) / (1.0 + local.z)
        ring, _ = self._log_edges.place(dr.log(dr.maximum(versine, _LEAST_SQUARE)))
        column = whole(_turns(local, self._columns), self._columns)
        light, weight = self._light(wi)
        rows: list[tuple[Any, Any]] = [(1.0, mi.UInt32(0))]
        if self._turns > 1:
            turn = self._turn(wi)
            rows = [(1.0 - turn.weight, turn.before), (turn.weight, turn.behind)]
        total: Any = 0.0
        for share, row in rows:
            place = ((light * self._turns + row) * self._rings + ring) * self._columns + column
            begin, end = self._density.row(place, 2)
            total = total + share * (begin + weight * (end - begin))
        return dr.select(h.z > _FLAT, 0.5 * total * inverse, 0.0)

    def _light(self, wi: Any) -> CellPlace:
        """Return the number of the light before `wi` in theta, and the weight of the light behind it."""
        return self._theta_i.place(dr.atan2(dr.sqrt(dr.square(wi.x) + dr.square(wi.y)), wi.z))

    def _turn(self, wi: Any) -> _Turn:
        turn = _turns(wi, self._turns)
        before = whole(turn, self._turns)
        behind = dr.select(before >= self._turns - 1, mi.UInt32(0), before + 1)
        return _Turn(before, behind, dr.clip(turn - before, 0.0, 1.0))

    def _turned(self, h: Any, wi: Any, sign: float) -> Any:
        """Return half vectors of an isotropic table turned by the azimuth of the light; others stay."""
        if self._turns > 1:
            return h
        sin2 = dr.square(wi.x) + dr.square(wi.y)
        upright = sin2 < _LEAST_SQUARE
        inverse = dr.rsqrt(dr.select(upright, 1.0, sin2))
        cos_phi, sin_phi = dr.select(upright, 1.0, wi.x * inverse), dr.select(upright, 0.0, sign * wi.y * inverse)
        return mi.Vector3f(h.x * cos_phi - h.y * sin_phi, h.x * sin_phi + h.y * cos_phi, h.z)


def _axis(nodes: Array) -> GridAxis:
    return GridAxis(prepared([nodes], [("open", "open")], cubic=False), 0)


def _turns(w: Any, count: int) -> Any:
    """Return the azimuth in parts of the turn, from 0 to their number."""
    phi = dr.atan2(w.y, w.x)
    return dr.select(phi < 0.0, phi + dr.two_pi, phi) * (count / dr.two_pi)
