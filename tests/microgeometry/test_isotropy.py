"""Harmonics of slopes over azimuth: patterns with known harmonics, isotropic fields, and anisotropic ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from brdfdb.errors import ParameterError
from brdfdb.microgeometry.height_map import HeightMap
from brdfdb.microgeometry.isotropy import slope_harmonics
from brdfdb.microgeometry.surfaces import Kind, MadeSurface

N = np.arange(256)


def saw(count: int) -> np.ndarray:
    return 0.3 * (N % count).astype(float)


def test_harmonics_of_grooves_and_of_pyramids_follow_from_their_azimuths() -> None:
    tent = np.abs((N % 32) - 16.0)
    grooves = slope_harmonics(HeightMap(np.repeat(tent[:, np.newaxis], 256, axis=1), 1.0, 1.0))
    # slopes of +1 and -1 along x: 127 or 128 cells of each
    assert grooves.sizes == pytest.approx([0.0, 1.0, 0.0, 1.0, 0.0, 1.0], abs=0.01)
    pyramids = slope_harmonics(HeightMap(np.maximum(tent[:, np.newaxis], tent), 1.0, 1.0))
    # four azimuths at right angles, but for the cells at ridges
    assert pyramids.sizes == pytest.approx([0.0, 0.0, 0.0, 1.0, 0.0, 0.0], abs=0.08)
    assert pyramids.preferred == 4
    assert grooves.preferred in (2, 4, 6)
    turned = slope_harmonics(HeightMap(tent[:, np.newaxis] + tent, 1.0, 1.0))
    assert turned.sizes[3] == pytest.approx(1.0, abs=0.08)


def test_steps_that_lean_to_one_side_have_a_direction() -> None:
    both = saw(16)[:, np.newaxis] + saw(16)
    harmonics = slope_harmonics(HeightMap(both, 1.0, 1.0))
    assert harmonics.sizes[1] < 0.1  # second moments do not tell
    assert harmonics.preferred in (1, 3, 4)
    assert harmonics.sentence.endswith(" %, more than 10 %")


def test_cones_and_flat_maps_have_none() -> None:
    x = (N % 64) - 32.0
    cones = np.minimum(np.hypot(x[:, np.newaxis], x), 31.0)  # flat between them
    assert slope_harmonics(HeightMap(cones, 1.0, 1.0)).preferred == 0
    flat = slope_harmonics(HeightMap(np.zeros((32, 32)), 1.0, 1.0))
    assert (flat.preferred, max(flat.sizes)) == (0, 0.0)


@pytest.mark.parametrize(
    ("kind", "nodes"), [("gaussian", 128), ("gaussian", 256), ("exponential", 128), ("band", 128), ("band", 512)]
)
def test_an_isotropic_field_is_found_isotropic(kind: Kind, nodes: int) -> None:
    surface = MadeSurface(kind, 0.3, nodes=nodes)
    seeds = 40 if nodes > 256 else 60
    alarms = np.count_nonzero([slope_harmonics(surface.draw(seed)).preferred for seed in range(seeds)])
    assert alarms <= binom.ppf(0.99, seeds, 0.05)


def test_slopes_that_differ_by_two_have_a_direction_where_blocks_are_alike() -> None:
    # 26 lengths of a limited bandwidth along x, 13 along y: few wave vectors have slopes
    surface = MadeSurface("band", 0.3, 0.15, nodes=256)
    preferred = [slope_harmonics(surface.draw(seed)).preferred for seed in range(30)]
    assert preferred.count(2) >= 28


def test_feed_marks_on_an_isotropic_surface_have_a_direction() -> None:
    # a single wave vector, whose slopes are those of the roughness: harmonic 2 is 0.33
    rough = MadeSurface("gaussian", 0.3, nodes=128).draw(1)
    x = np.arange(128.0)[:, np.newaxis]
    marks = 0.3 * 1.28 / (2.0 * np.pi) * np.sin(2.0 * np.pi * x / 12.8)
    harmonics = slope_harmonics(HeightMap(rough.heights_um + marks, 0.1, 0.1))
    assert harmonics.sizes[1] == pytest.approx(0.3**2 / 2 / (0.3**2 / 2 + 2 * 0.3**2), abs=0.15)
    assert harmonics.preferred == 2


def test_a_small_map_is_judged_by_its_chance() -> None:
    found = [slope_harmonics(MadeSurface("gaussian", 0.3, nodes=128).draw(seed)) for seed in range(60)]
    by_chance = [one for one in found if max(one.sizes) > 0.1 and not one.preferred]
    assert len(by_chance) > 5  # 13 lengths of correlation along each axis
    assert all(one.sentence.endswith("%, which is within chance") for one in by_chance)


@pytest.mark.parametrize("seed", range(5))
def test_slopes_that_differ_along_two_axes_have_a_direction(seed: int) -> None:
    # slopes of 0.3 and 0.15: harmonic 2 is (0.09 - 0.0225) / (0.09 + 0.0225) = 0.6
    harmonics = slope_harmonics(MadeSurface("gaussian", 0.3, 0.15, nodes=512).draw(seed))
    assert harmonics.sizes[1] == pytest.approx(0.6, abs=0.05)
    assert harmonics.preferred == 2


def test_lengths_of_steps_count() -> None:
    z = MadeSurface("gaussian", 0.3, nodes=256).draw(1).heights_um
    harmonics = slope_harmonics(HeightMap(z, 0.1, 0.2))
    assert harmonics.sizes[1] == pytest.approx(0.6, abs=0.08)


def test_a_map_of_few_nodes_is_refused() -> None:
    with pytest.raises(ParameterError, match="4 x 9 nodes are too few; allowed are 5 x 5 or more"):
        slope_harmonics(HeightMap(np.zeros((4, 9)), 1.0, 1.0))
