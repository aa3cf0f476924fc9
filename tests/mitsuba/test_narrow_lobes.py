"""Samples of lobes that are finer than the grid of Mitsuba's chi-square test: stray light of polished mirrors.

Bins are rings and sectors of the slopes of half vectors. Rings have about equal probabilities, by quadrature of the
density over the logarithm of the slope, where the narrowest lobe is as wide as any other.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from brdfdb.geometry import unit_vector
from tests.mitsuba.surfaces import Subject, evaluated, interaction, variant

Array = NDArray[Any]

LIGHTS_DEG, TURNED = (0.0, 45.0, 75.0, 85.0), 0.5
SIGNIFICANCE = 0.01  # level at which all tests of one surface together reject it by chance
DRAWN = 1 << 18
RINGS, SECTORS = 24, 8
# Nodes over the logarithm of the slope, up to slopes of the horizon, and over the azimuth
FINE, AZIMUTHS = 1200, 32 * SECTORS
SMALLEST, LARGEST = 1e-8, 1e4
FEWEST = 10.0  # expected directions of a bin; bins with fewer are one
TOTAL = 1e-4  # of the density above the horizon, beyond 1; measured 2.2e-5

NARROW = (
    *(
        Subject("brdfdb_abg", "abg", {"a": 1e-4 * b, "b": b, "g": g})
        for b, g in ((1e-3, 1.8), (1e-5, 1.5), (1e-8, 2.0))
    ),
    *(
        Subject("brdfdb_harvey_shack", "harvey_shack", {"b_0": 1.0, "knee": knee, "slope": -1.5})
        for knee in (1e-2, 1e-3, 1e-4)
    ),
)


class Bins(NamedTuple):
    """Edges of rings [1] in the slope, and shares [1] of directions in rings and sectors."""

    edges: Array
    shares: Array


def bins_of(mitsuba: Any, subject: Subject, wi: Array) -> Bins:
    """Return bins of the density of a surface: its integral over each."""
    logs = np.linspace(np.log(SMALLEST), np.log(LARGEST), FINE + 1)
    slope = np.exp(0.5 * (logs[:-1] + logs[1:]))[:, np.newaxis]
    psi = (np.arange(AZIMUTHS) + 0.5) * (2.0 * np.pi / AZIMUTHS)
    h = np.stack(np.broadcast_arrays(slope * np.cos(psi), slope * np.sin(psi), 1.0 + 0.0 * slope * psi), axis=-1)
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    along = h @ wi
    wr = 2.0 * along[..., np.newaxis] * h - wi
    flat = wr.reshape(-1, 3)
    density = evaluated(mitsuba, mitsuba.load_dict(subject.document), np.tile(wi, (len(flat), 1)), flat)[1]
    # Solid angles: of half vectors cos^3 over slopes, of directions 4 (h.i) as large
    area = slope**2 * (logs[1] - logs[0]) * (2.0 * np.pi / AZIMUTHS)
    seen = (along > 0.0) & (wr[..., 2] > 0.0)
    inside = np.where(seen, density.reshape(along.shape) * 4.0 * along * h[..., 2] ** 3 * area, 0.0)
    inside = inside.reshape(FINE, SECTORS, -1).sum(axis=2)
    summed = np.cumsum(inside.sum(axis=1))
    numbers = np.unique(np.searchsorted(summed, summed[-1] * np.arange(1, RINGS) / RINGS)) + 1
    starts = np.concatenate([[0], numbers])
    return Bins(np.exp(logs[numbers]), np.add.reduceat(inside, starts, axis=0))


def counts(mitsuba: Any, subject: Subject, wi: Array, edges: Array) -> Array:
    """Return the directions that a surface draws in rings and sectors."""
    choice, u, v = np.random.default_rng(1976).random((3, DRAWN)).astype(np.float32)
    surface = mitsuba.load_dict(subject.document)
    place, point = interaction(mitsuba, np.tile(wi, (DRAWN, 1))), mitsuba.Point2f(u, v)
    drawn, _ = surface.sample(mitsuba.BSDFContext(), place, mitsuba.Float(choice), point)
    wr = np.array(drawn.wo, dtype=np.float64).T[np.array(drawn.pdf) > 0.0]
    h = wr + wi
    ring = np.searchsorted(edges, np.hypot(h[:, 0], h[:, 1]) / h[:, 2])
    sector = (np.arctan2(h[:, 1], h[:, 0]) % (2.0 * np.pi) * (SECTORS / (2.0 * np.pi))).astype(np.int64) % SECTORS
    found = np.zeros((edges.size + 1, SECTORS))
    np.add.at(found, (ring, sector), 1.0)
    return found


def chance(shares: Array, found: Array) -> float:
    """Return the probability of counts that differ from shares by as much; what is in no bin is a bin, too."""
    expected = DRAWN * np.append(shares.ravel(), max(0.0, 1.0 - shares.sum()))
    seen = np.append(found.ravel(), DRAWN - found.sum())
    many = expected >= FEWEST
    expected, seen = (np.append(values[many], values[~many].sum()) for values in (expected, seen))
    some = expected > 0.0
    statistic = np.sum((seen - expected)[some] ** 2 / expected[some])
    return float(stats.chi2.sf(statistic, np.count_nonzero(some) - 1))


def light(theta_deg: float) -> Array:
    """Return a light as Mitsuba takes it, in float32."""
    return np.asarray(unit_vector(np.deg2rad(theta_deg), TURNED), dtype=np.float32).astype(np.float64)


@pytest.mark.parametrize("subject", NARROW, ids=str)
def test_samples_of_narrow_lobes_have_their_density(subject: Subject) -> None:
    mitsuba = variant("llvm_ad_mono")
    for theta_deg in LIGHTS_DEG:
        wi = light(theta_deg)
        bins = bins_of(mitsuba, subject, wi)
        assert bins.shares.sum() < 1.0 + TOTAL
        found = counts(mitsuba, subject, wi, bins.edges)
        assert chance(bins.shares, found) > SIGNIFICANCE / len(LIGHTS_DEG), f"{theta_deg} degrees"


@pytest.mark.parametrize("subject", NARROW, ids=str)
def test_a_lobe_that_is_5_percent_wider_is_rejected(subject: Subject) -> None:
    mitsuba = variant("llvm_ad_mono")
    bend = {"b": 1.05 ** subject.parameters["g"]} if subject.model == "abg" else {"knee": 1.05}
    wider = {name: value * bend.get(name, 1.0) for name, value in subject.parameters.items()}
    wi = light(45.0)
    bins = bins_of(mitsuba, subject, wi)
    found = counts(mitsuba, Subject(subject.plugin, subject.model, wider), wi, bins.edges)
    assert chance(bins.shares, found) < 1e-6
