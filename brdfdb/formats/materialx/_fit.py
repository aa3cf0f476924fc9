"""The surface of MaterialX that comes closest to a table: least squares of cube roots of f_r, as `conversion` has."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.conversion.nodes import COARSE, TruthNodes
from brdfdb.errors import import_extra
from brdfdb.formats._channels import Channels
from brdfdb.formats.materialx._surface import OPEN_PBR, MaterialXSurface, darkest_edge
from brdfdb.integrals.pairs import Symmetry
from brdfdb.lobes import Lobe
from brdfdb.parameters import Floats
from brdfdb.tables.table import Table

Array = NDArray[np.float64]

DIGITS = 6  # significant digits of the parameters, which are also those of the shaders
_NARROWEST, _WIDEST = 1e-3, 1.0  # alphas that are searched: narrower lobes are smooth surfaces to a renderer
_MOST_F_0 = 0.9  # reflectance of a dielectric at normal incidence, an index of 37
_STEPS = 40  # most steps of a descent
_PURE = 1e-3  # share of metal, or of the rest, that is left out
_PRECISION = 1e-5  # of the distance and of the numbers
_METALS = 0.1, 0.9  # shares of metal at which descents begin: one ends in a painted surface, one in a metal
_FLOOR = 1e-4  # share of the mean f_r below which cube roots are those of this share: their slope has a pole at 0


def fitted(kind: str, table: Table, channels: Channels) -> MaterialXSurface:
    """Return the surface of a kind whose f_r in the channels is closest to that of a table.

    The channels are one, or red, green and blue. If nothing but the specular part is in the lobe of the table, the
    facets of the surface mirror, with a roughness of 0. The specular part of other tables is left out.

    The sum over all pairs of directions, with both cosines, of the squared difference of cube roots of f_r is made
    least. It is the distance "lightness" of `brdfdb.conversion.convert`, which keeps highlights. All numbers of all
    channels are searched together by least squares, which takes half a second. The simplexes of `convert`, for which
    any distance will do, take minutes for three channels.
    """
    source = table.source
    at = channels.wavelength_nm
    symmetry = Symmetry(table.anisotropic, source is not None and source.elliptical)

    def lobe(cos: Array) -> Lobe | None:
        return None if source is None else source.lobe(cos, at)

    def truth(wi: Floats, wr: Floats) -> Floats:
        return channels.values(table, wi, wr)

    def mirror(theta: Array) -> Floats:
        return channels.of_spectra(np.asarray(table.specular_reflectance(theta, at)))

    normal = lobe(np.asarray(1.0))
    smooth = table.specular is not None and normal is not None and not np.any(normal.share)
    nodes = TruthNodes(lobe, COARSE, symmetry, truth, mirror if smooth else None, "lightness")
    if not np.any(nodes.truth) and not (smooth and np.any(nodes.specular)):
        black = (0.0,) * nodes.truth.shape[1]
        return MaterialXSurface(kind, black, black, specular_weight=0.0)
    search = _MaterialXSearch(kind, nodes, normal, smooth, table.anisotropic)
    return _tidied(min((search.descent(metal) for metal in search.metals), key=search.distance))


class _MaterialXSearch:
    """A search for the surface that is closest at nodes.

    `normal` is the lobe at normal incidence, None of a diffuse source. The facets of a smooth surface mirror.
    """

    def __init__(self, kind: str, nodes: TruthNodes, normal: Lobe | None, smooth: bool, anisotropic: bool) -> None:
        self.kind = kind
        self.nodes = nodes
        self.smooth = smooth
        self.diffuse = normal is None
        self.black = not np.any(nodes.truth)  # but for the mirror direction
        self.metals = _METALS[:1] if self.diffuse or self.black else _METALS
        self.widths = np.zeros(0)
        if normal is not None and not smooth:
            widths = np.array([np.min(normal.alpha_x), np.min(normal.alpha_y)])[: 2 if anisotropic else 1]
            self.widths = np.log(np.clip(widths, 1.01 * _NARROWEST, 0.99 * _WIDEST))
        truth = nodes.truth
        weight = nodes.weight
        if smooth:
            truth = np.concatenate([truth, nodes.specular])
            weight = np.concatenate([weight, nodes.theta_weight])
        self._floor = np.cbrt(_FLOOR * (weight @ np.abs(truth)) / weight.sum())
        self._truth = np.maximum(np.cbrt(truth), self._floor)
        self._weight = np.sqrt(weight[:, np.newaxis] / (weight @ self._truth**2))

    def surface(self, numbers: Array) -> MaterialXSurface:
        """Return the surface of the numbers that are searched."""
        colors = self._truth.shape[1]
        roughness = float(numbers[0])
        base = tuple(numbers[1 : 1 + colors].tolist())
        if self.diffuse:
            # OpenPBR takes the light of a black highlight from the body, at grazing: least of a rough one
            rough = 1.0 if self.kind == OPEN_PBR else 0.3
            return MaterialXSurface(
                self.kind, base, base_diffuse_roughness=roughness, specular_weight=0.0, specular_roughness=rough
            )
        edge = numbers[1 + colors : 1 + 2 * colors]
        rest = numbers[1 + 2 * colors :]
        if self.kind == OPEN_PBR:
            edge = np.maximum(edge, darkest_edge(numbers[1 : 1 + colors]))
        root, metal, weight = rest[:3].tolist()
        facets: dict[str, Any] = {"specular_roughness": 0.0}
        if self.widths.size:
            facets = of_alphas(self.kind, float(np.exp(rest[3])), float(np.exp(rest[-1])))
        return MaterialXSurface(
            self.kind,
            base,
            tuple(edge.tolist()),
            base_diffuse_roughness=roughness,
            base_metalness=1.0 if self.black else metal,
            specular_weight=weight if self.kind == OPEN_PBR else 1.0,
            specular_ior=(1.0 + root) / (1.0 - root),
            **facets,
        )

    def descent(self, metal: float) -> MaterialXSurface:
        """Return the surface at the end of a descent that begins with a share of metal."""
        least_squares = import_extra("scipy.optimize").least_squares
        colors = self._truth.shape[1]
        begin = [0.3] * (1 + colors)
        low = [0.0] * (1 + colors)
        high = [1.0] * (1 + colors)
        if not self.diffuse:
            begin += [*([0.7] * colors), 0.3, metal, 0.7, *self.widths]
            low += [*([0.0] * (colors + 3)), *np.full(self.widths.size, np.log(_NARROWEST))]
            high += [*([1.0] * colors), np.sqrt(_MOST_F_0), 1.0, 1.0, *np.full(self.widths.size, np.log(_WIDEST))]
        end = least_squares(
            self._left, begin, bounds=(low, high), ftol=_PRECISION, xtol=_PRECISION, max_nfev=_STEPS, tr_solver="lsmr"
        )
        return self.surface(end.x)

    def distance(self, surface: MaterialXSurface) -> float:
        """Return the squared distance of a surface, which is made least."""
        return float(np.sum(self._residuals(surface) ** 2))

    def _left(self, numbers: Array) -> Array:
        return self._residuals(self.surface(numbers)).ravel()

    def _residuals(self, surface: MaterialXSurface) -> Array:
        values = surface.brdf(self.nodes.wi, self.nodes.wr)
        if self.smooth:
            values = np.concatenate([values, surface.specular_reflectance(self.nodes.theta)])
        return np.asarray(self._weight * (np.maximum(np.cbrt(values), self._floor) - self._truth))


def of_alphas(kind: str, alpha_x: float, alpha_y: float) -> dict[str, Any]:
    """Return the roughness, the anisotropy and the turn of the tangent that give GGX these widths along x and y."""
    wide, narrow = max(alpha_x, alpha_y), min(alpha_x, alpha_y)
    square = np.sqrt(0.5 * (wide**2 + narrow**2)) if kind == OPEN_PBR else np.sqrt(wide * narrow)
    return {
        "specular_roughness": float(np.sqrt(square)),
        "specular_anisotropy": 1.0 - narrow / wide,
        "quarter_turn": alpha_y > alpha_x,
    }


def _tidied(surface: MaterialXSurface) -> MaterialXSurface:
    """Return a surface that is all metal, or no metal, if it nearly is, without the parameters that then do nothing."""
    if surface.base_metalness > 1.0 - _PURE:
        return replace(surface, base_metalness=1.0, specular_ior=1.5, base_diffuse_roughness=0.0)
    return replace(surface, base_metalness=0.0) if surface.base_metalness < _PURE else surface
