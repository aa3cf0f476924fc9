"""Ward 1992, Figs 7 and 9: noise of the highlight on a sphere, for three techniques, and the lid of the silver box."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.figure import Figure, Panel, Picture, Statement, curve_of, listed, rows
from brdfdb.geometry import HALF_PI, radians, unit_vector
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.integrals.sampling import sample
from brdfdb.materials import presets
from brdfdb.models import ward_vectors

Array = NDArray[np.float64]

# The sphere of Fig. 7
CAMERA_DEG = 35.0  # elevation of the camera above the equator of the sphere
LIGHT_DEG = 75.0  # elevation of the light
HALF_ANGLE_DEG = 2.0  # half angle of the disc of light
SOLID_ANGLE = float(np.pi * np.sin(radians(HALF_ANGLE_DEG)) ** 2)  # sr
RAYS = 16  # "even with 16 samples per pixel"
MANY = 2000  # rays of a point that measure the noise
PIXELS = 64
AMBIENT = 0.1  # radiance of the dark stripes, for a light with an irradiance of 1
STRIPES = 0.3  # radiance of the bright stripes
WHITE = 0.25  # radiance drawn as white

STRICT = "strict Monte Carlo, eq. 7 (Fig. 7b)"
HYBRID = "hybrid, eq. 6 with eq. 7 (Fig. 7c)"
# Our readings of words of the paper
EXCESSIVE = 0.5  # standard deviation over radiance for "excessive noise"
CLEAN = 0.1  # standard deviation over radiance for "a clean result"
ACCURATE = 0.05  # relative error for "without compromising accuracy", because a disc is not a point
MUCH = 10.0  # ratio of variances for "much more efficient"
CORRECT = 0.05  # relative error for "correctly reproduce"

# The lid of Fig. 9
WAVES = 4  # waves over the width of the lid
SWING_DEG = 40.0  # swing of the brushed direction to either side
CAMERA = np.array([0.0, -2.2, 2.0])  # The lid extends from -1 to 1 in x and from -0.7 to 0.7 in y, at z = 0
CANDLES = (np.array([-1.6, 1.3, 0.9]), np.array([1.5, 1.5, 0.8]))
OVERHEAD = np.array([0.5, 2.0, 2.2])
MOON = unit_vector(radians(65.0), radians(115.0))  # through the window
STRENGTHS = 0.35, 0.35, 1.0, 0.15  # irradiance of each light at the middle of the lid, across the light
LINE = 0.45  # y of the line of the profile
ROWS = 44
COLUMNS = 72


class SpherePoints(NamedTuple):
    """Points of the sphere: frames (..., 3, 3) with x along the meridian, and camera and light in them (..., 3)."""

    frame: Array
    camera: Array
    light: Array


def points_at(across: Array, up: Array) -> SpherePoints:
    """Return the points at places [radius] in the image of a unit sphere."""
    camera, light = (unit_vector(HALF_PI - radians(elevation), 0.0) for elevation in (CAMERA_DEG, LIGHT_DEG))
    right = np.array([0.0, 1.0, 0.0])
    normal = across[..., None] * right + up[..., None] * np.cross(camera, right)
    normal = normal + np.sqrt(1.0 - across**2 - up**2)[..., None] * camera
    parallel = np.cross([0.0, 0.0, 1.0], normal)
    parallel /= np.linalg.norm(parallel, axis=-1, keepdims=True)
    frame = np.stack([np.cross(normal, parallel), parallel, normal], axis=-2)
    return SpherePoints(frame, frame @ camera, frame @ light)


def _radiance(x: Array, y: Array, swing_deg: float, alphas: tuple[float, float]) -> Array:
    """Return the radiance [irradiance / sr] of points of the lid under all four lights, eq. 6 without its samples."""
    surface = presets()["rolled-brass"].numbers | {"alpha_x": alphas[0], "alpha_y": alphas[1]}
    points = np.stack([x, y, np.zeros(x.shape)], axis=-1)
    turn = np.asarray(radians(swing_deg) * np.sin(np.pi * WAVES * x))  # azimuth of the x axis of the lobe
    along = np.stack([np.cos(turn), np.sin(turn), np.zeros(x.shape)], axis=-1)
    up = np.broadcast_to([0.0, 0.0, 1.0], along.shape)
    frame = np.stack([along, np.cross(up, along), up], axis=-2)

    def local(target: Array) -> Array:
        """Return the unit vectors towards a target, in the frames of the points."""
        direction = target - points
        direction = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
        return np.asarray(np.einsum("...ij,...j->...i", frame, direction))

    total = np.zeros(x.shape)
    for light, strength in zip((*CANDLES, OVERHEAD, 1e6 * MOON), STRENGTHS, strict=True):
        wi = local(light)
        fall = np.sum(light**2) / np.sum((light - points) ** 2, axis=-1)
        total += strength * fall * ward_vectors(wi, local(CAMERA), **surface) * np.maximum(wi[..., 2], 0.0)
    return total


def _forms() -> dict[str, tuple[float, tuple[float, float]]]:
    """Return the swing of the brushing [degree] and both alphas [1] of the drawn lids."""
    surface = presets()["rolled-brass"].numbers
    both = surface["alpha_x"], surface["alpha_y"]
    mean = float(np.sqrt(both[0] * both[1]))
    return {
        "brushed in waves": (SWING_DEG, both),
        "brushed evenly": (0.0, both),
        "not brushed, eq. 4": (SWING_DEG, (mean, mean)),
    }


def fig_09() -> Figure:
    """Draw the lid with its wave, brushed evenly, and not brushed."""
    axis = np.linspace(-1.0, 1.0, COLUMNS)
    x, y = np.meshgrid(axis, np.linspace(0.7, -0.7, ROWS))
    images = {name: _radiance(x, y, *form) for name, form in _forms().items()}
    white = max(float(image.max()) for image in images.values())
    (swing_deg, alphas), _, (_, means) = _forms().values()
    changes = [_radiance(x, y, swing_deg, widths) / _radiance(x, y, 0.0, widths) for widths in (alphas, means)]
    share, isotropic = (float(np.mean(np.abs(np.log(change)) > np.log(2.0))) for change in changes)
    return Figure(
        key="ward-1992-fig-09",
        paper="ward1992",
        title="Fig. 9: the lid of the silver box",
        caption="Rolled brass, since section 6 has no silver, under four lights: two candles, one overhead "
        f"to the right, and the moon. The x axis of eq. 5a swings by {SWING_DEG:.0f}° to either side, {WAVES} waves "
        "over the lid. Shape, lights and wave are our choice, because the text gives none. Only the lid of the scene "
        "is drawn.",
        panels=[Picture(title=name, radiance=rows(image / white, 3)) for name, image in images.items()],
        statements=[
            Statement(
                says="the lid demonstrates the use of local control to affect the reflectance properties of an "
                "anisotropic surface",
                where="section 6, Fig. 9",
                seen=f"A turn of the brushed direction alone changes the radiance of {share:.0%} of the lid by a "
                f"factor of two or more. With eq. 4 it changes {isotropic:.0%} of the lid.",
                threshold_from="our reading: affected is a factor of two, over a tenth of the lid",
                holds=share > 0.1 and isotropic == 0.0,
            )
        ],
    )


def profile() -> Figure:
    """Draw the radiance along a line of the lid."""
    x = np.linspace(-1.0, 1.0, 241)
    return Figure(
        key="ward-1992-fig-09-profile",
        paper="ward1992",
        title="Fig. 9: along a line of the lid",
        caption=f"The lid of the figure before, along the line y = {LINE:g}, behind the middle.",
        panels=[
            Panel(
                x_label="x, half widths of the lid",
                y_label="radiance",
                curves=[
                    curve_of(name, x, _radiance(x, np.full(x.shape, LINE), *form)) for name, form in _forms().items()
                ],
            )
        ],
        statements=[_highlights()],
    )


def _highlights() -> Statement:
    x = np.linspace(-0.8, 0.8, 2001)  # without the edges, where the candles are
    counts = []
    for form in _forms().values():
        line = _radiance(x, np.full(x.shape, LINE), *form)
        maximum = (line[1:-1] > line[:-2]) & (line[1:-1] >= line[2:])
        counts.append(int(np.sum(maximum & (line[1:-1] > 0.5 * line.max()))))
    waves, even, isotropic = counts
    return Statement(
        says='"a wave function determines the orientation of the brushed direction in the box lid, producing '
        'characteristic highlights"',
        where="section 6, Fig. 9",
        seen=f"Along the line the light overhead makes {waves} highlights (maxima above half of the highest) with the "
        f"wave, {even} brushed evenly and {isotropic} not brushed.",
        threshold_from="the paper's words: highlights, in the plural, of one light",
        holds=waves >= 2 > max(even, isotropic),
    )


def _lobe() -> dict[str, Any]:
    """Return the parameters of the lobe of rolled brass."""
    surface = presets()["rolled-brass"].numbers
    return {name: surface[name] for name in ("rho_s", "alpha_x", "alpha_y")}


def _random(seed: int, count: int, shape: tuple[int, ...]) -> tuple[Array, Array]:
    """Return two arrays of random numbers in [0, 1), of the shape (count, *shape)."""
    rng = np.random.default_rng(seed)
    return rng.uniform(size=(count, *shape)), rng.uniform(size=(count, *shape))


class _Rays(NamedTuple):
    """Weighted radiance of rays (rays, points) from surroundings and disc, and whether a ray meets the disc."""

    around: Array
    disc: Array
    met: NDArray[np.bool_]


def _followed(points: SpherePoints, directions: Array, weight: Array) -> _Rays:
    """Return the rays that leave points in directions of their frames."""
    met = np.sum(directions * points.light, axis=-1) > np.cos(radians(HALF_ANGLE_DEG))
    # Twelve upright stripes surround the sphere
    world = np.einsum("...ij,...i->...j", points.frame, directions)
    stripes = np.where(np.sin(6.0 * np.arctan2(world[..., 1], world[..., 0])) > 0.0, STRIPES, AMBIENT)
    around = np.where(met, 0.0, weight * stripes)
    return _Rays(around, np.where(met, weight / SOLID_ANGLE, 0.0), met)


def _by_eq_7(points: SpherePoints, rays: int, seed: int = 7) -> _Rays:
    """Return rays drawn from the lobe of each point, eq. 7 with its weights."""
    u1, u2 = _random(seed, rays, points.camera.shape[:-1])
    drawn = sample("ward", u1, u2, points.camera, rho_d=0.0, **_lobe())
    return _followed(points, drawn.wr, drawn.weight)


def _evenly(points: SpherePoints, rays: int, seed: int = 7) -> _Rays:
    """Return rays drawn evenly over the hemisphere, with the weights 2 pi f_r cos(theta)."""
    u1, u2 = _random(seed, rays, points.camera.shape[:-1])
    directions = unit_vector(np.arccos(u1), 2.0 * np.pi * u2)
    f_r = ward_vectors(directions, points.camera, rho_d=0.0, **_lobe())
    return _followed(points, directions, 2.0 * np.pi * f_r * u1)


def _closed(points: SpherePoints) -> Array:
    """Return L_i omega_i cos(theta_i) rho_bd [1/sr] of eq. 6 for the lobe alone, the deterministic term."""
    f_r = ward_vectors(points.light, points.camera, rho_d=0.0, **_lobe())
    return np.asarray(f_r * np.maximum(points.light[..., 2], 0.0))


def _diffuse(points: SpherePoints) -> Array:
    """Return the diffuse part of eq. 6 [1/sr], for the source and a constant ambient level; all pictures share it."""
    rho_d = presets()["rolled-brass"].numbers["rho_d"]
    return np.asarray(rho_d / np.pi * (np.maximum(points.light[..., 2], 0.0) + np.pi * (AMBIENT + STRIPES) / 2.0))


def _line() -> tuple[Array, SpherePoints]:
    """Return heights in the image [radius] along the meridian that faces the camera, and the points there."""
    up = np.linspace(0.15, 0.55, 41)
    return up, points_at(np.full(up.shape, 0.02), up)


def _noise(samples: Array, total: Array) -> Array:
    """Return the standard deviation of a mean of RAYS samples over the radiance [1]."""
    return np.asarray(samples.std(axis=0) / np.sqrt(RAYS) / total)


WORK = (
    f"{RAYS} rays a pixel, with fixed seeds. Work is counted, not timed: strict Monte Carlo follows {RAYS} rays and "
    "evaluates f_r for each of them. The hybrid does the same and evaluates f_r once more for the light."
)


def pictures() -> Figure:
    """Draw the three pictures of Fig. 7."""
    _, line = _line()
    seven = _by_eq_7(line, MANY)
    drawn, met = _pictures()
    return Figure(
        key="ward-1992-fig-07-techniques",
        paper="ward1992",
        title="Fig. 7: three ways to render an anisotropic highlight",
        caption="Rolled brass on a sphere, light and camera as in Fig. 7a before; the light is a disc of "
        f"{2.0 * HALF_ANGLE_DEG:g}°, and twelve stripes surround the sphere. (a) Eq. 6 without samples. (b) Rays by "
        "eq. 7 with their weights, which meet the light by chance. (c) Eq. 6 with the same rays, except those that "
        f"meet the light. The diffuse part is the same in all. {WORK}",
        panels=[*drawn],
        statements=[_misses(seven, _total(line, seven)), _unbiased(met)],
    )


def noise() -> Figure:
    """Draw the noise of Figs 7b and 7c, and of rays that are drawn evenly."""
    up, line = _line()
    seven, even = _by_eq_7(line, MANY), _evenly(line, MANY)
    total = _total(line, seven)
    noises = {
        STRICT: _noise(seven.around + seven.disc, total),
        HYBRID: _noise(seven.around, total),
        "hybrid, rays drawn evenly": _noise(even.around, total),
    }
    lit = _closed(line) > 0.5 * _closed(line).max()
    return Figure(
        key="ward-1992-fig-07-noise",
        paper="ward1992",
        title="Fig. 7: noise along the meridian through the highlight",
        caption=f"The sphere of the figure before. {WORK}",
        panels=[
            Panel(
                x_label="height in the picture, radii of the sphere",
                y_label="standard deviation over radiance",
                log_y=True,
                curves=[curve_of(label, up, values) for label, values in noises.items()],
            ),
        ],
        statements=[
            _excessive(noises[STRICT][lit]),
            _clean(noises[STRICT][lit], noises[HYBRID][lit]),
            _efficient(seven.around, even.around),
            _uniform_weights(),
        ],
    )


def _total(line: SpherePoints, rays: _Rays) -> Array:
    """Return the radiance [1/sr] by eq. 6."""
    return np.asarray(_diffuse(line) + _closed(line) + rays.around.mean(axis=0))


def _pictures() -> tuple[list[Picture], float]:
    """Return the pictures (a), (b) and (c), and the share [1] of the rays of (c) that meet the light."""
    axis = np.linspace(-1.0, 1.0, PIXELS)
    across, up = np.meshgrid(axis, axis[::-1])
    inside = across**2 + up**2 < 1.0
    points = points_at(across[inside], up[inside])
    rays = _by_eq_7(points, RAYS)
    base, closed = _diffuse(points), _closed(points)
    radiances = {
        "(a) deterministic": base + closed,
        f"(b) Monte Carlo, {RAYS} rays": base + (rays.around + rays.disc).mean(axis=0),
        f"(c) hybrid, {RAYS} rays": base + closed + rays.around.mean(axis=0),
    }
    drawn = []
    for title, radiance in radiances.items():
        image = np.full(across.shape, np.nan)
        image[inside] = np.minimum(radiance / WHITE, 1.0)
        drawn.append(Picture(title=title, radiance=rows(image, 3)))
    return drawn, float(rays.met.mean())


def _misses(rays: _Rays, total: Array) -> Statement:
    missed = rays.around.mean(axis=0) / total
    albedo = float(rays.around.mean() / (0.5 * (AMBIENT + STRIPES)))
    return Statement(
        says='a strictly deterministic calculation "fails to pick up indirect semispecular contributions"',
        where="section 5, Fig. 7a",
        seen=f"Beside the highlight (a) lacks {missed[0]:.0%} of the radiance, in it {missed.min():.0%}: the light of "
        f"the stripes in the lobe, {albedo:.2f} of their mean radiance.",
        threshold_from="our reading: a failure to pick something up lacks more than half of it",
        holds=bool(missed[0] > 0.5),
    )


def _excessive(noise: Array) -> Statement:
    return Statement(
        says='relying solely on stochastic sampling shows "high variance in the form of excessive noise, even with 16 '
        'samples per pixel"',
        where="section 5, Fig. 7b",
        seen=f"In the highlight, where the source has at least half of its largest radiance, the standard deviation of "
        f"{RAYS} rays is {noise.min():.0%} to {noise.max():.0%} of the radiance (excessive: {EXCESSIVE:.0%}).",
        threshold_from="our reading: excessive is half of the radiance",
        holds=bool(noise.min() > EXCESSIVE),
    )


def _clean(strict: Array, hybrid: Array) -> Statement:
    gain = (strict / hybrid) ** 2 * RAYS / (RAYS + 1.0)  # The hybrid evaluates f_r once more
    return Statement(
        says='by combining the two techniques "we get a clean result", with the same number of samples as Fig. 7b',
        where="section 5, Fig. 7c",
        seen=f"In the highlight the standard deviation of (c) is {hybrid.max():.1%} of the radiance at most (clean: "
        f"{CLEAN:.0%}); its variance times work is smaller than that of (b) by a factor of {gain.min():.1e} or more.",
        threshold_from="our reading: clean is within a tenth of the radiance",
        holds=bool(hybrid.max() < CLEAN and gain.min() > MUCH),
    )


def _unbiased(met: float) -> Statement:
    up = np.linspace(0.15, 0.55, 201)
    line = points_at(np.full(up.shape, 0.02), up)
    lit = np.flatnonzero(_closed(line) > 0.5 * _closed(line).max())[::3]
    points = SpherePoints(*(values[lit] for values in line))
    rays = _by_eq_7(points, 30000, 1992).disc
    closed = float(_closed(points).sum())
    ratio = float(rays.mean(axis=0).sum()) / closed
    error = float(np.sqrt((rays.var(axis=0) / len(rays)).sum())) / closed
    return Statement(
        says='the hybrid technique is clean "without compromising accuracy"; bias is avoided by not counting rays that '
        "hit a source",
        where="section 5",
        seen=f"In the highlight rays by eq. 7 find {ratio:.3f} ± {error:.3f} times the light of the source by eq. 6 "
        f"(a disc of {2.0 * HALF_ANGLE_DEG:g}° taken as a point). If they counted too, they would double it. Without "
        f"them, {met:.2%} of the rays of picture (c) are wasted.",
        threshold_from="our reading: accuracy is kept within 5 % of the light of the source",
        holds=abs(ratio - 1.0) < ACCURATE and error < 0.4 * ACCURATE,
    )


def _efficient(seven: Array, even: Array) -> Statement:
    gain = (even.var(axis=0) / seven.var(axis=0)).mean()
    lobe = _lobe()
    up = np.array([0.0, 0.0, 1.0])
    peak = float(ward_vectors(up, up, rho_d=0.0, **lobe))
    accepted = float(directional_albedo("ward", 0.0, tolerance=1e-4, rho_d=0.0, **lobe).albedo) / (2.0 * np.pi * peak)
    return Statement(
        says='sampling by eq. 7 "is much more efficient than either distributing the samples evenly and then weighting '
        'the result, or using other techniques, such as rejection sampling"',
        where="section 5.1",
        seen=f"Along the line of the picture the variance of evenly drawn rays is {gain:.0f} times that of eq. 7 for "
        f"the same number of rays (much: {MUCH:.0f}). Rejection under the peak keeps one of {1.0 / accepted:.0f} "
        "directions along the normal; eq. 7 keeps all directions above the horizon.",
        threshold_from="our reading: much more is ten times",
        holds=bool(gain > MUCH and 1.0 / accepted > MUCH),
    )


def _uniform_weights() -> Statement:
    lobe = _lobe()
    thetas_deg = [0.0, 30.0, 60.0]
    viewers = unit_vector(radians(thetas_deg), 0.0)
    u1, u2 = _random(92, 4000, (len(thetas_deg),))
    drawn = sample("ward", u1, u2, viewers, rho_d=0.0, **lobe)
    exact = directional_albedo("ward", radians(thetas_deg), tolerance=1e-4, rho_d=0.0, **lobe).albedo
    uniform = lobe["rho_s"] * (drawn.wr[..., 2] > 0.0).mean(axis=0) / exact
    weighted = drawn.weight.mean(axis=0) / exact
    return Statement(
        says='"uniformly weighted sample rays sent according to the above distribution will correctly reproduce the '
        'specified highlight"',
        where="section 5.1, eq. 7",
        seen=f"In uniform light they bring {listed(uniform, '.2f')} times the light that eq. 5a reflects, for θ_r of "
        f"{listed(thetas_deg, '.0f')}°. With the weights f_r cos θ_i over their density they bring "
        f"{listed(weighted, '.3f')} times.",
        threshold_from="our reading: correct is within 5 % of the lobe",
        holds=bool(np.abs(uniform - 1.0).max() < CORRECT),
    )


FIGURES: dict[str, Callable[[], Figure]] = {
    "ward-1992-fig-07-techniques": pictures,
    "ward-1992-fig-07-noise": noise,
    "ward-1992-fig-09": fig_09,
    "ward-1992-fig-09-profile": profile,
}
