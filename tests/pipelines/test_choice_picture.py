"""The picture of a choice: pixels as they are, colours that mean the same in every picture."""

from __future__ import annotations

import io
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from brdfdb.scenes import image
from brdfdb.scenes.scene import Scene
from brdfdb.scenes.shapes import Array
from brdfdb_pipelines import choose

TOLERANCE = 0.5
ROUNDED = 1.01 / 255.0  # of colours in a PNG, twice: the picture and the PNG
GAP, TITLE = 14, 30  # pixels around panels and above them
HEIGHT, WIDTH = 3, 4
SCALE = 105  # 420 pixels across


@dataclass
class Seen:
    """A picture whose differences are made up: as if nothing could be told from the truth but by that."""

    scene: Scene
    truth: Array
    off: Array

    def differences(self, _picture: Array) -> Array:
        return self.off


@pytest.fixture
def seen() -> Seen:
    scene = Scene.model_validate(
        {
            "ambient": 1.0,
            "camera": {"position": (0.0, -1.0, 0.0), "height": 1.0},
            "tolerance": {"ciede2000": TOLERANCE},
            "objects": [{"name": "ball", "material": "clay-vase", "shape": {"kind": "sphere", "radius": 1}}],
        }
    )
    rng = np.random.default_rng(1991)
    shades = rng.random((HEIGHT, WIDTH, 1)) * np.ones(len(scene.wavelengths_nm))
    return Seen(scene, shades, TOLERANCE * np.linspace(0.0, 3.0, HEIGHT * WIDTH).reshape(HEIGHT, WIDTH))


def panels(data: bytes) -> list[Array]:
    """The panels, row by row, every pixel of the scene SCALE times across and down."""
    whole = imread(io.BytesIO(data))[..., :3]
    across, down = SCALE * WIDTH, SCALE * HEIGHT
    assert whole.shape[:2] == (2 * (down + TITLE + GAP), 3 * across + 4 * GAP)
    tops, lefts = (TITLE, 2 * TITLE + down + GAP), [GAP + column * (across + GAP) for column in range(3)]
    return [whole[top : top + down, left : left + across] for top in tops for left in lefts]


def blocks(picture: Array) -> Array:
    return picture.repeat(SCALE, axis=0).repeat(SCALE, axis=1)


def test_pixels_are_squares_of_one_colour(seen: Seen) -> None:
    choice, cheaper = 0.5 * seen.truth, 0.25 * seen.truth
    drawn = panels(choose.png(seen, choice, cheaper))[:3]
    for panel, picture in zip(drawn, (seen.truth, choice, cheaper), strict=True):
        np.testing.assert_allclose(panel, blocks(image.srgb(seen.scene, picture)), atol=ROUNDED)


def test_colours_of_differences_run_to_twice_the_tolerance_and_what_is_more_has_its_own(seen: Seen) -> None:
    colours = mpl.colormaps["viridis"](seen.off / (2.0 * TOLERANCE))[..., :3]
    colours[seen.off > 2.0 * TOLERANCE] = to_rgb(choose.BEYOND)
    drawn = panels(choose.png(seen, seen.truth, seen.truth))
    for panel in drawn[4:]:
        np.testing.assert_allclose(panel, blocks(colours), atol=ROUNDED)


def test_where_nothing_is_cheaper_nothing_is_shown_and_the_bar_marks_the_tolerance_in_the_middle(seen: Seen) -> None:
    drawn = panels(choose.png(seen, seen.truth, None))
    assert np.all(drawn[2] == 1.0)
    assert np.all(drawn[5] == 1.0)
    row = drawn[3][choose.BAR // 2]
    beyond = np.flatnonzero(np.all(np.abs(row - to_rgb(choose.BEYOND)) < ROUNDED, axis=-1))[0]
    mark = np.flatnonzero(np.all(row[:beyond] == 1.0, axis=-1))
    np.testing.assert_allclose(mark.mean(), beyond / 2.0, atol=2.0)  # pixels
