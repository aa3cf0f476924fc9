"""Tables with one thing wrong each, and what an audit says against them."""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from brdfdb.audit import MaterialAudit
from brdfdb.materials import Material, presets
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import plan
from brdfdb.tables.stated_error import Overall
from brdfdb.tables.table import Table
from tests.benchmarks.sound_materials import built

WAVELENGTHS = np.linspace(420.0, 680.0, 5)
THETA = np.append(np.arange(0.0, 86.0, 5.0), 89.5)
COARSE = Grid({"theta_i": THETA, "theta_r": THETA, "delta_phi": np.arange(0.0, 181.0, 10.0)})
STATISTICS = tuple(Overall.model_fields)


@functools.cache
def copper() -> Table:
    """A copper table on a plain, coarse grid: its stated 99th percentile is above 1."""
    return built(Layout(presets()["scene-copper-sphere"], COARSE, WAVELENGTHS))


@functools.cache
def brass() -> Table:
    """A planned table of brass, with the ellipse of a brushed surface."""
    return built(plan(presets()["rolled-brass"], None, 0.05))


@functools.cache
def clay() -> Table:
    """A planned table of rough clay."""
    return built(plan(presets()["clay-vase"], None, 0.05))


@functools.cache
def grooves() -> Table:
    """A table of parallel cavities, which are no mirror image of themselves."""
    fields = {"title": "Grooves", "model": "oren_nayar_unidirectional", "source": "made up"}
    parameters = {"rho": 0.6, "theta_a_deg": 30.0, "phi_a_deg": 20.0}
    turn = np.arange(0.0, 361.0, 30.0)
    theta = np.array([0.0, 20.0, 40.0, 60.0, 75.0, 85.0])
    grid = Grid({"theta_i": theta, "phi_i": turn, "theta_r": theta, "phi_r": turn})
    return built(Layout(Material.from_table("grooves", {**fields, "parameters": parameters}), grid))


def of_values(table: Table, change: Callable[[Any], Any]) -> Table:
    """The table with its numbers changed, in float64."""
    return replace(table, values=change(table.values.astype(np.float64)).astype(np.float32))


def of_error_stated(table: Table, change: Callable[[dict[str, Any]], None]) -> Table:
    """The table with its stated error changed in place."""
    error = copy.deepcopy(table.attrs["error"])
    change(error)
    return replace(table, attrs={**table.attrs, "error": error})


def times(table: Table, factor: float) -> Table:
    """The table with all of f_r, uniform part included, times a factor."""
    if not table.interpolation.logarithm:
        return of_values(table, lambda values: values * factor)
    how = replace(table.interpolation, offset=table.interpolation.offset * factor)
    attrs = {**table.attrs, "interpolation": {**table.attrs["interpolation"], "offset": how.offset}}
    changed = replace(table, interpolation=how, attrs=attrs)
    if table.uniform is not None:
        changed = replace(changed, uniform=table.uniform * factor)
    return of_values(changed, lambda values: values + np.log(factor))


def _all_bands(value: float) -> Callable[[dict[str, Any]], None]:
    def change(error: dict[str, Any]) -> None:
        for name in STATISTICS:
            error[name] = [[value for _ in row] for row in error[name]]

    return change


def _everything(factor: float, *names: str) -> Callable[[dict[str, Any]], None]:
    def change(error: dict[str, Any]) -> None:
        for name in names:
            error[name] = [[factor * each for each in row] for row in error[name]]
            error["overall"][name] *= factor

    return change


def _one_cell(error: dict[str, Any]) -> None:
    error["median"][4][2] /= 2.0


def _floor(error: dict[str, Any]) -> None:
    error["floor"] = [3.0 * each for each in error["floor"]]


def _turned(values: Any) -> Any:
    """Numbers over theta_h, phi_h, ...: the last column of phi_h, the short axis, becomes the first."""
    return values[:, ::-1]


def _smoothed(values: Any) -> Any:
    peak = values.copy()
    peak[1:-1] = 0.25 * values[:-2] + 0.5 * values[1:-1] + 0.25 * values[2:]
    return peak


def _noise(values: Any) -> Any:
    symmetric = np.random.default_rng(3).normal(0.0, 0.02, values.shape)
    return values * np.exp(symmetric + np.swapaxes(symmetric, 0, 1))


def _band(values: Any) -> Any:
    bright = values.copy()
    bright[11:13] *= 1.1  # light from 55 and 60 degrees
    bright[:, 11:13] *= 1.1
    return bright


def _wavelength(values: Any) -> Any:
    return values * np.where(np.arange(values.shape[-1]) == 3, 1.1, 1.0)


def _shifted(table: Table) -> Table:
    """The table on axes whose inner nodes say that they lie 2 degrees further from the normal."""
    axes = {name: nodes.copy() for name, nodes in table.grid.axes.items()}
    for name in ("theta_i", "theta_r"):
        axes[name][1:-1] += 2.0
    return replace(table, grid=Grid(axes))


_QUARTER = (np.arange(13) - 3) % 12  # nodes of azimuths 30 degrees apart, the last of which is the first
PLANTED: dict[str, Callable[[], Table]] = {
    # as they were found from outside
    "copper times 0.8, whose stated p99 is above 1": lambda: times(copper(), 0.8),
    "brass turned by 90 degrees": lambda: of_values(brass(), _turned),
    "all stated errors of bands 1e-6, the overall kept": lambda: of_error_stated(clay(), _all_bands(1e-6)),
    "n times 1.3": lambda: replace(copper(), n=None if copper().n is None else 1.3 * np.asarray(copper().n)),
    # and more
    "k times 0.9": lambda: replace(copper(), k=None if copper().k is None else 0.9 * np.asarray(copper().k)),
    "clay times 1.05": lambda: times(clay(), 1.05),
    "clay times 0.99": lambda: times(clay(), 0.99),
    "copper seen from the other side": lambda: of_values(copper(), lambda values: values[:, :, ::-1]),
    "grooves in a mirror": lambda: of_values(grooves(), lambda values: values[:, ::-1, :, ::-1]),
    "grooves turned by 90 degrees": lambda: of_values(
        grooves(), lambda values: np.take(np.take(values, _QUARTER, axis=1), _QUARTER, axis=3)
    ),
    "grooves with azimuths of light and viewer exchanged": lambda: of_values(
        grooves(), lambda values: np.swapaxes(values, 1, 3)
    ),
    "copper on shifted axes": lambda: _shifted(copper()),
    "copper, one band too bright": lambda: of_values(copper(), _band),
    "copper, one wavelength too bright": lambda: of_values(copper(), _wavelength),
    "copper, wavelengths in reverse": lambda: of_values(copper(), lambda values: values[..., ::-1]),
    "copper with a smoothed peak": lambda: of_values(copper(), _smoothed),
    "copper clipped": lambda: of_values(copper(), lambda values: np.minimum(values, 0.5 * values.max())),
    "copper with noise of 3 %": lambda: of_values(copper(), _noise),
    "brass with half of its uniform part": lambda: replace(
        brass(), uniform=None if brass().uniform is None else 0.5 * np.asarray(brass().uniform)
    ),
    "a floor three times too high": lambda: of_error_stated(clay(), _floor),
    "every statistic a tenth": lambda: of_error_stated(clay(), _everything(0.1, *STATISTICS)),
    "every statistic ten times": lambda: of_error_stated(clay(), _everything(10.0, *STATISTICS)),
    "l1 alone a third": lambda: of_error_stated(clay(), _everything(1.0 / 3.0, "l1")),
    "median alone half": lambda: of_error_stated(copper(), _everything(0.5, "median")),
    "the maximum a tenth": lambda: of_error_stated(copper(), _everything(0.1, "max")),
    "one median of one band and wavelength half": lambda: of_error_stated(copper(), _one_cell),
}


def reasons_of(found: MaterialAudit) -> list[str]:
    """Return what an audit says against a table, finding by finding."""
    return found.problems()
