"""Ward's imaging gonioreflectometer (``ward1992``, section 3): pictures of a surface, and their reduction to samples.

A half-silvered hemisphere collects the light that a small sample reflects. It reflects that light into a camera with a
fish-eye lens, which stands beside the sample. The beam of the lamp comes through the hemisphere. One picture thus holds
f_r for one direction of the light and nearly all directions of the viewer.
"""

from __future__ import annotations

import itertools
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import degrees, radians, spherical_angles, unit_vector
from brdfdb.materials.source import Evaluate
from brdfdb.measurements.aperture import cone, disk
from brdfdb.measurements.instrument import Instrument
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Array

Frames = NDArray[np.float32]

_RANGES = {
    "width": (8, 8192),
    "height": (8, 8192),
    "offset": (0.0, 0.5),
    "field_deg": (1.0, 90.0),
    "largest_theta_r_deg": (1.0, 89.0),
    "standard_reflectance": (0.01, 1.0),
    "light_half_angle_deg": (0.0, 10.0),
    "blur_px": (0.0, 20.0),
    "full_well": (100.0, 1e9),
    "read_noise": (0.0, 1e6),
    "bits": (4, 24),
    "frames": (1, 10000),
    "stray": (0.0, 1.0),
}
_WHITE = 0.7  # share of the full well that the standard fills at the longest exposure under perpendicular light
_PIXEL = 1.0 / 12.0  # variance of a pixel along an axis [pixel^2]
_SHARP = 1.0  # standard deviation [pixel] of the weaker smoothing before second derivatives are taken
_SMOOTH = 2.0  # standard deviation [pixel] of the smoothing of counts by which noise is judged
_SATURATED = 0.9  # share of the largest count above which a count is not used
# Points of a pixel along each axis at which f_r is evaluated: Gauss and Legendre's two, with the variance of a pixel
_WITHIN = (0.5 - 0.5 / np.sqrt(3.0), 0.5 + 0.5 / np.sqrt(3.0))
_STANDARD_ERRORS = 4.0  # blocks of pixels are not merged where they differ by more standard errors from their mean
_FLAT = 0.02  # and by a larger share of it
_LARGEST_BLOCK = 16  # pixels along the largest block


def eq_3(theta_c: Array, phi_c: Array, offset: float) -> Array:
    """Return the directions from the target, unit vectors (..., 3), for directions of the camera: eq. 3 of the paper.

    `theta_c` and `phi_c` [rad] refer to the camera. `offset` [1] is D / R: half of the distance of target and camera
    over the radius of the sphere. The equation is an approximation for small offsets.
    """
    sine = np.sin(phi_c) * np.sin(theta_c)
    r_c = offset * sine + np.sqrt(offset**2 * sine**2 + 1.0 - offset**2)
    x = r_c * np.cos(phi_c) * np.sin(theta_c)
    y = r_c * sine - 2.0 * offset
    z = r_c * np.cos(theta_c)
    theta_r = np.arccos(z / np.sqrt(x**2 + y**2 + z**2))
    return unit_vector(theta_r, np.arctan2(y, x))


def traced(theta_c: Array, phi_c: Array, offset: float) -> Array:
    """Return the directions, unit vectors (..., 3), in which light leaves the sample towards the camera.

    The camera is at (0, -offset, 0) and the target at (0, offset, 0), with the middle of a sphere of radius 1 between
    them. A ray from the camera is mirrored once, and meets the sample at the target or close to it. `theta_c` and
    `phi_c` [rad] refer to the camera.
    """
    out = unit_vector(theta_c, phi_c)
    camera = np.array([0.0, -offset, 0.0])
    along = out @ camera
    point = camera + (-along + np.sqrt(along**2 + 1.0 - offset**2))[..., None] * out
    return np.asarray(2.0 * np.sum(out * point, axis=-1, keepdims=True) * point - out)


class CameraAngles(NamedTuple):
    """Polar angles and azimuths [rad] of directions of the camera."""

    theta_c: Array
    phi_c: Array


@dataclass(frozen=True)
class Gonioreflectometer:
    """The instrument. The defaults are those of a camera of today; the paper prints few of its numbers."""

    #: width, height: pixels of the camera. The paper reduces its pictures to 108 by 80 before it uses them
    width: int = 432
    height: int = 320
    offset: float = 0.05  #: D / R: half of the distance of sample and camera over the radius of the hemisphere, [1]
    #: angle of the lens at the upper edge of the picture. The lens gives all pixels the same solid angle: the distance
    #: from the middle is in proportion to the sine of half of the angle, [degree]
    field_deg: float = 85.0
    #: largest polar angle of the viewer that is used; the hemisphere ends there, [degree]
    largest_theta_r_deg: float = 75.0
    standard_reflectance: float = 0.98  #: reflectance of the diffuse standard, rho_standard of eq. 2, [1]
    light_half_angle_deg: float = 0.5  #: half of the angle of the beam, seen from the sample, [degree]
    blur_px: float = 0.7  #: standard deviation of the blur of hemisphere and lens, [pixel]
    #: full_well, read_noise: charge at the largest count, and noise of a pixel in the dark, [electron]
    full_well: float = 20000.0
    read_noise: float = 8.0
    bits: int = 14  #: bits of a count
    #: times of exposure, relative to the longest. Their range is that of the measured values, [1]
    exposures: tuple[float, ...] = (1.0, 1.0 / 16.0, 1.0 / 256.0)
    frames: int = 16  #: number of pictures of the standard and of the background that are averaged
    stray: float = 0.002  #: stray light in the background, relative to that of a perfect white, [1]

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise ParameterError(name, f"{value:g} is not in [{low:g}, {high:g}]", value, (low, high))
        times = self.exposures
        if not times or times[0] != 1.0 or not all(0.0 < b < a for a, b in itertools.pairwise(times)):
            raise ParameterError("exposures", f"{list(times)} does not begin with 1 and decrease", times)

    @property
    def pitch(self) -> float:
        """The side [rad] of a pixel, whose square is its solid angle."""
        return float(2.0 * np.sin(0.5 * radians(self.field_deg))) / (0.5 * self.height)

    @property
    def electrons(self) -> float:
        """Electrons of a count."""
        return self.full_well / self.saturation

    @property
    def saturation(self) -> float:
        """The largest count."""
        return float(2**self.bits - 1)

    def pixels(self, within: tuple[float, ...] = (0.5,)) -> CameraAngles:
        """Return the angles of the pixels, the top row first.

        The shape is (height * K, width * K) for K points along each axis of a pixel, at `within` [pixel] of its corner.
        """
        x, y = (
            (np.arange(count)[:, np.newaxis] + within).reshape(-1) - 0.5 * count for count in (self.width, self.height)
        )
        right, up = np.meshgrid(x, -y)
        sine = 0.5 * self.pitch * np.hypot(right, up)  # of half of theta_c
        return CameraAngles(2.0 * np.arcsin(np.minimum(sine, 1.0)), np.arctan2(up, right))

    @cached_property
    def directions(self) -> Array:
        """Directions of the viewer at the pixels, unit vectors (height, width, 3), x to the right; nan outside."""
        theta_c, phi_c = self.pixels()
        wr = traced(np.minimum(theta_c, 0.5 * np.pi), phi_c, self.offset)
        inside = (theta_c <= radians(self.field_deg)) & (wr[..., 2] >= np.cos(radians(self.largest_theta_r_deg)))
        return np.where(inside[..., np.newaxis], wr, np.nan)

    @property
    def instrument(self) -> Instrument:
        """The instrument as samples record it: solid angles are those of disks that blur as much."""
        variance = (self.blur_px**2 + _PIXEL) * self.pitch**2  # along an axis; a disk of radius a has a^2 / 4
        light = radians(self.light_half_angle_deg)
        return Instrument(
            name="imaging gonioreflectometer",
            source_solid_angle_sr=float(2.0 * np.pi * (1.0 - np.cos(light))) or None,
            receiver_solid_angle_sr=4.0 * np.pi * variance,
            polarisation="unpolarised",
        )

    def settings(self) -> dict[str, Any]:
        """Return the attributes by name, as JSON."""
        return asdict(self) | {"exposures": list(self.exposures)}


@dataclass(frozen=True, eq=False)
class CameraPicture:
    """Counts of the camera for one direction of the light.

    `theta_i`, `phi_i` [rad] is the light in the frame of the sample: light comes from the right, and the sample is
    turned by -phi_i. `sample`, `standard`, `background` are counts (E, height, width) with the sample, with the
    standard, and without either, an array an exposure. Standard and background are means of `frames` pictures.
    `provenance` is where the picture comes from.
    """

    settings: Gonioreflectometer
    theta_i: float
    phi_i: float
    sample: Frames
    standard: Frames
    background: Frames
    name: str = "sample"
    provenance: str = ""

    def __post_init__(self) -> None:
        shape = (len(self.settings.exposures), self.settings.height, self.settings.width)
        for name in ("sample", "standard", "background"):
            counts = getattr(self, name)
            if counts.shape != shape or not np.all(np.isfinite(counts)):
                raise ParameterError(name, f"counts of shape {counts.shape}; they must be finite and of shape {shape}")
        if not 0.0 <= self.theta_i < 0.5 * np.pi:
            raise ParameterError("theta_i", f"{degrees(self.theta_i):g} degrees is not in [0, 90)", self.theta_i)


def photograph(
    brdf: Evaluate, settings: Gonioreflectometer, theta_i: float, phi_i: float, seed: int, name: str = "sample"
) -> CameraPicture:
    """Return the picture that the instrument takes of a surface: blurred, noisy, and clipped where it saturates.

    `brdf` gives f_r [1/sr], shape (N, 1), at unit vectors (N, 3) of light and viewer. The light at `theta_i`, `phi_i`
    [rad] is in the frame of the sample. `seed` is that of the noise.

    Notes
    -----
    A pixel gathers the light of the whole sample within its angle: radiance times cos(theta_r). Reflectance and
    transmittance of the half-silvered hemisphere are the same for sample and standard. They are part of the exposure.
    """
    from scipy.ndimage import gaussian_filter

    theta_c, phi_c = settings.pixels(_WITHIN)
    seen = theta_c < 0.5 * np.pi
    wr = traced(theta_c[seen], phi_c[seen], settings.offset)
    above = wr[:, 2] > 0.0
    turned = _turned(wr[above], phi_i)
    f_r = np.zeros(len(wr))
    beam = cone(unit_vector(theta_i, phi_i)[np.newaxis], float(radians(settings.light_half_angle_deg)))
    for w_i, weight in zip(beam, disk(1).weights, strict=True):
        share = weight * w_i[0, 2] / np.cos(theta_i)
        f_r[above] += share * brdf(np.broadcast_to(w_i, turned.shape), turned)[:, 0]
    light = np.zeros((2, *theta_c.shape))
    cosines = np.cos(theta_i) * np.maximum(wr[:, 2], 0.0)
    light[:, seen] = np.pi * f_r * cosines, settings.standard_reflectance * cosines
    shape = (2, settings.height, len(_WITHIN), settings.width, len(_WITHIN))
    light = light.reshape(shape).mean(axis=(2, 4))
    if settings.blur_px > 0.0:
        light = gaussian_filter(light, (0.0, settings.blur_px, settings.blur_px))
    rng = np.random.default_rng(seed)
    parts = (light[0], 1), (light[1], settings.frames), (np.zeros_like(light[0]), settings.frames)
    sample, standard, background = (_counts(part, settings, frames, rng) for part, frames in parts)
    return CameraPicture(settings, theta_i, phi_i, sample, standard, background, name, "simulated")


def _turned(w: Array, phi: float) -> Array:
    """Return vectors (N, 3) of the instrument in the frame of the sample, whose light comes from azimuth phi [rad]."""
    c, s = np.cos(phi), np.sin(phi)
    return np.stack([c * w[:, 0] - s * w[:, 1], s * w[:, 0] + c * w[:, 1], w[:, 2]], axis=1)


def _counts(light: Array, settings: Gonioreflectometer, frames: int, rng: np.random.Generator) -> Frames:
    """Return counts (E, height, width) of light, in multiples of a perfect white under perpendicular light."""
    exposed = []
    for time in settings.exposures:
        mean = np.maximum(light + settings.stray, 0.0) * (_WHITE * settings.full_well * time)
        electrons = rng.poisson(mean * frames) + settings.read_noise * np.sqrt(frames) * rng.standard_normal(mean.shape)
        counts = electrons / (frames * settings.electrons)
        if frames == 1:
            counts = np.round(counts)
        exposed.append(np.clip(counts, None, settings.saturation))
    return np.stack(exposed).astype(np.float32)


def reduced(picture: CameraPicture, thin: bool = True) -> Samples:
    """Return the samples of a picture: f_r by eq. 2 at the directions of the pixels, with its standard uncertainty.

    With `thin`, pixels are left out where f_r hardly changes, so that samples are dense at the peak alone.
    ParameterError if all pixels are dark, saturated or outside.

    Notes
    -----
    Of the exposures in which a pixel does not saturate the longest counts. The paper fits to directions by eq. 3; here
    they are those of traced rays, which eq. 3 approximates. Pixels are not averaged: what a pixel blurs is stated by
    the solid angle of the receiver. The blur is round in the picture, and the lens makes it an ellipse in directions:
    at 60 degrees it is 4 / 3 as wide along theta as across. f_r is taken back to a round one by its second derivatives.
    What this leaves is no noise, and no uncertainty states it: 0.1 % of f_r in lobes whose width is seven pixels, and
    0.01 % of the widths that are fitted. In lobes of alpha 0.02, three pixels, 0.1 % of the widths and 0.2 % of rho_s:
    `brdfdb.fitting.judgement` widens the intervals of such lobes by more than that.
    """
    settings = picture.settings
    surface, noise = _unsaturated(picture.sample, picture.background, settings, 1)
    white, white_noise = _unsaturated(picture.standard, picture.background, settings, settings.frames)
    scale = settings.standard_reflectance / np.pi
    with np.errstate(divide="ignore", invalid="ignore"):
        f_r = surface / white * scale
        uncertainty = np.hypot(noise, surface / white * white_noise) / white * scale
    f_r = _rounded(f_r, settings)
    known = np.isfinite(settings.directions[..., 0]) & np.isfinite(f_r) & (white > 5.0 * white_noise)
    if not np.any(known):
        raise ParameterError("picture", "every pixel is dark, saturated or outside of the hemisphere")
    kept = known & _chosen(_smoothed(np.where(known, f_r, np.nan)), uncertainty) if thin else known
    theta_r, phi_r = spherical_angles(_turned(settings.directions[kept], picture.phi_i))
    return Samples(
        name=picture.name,
        theta_i=np.full(theta_r.size, picture.theta_i),
        phi_i=np.full(theta_r.size, picture.phi_i),
        theta_r=theta_r,
        phi_r=phi_r,
        channels=("grey",),
        wavelength_nm=None,
        values=f_r[kept][:, np.newaxis],
        uncertainty=uncertainty[kept][:, np.newaxis],
        instrument=settings.instrument,
        provenance=picture.provenance,
        record={"gonioreflectometer": settings.settings()},
    )


class _Exposed(NamedTuple):
    """Counts less the background, a unit of time, and their standard uncertainty; nan where all exposures saturate."""

    counts: Array
    noise: Array


def _unsaturated(counts: Frames, background: Frames, settings: Gonioreflectometer, frames: int) -> _Exposed:
    """Return the counts of the longest exposure in which a pixel does not saturate.

    Noise and saturation are judged by counts that are smoothed over some pixels. A pixel that is dark by chance would
    otherwise count as one with less noise, and a fit that weighs by uncertainty would come out too dark.
    """
    from scipy.ndimage import gaussian_filter

    value = np.full(counts.shape[1:], np.nan)
    noise = np.full(counts.shape[1:], np.nan)
    for time, some, dark in zip(settings.exposures, counts, background, strict=True):
        smooth = gaussian_filter(some, _SMOOTH)
        variance = np.zeros(some.shape)
        for part, number in ((smooth, frames), (dark, settings.frames)):
            electrons = (
                np.maximum(part, 0.0) * settings.electrons + settings.read_noise**2 + settings.electrons**2 / 12.0
            )
            variance += electrons / (number * settings.electrons**2)
        used = np.isnan(value) & (smooth < _SATURATED * settings.saturation) & (some < settings.saturation)
        value[used] = (some.astype(np.float64) - dark)[used] / time
        noise[used] = np.sqrt(variance[used]) / time
    return _Exposed(value, noise)


def _smoothed(f_r: Array) -> Array:
    """Return f_r [1/sr] of pixels averaged over some of their neighbours; nan where it is.

    Thinning by single pixels would keep those whose noise adds to the slope of f_r, and lobes come out too narrow.
    """
    from scipy.ndimage import gaussian_filter

    known = np.isfinite(f_r)
    weight = gaussian_filter(known.astype(np.float64), _SMOOTH)
    sums = gaussian_filter(np.where(known, f_r, 0.0), _SMOOTH)
    return np.asarray(np.divide(sums, weight, where=known, out=np.full(f_r.shape, np.nan)))


def _rounded(f_r: Array, settings: Gonioreflectometer) -> Array:
    """Return f_r [1/sr] of pixels as a blur leaves it that is round in directions, and of the same variance.

    A blur adds half of its variance times the second derivative of f_r. The derivatives are those of two smoothed
    pictures, extrapolated to no smoothing, which makes those of narrow lobes too small. Pixels near the edge, or near
    pixels without a value, stay as they are.
    """
    from scipy.ndimage import gaussian_filter, minimum_filter

    down, right = np.gradient(settings.directions, axis=(0, 1))
    xx, yy, xy = (np.sum(a * b, axis=-1) / settings.pitch**2 for a, b in ((right, right), (down, down), (right, down)))
    area = xx * yy - xy**2
    known = np.isfinite(f_r)
    filled = np.where(known, f_r, 0.0)
    f_xx, f_yy, f_xy = (
        2.0 * gaussian_filter(filled, _SHARP, order) - gaussian_filter(filled, np.sqrt(2.0) * _SHARP, order)
        for order in ((0, 2), (2, 0), (1, 1))
    )
    difference = (1.0 - yy / area) * f_xx + (1.0 - xx / area) * f_yy + 2.0 * xy / area * f_xy
    change = 0.5 * (settings.blur_px**2 + _PIXEL) * difference
    inside = minimum_filter(known, int(8.0 * _SMOOTH) + 1) & np.isfinite(change)
    return f_r - np.where(inside, change, 0.0)


def _chosen(f_r: Array, uncertainty: Array) -> NDArray[np.bool_]:
    """Return the pixels that are kept: one in the middle of each block of pixels, small blocks where f_r changes.

    Four blocks become one where their means differ by less than 2 % or by less than four standard errors. A pixel that
    is nan agrees with all others, and is not kept.
    """
    height, width = f_r.shape
    padding = [(0, -height % _LARGEST_BLOCK), (0, -width % _LARGEST_BLOCK)]
    mean = np.pad(f_r, padding, constant_values=np.nan)
    variance = np.where(np.isfinite(mean), np.pad(uncertainty, padding, constant_values=np.nan) ** 2, 0.0)
    count = np.isfinite(mean).astype(np.float64)  # known pixels of a block
    known = np.isfinite(mean)
    kept = known.copy()
    merged = np.ones(mean.shape, dtype=bool)
    block = 1
    while block < _LARGEST_BLOCK:
        means, variances, counts = (_fours(array) for array in (mean, variance, count))
        weight = counts.sum(axis=-1)
        shares = counts / np.maximum(weight, 1.0)[..., np.newaxis]
        middle = np.sum(shares * np.where(counts > 0.0, means, 0.0), axis=-1)
        apart = np.where(counts > 0.0, np.abs(means - middle[..., np.newaxis]), 0.0).max(axis=-1)
        largest = variances.max(axis=-1)
        near = np.maximum(_FLAT * np.abs(middle), _STANDARD_ERRORS * np.sqrt(largest))
        merged = _fours(merged).all(axis=-1) & (apart <= near)
        block *= 2
        centre = np.zeros((block, block), dtype=bool)
        centre[block // 2, block // 2] = True
        kept = np.where(np.kron(merged, np.ones((block, block), dtype=bool)), np.kron(merged, centre), kept)
        mean = np.where(weight > 0.0, middle, np.nan)
        count = weight
        variance = np.sum(shares**2 * variances, axis=-1)
    return np.asarray((kept & known)[:height, :width])


def _fours(array: NDArray[Any]) -> NDArray[Any]:
    """Return the blocks of two by two of an array (H, W), shape (H / 2, W / 2, 4)."""
    height, width = array.shape
    return array.reshape(height // 2, 2, width // 2, 2).transpose(0, 2, 1, 3).reshape(height // 2, width // 2, 4)
