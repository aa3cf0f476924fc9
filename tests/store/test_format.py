"""docs/reference/format.md is enough to read a table: this reader uses it, zarr and numpy, and nothing of brdfdb."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

import brdfdb
from brdfdb.geometry import unit_vector
from brdfdb.materials import Material, presets
from brdfdb.materials.spectrum import Spectrum
from brdfdb.store.publication import publish_dataset
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.planner import plan
from brdfdb.tables.tabulation import tabulate

KINDS = (
    ("theta_h", "phi_h", "theta_d", "phi_d"),
    ("theta_h", "theta_d", "phi_d"),
    ("theta_i", "phi_i", "theta_r", "phi_r"),
    ("theta_i", "theta_r", "delta_phi"),
)
C = 6.123233995736766e-17

# The reader


def sealed(path: Path) -> dict[str, Any]:
    """Section "Files": a JSON object whose first line holds the digest of the others."""
    first, _, rest = path.read_bytes().partition(b"\n")
    assert first == b'{"sha256": "%s",' % hashlib.sha256(rest).hexdigest().encode()
    return json.loads(first + rest)


def current(root: Path, name: str) -> Path:
    """The directory of the current revision, by way of pointer and manifest."""
    assert sealed(root / "brdfdb.json").items() >= {"format": "brdfdb", "version": 2}.items()
    head = sealed(root / "materials" / name / "HEAD.json")
    manifest = root / "materials" / name / f"{head['revision']}.MANIFEST.json"
    assert hashlib.sha256(manifest.read_bytes()).hexdigest() == head["manifests"][head["revision"]]
    group = manifest.with_name(head["revision"])
    for file, entry in sealed(manifest)["files"].items():
        data = (group / file).read_bytes()
        assert (len(data), hashlib.sha256(data).hexdigest()) == (entry["size"], entry["sha256"])
    return group


def fold(angle: Any, period: float) -> Any:
    return angle - np.floor(angle / period) * period


def folded(turned: Any, other: Any, copies: int, mirror: Any) -> tuple[Any, Any]:
    """The symmetries of the surface: half a turn, and the mirror image."""
    half = (copies > 1) & (turned >= 180.0)
    turned, other = np.where(half, turned - 180.0, turned), mirror[0](other, half)
    flip = (copies == 4) & (turned > 90.0)
    return np.where(flip, 180.0 - turned, turned), mirror[1](other, flip)


def coordinates(names: tuple[str, ...], nodes: list[Any], wi: Any, wr: Any) -> list[Any]:
    """Step 1."""
    phi_i, phi_r = (np.rad2deg(np.arctan2(y, x)) for x, y, _ in (wi.T, wr.T))
    theta_i, theta_r = (np.rad2deg(np.arctan2(np.hypot(x, y), z)) for x, y, z in (wi.T, wr.T))
    copies = round(360.0 / nodes[1][-1])
    if names == KINDS[3]:
        d = phi_r - phi_i
        return [theta_i, theta_r, np.abs(d - 360.0 * np.floor(d / 360.0 + 0.5))]
    if names == KINDS[2]:
        both = lambda phi, half: np.where(half, phi - 180.0, phi), lambda phi, flip: np.where(flip, 180.0 - phi, phi)
        phi_i, phi_r = folded(fold(phi_i, 360.0), phi_r, copies, both)
        return [theta_i, phi_i, theta_r, fold(phi_r, 360.0)]
    h, d = (wi + wr).T, (wi - wr).T
    flat, length = h[0] ** 2 + h[1] ** 2, np.sqrt(np.sum(h**2, axis=0))
    pole = flat < 1e-28 * length**2
    along = np.where(pole, d[0], (d[0] * h[0] + d[1] * h[1]) * h[2] - d[2] * flat)
    across = np.where(pole, d[1], (d[1] * h[0] - d[0] * h[1]) * length)
    theta_h = np.rad2deg(np.arctan2(np.sqrt(flat), h[2]))
    theta_d = np.rad2deg(np.arctan2(np.sqrt(np.sum(d**2, axis=0)), length))
    if names == KINDS[1]:
        return [theta_h, theta_d, np.rad2deg(np.arctan2(np.abs(across), np.abs(along)))]
    phi_h = np.where(pole, 0.0, fold(np.rad2deg(np.arctan2(h[1], h[0])), 360.0))
    one = lambda phi, _: phi, lambda phi, flip: np.where(flip, -phi, phi)
    phi_h, phi_d = folded(phi_h, np.rad2deg(np.arctan2(across, along)), copies, one)
    return [theta_h, phi_h, theta_d, fold(phi_d, 180.0)]


def ends(name: str, names: tuple[str, ...], copies: int) -> tuple[str, str]:
    """The table of step 2."""
    isotropic = len(names) == 3
    around = {"phi_i": copies == 1, "phi_h": copies < 4}
    if name in around:
        return ("periodic", "periodic") if around[name] else ("open", "open")
    return {
        "delta_phi": ("even", "even"),
        "phi_r": ("periodic", "periodic"),
        "phi_d": ("even", "even") if isotropic else ("periodic", "periodic"),
        "theta_h": ("even" if isotropic or copies > 1 else "open", "open"),
        "theta_d": ("even", "open"),
    }.get(name, ("open", "open"))


def parabola_slope(x: list[float], at: float) -> Any:
    """The slope at a point of the parabola through three nodes, as weights of their values."""
    a, b, c = x
    below = np.array([(a - b) * (a - c), (b - a) * (b - c), (c - a) * (c - b)])
    return np.array([2.0 * at - b - c, 2.0 * at - a - c, 2.0 * at - a - b]) / below


def weights(nodes: Any, x: float, end: tuple[str, str], cubic: bool) -> Any:
    """The weight of each node of an axis at one point: steps 2 and 3."""
    w, last = np.zeros(nodes.size), nodes.size - 1
    if last == 0:
        return np.ones(1)
    x = min(max(x, nodes[0]), nodes[-1])
    j = min(int(np.searchsorted(nodes, x, side="right")) - 1, last - 1)
    step = nodes[j + 1] - nodes[j]
    t = (x - nodes[j]) / step
    if not cubic or nodes.size == 2:
        w[j], w[j + 1] = 1.0 - t, t
        return w
    r = t * t * (3.0 - 2.0 * t)
    w[j], w[j + 1] = 1.0 - r, r
    for k, factor in ((j, t * (1.0 - t) ** 2 * step), (j + 1, -t * t * (1.0 - t) * step)):
        at, kind = [k - 1, k, k + 1], end[0] if k == 0 else end[1]
        where = [nodes[i] if 0 <= i <= last else np.nan for i in at]
        if k in (0, last):
            outside, inside = (0, 1) if k == 0 else (2, last - 1)
            if kind == "even":
                at[outside], where[outside] = inside, 2.0 * nodes[k] - nodes[inside]
            elif kind == "periodic":
                turn = nodes[-1] - nodes[0]
                at[outside] = last - 1 if k == 0 else 1
                where[outside] = nodes[at[outside]] + (-turn if k == 0 else turn)
            else:
                at = [0, 1, 2] if k == 0 else [last - 2, last - 1, last]
                where = [nodes[i] for i in at]
        np.add.at(w, at, factor * parabola_slope(where, nodes[k]))
    return w


class Reader:
    """A table read by the page."""

    def __init__(self, group: Path) -> None:
        opened = zarr.open_group(group, mode="r")
        self.arrays = {name: np.asarray(array[...]) for name, array in opened.arrays()}
        how: dict[str, Any] = dict(opened.attrs).get("interpolation", {})  # type: ignore[assignment]
        assert set(how) <= {"method", "logarithm", "offset", "power", "wavelengths"}
        assert how.get("method", "linear") in ("linear", "cubic")
        self.cubic, self.logarithm = how.get("method") == "cubic", how.get("logarithm", False)
        self.offset, self.power = how.get("offset", 0.0), how.get("power", 0.0)
        self.straight = how.get("wavelengths", "cubic") == "linear"
        self.names = next(kind for kind in KINDS if set(kind) <= set(self.arrays))
        self.nodes = [self.arrays[name] for name in self.names]
        stored = self.arrays["brdf"] if "brdf" in self.arrays else self.arrays["parts"]
        self.numbers = stored.reshape(*(nodes.size for nodes in self.nodes), -1).astype(np.float64)
        self.wavelengths = self.arrays.get("wavelength")

    def over_wavelengths(self, wavelength: float) -> tuple[Any, bool]:
        if self.wavelengths is None:
            return np.ones(1), True
        w = weights(self.wavelengths, wavelength, ("open", "open"), not self.straight)
        return w, wavelength in self.wavelengths

    def lookup(self, wi: Any, wr: Any, wavelength: float) -> Any:
        copies = round(360.0 / self.nodes[1][-1])
        x = coordinates(self.names, self.nodes, wi, wr)
        spectrum, on_node = self.over_wavelengths(wavelength)
        mixture = self.arrays.get("mixture")
        if mixture is not None:
            basis = np.eye(len(mixture))
        elif self.straight:
            basis = self.arrays.get("spectra", np.eye(spectrum.size))
        else:
            basis = (self.arrays["spectra"] @ spectrum if "spectra" in self.arrays else spectrum)[:, np.newaxis]
        numbers = np.empty((len(wi), basis.shape[1]))
        for point in range(len(wi)):
            value = self.numbers
            for name, nodes, at in zip(self.names, self.nodes, x, strict=True):
                value = np.tensordot(weights(nodes, at[point], ends(name, self.names, copies), self.cubic), value, 1)
            numbers[point] = value @ basis
        value = np.exp(numbers) - self.offset if self.logarithm else numbers
        if self.logarithm or self.cubic or self.names in KINDS[:2] or not on_node:
            value = np.maximum(value, 0.0)
        if mixture is not None:
            value = np.maximum(value @ (mixture @ spectrum), 0.0)
        else:
            value = value @ spectrum if self.straight else value[:, 0]
        mu = np.maximum(wi[:, 2], C) * np.maximum(wr[:, 2], C)
        uniform = np.ravel(self.arrays.get("uniform", 0.0))
        apart = uniform[0] if uniform.size == 1 else uniform @ spectrum
        apart = apart if on_node else max(apart, min(0.0, uniform.min()))
        f_r = value / mu**self.power + apart
        return np.where((wi[:, 2] < 0.0) | (wr[:, 2] < 0.0), 0.0, f_r)

    def specular(self, theta_i_deg: float, wavelength: float) -> float:
        if "specular_reflectance" not in self.arrays or theta_i_deg > 90.0:
            return 0.0
        nodes = self.arrays.get("specular_theta_i", self.arrays.get("theta_i"))
        rows = self.arrays["specular_reflectance"].reshape(nodes.size, -1)
        values = weights(nodes, theta_i_deg, ("open", "open"), False) @ rows
        return max(float(values @ self.over_wavelengths(wavelength)[0]), 0.0)


# Tables of every kind, against the library

GREEN = Spectrum(wavelengths_nm=(380.0, 520.0, 540.0, 780.0), values=(0.1, 0.7, 0.6, 0.05), origin="a test")
VISIBLE = np.array([400.0, 450.0, 520.0, 600.0, 700.0])
POLAR = {"theta_i": [0, 25, 60, 89], "theta_r": [0, 30, 62, 89], "delta_phi": [0, 45, 120, 180]}
# the symmetries of the surface map these onto themselves, else f_r jumps by rounding where phi_i is folded
AZIMUTHS = [0, 50, 90, 130, 180, 230, 270, 310, 360]
TURNED = {"theta_i": [0, 30, 60, 85], "phi_i": [0, 30, 90], "theta_r": [0, 30, 85], "phi_r": AZIMUTHS}
HALF = {"theta_h": [0, 3, 10, 40, 85], "theta_d": [0, 45, 79], "phi_d": [0, 45, 90]}
HALF_TURNED = {"theta_h": [0, 3, 10, 60], "phi_h": [0, 45, 90], "theta_d": [0, 45, 79], "phi_d": [0, 50, 90, 180]}
HALF_TURN = {**HALF_TURNED, "phi_h": [0, 45, 120, 180]}
ROOT_OF = ("cubic", True, 1e-3, 0.5)
ROOT = Interpolation(*ROOT_OF)
TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(5, 5)))[0]
COPPER, BRASS = presets()["scene-copper-sphere"], presets()["rolled-brass"]
PAPER = presets()["glossy-grey-paper"]
PAINTED = PAPER.model_copy(update={"parameters": PAPER.parameters | {"rho_d": GREEN, "rho_s": GREEN}})
CLAY = Material(name="clay", title="Clay", model="oren_nayar", parameters={"rho": GREEN, "sigma": 0.5}, source="a test")
LAYOUTS = {
    "plain": lambda: Layout(presets()["clay-vase"], Grid(POLAR)),
    "specular": lambda: Layout(COPPER, Grid(POLAR), VISIBLE),
    "anisotropic": lambda: Layout(BRASS, Grid(TURNED)),
    "anisotropic-cubic": lambda: Layout(BRASS, Grid({**TURNED, "phi_i": [0, 80, 180]}), interpolation=ROOT),
    "weighted": lambda: Layout(presets()["clay-vase"], Grid(POLAR), interpolation=Interpolation("cubic", power=1.0)),
    "half": lambda: Layout(presets()["glossy-grey-paper"], Grid(HALF), interpolation=ROOT),
    "half-anisotropic": lambda: Layout(BRASS, Grid(HALF_TURNED), interpolation=ROOT),
    "half-turn": lambda: Layout(BRASS, Grid(HALF_TURN), interpolation=ROOT),
    "mixed": lambda: plan(CLAY, VISIBLE, 0.2),
    "mixed-lobe": lambda: plan(PAINTED, VISIBLE, 0.2),
    "planned-factored": lambda: plan(COPPER, VISIBLE, 0.2),
    "straight": lambda: Layout(CLAY, Grid(POLAR), VISIBLE, Interpolation(wavelengths="linear")),
    "straight-logarithms": lambda: Layout(CLAY, Grid(POLAR), VISIBLE, Interpolation(*ROOT_OF, "linear")),
    "straight-factored": lambda: Layout(CLAY, Grid(POLAR), VISIBLE, Interpolation(*ROOT_OF, "linear"), TURN),
}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    store = tmp_path_factory.mktemp("format") / "store"
    for name, layout in LAYOUTS.items():
        publish_dataset(store, name, tabulate(layout()))
    return store


def directions(grid: Grid, count: int) -> tuple[Any, Any]:
    """Pairs at nodes and between them: every fourth is at nodes, and some are below the horizon or mirrored."""
    rng = np.random.default_rng(11)
    theta_i, theta_r = rng.uniform(0.0, 1.6, (2, count))
    phi_i, phi_r = rng.uniform(-4.0, 8.0, (2, count))
    theta_r[::3], phi_r[::3] = theta_i[::3], phi_i[::3] + np.pi
    at = [np.broadcast_to(angle, grid.shape).reshape(-1) for angle in grid.directions()]
    chosen = rng.integers(0, at[0].size, len(theta_i[::4]))
    for angle, nodes in zip((theta_i, phi_i, theta_r, phi_r), at, strict=True):
        angle[::4] = nodes[chosen]
    return unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)


def wavelengths(table: Any) -> Iterable[float]:
    return (500.0,) if table.wavelength_nm is None else (400.0, 437.0, 520.0, 688.0)


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_reader_written_from_the_page_agrees_with_the_library(name: str, root: Path) -> None:
    table, reader = brdfdb.open(root)[name], Reader(current(root, name))
    wi, wr = directions(table.grid, 60)
    for wavelength in wavelengths(table):
        expected = table.lookup_vectors(wi, wr, wavelength)
        assert np.count_nonzero(expected) > 30
        # the library sums in another order, with its own exp and arcsin; measured: 3e-13
        np.testing.assert_allclose(reader.lookup(wi, wr, wavelength), expected, rtol=3e-12, atol=1e-15)
        for theta_i in (0.0, 12.3, 75.0, 89.97, 95.0):
            mirrored = float(table.specular_reflectance(np.deg2rad(theta_i), wavelength))
            # the library holds float32
            assert reader.specular(theta_i, wavelength) == pytest.approx(mirrored, rel=3e-7, abs=1e-12)


def test_the_tables_are_of_every_kind(root: Path) -> None:
    readers = {name: Reader(current(root, name)) for name in LAYOUTS}
    assert {reader.names for reader in readers.values()} == set(KINDS)
    factored = readers["planned-factored"].arrays
    assert "spectra" in factored
    assert factored["specular_reflectance"].max() > 0.1
    assert "uniform" in readers["half"].arrays
