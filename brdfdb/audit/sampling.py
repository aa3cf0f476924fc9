"""The sampler of the model behind a table: histogram compared with density, weights compared with the albedo."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from brdfdb.audit.finding import Cell, Finding, NumberTable, Sentence, Subject, Verdict
from brdfdb.audit.pairs import SEED, representative_nm
from brdfdb.figure import Numbers, number, numbers
from brdfdb.gauss import GaussRule, gauss_rule
from brdfdb.geometry import radians, unit_vector
from brdfdb.integrals.quadrature import spectral_albedo
from brdfdb.integrals.sampling import lobe_of, mixture_density, sample
from brdfdb.lobes import Lobe
from brdfdb.materials import Material
from brdfdb.parameters import Array, ModelSpec
from brdfdb.tables.table import Table

SAMPLES = 100_000  # number of samples for each light
FEWER_SAMPLES = 4000  # number of samples if the values of the model are integrals
THETA_I_DEG = (10.0, 45.0, 80.0)
PHI_I_DEG = 30.0
LEAST_CHANCE = 1e-6  # smallest p of a sound sampler
STANDARD_ERRORS = 6.0  # allowed difference of the albedos, in standard errors; chance exceeds it once in 500 million
_ROUNDING = 1e-12  # rounding error of a mean of equal weights
_ALBEDO_TOLERANCE = 1e-5  # of the albedo by quadrature, of which four digits are shown
_ENOUGH = 10.0  # smallest expected number of samples in a bin
# Edges of the bins of half vectors. t is the slope in widths of the lobe: its bins are tenths of the distribution, then
# half octaves. psi is the azimuth on the ellipse of the lobe
_TENTHS = 1.0 - np.arange(10) / 10.0
_HALF_OCTAVES = 2.0 ** (np.arange(1, 33) / 2.0)
_PSI_EDGES = np.linspace(-np.pi, np.pi, 13)
_NODES = 12  # number of Gauss nodes along each side of a bin


class Sampling(Finding):
    """The sampler of the model at the parameters of the material, for some lights."""

    key = "sampling"
    order = 7
    explanation = (
        "p is the probability that samples with the density of the model have a worse histogram. The weight of a "
        "sample is f_r cos theta_r over that density."
    )

    samples: int = Field(description="number of samples for each light")
    theta_i_deg: list[float]
    phi_i_deg: float
    wavelength_nm: float | None
    chi_square_p: Numbers = Field(description="probability of a worse histogram if the density is right")
    largest_weight: Numbers
    weight_spread: Numbers = Field(description="standard deviation of the weights over their mean")
    monte_carlo: Numbers = Field(description="albedo without the specular part")
    monte_carlo_error: Numbers = Field(description="standard error of the sampled albedo")
    quadrature: Numbers
    verdict: Verdict

    @classmethod
    def judge(cls, subject: Subject) -> Finding:
        """Draw samples of the model of a table."""
        if not isinstance(subject.source, Material):
            return subject.not_judged("samples are drawn from the model of the source")
        return sampling_of(subject.table, subject.source)

    def sentences(self) -> list[Sentence]:
        """Return a sentence on the least likely histogram."""
        if self._smallest is None:
            text = "no bins to compare"
        else:
            text = f"the smallest p of {len(self.theta_i_deg)} lights is {_probability(self._smallest)}"
        if self.verdict == "violates":
            text = f"samples of the model have a wrong density or a wrong albedo; {text}"
        return [self.sentence(self.verdict, text)]

    def cells(self) -> list[Cell]:
        """Return the smallest p."""
        sort = 1.0 if self._smallest is None else self._smallest
        return [Cell(self.verdict, f"p {_probability(self._smallest)}", sort)]

    def tables(self) -> list[NumberTable]:
        """Return the samples of each light."""
        columns = (self.largest_weight, self.weight_spread, self.monte_carlo, self.monte_carlo_error, self.quadrature)
        rows = [
            (f"{theta:.4g}°", _probability(p), *(number(value) for value in rest))
            for theta, p, *rest in zip(self.theta_i_deg, self.chi_square_p, *columns, strict=True)
        ]
        at = "" if self.wavelength_nm is None else f" at {self.wavelength_nm:g} nm"
        caption = f"Sampling: {self.samples} samples for each light{at}"
        headings = ("light", "p", "largest weight", "spread", "diffuse albedo, sampled", "standard error", "integrated")
        return [NumberTable(caption, headings, rows)]

    @property
    def _smallest(self) -> float | None:
        return min((p for p in self.chi_square_p if p is not None), default=None)


def _probability(value: float | None) -> str:
    """Return a probability as text, without digits that carry no information."""
    if value is None:
        return "–"
    return "below 0.001" if value < 0.001 else f"{value:.3f}"


class _Light(NamedTuple):
    """Numbers of one light, as in `Sampling`, and the verdict on them."""

    chi_square_p: float
    largest_weight: float
    weight_spread: float
    monte_carlo: float
    monte_carlo_error: float
    quadrature: float
    good: bool


def sampling_of(table: Table, material: Material) -> Sampling:
    """Return the finding on samples for each light, at the middle wavelength of the table."""
    wavelength = representative_nm(table)
    count = min(SAMPLES, FEWER_SAMPLES) if material.spec.slow else SAMPLES
    arguments = material.arguments(wavelength)
    albedo, error = spectral_albedo(
        material.spec,
        radians(THETA_I_DEG),
        radians(PHI_I_DEG),
        arguments,
        tolerance=_ALBEDO_TOLERANCE,
        mirrored=not material.anisotropic,
    )
    integrated = zip(THETA_I_DEG, albedo[:, 0].tolist(), error.tolist(), strict=True)
    lights = [_light(material.spec, arguments, theta, count, *of_light) for theta, *of_light in integrated]
    columns = {name: numbers([getattr(light, name) for light in lights]) for name in _Light._fields if name != "good"}
    return Sampling(
        samples=count,
        theta_i_deg=list(THETA_I_DEG),
        phi_i_deg=PHI_I_DEG,
        wavelength_nm=wavelength,
        **columns,
        verdict="passes" if all(light.good for light in lights) else "violates",
    )


def _light(
    spec: ModelSpec, arguments: Mapping[str, Any], theta_i_deg: float, count: int, albedo: float, error: float
) -> _Light:
    wi = unit_vector(radians(theta_i_deg), radians(PHI_I_DEG))
    u1, u2 = np.random.default_rng(SEED).random((2, count))
    drawn = sample(spec, u1, u2, wi, **arguments)
    mean = float(np.mean(drawn.weight))
    deviation = float(np.std(drawn.weight, ddof=1))
    standard_error = deviation / np.sqrt(count)
    p = _chance(drawn.wr, wi, lobe_of(spec, wi, arguments))
    off = abs(mean - albedo)
    allowed = STANDARD_ERRORS * standard_error + min(error, _ALBEDO_TOLERANCE) + _ROUNDING
    return _Light(
        chi_square_p=p,
        largest_weight=float(np.max(drawn.weight)),
        weight_spread=deviation / mean if mean > 0.0 else 0.0,
        monte_carlo=mean,
        monte_carlo_error=standard_error,
        quadrature=albedo,
        good=p >= LEAST_CHANCE and off <= allowed,
    )


def _chance(wr: Array, wi: Array, lobe: Lobe) -> float:
    """Return the p [1] of directions by Pearson's chi-square test, in bins of their half vectors.

    Bins are in slopes in units of the lobe, so that they are fine enough for a narrow lobe, too. One bin holds all
    other directions.
    """
    import mpmath  # it takes a tenth of a second, and other findings do without it

    alpha = np.array([lobe.alpha_x, lobe.alpha_y], dtype=np.float64)
    h_x, h_y, h_z = (wr[:, axis] + wi[axis] for axis in range(3))
    s_x, s_y = h_x / h_z / alpha[0], h_y / h_z / alpha[1]
    t, psi = np.hypot(s_x, s_y), np.arctan2(s_y, s_x)
    t_edges = _t_edges(lobe)
    counts, _, _ = np.histogram2d(t, psi, bins=(t_edges, _PSI_EDGES))
    expected = len(wr) * _shares(wi, lobe, alpha, t_edges)
    observed = np.append(counts, len(wr) - counts.sum())
    expected = np.append(expected, len(wr) - expected.sum())
    order = np.argsort(expected)[::-1]  # the fullest bins first; bins with few expected samples are merged
    starts = np.arange(max(int(np.count_nonzero(expected >= _ENOUGH)), 1))
    observed = np.add.reduceat(observed[order], starts)
    expected = np.add.reduceat(expected[order], starts)
    chi_square = float(np.sum((observed - expected) ** 2 / expected))
    return float(mpmath.gammainc((len(expected) - 1) / 2.0, chi_square / 2.0, regularized=True))


def _t_edges(lobe: Lobe) -> Array:
    tenths = lobe.distribution.radius(_TENTHS)
    return np.append(tenths, tenths[-1] * _HALF_OCTAVES)


def _shares(wi: Array, lobe: Lobe, alpha: Array, t_edges: Array) -> Array:
    """Return the integral [1] of the density over each bin, shape (bins of t, bins of psi)."""
    t, t_weight = _gauss(t_edges)
    psi, psi_weight = _gauss(_PSI_EDGES)
    t = t[:, :, np.newaxis, np.newaxis]
    psi = psi[np.newaxis, np.newaxis]
    s_x = alpha[0] * t * np.cos(psi)
    s_y = alpha[1] * t * np.sin(psi)
    cos_h = 1.0 / np.sqrt(1.0 + s_x * s_x + s_y * s_y)
    h = np.stack([s_x * cos_h, s_y * cos_h, cos_h], axis=-1)
    h_i = h @ wi
    wr = np.stack([2.0 * h_i * h[..., axis] - wi[axis] for axis in range(3)], axis=-1)
    # d omega_r = 4 abs(h.i) d omega_h, d omega_h = cos^3 d(slopes), d(slopes) = alpha_x alpha_y t dt dpsi
    measure = 4.0 * np.abs(h_i) * cos_h**3 * alpha[0] * alpha[1] * t
    return np.asarray(np.einsum("abcd,ab,cd->ac", mixture_density(lobe, wi, wr) * measure, t_weight, psi_weight))


def _gauss(edges: Array) -> GaussRule:
    """Return a rule between neighbouring edges, as rows."""
    rule = gauss_rule(_NODES)
    half = np.diff(edges)[:, np.newaxis] / 2.0
    return GaussRule((edges[:-1] + edges[1:])[:, np.newaxis] / 2.0 + half * rule.nodes, half * rule.weights)
