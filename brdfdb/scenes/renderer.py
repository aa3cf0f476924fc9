"""Radiance of the points that a camera sees, by the shading of the papers, with any function as the BRDF."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import radians
from brdfdb.materials import Source
from brdfdb.materials.source import Lookups
from brdfdb.parameters import Floats
from brdfdb.scenes.gbuffer import CameraView, VisiblePoints
from brdfdb.scenes.scene import Scene
from brdfdb.scenes.shapes import Array
from brdfdb.tables.albedo import source_albedo

# (wi, wr, wavelengths [nm]) of shapes (N, 3), (N, 3), (L,) -> f_r [1/sr] of shape (N, L), or (N, 1) without colour
Brdf = Callable[[Array, Array, Array], Floats]

# Albedos are polynomials of theta_r through this number of angles. The error is at most 4e-3 for the metals of the
# papers. Lines through 17 angles would have an error of 3e-2
_DEGREE = 20
_LAST = float(radians(89.5))  # last of these angles, beyond which albedos are constant
# Azimuths of anisotropic materials. The other half turn is the same, because lobes are ellipses and grooves straight
_PHI = np.pi / 6.0
_TOLERANCE = 1e-3  # absolute error of these albedos
_VISIBLE_NM = (380.0, 780.0)  # allowed wavelengths of a material whose picture is grey
_BATCH = 20_000  # pairs of viewer and light at a time; the calls cost little, and their spectra take 7 MB


class Reflector:
    """The reflection of a source in a scene: f_r, the albedo for ambient light, and the mirror.

    `wavelength_nm` are those of its evaluation: of the scene, or the first of a source that is stated for too few
    wavelengths for a colour; None for a grey source. ParameterError if the source is stated for invisible light, or is
    not known at the wavelengths of the scene.
    """

    def __init__(self, source: Source, wavelength_nm: Array) -> None:
        self.source = source
        self.wavelength_nm = source.evaluated_at(wavelength_nm)
        one = self.wavelength_nm[0] if self.wavelength_nm is not None and self.wavelength_nm.size == 1 else None
        if one is not None and not _VISIBLE_NM[0] <= one <= _VISIBLE_NM[1]:
            raise ParameterError(
                source.name,
                f"its parameters are stated for {one:g} nm, outside the visible, {_VISIBLE_NM[0]:g} to "
                f"{_VISIBLE_NM[1]:g} nm",
            )
        self._brdf = source.brdf_at(self.wavelength_nm)

    def brdf(self, wi: Array, wr: Array, _wavelength_nm: Array | None = None) -> Floats:
        """Return f_r [1/sr] of shape (N, L), or (N, 1) without colour."""
        return self._brdf(wi, wr)

    def mirror(self, wr: Array) -> Floats:
        """Return the reflectance [1] of the specular part towards viewers (N, 3): (N, L), or (N, 1)."""
        if not self.source.has_specular:
            return np.zeros((len(wr), 1))
        theta = np.arccos(np.clip(wr[:, 2], -1.0, 1.0))
        return np.reshape(self.source.specular_reflectance(theta, self.wavelength_nm), (len(wr), -1))

    def albedo(self, wr: Array) -> Floats:
        """Return the share [1] of ambient radiance that viewers (N, 3) see, without the mirror's: (N, L), or (N, 1)."""
        theta = np.minimum(np.arccos(np.clip(wr[:, 2], -1.0, 1.0)), _LAST)
        around = np.moveaxis(chebyshev.chebval(2.0 * theta / _LAST - 1.0, self._albedos), -1, 0)  # (N, azimuths, L)
        values = around[:, 0]
        if around.shape[1] > 1:
            turn, share = np.divmod(np.arctan2(wr[:, 1], wr[:, 0]) / _PHI, 1.0)
            row = np.arange(len(wr))
            low = turn.astype(np.int64) % around.shape[1]
            upper = around[row, (low + 1) % around.shape[1]]
            values = around[row, low] + share[:, np.newaxis] * (upper - around[row, low])
        return np.where(wr[:, 2:] >= 0.0, np.maximum(values, 0.0), 0.0)

    @functools.cached_property
    def _albedos(self) -> Array:
        """Polynomials of directional albedo, (coefficients, azimuths, L), for viewers and by reciprocity for lights."""
        anisotropic = self.source.anisotropic
        nodes = np.cos(np.pi * (np.arange(_DEGREE) + 0.5) / _DEGREE)
        phis = np.arange(0.0, np.pi - 1e-9, _PHI) if anisotropic else np.zeros(1)
        known = [
            [
                source_albedo(self.source, float(theta), float(phi), self.wavelength_nm, tolerance=_TOLERANCE).albedo
                for phi in phis
            ]
            for theta in _LAST * (nodes + 1.0) / 2.0
        ]
        shape = np.shape(known)
        return chebyshev.chebfit(nodes, np.reshape(known, (_DEGREE, -1)), _DEGREE - 1).reshape(shape)


def reflectors(scene: Scene) -> dict[str, Reflector]:
    """Return the reflectors of a scene by the names of their materials."""
    wavelength = np.array(scene.wavelengths_nm)
    return {name: Reflector(source, wavelength) for name, source in scene.materials.items()}


def radiance(scene: Scene, points: VisiblePoints, reflector: Reflector, brdf: Brdf | None = None) -> Floats:
    """Return the spectral radiance (N, L) of points in multiples of the illuminant; white has 1.

    Mirror images of other objects are left out; `render` adds them. `brdf` stands in for f_r of the reflector:
    ``brdf(wi, wr, wavelength_nm)`` gives (N, L) or (N, 1) [1/sr]; ParameterError if its result has another shape.

    Notes
    -----
    The radiance follows eq. (6) of Ward 1992 (``ward1992``): lights are deterministic and the environment is sampled.
    It also follows eq. (12) of He et al. 1991 (``he1991``): mirror, lights, and rho_hd times ambient light. rho_hd is
    the directional albedo of the same model for the direction of the viewer, not a constant. The mirror shows a light
    only where the mirror direction is within the disc of the light. Albedo and mirror are those of the material for any
    `brdf`.
    """
    wavelength = np.array(scene.wavelengths_nm)
    f_r = reflector.brdf if brdf is None else brdf
    total = np.zeros((len(points.wr), wavelength.size))
    step = max(1, _BATCH // max(1, len(points.wi)))
    for start in range(0, len(total), step):
        part = slice(start, start + step)
        irradiance = points.irradiance[:, part].T
        number, light = np.nonzero(irradiance * (points.wr[part, 2:] > 0.0))
        if number.size:
            reflected = np.asarray(f_r(points.wi[light, start + number], points.wr[start + number], wavelength))
            shapes = (number.size, wavelength.size), (number.size, 1)
            if reflected.shape not in shapes:
                raise ParameterError(
                    f"f_r of {points.material}",
                    f"{number.size} pairs of directions at {wavelength.size} wavelengths "
                    f"gave the shape {reflected.shape}; must be {shapes[0]} or {shapes[1]}",
                )
            first = np.flatnonzero(np.diff(number, prepend=-1))
            sums = np.add.reduceat(reflected * irradiance[number, light][:, np.newaxis], first)
            total[start + number[first]] += sums
    if scene.ambient:
        total += scene.ambient * reflector.albedo(points.wr)
    total += points.beyond[:, np.newaxis] * reflector.mirror(points.wr)
    return total


def render(
    scene: Scene,
    view: CameraView,
    brdfs: Mapping[str, Brdf | Lookups] | None = None,
    *,
    materials: Mapping[str, Reflector] | None = None,
    progress: Callable[[], None] | None = None,
) -> NDArray[np.float64]:
    """Render the picture of a scene.

    Parameters
    ----------
    scene : Scene
        The scene.
    view : CameraView
        The points of the view, from `brdfdb.scenes.gbuffer.gather`.
    brdfs : mapping, optional
        By the name of a material, a function, a source or a table that replaces its model.
    materials : mapping, optional
        The result of `reflectors`, with its albedos, for callers that render a scene more than once.
    progress : callable, optional
        A function that is called after each list of points.

    Returns
    -------
    array (height, width, L)
        Spectral radiance in multiples of the illuminant, averaged over each pixel. It is ambient radiance and
        environment where there is no object.

    Raises
    ------
    ParameterError
        If a key of `brdfs` is not a material of the scene, or a value is not a function or returns a wrong shape.
        If a material is stated for invisible light, or the view is that of another scene.
    """
    for points in view.points:
        if points.material not in scene.materials:
            text = f"it shows {points.material}, which is not a material of the scene; gather the view of this scene"
            raise ParameterError("view", text, points.material, tuple(scene.materials))
    known = reflectors(scene) if materials is None else materials
    replaced: dict[str, Brdf] = {}
    for name, given in ({} if brdfs is None else brdfs).items():
        if name not in scene.materials:
            text = f"{name!r} is not one of the scene's materials: {', '.join(scene.materials)}"
            raise ParameterError("brdfs", text, name, tuple(scene.materials))
        brdf = given.lookup_vectors if isinstance(given, Lookups) else given
        if not callable(brdf):
            raise ParameterError("brdfs", f"{name}: {given!r:.80} is not a function, a source or a table", given)
        replaced[name] = brdf
    lists = []
    for points in view.points:
        lists.append(radiance(scene, points, known[points.material], replaced.get(points.material)))
        if progress is not None:
            progress()
    return composed(scene, view, lists, known)


def composed(
    scene: Scene, view: CameraView, lists: Sequence[Floats], materials: Mapping[str, Reflector]
) -> NDArray[np.float64]:
    """Return the picture (height, width, L) of radiances of each list of points; mirrors add what they show."""
    known = materials
    lists = [values.copy() for values in lists]
    pixels = np.zeros((view.height * view.width, len(scene.wavelengths_nm)))
    free = np.full(len(pixels), float(view.samples))
    # Points seen in a mirror come after the points of the mirror in the list
    for points, values in zip(view.points[::-1], lists[::-1], strict=True):
        if points.via is None:
            np.add.at(pixels, points.at, values)
            np.add.at(free, points.at, -1.0)
        else:
            mirror = view.points[points.via]
            lists[points.via][points.at] += known[mirror.material].mirror(mirror.wr[points.at]) * values
    pixels += (scene.ambient * free + view.background)[:, np.newaxis]
    return pixels.reshape(view.height, view.width, -1) / view.samples
