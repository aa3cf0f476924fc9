"""Rays on the surface of a material as one more way to f_r: how far the exact form is from it, and what rays cost."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from pydantic import Field

from brdfdb.errors import MissingExtraError
from brdfdb.figure import DocumentPart
from brdfdb.integrals.patches import BASES
from brdfdb.materials import Material
from brdfdb.materials.spectrum import Spectrum
from brdfdb.microgeometry.facets import Facets
from brdfdb.microgeometry.model_errors import SurfaceError, surface_error
from brdfdb.microgeometry.surfaces import MadeSurface

ESTIMATES = 4  # maps whose spread gives the standard error
NODES = 256  # of a map along each axis: to prepare larger ones takes most of the time
RAYS = 2048  # rays for each light on each map: the standard error is about 2 %
_FLAT = 1e-3  # slope below which no map is made
_DIM = 0.01  # of the peak: darker values do not count


class RayCost(DocumentPart):
    """Time of rays on the machine that made the chart, for all pairs of as many lights and viewers at once."""

    ns: float = Field(description="processor time of a value of f_r, with its share of making and preparing the maps")
    standard_error: float = Field(
        description="of these values, relative: the root of the mean square where f_r exceeds a hundredth of its peak"
    )
    directions: int = Field(description="number of lights, and of viewers: the patches of a basis of Klems")


class ChartedSurface(DocumentPart):
    """Rays on the surface that suits a material. The truth of a chart is itself off from such a surface."""

    error: SurfaceError = Field(
        description="error of the truth against the rays; those of points are against the truth"
    )
    cost: RayCost | None = Field(description="null: outside of the map, a flat surface, or no tracer is installed")

    @property
    def title(self) -> str:
        """The surface in a few words."""
        slope = "" if self.error.slope is None else f", slope {self.error.slope:.2g}"
        return f"rays on a Gaussian surface{slope}"


def charted_surface(material: Material | None, clock: Callable[[], float] = time.process_time) -> ChartedSurface | None:
    """Return the surface that suits a material, and the cost of rays on it; None if there is no map for its model."""
    error = None if material is None else surface_error(material)
    if material is None or error is None:
        return None
    if error.slope is None or error.slope < _FLAT:
        return ChartedSurface(error=error, cost=None)
    rho = material.parameters.get("rho")
    if isinstance(rho, Spectrum):
        rho = float(np.mean(rho.values))
    facets = Facets(mirror=1.0) if rho is None else Facets(rho=rho)
    try:
        return ChartedSurface(error=error, cost=_cost(MadeSurface("gaussian", error.slope, nodes=NODES), facets, clock))
    except MissingExtraError:
        return ChartedSurface(error=error, cost=None)


def _cost(surface: MadeSurface, facets: Facets, clock: Callable[[], float]) -> RayCost:
    """Trace rays on a few maps of a surface, and return their time and the standard error that they reach."""
    from brdfdb.microgeometry.goniometer import bounces  # scipy, which other charts do not need

    # Rays of diffuse facets serve all pairs, so that many take hardly longer; not so those of mirror-like facets
    directions = BASES["quarter" if facets.mirror else "full"].middles
    start = clock()
    values = np.stack(
        [
            bounces(
                surface.draw(seed),
                facets,
                directions,
                directions,
                rays=RAYS,
                seed=seed,
                turned=surface.isotropic,
                gaussian_slopes=(surface.slope, surface.slope),
            ).total
            for seed in range(ESTIMATES)
        ]
    )
    seconds = clock() - start
    mean = values.mean(axis=0)
    variance = values.var(axis=0, ddof=1) / ESTIMATES
    bright = mean > _DIM * mean.max()
    reached = float(np.sqrt(np.mean(variance[bright] / mean[bright] ** 2)))
    ns = float(f"{1e9 * seconds / mean.size:.3g}")
    return RayCost(ns=ns, standard_error=float(f"{reached:.2g}"), directions=len(directions))
