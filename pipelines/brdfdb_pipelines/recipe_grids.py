"""Grids of recipes: lists of numbers and ranges, and the axes of each kind of table."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Discriminator, FailFast, Field, Tag, TypeAdapter

from brdfdb.errors import ParameterError
from brdfdb.tables.grids import Axis

STRICT = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)
_MOST_NODES = 100_000  # nodes of an axis: far more than any recipe uses, and far less than fills the memory


class RecipeError(ParameterError):
    """A recipe that cannot be built: the file, the field with the tables around it, and a sentence."""

    file = ""

    def __str__(self) -> str:
        return ": ".join(part for part in (self.file, self.parameter, self.sentence) if part)


class Range(BaseModel):
    """Equally spaced numbers from start to stop, both included."""

    model_config = STRICT

    start: float
    stop: float
    step: float = Field(gt=0.0)

    def nodes(self, name: str) -> Axis:
        """Return the numbers; RecipeError if the step does not lead from start to stop."""
        count = (self.stop - self.start) / self.step
        if count >= _MOST_NODES:
            raise RecipeError(name, f"steps of {self.step:g} make too many nodes; an axis has at most {_MOST_NODES}")
        if not count >= 0.0 or abs(count - round(count)) > 1e-6:
            raise RecipeError(name, f"steps of {self.step:g} from {self.start:g} do not end at {self.stop:g}")
        return np.linspace(self.start, self.stop, round(count) + 1)


# FailFast: otherwise pydantic collects two errors for each wrong number
Nodes = Annotated[list[float | Range], FailFast(), Field(min_length=1, max_length=_MOST_NODES)]
LIST: TypeAdapter[list[float | Range]] = TypeAdapter(Nodes, config=ConfigDict(strict=True, allow_inf_nan=False))


def nodes_of(name: str, parts: list[float | Range]) -> Axis:
    """Return the numbers of a list with ranges; RecipeError if there are more than an axis may have."""
    pieces = []
    count = 0
    for part in parts:
        pieces.append(part.nodes(name) if isinstance(part, Range) else np.array([part]))
        count += pieces[-1].size
        if count > _MOST_NODES:
            raise RecipeError(name, f"the list has too many nodes; an axis has at most {_MOST_NODES}")
    return np.concatenate(pieces)


class _GridAxes(BaseModel):
    model_config = STRICT


class IsotropicGrid(_GridAxes):
    """Axes of a table of an isotropic material."""

    theta_i_deg: Nodes
    theta_r_deg: Nodes
    delta_phi_deg: Nodes


class AnisotropicGrid(_GridAxes):
    """Axes of a table of an anisotropic material."""

    theta_i_deg: Nodes
    phi_i_deg: Nodes
    theta_r_deg: Nodes
    phi_r_deg: Nodes


class HalfDifferenceGrid(_GridAxes):
    """Axes of half and difference vectors, of a table of an isotropic material."""

    theta_h_deg: Nodes
    theta_d_deg: Nodes
    phi_d_deg: Nodes


class AnisotropicHalfDifferenceGrid(_GridAxes):
    """Axes of half and difference vectors, of a table of an anisotropic material."""

    theta_h_deg: Nodes
    phi_h_deg: Nodes
    theta_d_deg: Nodes
    phi_d_deg: Nodes


def _meant(grid: Any) -> str:
    """Return the kind of grid that a table of a recipe is meant to be."""
    half = isinstance(grid, BaseModel | dict) and "theta_h_deg" in (grid if isinstance(grid, dict) else dict(grid))
    return "half" if half else "plain"


AnyIsotropicGrid = Annotated[
    Annotated[IsotropicGrid, Tag("plain")] | Annotated[HalfDifferenceGrid, Tag("half")], Discriminator(_meant)
]
AnyAnisotropicGrid = Annotated[
    Annotated[AnisotropicGrid, Tag("plain")] | Annotated[AnisotropicHalfDifferenceGrid, Tag("half")],
    Discriminator(_meant),
]


class Grids(BaseModel):
    """The grid for each kind of material, over light and viewer or over half and difference vectors.

    A kind of which the recipe has no material may be left out.
    """

    model_config = STRICT

    isotropic: AnyIsotropicGrid | None = None
    spectral: AnyIsotropicGrid | None = None
    anisotropic: AnyAnisotropicGrid | None = None
