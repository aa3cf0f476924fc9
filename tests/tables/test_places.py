"""Places where the error is measured by itself: who is there, and that what is drawn there is."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.geometry import checked_angles, checked_vectors, radians, unit_vector
from brdfdb.tables.places import ALONGSIDE, BOTH_GRAZING, ONE_GRAZING, ROWS, draw, rows_of

COUNT = 50


@pytest.mark.parametrize(
    ("theta_i", "theta_r", "delta_phi", "rows"),
    [
        (5.0, 45.0, 180.0, {0}),
        (30.0, 60.0, 10.0, {3}),  # on an edge, the band above
        (45.0, 45.0, 0.0, {4, ALONGSIDE + 4}),
        (45.0, 54.0, 89.0, {4, ALONGSIDE + 4}),
        (45.0, 55.5, 0.0, {4}),
        (45.0, 45.0, 91.0, {4}),
        (0.0, 8.0, 0.0, {0, ALONGSIDE}),
        (84.0, 86.0, 180.0, {8, ONE_GRAZING}),
        (20.0, 88.0, 0.0, {2, ONE_GRAZING + 1}),
        (89.5, 20.0, 180.0, {8, ONE_GRAZING + 2}),
        (84.0, 86.0, 0.0, {8, ALONGSIDE + 8, ONE_GRAZING}),
        (86.0, 86.0, 180.0, {8, BOTH_GRAZING}),
        (86.0, 88.0, 0.0, {8, BOTH_GRAZING + 1}),
        (90.0, 90.0, 0.0, {8, BOTH_GRAZING + 2}),
    ],
)
def test_places_of_a_pair(theta_i: float, theta_r: float, delta_phi: float, rows: set[int]) -> None:
    turned = radians(20.0 + delta_phi)
    t_i, phi_i, t_r = radians([theta_i, 20.0, theta_r])
    assert set(rows_of(checked_angles(t_i, phi_i, t_r, turned)).tolist()) == rows
    assert set(rows_of(checked_vectors(unit_vector(t_i, phi_i), unit_vector(t_r, turned))).tolist()) == rows


def test_rows_broadcast_as_directions_do_and_a_direction_that_is_nan_has_some() -> None:
    theta = radians([[10.0], [np.nan]])
    rows = rows_of(checked_angles(theta, 0.0, radians([10.0, 80.0, 90.0]), [0.0, 0.1, 0.2]))
    assert rows.shape == (3, 2, 3)
    assert np.all((rows >= 0) & (rows < ROWS))


def test_pairs_that_tables_share_cannot_be_written() -> None:
    assert draw(50, 3) is draw(50, 3)
    for array in draw(50, 3):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_what_is_drawn_in_a_place_is_there() -> None:
    pairs = draw(COUNT, 3)
    rows = rows_of(checked_vectors(pairs.wi, pairs.wr))
    assert np.all(np.any(rows == pairs.row, axis=0))
    assert np.all(np.diff(pairs.sample) >= 0)
    assert np.all(np.bincount(pairs.sample) == COUNT)
    assert set(pairs.row.tolist()) == set(range(ALONGSIDE, ROWS))
    # of each band and each ring with both, some are exactly towards the light
    towards = np.all(np.abs(pairs.wi - pairs.wr) < 1e-12, axis=1)
    assert set(pairs.row[towards].tolist()) == {*range(ALONGSIDE, ONE_GRAZING), *range(BOTH_GRAZING, ROWS)}
    for w in (pairs.wi, pairs.wr):
        np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1.0, atol=1e-12)
        assert np.all(w[:, 2] > -1e-12)
