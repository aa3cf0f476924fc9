"""Stokes pictures of a sphere and matrices in Mitsuba's bases, by Mitsuba and by lookups of ours."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import spherical_angles
from brdfdb.tables import stokes

FLIPPED = np.diag([1.0, 1.0, -1.0, -1.0])  # U and V of Mitsuba have the opposite sign
SIZE, FINE = 32, 16  # pixels of the picture, and samples of each, along one side
RADIUS = 0.95
LIGHT = np.array([0.8, 0.3, 0.52]) / np.linalg.norm([0.8, 0.3, 0.52])

Array = NDArray[Any]


def turned(s: Array, phi: Array, k: Array) -> Array:
    """Return rotations of Stokes vectors from bases of the surface to those with s along a vector; travel along k."""
    own = stokes.horizontal(phi)
    return stokes.rotation(np.arctan2(np.sum(s * np.cross(own, k), axis=-1), np.sum(s * own, axis=-1)))


def as_mitsuba_has_them(mitsuba: Any, matrices: Array, wi: Array, wr: Array) -> Array:
    """Return matrices between bases of the surface as Mitsuba has them, for one light and one viewer each."""
    x_i, x_r = (_bases(mitsuba, k) for k in (-wi, wr))
    light, viewer = turned(x_i, spherical_angles(wi)[1], -wi), turned(x_r, spherical_angles(wr)[1], wr)
    return np.asarray(FLIPPED @ viewer @ matrices @ np.swapaxes(light, -1, -2) @ FLIPPED)


def _bases(mitsuba: Any, k: Array) -> Array:
    """Return the first axis (N, 3) of Mitsuba's basis for directions of travel."""
    basis, vector = mitsuba.mueller.stokes_basis, mitsuba.Vector3f
    if mitsuba.variant().startswith("scalar"):
        return np.array([np.ravel(basis(vector(*w))) for w in k.tolist()])
    return np.array(basis(vector(np.ascontiguousarray(k.T, np.float32)))).T


def picture_of_mitsuba(mitsuba: Any, surface: dict[str, Any]) -> Array:
    """Return the picture (SIZE, SIZE, 4) of a sphere in directional light: luminances of I, Q, U and V."""
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "pixel_format": "luminance"}
    camera = mitsuba.ScalarTransform4f().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0])
    scene = mitsuba.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "stokes", "nested": {"type": "direct"}},
            "sensor": {
                "type": "orthographic",
                "to_world": camera,
                "film": film,
                "sampler": {"type": "stratified", "sample_count": FINE**2},
            },
            "sun": {
                "type": "directional",
                "direction": (-LIGHT).tolist(),
                "irradiance": {"type": "uniform", "value": 1.0},
            },
            "ball": {"type": "sphere", "radius": RADIUS, "bsdf": surface},
        }
    )
    channels = np.array(mitsuba.render(scene))[..., 1:].reshape(SIZE, SIZE, 4, 3)
    return np.asarray(channels @ [0.2126, 0.7152, 0.0722])


def picture_of_lookups(matrices_in_plane: Callable[[Array, Array], Array]) -> Array:
    """Return the same picture from matrices; light in the basis of the camera, whose x is that of the picture."""
    at = (np.arange(SIZE * FINE) + 0.5) * (2.0 / (SIZE * FINE)) - 1.0
    x, y = np.meshgrid(at, -at)
    seen = x**2 + y**2 < RADIUS**2
    z = np.sqrt(RADIUS**2 - x[seen] ** 2 - y[seen] ** 2)
    normal = np.stack([x[seen], y[seen], z], axis=-1) / RADIUS
    across = np.cross([0.0, 1.0, 0.3], normal)
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    frame = np.stack([across, np.cross(normal, across), normal], axis=1)
    viewer = np.array([0.0, 0.0, 1.0])
    local_i, local_r = frame @ LIGHT, frame @ viewer
    lit = local_i[:, 2] > 0.0
    reflected = np.zeros((len(normal), 4))
    matrices = matrices_in_plane(local_i[lit], local_r[lit])
    reflected[lit] = matrices[:, :, 0] * local_i[lit][:, 2:]  # of unpolarised light, in the basis of the plane
    s = np.cross(LIGHT, viewer) / np.linalg.norm(np.cross(LIGHT, viewer))
    camera = np.array([1.0, 0.0, 0.0])
    angle = np.arctan2(camera @ np.cross(s, viewer), camera @ s)
    picture = np.zeros((*x.shape, 4))
    picture[seen] = reflected @ (FLIPPED @ stokes.rotation(angle)).T
    return np.asarray(picture.reshape(SIZE, FINE, SIZE, FINE, 4).mean(axis=(1, 3)))


def off_by(theirs: Array, ours: Array) -> list[float]:
    """Return the share [1] of I, Q and U by which a picture is off."""
    wrong = np.abs(theirs - ours)[..., :3].sum(axis=(0, 1)) / np.abs(ours)[..., :3].sum(axis=(0, 1))
    return [float(share) for share in wrong]
