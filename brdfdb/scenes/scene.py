"""Scenes: objects of one material each, lights far away, a camera, and the tolerance of the picture."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator, BaseModel, Field, field_validator, model_validator

from brdfdb.errors import BrdfdbError, MaterialError, ParameterError
from brdfdb.geometry import radians
from brdfdb.materials import Material, Source, presets
from brdfdb.materials.provenance import Text
from brdfdb.parameters import closest
from brdfdb.place import path_of
from brdfdb.scenes.environment import Environment
from brdfdb.scenes.shapes import STRICT, AnyShape, Array, Recorded, Vector, check_direction, unit
from brdfdb.spectra import ILLUMINANT, OBSERVER, check_illuminant, check_observer, covers_visible
from brdfdb.store import open_tables
from brdfdb.tables.table import TableSource, source_of_table

STORED = "store:"  # prefix of the name of a material that is read from the store of the scene
WAVELENGTHS_NM = [float(wavelength) for wavelength in range(380, 781, 10)]


class Light(BaseModel):
    """A light far away, the same from everywhere in the scene.

    `strength` [1] is the irradiance over pi of a surface that faces the light. A white Lambertian surface has that
    radiance there, whatever the solid angle. With a solid angle the light is a round disc that glossy surfaces blur and
    mirrors show. Without it, mirrors do not show the light.
    """

    model_config = STRICT

    direction: Annotated[Vector, AfterValidator(functools.partial(check_direction, "direction"))] = Field(
        description="towards the light"
    )
    strength: float = Field(default=1.0, gt=0.0)
    solid_angle_sr: float = Field(default=0.0, ge=0.0, le=1.0)
    samples: int = Field(
        default=16, ge=1, le=1024, description="over the solid angle; much narrower lobes show single samples"
    )

    @property
    def cos_radius(self) -> float:
        """The cosine of the angle from the middle of the disc to its edge."""
        return 1.0 - self.solid_angle_sr / (2.0 * np.pi)

    @property
    def intensity(self) -> float:
        """Radiance times solid angle: pi times the strength over the mean cosine for a surface that faces the disc."""
        return np.pi * self.strength / ((1.0 + self.cos_radius) / 2.0)

    @property
    def radiance(self) -> float:
        """The radiance of the disc; 0 if the light has no solid angle."""
        return self.intensity / self.solid_angle_sr if self.solid_angle_sr else 0.0

    def towards(self) -> Array:
        """Return unit vectors (samples, 3) towards the disc, of equal solid angles."""
        z = unit(np.asarray(self.direction))
        if self.solid_angle_sr == 0.0:
            return z[np.newaxis]
        x = unit(np.cross(z, np.eye(3)[np.argmin(np.abs(z))]))
        # A spiral of golden angles is even over the disc for any number of samples
        number = np.arange(self.samples)
        cos = 1.0 - (1.0 - self.cos_radius) * (number + 0.5) / self.samples
        turn = number * np.pi * (3.0 - np.sqrt(5.0))
        ring = np.cos(turn)[:, np.newaxis] * x + np.sin(turn)[:, np.newaxis] * np.cross(z, x)
        return np.asarray(cos[:, np.newaxis] * z + np.sqrt(1.0 - cos * cos)[:, np.newaxis] * ring)


class Rays(NamedTuple):
    """Origins and unit directions (N, 3) of rays."""

    origins: Array
    directions: Array


class Camera(BaseModel):
    """A pinhole with an angle of view, or a camera far away that sees a given height of the scene; z points up."""

    model_config = STRICT

    position: Vector
    target: Vector = (0.0, 0.0, 0.0)
    up: Vector = (0.0, 0.0, 1.0)
    fov_deg: float | None = Field(default=None, gt=0.0, lt=170.0, description="from the lower to the upper edge")
    height: float | None = Field(default=None, gt=0.0, description="height at the target that a distant camera sees")
    aspect: float = Field(default=4.0 / 3.0, ge=0.1, le=10.0, description="width of the picture over its height")

    @model_validator(mode="after")
    def _check(self) -> Camera:
        if (self.fov_deg is None) == (self.height is None):
            raise ParameterError("fov_deg, height", "give one of the two")
        forward = np.subtract(self.target, self.position)
        if np.linalg.norm(np.cross(forward, self.up)) <= 1e-9 * np.linalg.norm(forward) * np.linalg.norm(self.up):
            raise ParameterError("target", "the camera must look neither at its own position nor along `up`")
        return self

    def covered(self, distance: Array) -> Array:
        """Return the height of the visible part of the scene at distances from the camera."""
        if self.fov_deg is None:
            assert self.height is not None
            return np.full_like(distance, self.height)
        return 2.0 * np.tan(radians(self.fov_deg) / 2.0) * distance

    def rays(self, width: int, height: int) -> Rays:
        """Return the rays through the middles of pixels, row by row."""
        x, y = np.meshgrid(
            (2.0 * np.arange(width) + 1.0 - width) / height, 1.0 - (2.0 * np.arange(height) + 1.0) / height
        )
        return self.through(np.stack([x.ravel(), y.ravel()], axis=1))

    def through(self, places: Array) -> Rays:
        """Return the rays through places (N, 2) in the picture.

        Places are x to the right and y upwards from the middle of the picture, in halves of its height.
        """
        eye = np.asarray(self.position)
        forward = unit(np.subtract(self.target, self.position))
        right = unit(np.cross(forward, self.up))
        over = places[:, :1] * right + places[:, 1:] * np.cross(right, forward)
        if self.fov_deg is None:
            assert self.height is not None
            return Rays(eye + 0.5 * self.height * over, np.broadcast_to(forward, over.shape))
        return Rays(np.broadcast_to(eye, over.shape), unit(forward + np.tan(radians(self.fov_deg) / 2.0) * over))


class Object(BaseModel):
    """A shape of one material; `grain_deg` turns the material's x axis from the tangent of the shape."""

    model_config = STRICT

    name: Annotated[str, Field(min_length=1)]
    material: str = Field(
        description="a preset, a material that the scene defines, or store:NAME, a material of the scene's store"
    )
    shape: AnyShape | Recorded = Field(discriminator="kind")
    grain_deg: float = Field(default=0.0, description="counter-clockwise, seen from outside")


class Tolerance(BaseModel):
    """The largest error of the picture, either relative in radiance or in CIEDE2000.

    All checked places keep to it, or a percentile of the places of each material if isolated ones do not matter.
    """

    model_config = STRICT

    relative: float | None = Field(default=None, gt=0.0, lt=1.0)
    ciede2000: float | None = Field(default=None, gt=0.0, le=100.0)
    percentile: float = Field(default=100.0, gt=0.0, le=100.0, description="of the pixels of each material; 100: all")

    @model_validator(mode="after")
    def _check(self) -> Tolerance:
        if (self.relative is None) == (self.ciede2000 is None):
            raise ParameterError("relative, ciede2000", "give one of the two")
        return self

    @property
    def unit(self) -> Literal["relative", "CIEDE2000"]:
        """The unit of `value`."""
        return "CIEDE2000" if self.relative is None else "relative"

    @property
    def value(self) -> float:
        """The largest error, in `unit`."""
        value = self.ciede2000 if self.relative is None else self.relative
        assert value is not None  # `_check` has made sure of this
        return value


class Scene(BaseModel):
    """A scene. A white Lambertian surface that faces a light of strength 1 has the radiance 1.

    Raises
    ------
    ValueError
        For an unknown material, illuminant or observer, with the closest names; for wavelengths that make no colour.
    """

    model_config = STRICT

    title: str = ""
    source: str = Field(default="", description="source of the scene, such as a picture of a paper")
    objects: list[Object] = Field(min_length=1)
    lights: list[Light] = []
    ambient: float = Field(default=0.0, ge=0.0, description="radiance from all directions, without shadows")
    environment: Environment | None = Field(default=None, description="radiance that differs with the direction")
    shadows: bool = Field(default=True, description="true if objects cast shadows on one another and on themselves")
    camera: Camera
    exposure: float = Field(default=1.0, gt=0.0, description="factor of radiance that makes white 1")
    illuminant: str = Field(default=ILLUMINANT, description="spectrum of all light: a name of colour-science")
    observer: str = Field(default=OBSERVER, description="a name of colour-science")
    wavelengths_nm: list[float] = WAVELENGTHS_NM
    hold_ends: bool = Field(
        default=False,
        description="true: outside the wavelengths of a table of the store, f_r is that of its nearest wavelength",
    )
    tolerance: Tolerance = Tolerance(ciede2000=1.0)
    define: dict[str, dict[str, Any]] = Field(default={}, description="materials of your own, as in the preset files")
    store: Text | None = Field(
        default=None,
        min_length=1,
        description="directory of a store, relative to the scene, for materials store:NAME: the model that the table "
        "NAME was tabulated from, or the table itself if its source was a function or is unknown",
    )

    @field_validator("illuminant")
    @classmethod
    def _check_illuminant(cls, name: str) -> str:
        return check_illuminant(name)

    @field_validator("observer")
    @classmethod
    def _check_observer(cls, name: str) -> str:
        return check_observer(name)

    @field_validator("wavelengths_nm")
    @classmethod
    def _check_wavelengths(cls, wavelengths_nm: list[float]) -> list[float]:
        if not covers_visible(wavelengths_nm):
            text = "must increase from 420 or less to 680 or more in steps of at most 20 nm"
            raise ParameterError("wavelengths_nm", text)
        return wavelengths_nm

    @model_validator(mode="after")
    def _check(self) -> Scene:
        if not self.lights and not self.ambient and self.environment is None:
            raise ParameterError("lights, ambient, environment", "there is no light")
        names = [item.name for item in self.objects]
        for name in names:
            if names.count(name) > 1:
                raise ParameterError("objects", f"{name!r} is the name of two")
        if any(isinstance(item.shape, Recorded) for item in self.objects) and len(names) > 1:
            raise ParameterError("objects", "a recorded object fills the picture and must be the only object")
        _materials(self)
        return self

    @property
    def materials(self) -> dict[str, Source]:
        """The sources of the objects by name, each once.

        ParameterError if the store of the scene cannot be read, or has no such material.
        """
        sources = _materials(self)
        for name in self.stored:
            assert self.store is not None  # `_materials` has made sure of this
            sources[name] = _stored(self.store, name, tuple(self.wavelengths_nm) if self.hold_ends else None)
            _check_range(name, sources[name], self.wavelengths_nm)
        return sources

    @property
    def stored(self) -> list[str]:
        """The names of materials that are read from the store of the scene, each once."""
        return list(dict.fromkeys(item.material for item in self.objects if item.material.startswith(STORED)))

    def resolved(self, folder: Path) -> Scene:
        """Return the scene with its file names relative to a folder."""
        objects = [
            item.model_copy(update={"shape": item.shape.resolved(folder)}) if isinstance(item.shape, Recorded) else item
            for item in self.objects
        ]
        environment = None if self.environment is None else self.environment.resolved(folder)
        store = None if self.store is None else str(folder / path_of(self.store, "store"))
        return self.model_copy(update={"objects": objects, "environment": environment, "store": store})


@functools.lru_cache(maxsize=64)
def _stored(root: str, name: str, held_to: tuple[float, ...] | None) -> Source:
    """Return a material of a store. It stays in memory, because a scene needs it at every list of points."""
    try:
        return source_of_table(
            open_tables(root)[name.removeprefix(STORED)], known_nm=None if held_to is None else np.array(held_to)
        )
    except BrdfdbError as error:
        raise ParameterError(f"material {name}", str(error)) from None


def _check_range(name: str, source: Source, wavelengths_nm: list[float]) -> None:
    """Refuse a table that is a source if the wavelengths of the scene go beyond its own."""
    at = source.wavelengths_nm
    if not isinstance(source, TableSource) or at is None or len(at) == 1:
        return
    outside = [one for one in wavelengths_nm if not at[0] <= one <= at[-1]]
    if outside:
        inside = [wavelength for wavelength in wavelengths_nm if at[0] <= wavelength <= at[-1]]
        within = "give the scene a range within it, or " if covers_visible(inside) else ""
        text = (
            f"{outside[0]:g} is outside [{at[0]:g}, {at[-1]:g}] nm of {name}; {within}set hold_ends = true, which "
            "takes f_r of the nearest wavelength that it has"
        )
        raise ParameterError("wavelengths_nm", text, outside[0], (at[0], at[-1]))


def _materials(scene: Scene) -> dict[str, Source]:
    """Return the sources of the objects by name, except those of a store; ParameterError for an unknown name."""
    known: dict[str, Material] = presets()
    for name, table in scene.define.items():
        if name in known:
            raise ParameterError(f"define.{name}", "is the name of a preset; give yours another")
        try:
            known[name] = Material.from_table(name, table)
        except MaterialError as error:
            raise ParameterError(f"define.{name}", f"{error.parameter}: {error.sentence}") from None
    sources: dict[str, Source] = {}
    for item in scene.objects:
        if item.material.startswith(STORED):
            if scene.store is None:
                raise ParameterError("store", f"objects.{item.name} has the material {item.material}, give its store")
            continue
        if item.material not in known:
            text = f"{item.material!r} is unknown{closest(item.material, known)}"
            raise ParameterError(f"objects.{item.name}.material", text, item.material, tuple(known))
        sources[item.material] = known[item.material]
    return sources
