"""The view of a camera: the visible points of each object, with viewer and lights in the frame of the surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import radians
from brdfdb.scenes.scene import Camera, Object, Rays, Scene
from brdfdb.scenes.shapes import Array, PlaneShape, Recorded, unit

# Distance of the origins of shadow and mirror rays from their surface
_LIFT = 1e-4  # share of the height of the picture there
_ROUNDED = 1e-14  # share of coordinates, which are rounded
_BATCH = 40_000  # shadow rays at a time; fewer are slow because of the calls, and twice as many leave the cache
# Cosine that separates limbs from backs of surfaces. The smooth normals of cones turn away by half a degree at limbs
_BEHIND = -0.1
_WIDEST = 8192  # most pixels on a side: a spectral picture of 8192 x 6144 takes 16 GB
_MOST = 16384  # most rays on a side
_LENGTH_OFF = 0.05  # largest error of the length of a recorded vector; it is 5e-4 in an EXR with 16 bits


@dataclass(frozen=True, eq=False)
class VisiblePoints:
    """The N points of one object that a camera sees, directly or in the mirror of another object.

    Irradiance includes the cosine and is 0 in shadow. It is pi for a light of strength 1 that the surface faces, and is
    multiplied with the illuminant for spectral irradiance. For the environment, it is radiance times cosine times solid
    angle.
    """

    name: str  # the object
    material: str
    wr: Array  # (N, 3), unit vectors towards the viewer; x is along the grain, z the normal
    wi: Array  # (E, N, 3), unit vectors to each sample of each light, then to each direction of the environment
    irradiance: Array  # (E, N), by that sample
    beyond: Array  # (N,), radiance from the mirror direction; 0 where an object of the list stands there
    via: int | None  # number of the points in whose mirror these are seen; None if the camera sees them
    at: NDArray[np.int64]  # (N,), pixels, row by row from the top, or indices among the points of `via`


class CameraView(NamedTuple):
    """The view of a camera: lists of points. Points seen in a mirror come after the points of the mirror.

    `samples` is the number of rays of each of width x height pixels. Rays without a point meet no object.
    `background` (width * height,) is the radiance of the environment along those, summed over the rays of each pixel.
    """

    points: list[VisiblePoints]
    width: int
    height: int
    samples: int
    background: Array


def gather(scene: Scene, width: int, *, across: int = 1) -> CameraView:
    """Trace rays from the camera to the nearest object, from there to the lights, and once into mirrors.

    Parameters
    ----------
    scene : Scene
        The scene. A recorded scene has the size of its file.
    width : int
        Pixels across the picture. The aspect of the camera gives the pixels down. Either side has 8192 at most.
    across : int
        Rays across each pixel and down, so that `across` squared are averaged. Either side has 16384 rays at most.

    Returns
    -------
    CameraView
        A list of points for each object, then for each mirror and each object that it shows.

    Raises
    ------
    ParameterError
        If a side has too many pixels or rays. If no ray meets an object, the camera is inside one, or a light shines on
        nothing visible. If a recorded file holds no directions, or the file of an environment no picture.

    Notes
    -----
    Mirrors are surfaces whose model has a specular part. They show one reflection, as in section 5 of He et al. 1991
    (``he1991``). Objects shadow the environment, and their own light is not traced. Ambient radiance has no shadows.
    """
    first = scene.objects[0]
    if isinstance(first.shape, Recorded):
        view = _recorded(scene, first, first.shape)
    else:
        height = _height(scene.camera, width, across)
        pixels = np.arange(width * height).reshape(height, width).repeat(across, axis=0).repeat(across, axis=1)
        rays = scene.camera.rays(width * across, height * across)
        points, background = _traced(scene, rays, pixels.ravel(), width * height)
        shapes = {item.name: item.shape for item in scene.objects}
        for seen in points:
            flat = isinstance(shapes[seen.name], PlaneShape)
            if seen.via is None and not flat and np.median(seen.wr[:, 2]) < _BEHIND:
                raise ParameterError("camera.position", f"is inside {seen.name}, which is black from there")
        unseen = [item.name for item in scene.objects if item.name not in {met.name for met in points}]
        if unseen:
            raise ParameterError("objects", f"no ray of {width} x {height} pixels meets {', '.join(unseen)}")
        view = CameraView(points, width, height, across**2, background)
    _check_lights(scene, view.points)
    return view


def gather_at(scene: Scene, places: Array) -> CameraView:
    """Trace single rays through places (N, 2) in the picture, as in `brdfdb.scenes.scene.Camera.through`.

    The view has N pixels in one row, in the order of the places. A recorded scene has no rays.
    """
    points, background = _traced(scene, scene.camera.through(places), np.arange(len(places)), len(places))
    return CameraView(points, len(places), 1, 1, background)


def _traced(scene: Scene, rays: Rays, pixels: NDArray[np.int64], count: int) -> tuple[list[VisiblePoints], Array]:
    """Return the points that rays meet, directly and in mirrors, and the background of each of `count` pixels."""
    points, surfaces, missed = _seen(scene, rays, pixels)
    for number, surface in enumerate(surfaces):
        if scene.materials[points[number].material].has_specular:
            points += _mirrored(scene, points, number, surface)
    return points, _background(scene, rays.directions[missed], pixels[missed], count)


class _Surface(NamedTuple):
    """Points (N, 3), frames with tangent, across and normal as rows (N, 3, 3), and viewers (N, 3), all in the scene.

    `away` (N,) is the distance to the camera, by way of the mirror.
    """

    position: Array
    frame: Array
    viewer: Array
    away: Array


class _Met(NamedTuple):
    """Points of each object that rays meet first, the surfaces that they lie on, and the rays that meet none."""

    points: list[VisiblePoints]
    surfaces: list[_Surface]
    missed: NDArray[np.int64]


def _seen(scene: Scene, rays: Rays, at: NDArray[np.int64], via: int | None = None, before: Array | float = 0.0) -> _Met:
    """Return what rays meet first; `before` is the distance of their origins from the camera."""
    origins, directions = rays
    distance, nearest = _trace(scene, origins, directions)
    away = before + distance
    points, surfaces = [], []
    for number, item in enumerate(scene.objects):
        met = np.flatnonzero((nearest == number) & np.isfinite(distance))
        if not met.size or isinstance(item.shape, Recorded):
            continue
        position = origins[met] + distance[met, np.newaxis] * directions[met]
        surface = _Surface(position, _turned(item.shape.frame(position), item.grain_deg), -directions[met], away[met])
        wr = _viewed(surface)
        wi, irradiance = _lit(scene, item, surface, wr, (number, 0 if via is None else via + 1))
        beyond = _from_afar(scene, _mirror(surface))
        points.append(VisiblePoints(item.name, item.material, wr, wi, irradiance, beyond, via, at[met]))
        surfaces.append(surface)
    return _Met(points, surfaces, np.flatnonzero(~np.isfinite(distance)))


def _mirrored(scene: Scene, points: list[VisiblePoints], number: int, surface: _Surface) -> list[VisiblePoints]:
    """Return the points that the mirror of some points shows, and set `beyond` to 0 where the mirror shows one."""
    facing = np.flatnonzero(points[number].wr[:, 2] > 0.0)
    rays = Rays(_lifted(scene.camera, surface)[facing], _mirror(surface)[facing])
    reflected = _seen(scene, rays, facing, number, surface.away[facing])
    for seen, shown in zip(reflected.points, reflected.surfaces, strict=True):
        points[number].beyond[seen.at] = 0.0
        if scene.materials[seen.material].has_specular:  # the mirror of a mirrored point is not traced
            seen.beyond[np.isfinite(_trace(scene, _lifted(scene.camera, shown), _mirror(shown))[0])] = 0.0
    return reflected.points


def _trace(scene: Scene, origins: Array, directions: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the distance to the nearest object on each ray, and the number of that object."""
    shapes = [item.shape for item in scene.objects]
    distances = np.stack([shape.hit(origins, directions) for shape in shapes if not isinstance(shape, Recorded)])
    nearest = np.argmin(distances, axis=0)
    return np.min(distances, axis=0), nearest


def _lit(scene: Scene, item: Object, surface: _Surface, wr: Array, stream: tuple[int, int]) -> tuple[Array, Array]:
    """Return the directions of all samples of all lights in the frame of the surface, and irradiances, 0 in shadow."""
    lights = [(light.towards(), light.intensity) for light in scene.lights]
    towards = np.concatenate([np.zeros((0, 3)), *(samples for samples, _ in lights)])
    weight = np.concatenate([np.zeros(0), *(np.full(len(samples), total / len(samples)) for samples, total in lights)])
    wi = unit(np.einsum("nij,ej->eni", surface.frame, towards))
    irradiance = weight[:, np.newaxis] * np.maximum(wi[..., 2], 0.0)
    _shadow(scene, surface, np.broadcast_to(towards[:, np.newaxis], wi.shape), irradiance)
    if scene.environment is None:
        return wi, irradiance
    drawn = scene.environment.drawn(scene.materials[item.material], np.array(scene.wavelengths_nm), wr, stream)
    around = np.einsum("eni,nij->enj", drawn.wi, surface.frame)
    arriving = scene.environment.radiance(around) * np.maximum(drawn.wi[..., 2], 0.0) * drawn.solid_angle
    _shadow(scene, surface, around, arriving)
    return np.concatenate([wi, drawn.wi]), np.concatenate([irradiance, arriving])


def _shadow(scene: Scene, surface: _Surface, towards: Array, irradiance: Array) -> None:
    """Set irradiance (E, N) to 0 where an object stands in its direction (E, N, 3), in the frame of the scene."""
    if not scene.shadows:
        return
    origins = _lifted(scene.camera, surface)
    sample, point = np.nonzero(irradiance)
    for start in range(0, point.size, _BATCH):
        which = sample[start : start + _BATCH], point[start : start + _BATCH]
        irradiance[which] *= ~np.isfinite(_trace(scene, origins[which[1]], towards[which])[0])


def _from_afar(scene: Scene, directions: Array) -> Array:
    """Return the radiance from beyond all objects along directions: of lights, ambient, and of the environment."""
    radiance = np.full(len(directions), scene.ambient)
    if scene.environment is not None:
        radiance += scene.environment.radiance(directions)
    for light in scene.lights:
        radiance += np.where(directions @ unit(np.asarray(light.direction)) >= light.cos_radius, light.radiance, 0.0)
    return radiance


def _background(scene: Scene, directions: Array, at: NDArray[np.int64], pixels: int) -> Array:
    """Return the radiance of the environment along rays that meet no object, summed over the rays of each pixel."""
    background = np.zeros(pixels)
    if scene.environment is not None:
        np.add.at(background, at, scene.environment.radiance(directions))
    return background


def _lifted(camera: Camera, surface: _Surface) -> Array:
    """Return the origins of rays from a surface, outside it by a small part of a pixel."""
    lift = _LIFT * camera.covered(surface.away) + _ROUNDED * np.abs(surface.position).max(axis=1)
    return np.asarray(surface.position + lift[:, np.newaxis] * surface.frame[:, 2])


def _mirror(surface: _Surface) -> Array:
    """Return the mirror direction of each viewer, in the scene."""
    normal = surface.frame[:, 2]
    return np.asarray(2.0 * np.sum(normal * surface.viewer, axis=1, keepdims=True) * normal - surface.viewer)


def _turned(frame: Array, grain_deg: float) -> Array:
    """Return frames turned about their normals."""
    turn = float(radians(grain_deg))
    along = np.cos(turn) * frame[:, 0] + np.sin(turn) * frame[:, 1]
    return np.stack([along, np.cross(frame[:, 2], along), frame[:, 2]], axis=1)


def _viewed(surface: _Surface) -> Array:
    """Return viewers in the frames of their points, unit vectors to the last digit."""
    return unit(np.einsum("nij,nj->ni", surface.frame, surface.viewer))


def _recorded(scene: Scene, item: Object, shape: Recorded) -> CameraView:
    """Return the points of a file of directions."""
    arrays = shape.read()
    height, width = arrays["normal" if "normal" in arrays else "wr"].shape[:2]
    vectors = np.concatenate([array.reshape(-1, height * width, 3) for array in arrays.values()])
    length = np.linalg.norm(np.nan_to_num(vectors, nan=0.0, posinf=0.0, neginf=0.0), axis=-1)
    good = np.all(np.abs(length - 1.0) < _LENGTH_OFF, axis=0)
    at = np.flatnonzero(good)
    if not at.size:
        raise ParameterError(shape.file, "shows nothing: at every pixel a vector is not finite or not of length 1")
    flat = {name: unit(array.reshape(-1, height * width, 3)[:, at]) for name, array in arrays.items()}
    if "normal" in flat:
        surface = _frames(flat, scene.camera, width, height, at, item.grain_deg)
        # A file holds no positions, so its points are far apart and have no shadows
        wr = _viewed(surface)
        beyond = _from_afar(scene, _mirror(surface))
        wi, irradiance = _lit(scene.model_copy(update={"shadows": False}), item, surface, wr, (0, 0))
    else:
        if scene.environment is not None:
            raise ParameterError(shape.file, "has wr and wi; an environment needs normals")
        turn = _turned(np.eye(3)[np.newaxis], item.grain_deg)[0]
        wr = flat["wr"][0] @ turn.T
        wi = flat["wi"] @ turn.T
        if len(wi) != len(scene.lights) or any(light.solid_angle_sr for light in scene.lights):
            raise ParameterError(
                shape.file,
                f"wi has {len(wi)} lights, the scene {len(scene.lights)}; "
                "there must be as many, and none with a solid angle",
            )
        strength = np.array([light.strength for light in scene.lights])
        irradiance = np.pi * strength[:, np.newaxis] * np.maximum(wi[..., 2], 0.0)
        beyond = np.full(at.size, scene.ambient)
    directions = scene.camera.rays(width, height).directions
    none = np.flatnonzero(~good)
    background = _background(scene, directions[none], none, width * height)
    return CameraView(
        [VisiblePoints(item.name, item.material, wr, wi, irradiance, beyond, None, at)], width, height, 1, background
    )


def _frames(
    flat: dict[str, Array], camera: Camera, width: int, height: int, at: NDArray[np.int64], grain_deg: float
) -> _Surface:
    """Return the surface of recorded normals and tangents. Missing tangents are horizontal."""
    normal = flat["normal"][0]
    rough = flat["tangent"][0] if "tangent" in flat else np.cross([0.0, 0.0, 1.0], normal)
    tangent = rough - np.sum(rough * normal, axis=1, keepdims=True) * normal
    short = np.linalg.norm(tangent, axis=1) < 1e-6
    tangent[short] = np.cross(np.cross(normal[short], [1.0, 0.0, 0.0]), normal[short])
    tangent = unit(tangent)
    frame = np.stack([tangent, np.cross(normal, tangent), normal], axis=1)
    directions = camera.rays(width, height).directions
    return _Surface(np.zeros_like(normal), _turned(frame, grain_deg), -directions[at], np.zeros(len(normal)))


def _height(camera: Camera, width: int, across: int) -> int:
    """Return the pixels from the top of a picture to its bottom; ParameterError if there are too many or none."""
    for name, value in (("width", width), ("across", across)):
        if value < 1:
            raise ParameterError(name, f"{value} must be at least 1", value)
    height = max(1, round(width / camera.aspect))
    if max(width, height) > _WIDEST:
        text = f"{width} x {height} pixels are too many; either side may have {_WIDEST} at most"
        raise ParameterError("width", text, width)
    if across * max(width, height) > _MOST:
        raise ParameterError(
            "across",
            f"{across} rays across each of {width} x {height} pixels are too many; either side may have "
            f"{_MOST} rays at most",
            across,
        )
    return height


def _check_lights(scene: Scene, points: Sequence[VisiblePoints]) -> None:
    """Raise a ParameterError if a light falls on nothing visible."""
    start = 0
    for number, light in enumerate(scene.lights):
        stop = start + len(light.towards())
        if not any(np.any(seen.irradiance[start:stop]) for seen in points):
            text = "lights no visible point: it is below the horizon of each of them, or stands behind another object"
            raise ParameterError(f"lights.{number}", text)
        start = stop
