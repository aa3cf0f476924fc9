"""Ward 1992, Fig. 9: the lid of the silver box, whose brushed direction is a wave."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brdfdb.figure import Figure, Panel, Picture, Statement, curve_of, rows
from brdfdb.geometry import radians, unit_vector
from brdfdb.materials import presets
from brdfdb.models import ward_vectors

Array = NDArray[np.float64]

WAVES = 4  # waves over the width of the lid
SWING_DEG = 40.0  # swing of the brushed direction to either side
CAMERA = np.array([0.0, -2.2, 2.0])  # The lid extends from -1 to 1 in x and from -0.7 to 0.7 in y, at z = 0
CANDLES = (np.array([-1.6, 1.3, 0.9]), np.array([1.5, 1.5, 0.8]))
OVERHEAD = np.array([0.5, 2.0, 2.2])
MOON = unit_vector(radians(65.0), radians(115.0))  # through the window
STRENGTHS = 0.35, 0.35, 1.0, 0.15  # irradiance of each light at the middle of the lid, across the light
LINE = 0.45  # y of the line of the profile
ROWS, COLUMNS = 44, 72


def _turned(across: Array, swing_deg: float) -> Array:
    """Return the azimuth [rad] of the x axis of the lobe; a wave along the lid turns it."""
    return np.asarray(radians(swing_deg) * np.sin(np.pi * WAVES * across))


def _radiance(x: Array, y: Array, swing_deg: float, alphas: tuple[float, float]) -> Array:
    """Return the radiance [irradiance / sr] of points of the lid under all four lights, eq. 6 without its samples."""
    surface = presets()["rolled-brass"].numbers
    points = np.stack([x, y, np.zeros(x.shape)], axis=-1)
    turn = _turned(x, swing_deg)
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
        f_r = ward_vectors(
            wi,
            local(CAMERA),
            rho_d=surface["rho_d"],
            rho_s=surface["rho_s"],
            alpha_x=alphas[0],
            alpha_y=alphas[1],
        )
        total += strength * fall * f_r * np.maximum(wi[..., 2], 0.0)
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
    return Figure(
        key="ward-1992-fig-09",
        paper="ward1992",
        title="Fig. 9: the lid of the silver box",
        caption="Rolled brass, since section 6 has no silver, under four lights: two candles, one overhead "
        f"to the right, and the moon. The x axis of eq. 5a swings by {SWING_DEG:.0f}° to either side, {WAVES} waves "
        "over the lid. Shape, lights and wave are our choice, because the text gives none. Only the lid of the scene "
        "is drawn.",
        panels=[Picture(title=name, radiance=rows(image / white, 3)) for name, image in images.items()],
        statements=[_local_control(x, y)],
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


def _peaks(line: Array) -> int:
    """Return the number of maxima of a line that are at least half as high as its highest."""
    rising, falling = line[1:-1] > line[:-2], line[1:-1] >= line[2:]
    return int(np.sum(rising & falling & (line[1:-1] > 0.5 * line.max())))


def _highlights() -> Statement:
    """Return the statement that the wave produces characteristic highlights."""
    x = np.linspace(-0.8, 0.8, 2001)  # The edges, where the candles are, are left out
    waves, even, isotropic = (_peaks(_radiance(x, np.full(x.shape, LINE), *form)) for form in _forms().values())
    return Statement(
        says='"a wave function determines the orientation of the brushed direction in the box lid, producing '
        'characteristic highlights"',
        where="section 6, Fig. 9",
        seen=f"Along the line the light overhead makes {waves} highlights (maxima above half of the highest) with the "
        f"wave, {even} brushed evenly and {isotropic} not brushed.",
        threshold_from="the paper's words: highlights, in the plural, of one light",
        holds=waves >= 2 > max(even, isotropic),
    )


def _local_control(x: Array, y: Array) -> Statement:
    """Return the statement that the brushed direction controls the reflection locally."""
    (swing_deg, alphas), _, (_, means) = _forms().values()
    changes = [_radiance(x, y, swing_deg, widths) / _radiance(x, y, 0.0, widths) for widths in (alphas, means)]
    share, isotropic = (float(np.mean(np.abs(np.log(change)) > np.log(2.0))) for change in changes)
    return Statement(
        says="the lid demonstrates the use of local control to affect the reflectance properties of an anisotropic "
        "surface",
        where="section 6, Fig. 9",
        seen=f"A turn of the brushed direction alone changes the radiance of {share:.0%} of the lid by a "
        f"factor of two or more. With eq. 4 it changes {isotropic:.0%} of the lid.",
        threshold_from="our reading: affected is a factor of two, over a tenth of the lid",
        holds=share > 0.1 and isotropic == 0.0,
    )


FIGURES: dict[str, Callable[[], Figure]] = {"ward-1992-fig-09": fig_09, "ward-1992-fig-09-profile": profile}
