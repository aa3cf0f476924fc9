"""Layouts: the source, grid and wavelengths of a table, decided and checked before anything is computed."""

from __future__ import annotations

import functools
import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

from brdfdb._elementary import COS_HORIZON
from brdfdb.errors import BrdfdbError, ParameterError
from brdfdb.geometry import HALF_PI
from brdfdb.materials import Material, Source, source_of
from brdfdb.materials.polarised import polarised_source
from brdfdb.parameters import Floats
from brdfdb.tables.grids import Grid, check_wavelengths

if TYPE_CHECKING:
    from brdfdb.tables.mueller_field import MuellerField

TABLE_VERSION = 6  # of the variables, dimensions and attributes of a table

_METHODS = ("linear", "cubic")
LINEAR = "linear"

_BLOCK_VALUES = 1 << 20  # values of a block, 4 MB


@dataclass(frozen=True)
class Interpolation:
    """The way from the numbers of a table to f_r between its nodes."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")  # where attributes of tables are read

    #: "linear", or "cubic": Catmull-Rom, each cell the Hermite cubic with the slopes of parabolas through three nodes
    method: str = "linear"
    logarithm: bool = False  #: True if logarithms are tabulated and interpolated
    offset: float = 0.0  #: number that is added before logarithms are taken: much smaller values take no nodes, [1/sr]
    #: f_r is tabulated times (cos theta_i cos theta_r) to this power, in {0, 1/2, 1}: without the pole that a source
    #: may have at the horizon
    power: float = 0.0
    #: between wavelengths, "cubic": Catmull-Rom of the numbers of the table; or "linear": straight lines of f_r, as
    #: parameters are joined that a recipe gives at a few wavelengths
    wavelengths: str = "cubic"

    def __post_init__(self) -> None:
        for method in (self.method, self.wavelengths):
            if method not in _METHODS:
                raise ParameterError(
                    "interpolation", f"{method!r} is not one of {', '.join(_METHODS)}", method, tuple(_METHODS)
                )
        if self.power not in (0.0, 0.5, 1.0):
            raise ParameterError("power", f"{self.power!r} is not 0, 0.5 or 1", self.power, (0.0, 0.5, 1.0))

    @property
    def cubic(self) -> bool:
        """True if four nodes of an axis count, not two."""
        return self.method == "cubic"

    @property
    def straight(self) -> bool:
        """True if f_r itself is joined between wavelengths, by straight lines; else the numbers are, by cubics."""
        return self.wavelengths == LINEAR

    @property
    def plain(self) -> bool:
        """True if f_r itself is tabulated."""
        return not self.logarithm and self.power == 0.0

    def numbers(self, f_r: Floats, mu: Floats) -> Floats:
        """Return the numbers to tabulate for f_r [1/sr], shape (..., L); mu = cos theta_i cos theta_r, shape (...)."""
        values = f_r if self.power == 0.0 else f_r * (mu**self.power)[..., np.newaxis]
        return np.log(values + self.offset) if self.logarithm else values

    def f_r(self, numbers: Floats, mu: Floats) -> Floats:
        """Return f_r [1/sr] from tabulated numbers: the inverse of `numbers`, nothing below 0."""
        values = np.maximum(np.exp(numbers) - self.offset, 0.0) if self.logarithm else numbers
        return values if self.power == 0.0 else values / (mu**self.power)[..., np.newaxis]


PLAIN = Interpolation()


def over_wavelengths(source: Source) -> str:
    """Return the interpolation of a source between wavelengths: "linear" if a parameter is a spectrum, else "cubic"."""
    return LINEAR if isinstance(source, Material) and source.spectra else "cubic"


@dataclass(frozen=True, eq=False)
class Layout:
    """A table that is still to be computed.

    The layout of a material is plain data that travels to workers and into a staging directory. That of a function
    stays in this process.

    Raises
    ------
    ValueError
        If grid or wavelengths do not suit the source: no wavelengths for a spectral one, an isotropic grid for an
        anisotropic one, an azimuth of 90 or 180 degrees for a surface without the symmetry of an ellipse, a node at 90
        degrees where f_r has a pole, Mueller matrices of a source that has none.
    """

    source: Source  #: material or function to tabulate
    grid: Grid  #: angles [degree]; anisotropic for anisotropic sources
    wavelength_nm: NDArray[np.float64] | None = None  #: wavelengths of spectral sources, and only of them, (L,) [nm]
    #: the way from the numbers of the table to f_r; by default they are f_r, and linear
    interpolation: Interpolation = PLAIN
    #: basis of a factored spectrum. Without `part_nm` its rows are orthonormal and make logarithms: nodes store
    #: coefficients. With `part_nm` the rows say how f_r at those wavelengths makes f_r at all, (parts, L)
    spectra: NDArray[np.float64] | None = None
    bits: int = 23  #: bits of the mantissa to keep, in [1, 23]
    reason: str = ""  #: reason for the layout, in words
    #: wavelengths of the parts of a table whose spectra mix f_r itself: nodes store the numbers at these wavelengths,
    #: (parts,) [nm]
    part_nm: NDArray[np.float64] | None = None
    #: half angles between light and viewer, from 0 to 90, at which a polarised table stores its Mueller matrix; see
    #: `brdfdb.tables.polarisation`, (T,) [degree]
    facet_theta_d_deg: NDArray[np.float64] | None = None
    #: measured Mueller matrices of a polarised table
    field: MuellerField | None = None

    def __post_init__(self) -> None:
        source = self.source
        if source.spectral != (self.wavelength_nm is not None):
            raise ParameterError("wavelengths_nm", f"{source.name} {'needs them' if source.spectral else 'is grey'}")
        if source.anisotropic and not self.grid.anisotropic:
            raise ParameterError(
                "grid", f"{source.name} is anisotropic and needs the axes theta_i, phi_i, theta_r, phi_r"
            )
        if source.anisotropic and not source.elliptical and self.grid.copies > 1:
            raise ParameterError("grid", f"{source.name} has no symmetry of an ellipse; phi must end at 360 degrees")
        if self.grid.half_difference and self.grid.reciprocal and not source.reciprocal:
            end = 360 if source.anisotropic else 180
            raise ParameterError("grid", f"{source.name} is not reciprocal; phi_d must end at {end} degrees")
        if source.grazing_pole and self.interpolation.plain and self.grid.reaches_horizon:
            raise ParameterError("grid", f"theta of 90 degrees is a pole of {source.name}; end the axis below 90")
        if self.wavelength_nm is not None:
            object.__setattr__(self, "wavelength_nm", check_wavelengths(self.wavelength_nm))
            source.brdf_at(self.wavelength_nm)
        if self.facet_theta_d_deg is not None:
            polarised_source(source)

    @property
    def plain(self) -> bool:
        """True if the stored numbers are f_r itself."""
        return self.interpolation.plain and self.spectra is None

    @functools.cached_property
    def tabulated(self) -> Source:
        """The source whose f_r is in the table: without its uniform part, unless the stored numbers are f_r itself."""
        return self.source if self.plain else self.source.without_uniform()

    @property
    def evaluated_nm(self) -> NDArray[np.float64] | None:
        """The wavelengths [nm] at which nodes are evaluated: those of the parts of a mixture; None: grey."""
        return self.wavelength_nm if self.part_nm is None else self.part_nm

    @property
    def uniform(self) -> NDArray[np.float64] | None:
        """The uniform part [1/sr] if it is stored separately: (1,), or (L,) if it is a spectrum."""
        return None if self.plain else self.source.uniform_at(self.wavelength_nm)

    @property
    def variable(self) -> str:
        """Name of the variable that holds the values."""
        return "brdf" if self.plain else "parts"

    @property
    def spectral_dims(self) -> dict[str, int]:
        """Name and length of the last dimension of the variable, if it has one besides the axes of the grid."""
        if self.spectra is not None:
            return {"part": self.spectra.shape[0]}
        return {} if self.wavelength_nm is None else {"wavelength": self.wavelength_nm.size}

    @property
    def dims(self) -> tuple[str, ...]:
        """Dimensions of the variable: the axes of the grid and, last, that of the spectrum, if it has one."""
        return (*self.grid.axes, *self.spectral_dims)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the variable."""
        return (*self.grid.shape, *self.spectral_dims.values())

    @property
    def size(self) -> int:
        """Number of values of the variable."""
        return math.prod(self.shape)

    @property
    def block_rows(self) -> int:
        """Number of rows of the first axis in a block: the piece that a worker computes, and a chunk of the store."""
        return max(1, min(self.shape[0], _BLOCK_VALUES // math.prod(self.shape[1:])))

    @property
    def blocks(self) -> list[slice]:
        """The rows of the first axis that each block holds."""
        rows = self.shape[0]
        every = self.block_rows
        return [slice(start, min(start + every, rows)) for start in range(0, rows, every)]

    def document(self) -> dict[str, Any]:
        """Return all that determines the values, as JSON, except the callable of a function."""
        return {
            "table_version": TABLE_VERSION,
            **self.source.document(),
            "grid": {name: nodes.tolist() for name, nodes in self.grid.axes.items()},
            "wavelength_nm": None if self.wavelength_nm is None else self.wavelength_nm.tolist(),
            "interpolation": asdict(self.interpolation),
            "spectra": None if self.spectra is None else self.spectra.tolist(),
            "bits": self.bits,
            "reason": self.reason,
            **({} if self.part_nm is None else {"part_nm": self.part_nm.tolist()}),
            **({} if self.facet_theta_d_deg is None else {"facet_theta_d_deg": self.facet_theta_d_deg.tolist()}),
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Layout:
        """Return the layout that a document describes; BrdfdbError for a function, which a document cannot hold."""
        source = source_of(document)
        if not isinstance(source, Material):
            raise BrdfdbError(
                f"{source.name}: is a function, which no other process can read from a file; tabulate it in this one, "
                "with brdfdb.store.publication.publish"
            )
        arrays: dict[str, Any] = {
            name: None if document.get(name) is None else np.array(document[name])
            for name in ("wavelength_nm", "spectra", "part_nm", "facet_theta_d_deg")
        }
        return cls(
            source,
            Grid(document["grid"]),
            interpolation=Interpolation(**document["interpolation"]),
            bits=document["bits"],
            reason=document["reason"],
            **arrays,
        )


def digest(document: Mapping[str, Any]) -> str:
    """Return the sha256 of a document, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()


def rebuilt(
    numbers: Floats,
    interpolation: Interpolation,
    spectra: Floats | None,
    uniform: Floats | None,
    theta_i: Floats,
    theta_r: Floats,
    *,
    mixed: bool,
) -> Floats:
    """Return f_r [1/sr] at nodes, shape (..., L), from the numbers there, shape (..., coefficients or L).

    theta_i and theta_r [rad] broadcast to the shape of the nodes. It is 0 below the horizon. `mixed` says that the
    spectra mix f_r, not logarithms.
    """
    wavelengths = numbers if spectra is None or mixed else numbers.astype(np.float64) @ spectra
    mu = np.maximum(np.cos(theta_i), COS_HORIZON) * np.maximum(np.cos(theta_r), COS_HORIZON)
    f_r = interpolation.f_r(wavelengths, mu)
    if mixed and spectra is not None:
        f_r = np.maximum(f_r @ spectra, 0.0)
    f_r = f_r + (0.0 if uniform is None else uniform)
    return np.asarray(np.where((np.maximum(theta_i, theta_r) > HALF_PI)[..., np.newaxis], 0.0, f_r))
