"""Measured Mueller matrices: elements of files and their frames, physical realisability, and convex interpolation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import degrees
from brdfdb.measurements.samples import Samples, percent
from brdfdb.parameters import Floats

Array = NDArray[np.float64]

FRAMES = ("s", "p")
FRAME_WORDS = {
    "s": "Q > 0 is s-polarised and V > 0 turns counter-clockwise for an observer who looks towards the light",
    "p": "Q > 0 is p-polarised and V > 0 turns clockwise for an observer who looks towards the light",
}
# p for s reverses the signs of Q and V; that of U, linear along s + p, stays
_P_FOR_S = np.array([1.0, -1.0, 1.0, -1.0])
_MIRROR = np.array([1.0, 1.0, -1.0, -1.0])  # factors on I, Q, U, V of the mirror image of the plane of incidence
BLOCKS = ((2, 2), (3, 3), (3, 4), (4, 3), (4, 4))  # rows and columns of elements that make a polarised table
_ALLOWED = (
    "a polarised table needs the rows and columns I and Q (m00, m01, m10 and m11, or the columns ss, sp, ps and pp), "
    "those of I, Q and U, or these with the row or the column V, or all sixteen"
)
TOLERANCE = 1e-3  # by which an eigenvalue over the trace may be below 0 in measured data
_LOOSER = 10.0  # times the tolerance: how much of the rest noise of a hundredth makes
OF_TRACE = 4.0  # eigenvalues, so that one of -t takes at most 4 t of the intensity, of any light
_STATES = 96  # fully polarised states of the incident light at which the Stokes criterion is tested
_AT_ONCE = 1 << 13  # matrices
# sigma_i x conj(sigma_j), which sum, weighted by the elements of a Mueller matrix, to its coherency matrix
_PAULI = np.array([[[1, 0], [0, 1]], [[1, 0], [0, -1]], [[0, 1], [1, 0]], [[0, -1j], [1j, 0]]])
_BASIS = np.array([[np.kron(a, b.conj()) for b in _PAULI] for a in _PAULI])
_BY_CHANCE = 1e-4  # probability of shares that differ as much along an axis
_EXCESS = 1.2  # times as many as at all bands, at least
_MOST_REGIONS = 3
_LEAST_PART = 0.05  # of all unphysical matrices in a region
_NAMED = 4  # wavelengths
_PER_LIGHT = 4  # samples of each light among which the neighbours of a direction are
_NEIGHBOURS = 48
_MOST_LIGHTS = 100  # lights up to which neighbours are looked for at each of them
# Rows of the least squares of the weights of neighbours: their sum is 1, their mean is the point, and they are near
_SUM = 1e3
_ALONG = 0.2  # of theta_h against theta_d, among neighbours: matrices of facets depend on theta_d alone
_MEAN = 1e2
_VERTICES = 5
_ABOUT_DEG = 10.0  # half vectors within this angle of the normal are those of the mirror direction
_TILTED_DEG = (20.0, 80.0)  # theta_d at which Fresnel's s and p differ
_SEEN = 5  # samples that tell the sign of m01
_CLEAR = 0.02  # size of m01 that tells it


def of_polarisers(ss: Floats, sp: Floats, ps: Floats, pp: Floats) -> tuple[Array, Array]:
    """Return f_r [1/sr] (...) and the matrix over it (..., 4, 4), nan but for rows and columns I and Q.

    Parameters are f_r (...) [1/sr] of light polarised as the first letter says, seen through a polariser along the
    second. f_r of unpolarised light is the mean over the incident light of the sums over both polarisers.
    """
    f_r = np.asarray(0.5 * (ss + sp + ps + pp), np.float64)
    matrix = np.full((*np.shape(f_r), 4, 4), np.nan)
    elements = {(0, 0): f_r, (0, 1): ss + sp - ps - pp, (1, 0): ss - sp + ps - pp, (1, 1): ss - sp - ps + pp}
    with np.errstate(invalid="ignore", divide="ignore"):
        for place, element in elements.items():
            matrix[(..., *place)] = 1.0 if place == (0, 0) else 0.5 * element / f_r
    matrix[~np.isfinite(f_r) | (f_r == 0.0)] = np.nan
    return f_r, matrix


def of_lights(s: Floats, p: Floats) -> tuple[Array, Array]:
    """Return f_r [1/sr] (...) of unpolarised light, and the matrix over it (..., 4, 4), nan but for m00 and m01.

    Parameters are f_r (...) [1/sr] of light polarised along s and along p, seen without a polariser.
    """
    f_r = np.asarray(0.5 * (s + p), np.float64)
    matrix = np.full((*np.shape(f_r), 4, 4), np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        matrix[..., 0, 1] = 0.5 * (s - p) / f_r
    matrix[..., 0, 0] = 1.0
    matrix[~np.isfinite(f_r) | (f_r == 0.0)] = np.nan
    return f_r, matrix


def from_frame(matrix: Floats, frame: str) -> Floats:
    """Return Mueller matrices (..., 4, 4) of a frame of `FRAMES` in that of `brdfdb.tables.stokes`, which is s."""
    if frame not in FRAMES:
        raise ParameterError("mueller_frame", f"{frame!r} is not one of {', '.join(FRAMES)}", frame, FRAMES)
    return matrix * np.outer(_P_FOR_S, _P_FOR_S) if frame == "p" else matrix


def mirrored(matrix: Floats) -> Floats:
    """Return Mueller matrices (..., 4, 4) of the mirror image of the plane of light and viewer."""
    return matrix * np.outer(_MIRROR, _MIRROR)


def block_of(matrix: Floats, columns_read: str = "") -> tuple[int, int]:
    """Return the numbers of rows and columns that are measured in matrices (..., 4, 4), one of `BLOCKS`.

    `columns_read` are the columns of the file that the elements were made of, for the error.

    Raises
    ------
    ParameterError
        If the measured elements are no such block: it names those that there are.
    """
    known = np.isfinite(matrix).reshape(-1, 4, 4).any(axis=0)
    for rows, columns in BLOCKS:
        block = np.zeros((4, 4), dtype=bool)
        block[:rows, :columns] = True
        if np.array_equal(known, block):
            return rows, columns
    names = ", ".join(f"m{row}{column}" for row, column in np.argwhere(known)) or "none"
    read = f"{columns_read}, which make " if columns_read else ""
    raise ParameterError("polarised", f"{_ALLOWED}; the file has {read}{names}", names)


def elements_of(rows: int, columns: int) -> tuple[str, ...]:
    """Return the names of the elements of a block without m00, row by row."""
    return tuple(f"m{row}{column}" for row in range(rows) for column in range(columns) if row or column)


def coherency_eigenvalues(mueller: Floats) -> NDArray[np.float64]:
    """Return Cloude's eigenvalues [1] of Mueller matrices (N, 4, 4), over the trace of the coherency matrix: (N, 4)."""
    coherency = np.einsum("nij,ijab->nab", np.asarray(mueller, np.float64), _BASIS) / 4.0
    trace = np.trace(coherency, axis1=1, axis2=2).real
    return np.asarray(np.linalg.eigvalsh(coherency) / trace[:, np.newaxis])


class ReflectedPolarisation(NamedTuple):
    """The polarised part of reflected light less its intensity, over m00, and its degree of polarisation: (N,) [1]."""

    excess: NDArray[np.float64]
    degree: NDArray[np.float64]


def reflected_polarisation(mueller: Floats) -> ReflectedPolarisation:
    """Return how far polarised light can leave matrices (N, 4, 4), the largest for incident light of intensity 1.

    The excess is P - I of the reflected light over m00, with P = sqrt(Q^2 + U^2 + V^2), at most 0 where the Stokes
    criterion is met. The degree is P / I; above 1 it is 1 plus the excess, because I may be as small as its noise.
    Incident light has 96 fully polarised states. Elements that are nan are not counted: states are those of the columns
    that are known.
    """
    matrix = np.asarray(mueller, np.float64)
    columns = 1 if not len(matrix) else int(np.isfinite(matrix[0, 0]).sum())
    states = _states(columns)
    excess, degree = np.empty((2, len(matrix)))
    for start in range(0, len(matrix), _AT_ONCE):
        some = slice(start, start + _AT_ONCE)
        light = np.nan_to_num(matrix[some, :, :columns]) @ states.T
        polarised = np.sqrt(np.sum(light[:, 1:] ** 2, axis=1))
        excess[some] = (polarised - light[:, 0]).max(axis=1) / matrix[some, 0, 0]
        allowed = (light[:, 0] > 0.0) & (polarised <= light[:, 0])
        shares = np.divide(polarised, light[:, 0], out=np.zeros_like(polarised), where=allowed)
        degree[some] = np.where(excess[some] > 0.0, 1.0 + excess[some], shares.max(axis=1))
    return ReflectedPolarisation(excess, degree)


def _states(columns: int) -> Floats:
    """Return fully polarised states (S, columns) of the incident light of intensity 1."""
    if columns < 3:
        return np.array([[1.0, 1.0], [1.0, -1.0]])[:columns, :columns]
    turn = np.arange(_STATES)
    if columns == 3:
        angle = 2.0 * np.pi * turn / _STATES
        return np.stack([np.ones(_STATES), np.cos(angle), np.sin(angle)], axis=1)
    v = np.append(np.array([1.0, -1.0]), 1.0 - (2.0 * turn[: _STATES - 6] + 1.0) / (_STATES - 6))
    angle = turn[: _STATES - 4] * np.pi * (3.0 - np.sqrt(5.0))
    r = np.sqrt(1.0 - v**2)
    even = np.stack([np.ones(_STATES - 4), r * np.cos(angle), r * np.sin(angle), v], axis=1)
    poles = np.array([[1.0, 1.0, 0.0, 0.0], [1.0, -1.0, 0.0, 0.0], [1.0, 0.0, 1.0, 0.0], [1.0, 0.0, -1.0, 0.0]])
    return np.concatenate([even, poles])


class HalfDifferenceAngles(NamedTuple):
    """Half and difference angles (N,) [rad] of directions; phi_d in [-pi, pi] is negative for a mirror image."""

    theta_h: Floats
    theta_d: Floats
    phi_d: Floats

    @property
    def places(self) -> Floats:
        """Coordinates (N, 3) [rad]: theta_d, and theta_h along phi_d, shorter as matrices change less with it."""
        along = _ALONG * self.theta_h
        return np.stack([self.theta_d, along * np.cos(self.phi_d), along * np.sin(self.phi_d)], axis=1)

    @property
    def folded(self) -> HalfDifferenceAngles:
        """The angles of the mirror image with phi_d from 0 to pi."""
        return self._replace(phi_d=np.abs(self.phi_d))


def half_difference_angles(wi: Floats, wr: Floats) -> HalfDifferenceAngles:
    """Return the angles of unit vectors (N, 3) of light and viewer, as of `vectors_from_half_difference`."""
    half = wi + wr
    length = np.linalg.norm(half, axis=-1, keepdims=True)
    half = half / np.maximum(length, 1e-12)
    across = np.hypot(half[:, 0], half[:, 1])
    turn = np.arctan2(half[:, 1], half[:, 0])
    cos_h = half[:, 2]
    along = wi[:, 0] * np.cos(turn) + wi[:, 1] * np.sin(turn)
    x = along * cos_h - wi[:, 2] * across
    y = wi[:, 1] * np.cos(turn) - wi[:, 0] * np.sin(turn)
    theta_d = np.arctan2(np.linalg.norm(wi - wr, axis=-1), length[:, 0])
    return HalfDifferenceAngles(np.arctan2(across, cos_h), theta_d, np.arctan2(y, x))


_BANDS_DEG = {
    "theta_h": np.array([0.0, 5.0, 15.0, 30.0, 60.0, 90.0]),
    "theta_d": np.array([0.0, 10.0, 30.0, 50.0, 70.0, 80.0, 90.0]),
    "phi_d": np.array([0.0, 45.0, 90.0, 135.0, 180.0]),
}


class UnphysicalRegion(NamedTuple):
    """Bands of angles and wavelengths: their share of physical matrices, and their part of all unphysical ones."""

    place: str
    share: float
    part: float


class LowBands(NamedTuple):
    """The bands of an axis in which few matrices are physical, and by how much they are clearer than chance is."""

    axis: int
    low: NDArray[np.bool_]
    clearness: float


class PhysicalShare:
    """Counts of the Mueller matrices that a surface can have, by region and wavelength.

    Parameters
    ----------
    wavelength_nm : array (L,) [nm] or None
        Wavelengths; None of grey data, which have one channel.
    tolerance : float [1]
        By which an eigenvalue over the trace may be below 0. Q, U and V over I may exceed 1 by four times that: what
        the eigenvalues allow, the Stokes criterion allows.
    """

    def __init__(self, wavelength_nm: Floats | None, tolerance: float = TOLERANCE) -> None:
        self.wavelength_nm = wavelength_nm
        self.tolerance = tolerance
        channels = 1 if wavelength_nm is None else len(wavelength_nm)
        shape = (*(edges.size - 1 for edges in _BANDS_DEG.values()), channels)
        self.judged = np.zeros(shape, np.int64)
        self.realisable = np.zeros(shape, np.int64)  # by the eigenvalues; by the Stokes criterion if these are unknown
        self.within_stokes = np.zeros(shape, np.int64)
        self.smallest = 0.0  # eigenvalue over the trace
        self.nearly = 0  # matrices whose eigenvalues are above ten times the tolerance below 0
        self.most_excess = -1.0  # of Q, U and V over I
        self.most_degree = 0.0  # of polarisation
        self.whole = True  # all sixteen elements are known, so that there are eigenvalues

    def add(self, mueller: Floats, angles: HalfDifferenceAngles) -> None:
        """Count matrices (N, L, 4, 4) at angles; those with a nan in the first element are holes."""
        cells = tuple(
            np.clip(np.searchsorted(edges, degrees(angle), side="right") - 1, 0, edges.size - 2)
            for edges, angle in zip(_BANDS_DEG.values(), angles.folded, strict=True)
        )
        for channel in range(mueller.shape[1]):
            matrix = np.asarray(mueller[:, channel], np.float64)
            rows = np.flatnonzero(matrix[:, 0, 0] > 0.0)
            if not rows.size:
                continue
            judged = matrix[rows]
            excess, degree = reflected_polarisation(judged)
            self.most_degree = max(self.most_degree, float(degree.max()))
            self.most_excess = max(self.most_excess, float(excess.max()))
            physical = within = excess <= OF_TRACE * self.tolerance
            if self.whole and np.isfinite(judged).all():
                eigenvalues = np.concatenate(
                    [coherency_eigenvalues(part)[:, 0] for part in np.array_split(judged, 1 + len(judged) // _AT_ONCE)]
                )
                self.smallest = min(self.smallest, float(eigenvalues.min()))
                physical = eigenvalues >= -self.tolerance
                self.nearly += int(np.count_nonzero(eigenvalues >= -_LOOSER * self.tolerance))
            else:
                self.whole = False
            shape = self.judged.shape[:-1]
            cell = np.ravel_multi_index(tuple(index[rows] for index in cells), shape)
            for counts, counted in ((self.judged, None), (self.realisable, physical), (self.within_stokes, within)):
                found_in = np.bincount(cell if counted is None else cell[counted], minlength=math.prod(shape))
                counts[..., channel] += found_in.reshape(shape)

    @property
    def count(self) -> int:
        """Number of matrices that were judged."""
        return int(self.judged.sum())

    @property
    def share(self) -> float:
        """Share [0, 1] of the matrices that are physical; 1 of none."""
        return float(self.realisable.sum() / self.count) if self.count else 1.0

    @property
    def stokes_share(self) -> float:
        """Share [0, 1] of the matrices that meet the Stokes criterion; 1 of none."""
        return float(self.within_stokes.sum() / self.count) if self.count else 1.0

    def regions(self) -> list[UnphysicalRegion]:
        """Return where fewer are physical than chance explains: boxes of bands, each outside those before it.

        A box is cut along the axis with the clearest bands, then along others by what is in it alone: angles depend on
        each other at the horizon, so that bands of all matrices would also be low beside the cause.
        """
        failed = self.judged - self.realisable
        left, regions = self.judged > 0, list[UnphysicalRegion]()
        while len(regions) < _MOST_REGIONS:
            cells, places = left.copy(), dict[int, str]()
            while cuts := [cut for axis in range(4) if axis not in places and (cut := self._cut(failed, cells, axis))]:
                clearest = max(cuts, key=lambda cut: cut.clearness)
                places[clearest.axis] = self._words(clearest)
                cells &= np.expand_dims(clearest.low, tuple(axis for axis in range(4) if axis != clearest.axis))
            bad = int(failed[cells].sum())
            if not places or bad < _LEAST_PART * failed.sum():
                break
            words = " and ".join(places[axis] for axis in sorted(places))
            regions.append(UnphysicalRegion(words, 1.0 - bad / int(self.judged[cells].sum()), bad / int(failed.sum())))
            left &= ~cells
        return regions

    def _cut(self, failed: NDArray[np.int64], cells: NDArray[np.bool_], axis: int) -> LowBands | None:
        """Return the bands of an axis in which cells have more unphysical matrices than chance explains."""
        from scipy.special import rel_entr
        from scipy.stats import chi2

        others = tuple(number for number in range(4) if number != axis)
        counts, bad = ((of_cell * cells).sum(axis=others) for of_cell in (self.judged, failed))
        expected = float(bad.sum() / max(counts.sum(), 1)) * counts
        likelihood = 2.0 * np.sum(rel_entr(bad, expected) + rel_entr(counts - bad, counts - expected))
        clearness = float(likelihood - chi2.isf(_BY_CHANCE, max(np.count_nonzero(counts) - 1, 1)))
        low = bad > _EXCESS * expected
        if clearness < 0.0 or not low.any():
            return None
        if axis < len(_BANDS_DEG):  # of angles the bands beside the lowest alone
            worst = int(np.argmax(np.where(low, bad / np.maximum(counts, 1), 0.0)))
            runs = np.cumsum(np.append(0, np.diff(low.astype(np.int64)) != 0))
            low &= runs == runs[worst]
        return LowBands(axis, low, clearness)

    def _words(self, bands: LowBands) -> str:
        """Return the ends of bands of an angle, or wavelengths."""
        index = np.flatnonzero(bands.low)
        if bands.axis < len(_BANDS_DEG):
            name, edges = list(_BANDS_DEG.items())[bands.axis]
            return f"{name} {edges[index[0]]:g} to {edges[index[-1] + 1]:g} degrees"
        assert self.wavelength_nm is not None
        listed = [f"{nm:g}" for nm in self.wavelength_nm[index]]
        if len(listed) > 2 and index[-1] - index[0] == len(index) - 1:
            return f"{listed[0]} to {listed[-1]} nm"
        more = f" and {len(listed) - _NAMED} other wavelengths" if len(listed) > _NAMED else ""
        return f"{', '.join(listed[:_NAMED])} nm{more}"

    def sentences(self, of_all: int | None = None) -> list[str]:
        """Return what share is physical, by which criterion, and where the others are; `of_all` if they were drawn."""
        if not self.count:
            return ["No Mueller matrix is known."]
        drawn = ""
        if of_all is not None and of_all > self.count:
            error = np.sqrt(self.share * (1.0 - self.share) / self.count)
            drawn = f", drawn at random from about {of_all}: +- {percent(float(max(2.0 * error, 1e-4)))}"
        matrices = f"{self.count} Mueller {'matrix' if self.count == 1 else 'matrices'}"
        if self.whole:
            text = (
                f"Physical: {_tenths(self.share)} of {matrices}{drawn} (eigenvalues of the coherency matrix at least "
                f"-{self.tolerance:g} of its trace, Cloude 1986; {_tenths(self.nearly / self.count)} "
                f"at least -{_LOOSER * self.tolerance:g}; the smallest is {self.smallest:.2g})."
            )
            text += f" Stokes criterion, reflected light at most fully polarised: {_tenths(self.stokes_share)}."
        else:
            text = (
                f"Physical: {_tenths(self.stokes_share)} of {matrices}{drawn} (Stokes criterion of the known elements: "
                f"largest degree of polarisation of reflected light {self.most_degree:.4g}, allowed "
                f"{1.0 + OF_TRACE * self.tolerance:g}; eigenvalues need all sixteen)."
            )
        if self.share == 1.0:
            return [text]
        if regions := self.regions():
            worst = "; ".join(
                f"{_tenths(part)} are at {place}, where {_tenths(share)} are physical" for place, share, part in regions
            )
            return [text, f"Of the unphysical matrices, {worst}."]
        return [text, "The others are at no angles and wavelengths more often than chance explains."]


def _tenths(share: float) -> str:
    """Return a share in percent with one decimal, which is 100 or 0 only if it is exactly."""
    return f"{100.0 * share:.0f} %" if share in (0.0, 1.0) else f"{np.clip(100.0 * share, 0.1, 99.9):.1f} %"


def frame_doubt(samples: Samples) -> tuple[str, ...]:
    """Return whether m01 near the mirror direction has the sign of p, in a sentence.

    A surface reflects s more than p in the mirror direction, whatever it is made of (Fresnel), so that m01 is positive
    where Q > 0 is s-polarised.
    """
    if samples.mueller is None or samples.record.get("polarisers"):
        return ()
    theta_h, theta_d, _ = (degrees(angle) for angle in half_difference_angles(samples.w_i, samples.w_r))
    near = (theta_h <= _ABOUT_DEG) & (theta_d >= _TILTED_DEG[0]) & (theta_d <= _TILTED_DEG[1])
    m01 = samples.mueller[near][..., 0, 1]
    m01 = m01[np.isfinite(m01)]
    if m01.size < _SEEN or np.median(m01) > -_CLEAR:
        return ()
    frame = "s" if samples.record.get("mueller_frame") == "p" else "p"
    return (
        f"Frame? m01 is {np.median(m01):.2g} near the mirror direction, but surfaces reflect s more than p there "
        f"(Fresnel): if {FRAME_WORDS[frame]}, import the file with --mueller-frame {frame}.",
    )


def physical_share(samples: Samples) -> PhysicalShare:
    """Return the count of the physical matrices of samples, whose `mueller` is known."""
    assert samples.mueller is not None
    share = PhysicalShare(samples.wavelength_nm)
    share.add(samples.mueller, half_difference_angles(samples.w_i, samples.w_r))
    return share


def polarised_sentences(samples: Samples) -> tuple[str, ...]:
    """Return which elements of Mueller matrices samples have, and what share of them is physical; () without any.

    A reader that judged more matrices than those of the samples left its sentences in the entry "physical" of the
    record.
    """
    if samples.mueller is None:
        return ()
    try:
        rows, columns = block_of(samples.mueller, samples.record.get("polarised_columns", ""))
    except ParameterError as error:
        return (f"No polarised table: {error.sentence}.",)
    words = "all sixteen elements" if (rows, columns) == (4, 4) else f"{rows} rows and {columns} columns"
    judged = samples.record.get("physical") or physical_share(samples).sentences()
    frame = ""
    if not (samples.record.get("polarisers") or samples.record.get("mueller_frame")):
        frame = f" Their frame is taken to be the one in which {FRAME_WORDS['s']}; --mueller-frame p states the other."
    return (f"Polarised: {words} of the Mueller matrix; --polarised makes a polarised table.{frame}", *map(str, judged))


def convex_weights(points: Floats, groups: NDArray[np.int64], wanted: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Return rows (N, K) of points, and their weights (N, K), whose mean is nearest to each wanted place (N, D).

    Weights are at least 0 and sum to 1, so that what holds for convex sums holds for the result: means of physical
    Mueller matrices are physical. Neighbours are looked for in each group (P,), such as the samples of a light, so that
    dense scans of far lights do not hide the next light.
    """
    from scipy.optimize import nnls
    from scipy.spatial import cKDTree

    lists = [np.flatnonzero(groups == group) for group in np.unique(groups)]
    if len(lists) > _MOST_LIGHTS:
        lists = [np.arange(len(points))]
    per_light = _NEIGHBOURS if len(lists) == 1 else _PER_LIGHT
    near = [cKDTree(points[rows]).query(wanted, k=np.arange(1, min(per_light, len(rows)) + 1)) for rows in lists]
    distance = np.concatenate([far for far, _ in near], axis=1)
    number = np.concatenate([rows[nearest] for rows, (_, nearest) in zip(lists, near, strict=True)], axis=1)
    order = np.argsort(distance, axis=1, kind="stable")[:, :_NEIGHBOURS]
    distance, number = (np.take_along_axis(part, order, axis=1) for part in (distance, number))
    weights = np.zeros(number.shape)
    for row, (rows, far, place) in enumerate(zip(number, distance, wanted, strict=True)):
        if far[0] < 1e-9:
            weights[row, 0] = 1.0
            continue
        system = np.vstack([np.full(rows.size, _SUM), _MEAN * points[rows].T, far**2])
        solution, _ = nnls(system, np.concatenate([[_SUM], _MEAN * place, [0.0]]))
        weights[row] = solution / solution.sum()
    first = np.argsort(-weights, axis=1, kind="stable")[:, :_VERTICES]  # least squares of five rows leave five weights
    return np.take_along_axis(number, first, axis=1), np.take_along_axis(weights, first, axis=1)
