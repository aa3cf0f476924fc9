"""What a table is going to be: its material, grid and wavelengths, decided and checked before anything is computed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.grids import Grid, check_wavelengths
from brdfdb.materials import Material

TABLE_VERSION = 2  # of the variables, dimensions and attributes of a table

_BLOCK_VALUES = 1 << 20  # values of a block, 4 MB


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

    Raises
    ------
    ValueError
        If grid or wavelengths do not suit the material: no wavelengths for a spectral one, an isotropic grid for an
        anisotropic one, a node at 90 degrees where the model has a pole.
    """

    material: Material
    grid: Grid
    wavelength_nm: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        material = self.material
        if material.spectral != (self.wavelength_nm is not None):
            raise ValueError(f"wavelengths_nm: {material.name} {'needs them' if material.spectral else 'is grey'}")
        if material.anisotropic and not self.grid.anisotropic:
            raise ValueError(f"grid: {material.name} is anisotropic and needs the axes theta_i, phi_i, theta_r, phi_r")
        if material.spec.grazing_pole and self.grid.reaches_horizon:
            raise ValueError(
                f"grid: theta of 90 degrees is a pole of the model {material.spec.name} ({material.name}); "
                "end the axis below 90"
            )
        if self.wavelength_nm is not None:
            object.__setattr__(self, "wavelength_nm", check_wavelengths(self.wavelength_nm))
            material.arguments(self.wavelength_nm)

    @property
    def variable(self) -> str:
        """Name of the variable that holds the values."""
        return "brdf"

    @property
    def dims(self) -> tuple[str, ...]:
        """Dimensions of the variable: the axes of the grid and, last, that of the spectrum, if it has one."""
        return (*self.grid.axes, *(() if self.wavelength_nm is None else ("wavelength",)))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the variable."""
        return (*self.grid.shape, *(() if self.wavelength_nm is None else self.wavelength_nm.shape))

    @property
    def size(self) -> int:
        """Number of values of the variable."""
        return int(np.prod(self.shape))

    @property
    def block_rows(self) -> int:
        """Rows of the first axis that make a block, the piece that a worker computes and a chunk of the store."""
        return max(1, min(self.shape[0], _BLOCK_VALUES // int(np.prod(self.shape[1:]))))

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
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Layout:
        """The layout that a document describes."""
        wavelength_nm = document["wavelength_nm"]
        return cls(
            Material.model_validate(document["material"]),
            Grid(document["grid"]),
            None if wavelength_nm is None else np.array(wavelength_nm),
        )


def digest(document: Mapping[str, Any]) -> str:
    """sha256 of a document, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()
