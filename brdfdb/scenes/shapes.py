"""Shapes: plane, sphere, cylinder, box and surface of revolution, with distances along rays and frames at points."""

from __future__ import annotations

import zipfile
import zlib
from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from brdfdb.errors import ParameterError
from brdfdb.geometry import radians
from brdfdb.place import path_of

Array = NDArray[np.float64]
Vector = Annotated[tuple[float, float, float], Field(strict=False)]  # TOML has lists
Pair = Annotated[tuple[float, float], Field(strict=False)]
Length = Annotated[float, Field(gt=0.0)]

STRICT = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)
_FACETS = 24  # cones between two points of a profile; the contour turns by less than a degree from one to the next

WANTED = "neither `normal`, nor `wr` and `wi`, of shape (height, width, 3)"


def unit(vectors: Array) -> Array:
    """Return vectors (..., 3) divided by their length."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def check_direction(name: str, vector: Vector) -> Vector:
    """Return the vector; ParameterError if its length is below 1e-6 or nan."""
    if not np.linalg.norm(vector) > 1e-6:
        raise ParameterError(name, f"{list(vector)} points nowhere", list(vector))
    return vector


class Shape(BaseModel, ABC):
    """A shape with its own origin at `position` and its own z axis along `axis`, turned about that axis.

    Rays and points are arrays (N, 3) in the frame of the scene, whose z axis points up.
    """

    model_config = STRICT

    position: Vector = (0.0, 0.0, 0.0)
    axis: Annotated[Vector, AfterValidator(partial(check_direction, "axis"))] = (0.0, 0.0, 1.0)
    turn_deg: float = Field(default=0.0, description="about the axis, counter-clockwise")

    @property
    def _axes(self) -> Array:
        """The shape's own x, y and z axes in the scene, as rows."""
        z = unit(np.asarray(self.axis))
        aside = np.eye(3)[0 if abs(z[0]) < 0.9 else 1]
        x = unit(aside - (aside @ z) * z)
        y = np.cross(z, x)
        turn = float(radians(self.turn_deg))
        return np.stack([np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x, z])

    def hit(self, origins: Array, directions: Array) -> Array:
        """Return the distance (N,) along each ray to the first hit, in units of its direction; inf without a hit."""
        axes = self._axes
        return self._hit((origins - np.asarray(self.position)) @ axes.T, directions @ axes.T)

    def frame(self, points: Array) -> Array:
        """Return tangent, bitangent and outward normal at points as the rows of (N, 3, 3)."""
        axes = self._axes
        tangent, normal = self._tangent_and_normal((points - np.asarray(self.position)) @ axes.T)
        return np.stack([tangent, np.cross(normal, tangent), normal], axis=1) @ axes

    @abstractmethod
    def _hit(self, o: Array, d: Array) -> Array:
        """Return the distances of `hit`, in the shape's own axes."""

    @abstractmethod
    def _tangent_and_normal(self, p: Array) -> tuple[Array, Array]:
        """Return tangent and normal at points, in the shape's own axes."""


class PlaneShape(Shape):
    """A plane through the origin, its normal along the axis; a rectangle around it if it has a size.

    Its tangent is its own x axis.
    """

    kind: Literal["plane"]
    size: Annotated[tuple[Length, Length], Field(strict=False)] | None = Field(
        default=None, description="along x and y; without it the plane has no end"
    )

    def _hit(self, o: Array, d: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):  # rays along the plane
            t = -o[:, 2] / d[:, 2]
            p = o + t[:, np.newaxis] * d
            inside = t > 0.0
            if self.size is not None:
                inside &= np.all(np.abs(p[:, :2]) <= np.asarray(self.size) / 2.0, axis=1)
        return np.where(inside, t, np.inf)

    def _tangent_and_normal(self, p: Array) -> tuple[Array, Array]:
        return np.broadcast_to(np.eye(3)[0], p.shape), np.broadcast_to(np.eye(3)[2], p.shape)


class Sphere(Shape):
    """A sphere around the origin; its tangent runs around the axis."""

    kind: Literal["sphere"]
    radius: Length

    def _hit(self, o: Array, d: Array) -> Array:
        return _nearest(*_roots(_dot(d, d), _dot(o, d), _dot(o, o) - self.radius**2))

    def _tangent_and_normal(self, p: Array) -> tuple[Array, Array]:
        return _around(p), unit(p)


class Box(Shape):
    """A box that stands on the origin; its tangent is horizontal on the sides, and its own x axis at top and bottom."""

    kind: Literal["box"]
    size: Annotated[tuple[Length, Length, Length], Field(strict=False)]

    def _hit(self, o: Array, d: Array) -> Array:
        half = np.asarray(self.size) / 2.0
        with np.errstate(divide="ignore", invalid="ignore"):  # rays along a face
            ends = (np.stack([-half, half])[:, np.newaxis] - (o - [0.0, 0.0, half[2]])) / d
        near = np.nanmax(np.minimum(*ends), axis=1)
        far = np.nanmin(np.maximum(*ends), axis=1)
        return np.where(near <= far, _nearest(near, far), np.inf)

    def _tangent_and_normal(self, p: Array) -> tuple[Array, Array]:
        half = np.asarray(self.size) / 2.0
        scaled = (p - [0.0, 0.0, half[2]]) / half
        face = np.argmax(np.abs(scaled), axis=1)
        normal = np.eye(3)[face] * np.sign(np.take_along_axis(scaled, face[:, np.newaxis], axis=1))
        across = np.stack([-normal[:, 1], normal[:, 0], 0.0 * face], axis=1)
        return np.where((face == 2)[:, np.newaxis], np.eye(3)[0], across), normal


class Revolution(Shape):
    """A surface of revolution about its own z axis, closed by discs at both ends; its tangent runs around the axis.

    Between the points of the profile the radius is a smooth function of the height, and between the radii at both ends;
    rays hit cones that follow it, normals are those of the smooth profile. The tangent of a disc is its own x axis.
    """

    kind: Literal["revolution"]
    profile: list[Pair] = Field(min_length=2, description="radius and height, from below upwards")

    @model_validator(mode="after")
    def _check_profile(self) -> Revolution:
        radius, height = np.array(self.profile).T
        if np.any(radius <= 0.0) or np.any(np.diff(height) <= 0.0):
            raise ParameterError("profile", "needs radii above 0 and heights that increase")
        return self

    def radius_at(self, z: Array) -> tuple[Array, Array]:
        """Return the radius of the smooth profile at a height, and its slope dr/dz."""
        radius, height = np.array(self.profile).T
        secant = np.diff(radius) / np.diff(height)
        before = secant[[0, *range(secant.size)]]
        after = secant[[*range(secant.size), -1]]
        # Fritsch and Butland's slopes, 0 where the secants change sign, keep straight profiles straight
        turns = before * after <= 0.0
        slope = np.where(turns, 0.0, 2.0 * before * after / np.where(turns, 1.0, before + after))
        at = np.clip(np.searchsorted(height, z) - 1, 0, height.size - 2)
        h = height[at + 1] - height[at]
        u = np.clip((z - height[at]) / h, 0.0, 1.0)
        r0 = radius[at]
        r1 = radius[at + 1]
        m0 = h * slope[at]
        m1 = h * slope[at + 1]
        # Hermite's cubic and its derivative
        c2 = 3.0 * (r1 - r0) - 2.0 * m0 - m1
        c3 = 2.0 * (r0 - r1) + m0 + m1
        return ((c3 * u + c2) * u + m0) * u + r0, ((3.0 * c3 * u + 2.0 * c2) * u + m0) / h

    def _hit(self, o: Array, d: Array) -> Array:
        # Radii and heights where one cone ends and the next begins
        height = np.array(self.profile)[:, 1]
        z = np.interp(np.arange((height.size - 1) * _FACETS + 1) / _FACETS, np.arange(height.size), height)
        radius = self.radius_at(z)[0]
        t = np.minimum(*(_disc(o, d, radius[end], z[end]) for end in (0, -1)))
        # Only rays that meet the cylinder around all cones, and then the cylinder around some of them, are traced
        candidates = np.flatnonzero(np.isfinite(_cone(o, d, radius.max(), radius.max(), z[0], z[-1])))
        for start in range(0, len(z) - 1, _FACETS):
            r_part, z_part = radius[start : start + _FACETS + 1], z[start : start + _FACETS + 1]
            around = _cone(o[candidates], d[candidates], r_part.max(), r_part.max(), z_part[0], z_part[-1])
            near = candidates[np.isfinite(around)]
            o_near, d_near = o[near], d[near]
            for r0, r1, z0, z1 in zip(r_part[:-1], r_part[1:], z_part[:-1], z_part[1:], strict=True):
                t[near] = np.minimum(t[near], _cone(o_near, d_near, r0, r1, z0, z1, open_ends=True))
        return t

    def _tangent_and_normal(self, p: Array) -> tuple[Array, Array]:
        ends = np.array(self.profile)[[0, -1], 1]
        off = np.abs(p[:, 2:] - ends)
        disc = np.argmin(off, axis=1)
        on_disc = np.min(off, axis=1) < 1e-7 * (ends[1] - ends[0])
        tangent = _around(p)
        slope = self.radius_at(p[:, 2])[1]
        side = unit(np.stack([tangent[:, 1], -tangent[:, 0], -slope], axis=1))
        flat = np.stack([0.0 * slope, 0.0 * slope, np.where(disc == 0, -1.0, 1.0)], axis=1)
        where = on_disc[:, np.newaxis]
        return np.where(where, np.eye(3)[0], tangent), np.where(where, flat, side)


class Cylinder(Shape):
    """A closed cylinder that stands on the origin. Its tangent runs around the axis, and is its own x at the ends."""

    kind: Literal["cylinder"]
    radius: Length
    height: Length

    def _hit(self, o: Array, d: Array) -> Array:
        return _cone(o, d, self.radius, self.radius, 0.0, self.height)

    def _tangent_and_normal(self, p: Array) -> tuple[Array, Array]:
        flat = Revolution(kind="revolution", profile=[(self.radius, 0.0), (self.radius, self.height)])
        return flat._tangent_and_normal(p)


AnyShape = Annotated[PlaneShape | Sphere | Box | Cylinder | Revolution, Field(discriminator="kind")]


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.sum(a * b, axis=-1))


def _roots(a: Array, half_b: Array, c: Array) -> tuple[Array, Array]:
    """Return the roots of a t^2 + 2 half_b t + c without cancellation, nan where there are none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        q = -(half_b + np.copysign(np.sqrt(half_b * half_b - a * c), half_b))
        return np.asarray(q / a), np.asarray(c / q)


def _nearest(*ts: Array) -> Array:
    """Return the smallest positive distance of each ray; inf where there is none."""
    return np.asarray(np.min([np.where(t > 0.0, t, np.inf) for t in ts], axis=0))  # nan > 0 is False


def _cone(o: Array, d: Array, r0: float, r1: float, z0: float, z1: float, open_ends: bool = False) -> Array:
    """Return the distance to a cone about the z axis between two heights, closed by discs unless it has open ends."""
    s = (r1 - r0) / (z1 - z0)
    w = r0 + s * (o[:, 2] - z0)
    dz = s * d[:, 2]
    a = d[:, 0] ** 2 + d[:, 1] ** 2 - dz * dz
    half_b = o[:, 0] * d[:, 0] + o[:, 1] * d[:, 1] - w * dz
    c = o[:, 0] ** 2 + o[:, 1] ** 2 - w * w
    ts = []
    for t in _roots(a, half_b, c):
        with np.errstate(invalid="ignore"):
            z = o[:, 2] + t * d[:, 2]
            ts.append(np.where((z >= z0) & (z <= z1), t, np.inf))
    if not open_ends:
        ts += [_disc(o, d, r0, z0), _disc(o, d, r1, z1)]
    return _nearest(*ts)


def _disc(o: Array, d: Array, radius: float, z: float) -> Array:
    """Return the distance to a disc about the z axis."""
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (z - o[:, 2]) / d[:, 2]
        x, y = o[:, 0] + t * d[:, 0], o[:, 1] + t * d[:, 1]
        return _nearest(np.where(x * x + y * y <= radius * radius, t, np.inf))


def _around(p: Array) -> Array:
    """Return the direction around the z axis at points (N, 3), along y where a point is on the axis."""
    from_axis = np.hypot(p[:, 0], p[:, 1])
    x, y = (np.divide(p[:, i], from_axis, where=from_axis > 0.0, out=np.full(len(p), 1.0 - i)) for i in (0, 1))
    return np.stack([-y, x, np.zeros(len(p))], axis=1)


class Recorded(BaseModel):
    """A picture of directions in place of a shape. `file` is an EXR or .npz.

    The file holds one of two sets of vectors. The first is ``normal`` and, if the material is anisotropic, ``tangent``,
    in the frame of the scene. The second is ``wr`` and ``wi``, towards the viewer and towards each light of the scene
    in the frame of the surface (x the tangent, z the normal), for lights without a solid angle. An .npz has arrays of
    shape (height, width, 3), and ``wi`` of shape (lights, height, width, 3). An EXR has channels such as ``normal.X``,
    ``normal.Y`` and ``normal.Z``, and ``wi0.X``, ``wi1.X`` and so on for lights. Pixels where a vector is 0 or not
    finite show nothing. Nothing casts a shadow.
    """

    model_config = STRICT

    kind: Literal["recorded"]
    file: Annotated[str, Field(min_length=1)]

    def resolved(self, folder: Path) -> Recorded:
        """Return the shape with its file named relative to a folder."""
        return self.model_copy(update={"file": str(folder / path_of(self.file, "file"))})

    def read(self) -> dict[str, Array]:
        """Return the arrays of the file, float64, by name; ``wi`` with its axis of lights.

        ParameterError if the file does not exist, is not readable, or holds no directions.
        """
        path = path_of(self.file, "file")
        if not path.is_file():
            raise ParameterError(str(path), "there is no such file")
        arrays = _from_exr(path) if path.suffix == ".exr" else _from_npz(path)
        if "normal" not in arrays and not {"wr", "wi"} <= arrays.keys():
            raise ParameterError(str(path), f"has {WANTED}; it has {', '.join(arrays) or 'no vectors'}")
        first = "normal" if "normal" in arrays else "wr"
        pixels = arrays[first].shape[:2]
        for name, array in arrays.items():
            lights = array.shape[:1] if name == "wi" else ()
            if array.shape != (*lights, *pixels, 3):
                wanted = "(lights, height, width, 3)" if name == "wi" else "(height, width, 3)"
                sentence = f"{name} has the shape {array.shape}, which is not that of a picture of vectors, {wanted}"
                if name != first:
                    sentence += f", of as many pixels as {first} has, {pixels}"
                raise ParameterError(str(path), sentence, array.shape)
        return arrays


def _from_npz(path: Path) -> dict[str, Array]:
    try:
        with np.load(path) as file:
            arrays = {name: file[name] for name in ("normal", "tangent", "wr", "wi") if name in file}
    except (ValueError, TypeError, EOFError, zipfile.BadZipFile, zlib.error):
        raise ParameterError(str(path), "is not an .npz file of numbers, or is damaged") from None
    if any(array.dtype.kind not in "iuf" for array in arrays.values()):
        raise ParameterError(str(path), f"has {WANTED}: the arrays of these names are not numbers")
    return {name: array.astype(np.float64) for name, array in arrays.items()}


def _from_exr(path: Path) -> dict[str, Array]:
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels: dict[str, NDArray[np.floating]] = {name: c.pixels for name, c in file.channels().items()}
    except RuntimeError:
        raise ParameterError(str(path), "is not an OpenEXR file, or is damaged") from None
    arrays = {name: vector for name in ("normal", "tangent", "wr") if (vector := _vector(channels, name)) is not None}
    lights: list[Array] = []
    while (light := _vector(channels, f"wi{len(lights)}")) is not None:
        lights.append(light)
    return {**arrays, "wi": np.stack(lights)} if lights else arrays


def _vector(channels: Mapping[str, NDArray[np.floating]], name: str) -> Array | None:
    names = [f"{name}.{axis}" for axis in "XYZ"]
    if not all(channel in channels for channel in names):
        return None
    return np.stack([channels[channel] for channel in names], axis=-1).astype(np.float64)
