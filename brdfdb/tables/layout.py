"""What a table is going to be: its material, grid and wavelengths, decided and checked before anything is computed."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

from brdfdb.errors import ParameterError
from brdfdb.materials import Material
from brdfdb.parameters import Floats
from brdfdb.tables.grids import Grid, check_wavelengths

TABLE_VERSION = 3  # of the variables, dimensions and attributes of a table

_METHODS = ("linear", "cubic")

_BLOCK_VALUES = 1 << 20  # values of a block, 4 MB


@dataclass(frozen=True)
class Interpolation:
    """How the numbers of a table become f_r between its nodes.

    Attributes
    ----------
    method : str
        "linear", or "cubic": Catmull-Rom, each cell the Hermite cubic with the slopes of parabolas through three nodes.
    logarithm : bool
        Whether logarithms are tabulated and interpolated.
    offset : float [1/sr]
        What is added before logarithms are taken: values much smaller take no nodes.
    power : float
        What is tabulated is f_r times (cos theta_i cos theta_r) to this power, in {0, 1/2, 1}: without the pole that a
        model has at the horizon.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")  # where attributes of tables are read

    method: str = "linear"
    logarithm: bool = False
    offset: float = 0.0
    power: float = 0.0

    def __post_init__(self) -> None:
        if self.method not in _METHODS:
            raise ParameterError(
                "interpolation", f"{self.method!r} is not one of {', '.join(_METHODS)}", self.method, tuple(_METHODS)
            )
        if self.power not in (0.0, 0.5, 1.0):
            raise ParameterError("power", f"{self.power!r} is not 0, 0.5 or 1", self.power, (0.0, 0.5, 1.0))

    @property
    def cubic(self) -> bool:
        """Whether four nodes of an axis count, not two."""
        return self.method == "cubic"

    @property
    def plain(self) -> bool:
        """Whether it is f_r itself that is tabulated."""
        return not self.logarithm and self.power == 0.0

    def numbers(self, f_r: Floats, mu: Floats) -> Floats:
        """What is tabulated of f_r [1/sr], shape (..., L), where mu = cos theta_i cos theta_r, shape (...)."""
        values = f_r if self.power == 0.0 else f_r * (mu**self.power)[..., np.newaxis]
        return np.log(values + self.offset) if self.logarithm else values

    def f_r(self, numbers: Floats, mu: Floats) -> Floats:
        """f_r [1/sr] from what is tabulated: the inverse of `numbers`, nothing below 0."""
        values = np.maximum(np.exp(numbers) - self.offset, 0.0) if self.logarithm else numbers
        return values if self.power == 0.0 else values / (mu**self.power)[..., np.newaxis]


PLAIN = Interpolation()


@dataclass(frozen=True, eq=False)
class Layout:
    """A table that is still to be computed: plain data that travels to workers and into a staging directory.

    Parameters
    ----------
    material : Material
        Model, parameters and where they come from.
    grid : Grid
        Angles [degree]; anisotropic for anisotropic materials.
    wavelength_nm : array of shape (L,) [nm], optional
        For spectral materials, and only for them.
    interpolation : Interpolation
        How the numbers of the table become f_r between its nodes; by default they are f_r, and linear.
    spectra : array of shape (parts, L), optional
        Of logarithms: orthonormal rows that make up the spectrum of every node, which then is stored in parts.
    bits : int
        Bits of the mantissa that are kept, in [1, 23].
    reason : str
        Why the table is laid out so.

    Raises
    ------
    ValueError
        If grid or wavelengths do not suit the material: no wavelengths for a spectral one, an isotropic grid for an
        anisotropic one, an azimuth of 90 or 180 degrees for a surface without the symmetry of an ellipse, a node at 90
        degrees where the model has a pole.
    """

    material: Material
    grid: Grid
    wavelength_nm: NDArray[np.float64] | None = None
    interpolation: Interpolation = PLAIN
    spectra: NDArray[np.float64] | None = None
    bits: int = 23
    reason: str = ""

    def __post_init__(self) -> None:
        material = self.material
        if material.spectral != (self.wavelength_nm is not None):
            raise ParameterError(
                "wavelengths_nm", f"{material.name} {'needs them' if material.spectral else 'is grey'}"
            )
        if material.anisotropic and not self.grid.anisotropic:
            raise ParameterError(
                "grid", f"{material.name} is anisotropic and needs the axes theta_i, phi_i, theta_r, phi_r"
            )
        if material.anisotropic and material.spec.lobe_axes is None and self.grid.copies > 1:
            raise ParameterError("grid", f"{material.name} has no symmetry of an ellipse; phi must end at 360 degrees")
        if material.spec.grazing_pole and self.interpolation.plain and self.grid.reaches_horizon:
            raise ParameterError(
                "grid",
                f"theta of 90 degrees is a pole of the model {material.spec.name} ({material.name}); "
                "end the axis below 90",
            )
        if self.wavelength_nm is not None:
            object.__setattr__(self, "wavelength_nm", check_wavelengths(self.wavelength_nm))
            material.arguments(self.wavelength_nm)

    @property
    def plain(self) -> bool:
        """Whether the stored numbers are f_r itself."""
        return self.interpolation.plain and self.spectra is None

    @property
    def apart(self) -> str | None:
        """The parameter whose part of f_r, the same in all directions, is not in the table but beside it."""
        return None if self.plain else self.material.spec.uniform

    @property
    def uniform(self) -> NDArray[np.float64] | None:
        """That part [1/sr], of shape (1,)."""
        return None if self.apart is None else np.array([self.material.parameters[self.apart] / np.pi])

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
        """Rows of the first axis that make a block, the piece that a worker computes and a chunk of the store."""
        return max(1, min(self.shape[0], _BLOCK_VALUES // math.prod(self.shape[1:])))

    @property
    def blocks(self) -> list[slice]:
        """The rows of the first axis that each block holds."""
        return [
            slice(start, min(start + self.block_rows, self.shape[0]))
            for start in range(0, self.shape[0], self.block_rows)
        ]

    def document(self) -> dict[str, Any]:
        """All that decides the values, ready for JSON; `from_document` makes the same layout of it."""
        return {
            "table_version": TABLE_VERSION,
            "model_version": self.material.spec.version,
            "material": self.material.model_dump(mode="json"),
            "grid": {name: nodes.tolist() for name, nodes in self.grid.axes.items()},
            "wavelength_nm": None if self.wavelength_nm is None else self.wavelength_nm.tolist(),
            "interpolation": asdict(self.interpolation),
            "spectra": None if self.spectra is None else self.spectra.tolist(),
            "bits": self.bits,
            "reason": self.reason,
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Layout:
        """The layout that a document describes."""
        arrays = {
            name: None if document[name] is None else np.array(document[name]) for name in ("wavelength_nm", "spectra")
        }
        return cls(
            Material.model_validate(document["material"]),
            Grid(document["grid"]),
            interpolation=Interpolation(**document["interpolation"]),
            bits=document["bits"],
            reason=document["reason"],
            **arrays,
        )


def digest(document: Mapping[str, Any]) -> str:
    """sha256 of a document, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()
