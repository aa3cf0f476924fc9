"""Radiance of what a camera sees, by the shading of the papers, with any function as the BRDF."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from brdfdb.gather import Points, View
from brdfdb.geometry import radians
from brdfdb.materials import Material
from brdfdb.parameters import Floats
from brdfdb.quadrature import spectral_albedo
from brdfdb.scene import Scene
from brdfdb.shapes import Array

# (wi, wr, wavelengths [nm]) of shapes (N, 3), (N, 3), (L,) -> f_r [1/sr], (N, L), or (N, 1) where it has no colour
Brdf = Callable[[Array, Array, Array], Floats]

# Where the albedo of a viewer is known [degree]; linear between, and as at the last beyond
_THETA_DEG = np.array([*range(0, 70, 10), *range(70, 86, 3), 86.5, 88.0, 89.0, 89.5])
_PHI_DEG = np.arange(0.0, 181.0, 30.0)  # of anisotropic materials, whose other half turn is the same by reciprocity
_TOLERANCE = 1e-3  # absolute, of these albedos
_BATCH = 50_000  # pairs of viewer and light at a time: calls cost nothing beside them, and their spectra are 16 MB


class Reflector:
    """What a material does in a scene: f_r, the albedo that ambient light meets, and the mirror.

    Attributes
    ----------
    material : Material
        Which.
    wavelength_nm : array (L,) [nm] or None
        Where it is evaluated: that of the scene, or of the material if its parameters are stated for some wavelengths
        only, which do not make a colour. None of a model that is not spectral.
    """

    def __init__(self, material: Material, wavelength_nm: Array) -> None:
        self.material = material
        stated = material.wavelengths_nm
        at = None if not material.spectral else wavelength_nm if stated is None else np.array(stated[:1])
        self.wavelength_nm = at
        self._parameters = material.arguments(at)

    @functools.cached_property
    def _each(self) -> list[dict[str, float]]:
        """The parameters at each wavelength."""
        count = 1 if self.wavelength_nm is None else self.wavelength_nm.size
        return [
            {name: value if np.ndim(value) == 0 else value[w] for name, value in self._parameters.items()}
            for w in range(count)
        ]

    def brdf(self, wi: Array, wr: Array, _wavelength_nm: Array | None = None) -> Floats:
        """f_r [1/sr] of the model: (N, L), or (N, 1) where it has no colour."""
        # a wavelength at a time: all directions are one row of the kernel
        return np.stack([self.material.spec.vectors(wi, wr, **one) for one in self._each], axis=-1)

    def mirror(self, wr: Array) -> Floats:
        """Reflectance [1] of the Dirac part towards viewers (N, 3): (N, L), (N, 1), or 0."""
        spec = self.material.spec
        if spec.specular is None:
            return np.zeros((len(wr), 1))
        theta = np.arccos(np.clip(wr[:, 2], -1.0, 1.0))
        return np.stack(
            [spec.specular(theta, **{name: one[name] for name in spec.specular_parameters}) for one in self._each],
            axis=-1,
        )

    def albedo(self, wr: Array) -> Floats:
        """Share [1] of ambient radiance that viewers (N, 3) see, without the mirror's: (N, L), or (N, 1)."""
        theta = np.degrees(np.arccos(np.clip(wr[:, 2], -1.0, 1.0)))
        table = self._albedos
        low, share = _between(theta, _THETA_DEG)
        if table.shape[1] == 1:
            values = (1.0 - share) * table[low, 0] + share * table[low + 1, 0]
        else:
            turn, part = _between(np.degrees(np.arctan2(wr[:, 1], wr[:, 0])) % 180.0, _PHI_DEG)
            rows = [(1.0 - share) * table[low, turn + k] + share * table[low + 1, turn + k] for k in (0, 1)]
            values = (1.0 - part) * rows[0] + part * rows[1]
        return np.where(wr[:, 2:] >= 0.0, values, 0.0)

    @functools.cached_property
    def _albedos(self) -> Array:
        """Directional albedos over theta, phi and wavelength: by reciprocity, those of light are those of viewers."""
        anisotropic = self.material.anisotropic
        phis = _PHI_DEG[:-1] if anisotropic else _PHI_DEG[:1]
        rows = [
            [
                spectral_albedo(
                    self.material.spec,
                    float(radians(theta)),
                    float(radians(phi)),
                    self._parameters,
                    tolerance=_TOLERANCE,
                    mirrored=not anisotropic,
                ).albedo
                for phi in phis
            ]
            for theta in _THETA_DEG
        ]
        table = np.array(rows)
        return np.concatenate([table, table[:, :1]], axis=1) if anisotropic else table


def reflectors(scene: Scene) -> dict[str, Reflector]:
    """What the materials of a scene do, by name."""
    wavelength = np.array(scene.wavelengths_nm)
    return {name: Reflector(material, wavelength) for name, material in scene.materials.items()}


def radiance(scene: Scene, points: Points, reflector: Reflector, brdf: Brdf | None = None) -> Floats:
    """Spectral radiance of points, as multiples of the illuminant: 1 is white.

    Parameters
    ----------
    scene : Scene
        Its wavelengths and ambient light.
    points : Points
        What is seen.
    reflector : Reflector
        The material of the points.
    brdf : callable, optional
        f_r in place of the model's: ``brdf(wi, wr, wavelength_nm)`` gives (N, L) or (N, 1) [1/sr].

    Returns
    -------
    array (N, L)
        Without what the mirror shows of other objects, which `render` adds.

    Notes
    -----
    Eq. (6) of Ward 1992 (``ward1992``) with deterministic lights and ambient light in place of sampled one; eq. (12) of
    He et al. 1991 (``he1991``): mirror, lights, and rho_hd times ambient light, where rho_hd is the directional albedo
    of the same model for the direction of the viewer, not a constant. The mirror has a light only where the disc of
    the light holds the mirror direction. Albedo and mirror are those of the material whichever BRDF is given.
    """
    wavelength = np.array(scene.wavelengths_nm)
    f_r = reflector.brdf if brdf is None else brdf
    total = np.zeros((len(points.wr), wavelength.size))
    step = max(1, _BATCH // max(1, len(points.wi)))
    for start in range(0, len(total), step):
        part = slice(start, start + step)
        irradiance = points.irradiance[:, part].T
        number, light = np.nonzero(irradiance)
        if number.size:
            reflected = f_r(points.wi[light, start + number], points.wr[start + number], wavelength)
            first = np.flatnonzero(np.diff(number, prepend=-1))
            sums = np.add.reduceat(reflected * irradiance[number, light][:, np.newaxis], first)
            total[start + number[first]] += sums
    if scene.ambient:
        total += scene.ambient * reflector.albedo(points.wr)
    total += points.beyond[:, np.newaxis] * reflector.mirror(points.wr)
    return total


def render(
    scene: Scene,
    view: View,
    brdfs: Mapping[str, Brdf] | None = None,
    *,
    materials: Mapping[str, Reflector] | None = None,
    progress: Callable[[], None] | None = None,
) -> NDArray[np.float64]:
    """The picture of a scene.

    Parameters
    ----------
    scene : Scene
        What is seen.
    view : View
        Its points, by `brdfdb.gather.gather`.
    brdfs : mapping, optional
        By the name of a material, what is evaluated in place of its model.
    materials : mapping, optional
        The result of `reflectors`, which holds albedos: for callers that render a scene more than once.
    progress : callable, optional
        Called after each list of points.

    Returns
    -------
    array (height, width, L)
        Spectral radiance as multiples of the illuminant, averaged over each pixel; the ambient radiance where there is
        no object.
    """
    known = reflectors(scene) if materials is None else materials
    replaced = {} if brdfs is None else brdfs
    lists = []
    for points in view.points:
        lists.append(radiance(scene, points, known[points.material], replaced.get(points.material)))
        if progress is not None:
            progress()
    pixels = np.zeros((view.height * view.width, len(scene.wavelengths_nm)))
    free = np.full(len(pixels), float(view.samples))
    # what mirrors show comes after them in the list
    for points, values in zip(view.points[::-1], lists[::-1], strict=True):
        if points.via is None:
            np.add.at(pixels, points.at, values)
            np.add.at(free, points.at, -1.0)
        else:
            mirror = view.points[points.via]
            lists[points.via][points.at] += known[mirror.material].mirror(mirror.wr[points.at]) * values
    pixels += scene.ambient * free[:, np.newaxis]
    return pixels.reshape(view.height, view.width, -1) / view.samples


def _between(values: Array, nodes: Array) -> tuple[NDArray[np.int64], Array]:
    """The node below each value, and the share (N, 1) of the next one; beyond the last node that counts alone."""
    position = np.interp(values, nodes, np.arange(nodes.size))
    low = np.minimum(position.astype(np.int64), nodes.size - 2)
    return low, (position - low)[:, np.newaxis]
