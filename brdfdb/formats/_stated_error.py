"""The error that an exported file states: f_r as its reader sees it, against the table, at pairs drawn at random."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.formats._channels import Channels, channels_of
from brdfdb.formats._file_statement import FileStatement, of_file, up
from brdfdb.geometry import unit_vector
from brdfdb.integrals.sampling import mirrored_in_lobe, mixture_density
from brdfdb.parameters import Floats
from brdfdb.tables.error_measurement import WIDTHS, rank_of_limit

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

PAIRS = 10000  # pairs of each of the two draws
SEED = 2018
FLOOR = 1e-3  # share of the Lambertian BRDF with the albedo of the table
_WITHIN, _CONFIDENCE = 0.99, 0.999  # share of the values within p99, and how sure that is
_ROUNDING = 1e-9  # of sums of weights


@dataclass(frozen=True)
class FileError:
    """Error of the values of a file against those of its table, abs(file - table) / max(table, floor).

    Light and viewer are drawn cosine-weighted over the hemisphere. In a second draw the viewers are in the lobe, and
    each pair is weighted by the cosine of its viewer. Each number is that of the channel where it is largest.

    Attributes
    ----------
    p99 : float [1]
        Limit of 99 of 100 values, with a confidence of 99.9 %: the larger one of the two draws.
    p99_hemisphere, p99_lobe : float [1]
        The limit of each draw. They are equal if the source has no lobe.
    l1 : float [1]
        Mean of abs(file - table) over that of the table, cosine-weighted.
    largest : float [1]
        Largest error of all pairs.
    measure : callable or None
        Gives `statement`.
    """

    p99: float
    p99_hemisphere: float
    p99_lobe: float
    l1: float
    largest: float
    measure: Callable[[], FileStatement | None] | None = field(default=None, repr=False, compare=False)

    def document(self) -> dict[str, float]:
        """Return the numbers by name, to three digits and rounded up."""
        return {name: up(getattr(self, name)) for name in ("p99", "p99_hemisphere", "p99_lobe", "l1", "largest")}

    def __getstate__(self) -> dict[str, Any]:
        """Return the error for another process, with the statement measured: its closures stay in this one."""
        return {**self.__dict__, "measure": None, "statement": self.statement}

    @functools.cached_property
    def statement(self) -> FileStatement | None:
        """The error of the file against the model, measured at first use; None if its table states no error."""
        return None if self.measure is None else self.measure()


class Comparison:
    """Pairs of directions, and the f_r of a table there, that files are compared with.

    Parameters
    ----------
    table : Table
        Table that is exported.
    channels : Channels
        The channels of the file, by default those of the table.

    Attributes
    ----------
    wi, wr : array (N, 3)
        Unit vectors of light and viewer: first those over the hemisphere, then those in the lobe.
    truth : array (N, C) [1/sr]
        f_r of the table in the channels.
    """

    def __init__(self, table: Table, channels: Channels | None = None) -> None:
        self.table = table
        self.channels = channels_of(table) if channels is None else channels
        self.wi, self.wr, self._weight, lobe = _drawn(table)
        self._above = self._weight > 0.0
        # of a draw over the hemisphere all pairs count alike; one in the lobe is weighted by the cosine of the viewer
        self._share = np.where(self._above, 1.0, 0.0)
        if lobe:
            self._share[PAIRS:] = np.maximum(self.wr[PAIRS:, 2], 0.0)
        self._draws = slice(0, PAIRS), slice(PAIRS, 2 * PAIRS) if lobe else slice(0, 2 * PAIRS)
        self.truth = self.channels.values(table, self.wi, self.wr)

    @functools.cached_property
    def floor(self) -> Floats:
        """The floor [1/sr] of relative errors in each channel."""
        return np.asarray(FLOOR / np.pi * np.abs(self._weight @ self.truth) / len(self.wi))

    def error_of(self, evaluate: Callable[[Floats, Floats], Floats]) -> FileError:
        """Return the error of a file, whose reader gives f_r [1/sr], shape (N, C), at unit vectors (N, 3)."""
        values = evaluate(self.wi, self.wr)
        wrong = np.where(self._above[:, np.newaxis], np.abs(values - self.truth), 0.0)  # below, files may have holes
        scale = np.maximum(self.truth, self.floor)
        relative = np.divide(wrong, scale, out=np.where(wrong > 0.0, np.inf, 0.0), where=scale > 0.0)
        whole = self._weight @ np.abs(self.truth)
        l1 = np.divide(self._weight @ wrong, whole, out=np.zeros_like(whole), where=whole > 0.0)
        hemisphere, lobe = (self._p99(relative, draw) for draw in self._draws)
        return FileError(
            p99=max(hemisphere, lobe),
            p99_hemisphere=hemisphere,
            p99_lobe=lobe,
            l1=float(l1.max()),
            largest=float(relative[self._above].max()),
            measure=functools.partial(of_file, self.table, self.channels, self.floor, evaluate),
        )

    def _p99(self, relative: Floats, draw: slice) -> float:
        """Return the limit of 99 of 100 errors (N, C) of a draw, weighted by `_share`, of the worst channel."""
        share = self._share[draw]
        count = int(share.sum() ** 2 / (share**2).sum())  # as many pairs of equal weight are as sure
        beyond = rank_of_limit(count, _WITHIN, _CONFIDENCE) / count * share.sum()
        order = np.argsort(-relative[draw], axis=0)
        rank = (np.cumsum(share[order], axis=0) < beyond * (1.0 - _ROUNDING)).sum(axis=0)
        limits = relative[draw][order[rank, np.arange(relative.shape[1])], np.arange(relative.shape[1])]
        return float(limits.max())


def _drawn(table: Table) -> tuple[Floats, Floats, Floats, bool]:
    """Draw lights and viewers for a table: first over the hemisphere, then in the lobe.

    Returns
    -------
    wi, wr : array (2 PAIRS, 3)
        Unit vectors.
    weight : array (2 PAIRS,)
        Cosine of the viewer over the density with which it was drawn; 0 below the horizon.
    lobe : bool
        False if the source has no lobe, or none is known: all viewers are then over the hemisphere.
    """
    rng = np.random.default_rng(SEED)
    count = 2 * PAIRS
    wi, over = _cosine_weighted(rng, count), _cosine_weighted(rng, count)
    at = table.wavelength_nm
    in_turn = None if at is None else at[np.arange(count) % at.size]
    lobe = None if table.source is None else table.source.lobe(wi[:, 2], in_turn)
    if lobe is None:
        return wi, over, np.full(count, np.pi), False
    lobes = [
        lobe._replace(share=np.ones(1), alpha_x=width * lobe.alpha_x, alpha_y=width * lobe.alpha_y, visible=False)
        for width in WIDTHS
    ]
    u, angle = 1.0 - rng.random(count), rng.uniform(0.0, 2.0 * np.pi, count)
    wr = over
    for part, drawn in enumerate(lobes):  # the second half, in equal parts
        start = PAIRS + part * PAIRS // len(lobes)
        wr = np.where((np.arange(count) >= start)[:, np.newaxis], mirrored_in_lobe(u, angle, wi, drawn), wr)
    cosine = np.maximum(wr[:, 2], 0.0)
    density = 0.5 * cosine / np.pi + 0.5 * np.mean([mixture_density(drawn, wi, wr) for drawn in lobes], axis=0)
    return wi, wr, cosine / density, True


def _cosine_weighted(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Return unit vectors (N, 3) whose density over the hemisphere is proportional to the cosine."""
    theta = np.arcsin(np.sqrt(rng.random(count)))
    return unit_vector(theta, rng.uniform(0.0, 2.0 * np.pi, count))
