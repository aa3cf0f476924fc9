"""Plots of tables: curves and images hold the lookups, shares add up to the albedo, bad input is refused."""

from __future__ import annotations

import sys
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from brdfdb.errors import MissingExtraError, ParameterError
from brdfdb.geometry import radians
from brdfdb.tables.albedo import directional_albedo
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.plot import ALBEDO_DEG, albedo_shares
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import tabulate
from tests.tables.made_up import WAVELENGTHS, made_up, material, read_back

mpl.use("Agg")


@pytest.fixture
def grey() -> Table:
    return made_up("isotropic")


def test_cut_draws_lookups_over_signed_angles(grey: Table) -> None:
    axes = grey.plot.cuts([0.0, 40.0], ax=Figure().add_subplot())
    for line, theta_i in zip(axes.lines, (0.0, 40.0), strict=True):
        theta_r, brdf = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        assert np.all(np.diff(theta_r) > 0.0)
        expected = grey.lookup(radians(theta_i), 0.0, radians(np.abs(theta_r)), np.where(theta_r > 0.0, np.pi, 0.0))
        np.testing.assert_allclose(brdf, expected, rtol=1e-12)
    assert "[1/sr]" in axes.get_ylabel()
    assert labels(axes) == [r"$\theta_i$ = 0°", r"$\theta_i$ = 40°"]


def test_lobe_has_the_mirror_direction_on_the_right(grey: Table) -> None:
    axes = grey.plot.lobe(30.0, ax=Figure().add_subplot())
    x, y = (np.asarray(values) for values in axes.lines[-1].get_data())
    radius, angle = np.hypot(x, y), np.arctan2(x, y)
    expected = grey.lookup(radians(30.0), 0.0, np.abs(angle), np.where(angle > 0.0, np.pi, 0.0))
    np.testing.assert_allclose(radius / radius.max(), expected / expected.max(), rtol=1e-6)


def test_cuts_resolve_a_lobe_narrower_than_their_even_steps() -> None:
    alpha = 2e-3
    theta = np.array([0.0, 30.0, 60.0, 85.0])
    grid = Grid({"theta_i": theta, "theta_r": theta, "delta_phi": np.array([0.0, 90.0, 180.0])})
    polished = material("ward", rho_d=0.1, rho_s=0.3, alpha_x=alpha, alpha_y=alpha)
    table = read_back(tabulate(Layout(polished, grid)))
    for theta_i in (0.0, 30.0, 60.0):
        theta_r = np.asarray(table.plot.cuts(theta_i, ax=Figure().add_subplot()).lines[0].get_xdata())
        slopes = np.tan(radians(theta_r - theta_i) / 2.0) / alpha
        assert np.diff(slopes[np.abs(slopes) < 2.0]).max() < 0.25
        assert theta_r.size < 700


def test_lobe_of_an_anisotropic_table_has_two_azimuths() -> None:
    axes = made_up("anisotropic").plot.lobe([0.0, 60.0], ax=Figure().add_subplot())
    expected = [rf"$\theta_i$ = {theta}°, $\phi_i$ = {phi}°" for theta in (0, 60) for phi in (0, 90)]
    assert labels(axes) == expected


def test_wavelengths_have_curves_and_colours_of_their_own() -> None:
    table = made_up("isotropic", WAVELENGTHS)
    axes = table.plot.cuts(40.0, wavelength_nm=[400.0, 600.0], ax=Figure().add_subplot())
    lines = axes.lines
    assert lines[0].get_color() != lines[1].get_color()
    theta_r = np.asarray(lines[1].get_xdata())
    expected = table.lookup(radians(40.0), 0.0, radians(np.abs(theta_r)), np.where(theta_r > 0.0, np.pi, 0.0), 600.0)
    np.testing.assert_allclose(np.asarray(lines[1].get_ydata()), expected, rtol=1e-12)
    assert table.plot.cuts(ax=Figure().add_subplot()).get_title(loc="left") == "random at 550 nm"


def test_shares_add_up_to_the_albedo_of_the_table(grey: Table) -> None:
    table = made_up("isotropic", dirac=True)
    shares = albedo_shares(table, 0.0, None)
    exact = directional_albedo(grey, ALBEDO_DEG).albedo[:, 0, 0]
    # random values have a kink at every node; measured 1e-4. They differ with the azimuth of a light at the normal
    np.testing.assert_allclose((shares["uniform part"] + shares["reflected"])[1:], exact[1:], atol=1e-3)
    np.testing.assert_allclose(shares["specular part"], table.specular_reflectance(radians(ALBEDO_DEG)))


@pytest.mark.parametrize("kind", ["in_plane", "half_difference"])
def test_slice_is_shown_with_a_colour_bar(grey: Table, kind: str) -> None:
    figure = Figure()
    axes = grey.plot.slices(kind, ax=figure.add_subplot())  # type: ignore[arg-type]
    (image,) = axes.images
    assert image.norm.vmax == pytest.approx(float(np.asarray(image.get_array()).max()))
    assert "[1/sr]" in figure.axes[1].get_ylabel()


def test_new_axes_are_made_where_none_are_given(grey: Table) -> None:
    from matplotlib import pyplot

    axes = grey.plot.cuts()
    assert axes.figure is pyplot.gcf()
    pyplot.close("all")


def test_bad_input_is_refused(grey: Table) -> None:
    for draw, said in (
        (lambda: grey.plot.lobe(91.0), r"theta_i_deg: 91 is outside \[0, 90\] degrees"),
        (lambda: grey.plot.slices("disc"), "kind: 'disc' is not one of in_plane, half_difference"),  # type: ignore[arg-type]
        (lambda: grey.plot.cuts([]), "theta_i_deg: is an empty list"),
    ):
        with pytest.raises(ParameterError, match=said):
            draw()


def test_missing_matplotlib_is_named_in_one_sentence(grey: Table, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match="matplotlib is not installed; it comes with pip install"):
        grey.plot.cuts()


def test_uniform_part_of_a_material_is_its_share() -> None:
    source = material("ward", rho_d=0.2, rho_s=0.0, alpha_x=0.2, alpha_y=0.2)
    flat = replace(scaled(0.2, "gloss"), attrs={"source_record": source.document()})
    shares = albedo_shares(flat, 0.0, None)
    np.testing.assert_allclose(shares["uniform part"], 0.2, atol=1e-3)
    np.testing.assert_allclose(shares["lobe"], 0.0, atol=1e-3)


@pytest.mark.parametrize("kind", ["lobe", "cuts", "albedo", "slices"])
def test_every_plot_refuses_wavelengths_that_lookups_refuse(kind: str) -> None:
    spectral = made_up("isotropic", WAVELENGTHS)
    wrong = [(table, value) for table in (made_up("isotropic"), spectral) for value in (float("nan"), -5.0, "blue", ())]
    wrong += [(spectral, 1e9), *([(spectral, list(WAVELENGTHS[:2]))] if kind in ("albedo", "slices") else [])]
    for table, given in wrong:
        with pytest.raises(ParameterError, match=r"^wavelength_nm: "):
            getattr(table.plot, kind)(wavelength_nm=given, ax=Figure().add_subplot())


def scaled(factor: float, name: str) -> Table:
    """Return a table of f_r = factor / pi."""
    table = made_up("isotropic")
    values = np.full(table.values.shape, factor / np.pi, np.float32)
    return Table(name, "r000001", {}, table.grid, None, values, None)


def labels(axes: Axes) -> list[str]:
    legend = axes.get_legend()
    assert legend is not None
    return [text.get_text() for text in legend.get_texts()]


def curves(axes: Axes) -> dict[str, Line2D]:
    """Return the lines with a label by it."""
    return {str(line.get_label()): line for line in axes.lines if not str(line.get_label()).startswith("_")}


@pytest.mark.parametrize("order", [(0.1, 0.8), (0.8, 0.1)])
@pytest.mark.parametrize("kind", ["lobe", "cuts"])
def test_two_tables_on_the_same_axes_share_a_scale(kind: str, order: tuple[float, float]) -> None:
    """Each was drawn to its own scale as a lobe, and the taller of two cuts was cut off by the second."""
    axes = Figure().add_subplot()
    for factor in order:
        assert getattr(scaled(factor, f"of {factor:g}").plot, kind)([0.0, 45.0], ax=axes) is axes
    assert labels(axes) == [f"of {factor:g}, $\\theta_i$ = {angle}°" for factor in order for angle in (0, 45)]
    assert axes.get_title(loc="left") == ", ".join(f"of {factor:g}" for factor in order)
    shown = curves(axes)
    for label, line in shown.items():
        x, y = (np.asarray(data) for data in line.get_data())
        f_r = np.hypot(x, y) if kind == "lobe" else y
        np.testing.assert_allclose(f_r, float(label.split(",")[0].removeprefix("of ")) / np.pi, rtol=1e-6)
        (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        assert left < x.min() <= x.max() < right
        assert bottom < y.min() <= y.max() < top
    colours = [line.get_color() for line in shown.values()]
    assert colours[0] == colours[1] != colours[2] == colours[3]
    styles = [line.get_linestyle() for line in shown.values()]
    assert styles[0] == styles[2] != styles[1] == styles[3]
    if kind == "lobe":
        rings = [float(text.get_text()) for text in axes.texts if "°" not in text.get_text()]
        assert rings == sorted(set(rings))
        assert rings[-1] == pytest.approx(axes.get_xlim()[1] / 1.13)
        assert [text.get_position()[0] for text in axes.texts if "°" not in text.get_text()] == pytest.approx(rings)


def test_cuts_of_a_peak_and_a_flat_table_share_a_logarithmic_axis() -> None:
    axes = Figure().add_subplot()
    scaled(200.0, "bright").plot.cuts(0.0, ax=axes)
    scaled(0.5, "dim").plot.cuts(0.0, ax=axes)
    assert axes.get_yscale() == "linear"  # the median is of both
    scaled(0.5, "dimmer").plot.cuts(0.0, ax=axes)
    assert axes.get_yscale() == "log"
    bottom, top = axes.get_ylim()
    assert bottom < 0.5 / np.pi < 200.0 / np.pi < top
    scaled(0.5, "dim again").plot.cuts(0.0, ax=axes, log=False)
    assert axes.get_yscale() == "linear"
    assert axes.get_ylim()[0] == 0.0


def test_albedos_of_two_tables_are_lines_where_one_is_stacked(grey: Table) -> None:
    axes = Figure().add_subplot()
    scaled(0.3, "dim").plot.albedo(ax=axes)
    assert np.asarray(axes.lines[0].get_ydata()).tolist() == [1.0, 1.0]
    assert {text.get_text() for text in axes.texts} == {"reflected", "1: everything is reflected"}
    assert len(axes.collections) == 1
    grey.plot.albedo(ax=axes)
    assert len(axes.collections) == 0
    assert {text.get_text() for text in axes.texts} == {"1: everything is reflected"}
    assert labels(axes) == ["dim", "random"]
    shown = curves(axes)
    np.testing.assert_allclose(np.asarray(shown["dim"].get_ydata()), 0.3, atol=1e-3)
    np.testing.assert_allclose(np.asarray(shown["random"].get_ydata()), albedo_shares(grey, 0.0, None)["reflected"])
    assert axes.get_ylim()[1] > np.max(np.asarray(shown["random"].get_ydata()))
    assert shown["dim"].get_color() != shown["random"].get_color()


@pytest.mark.parametrize("kind", ["lobe", "cuts"])
def test_what_the_caller_has_drawn_is_not_cut_off(grey: Table, kind: str) -> None:
    axes = Figure().add_subplot()
    axes.plot([-30.0, 30.0] if kind == "cuts" else [0.0, 0.0], [0.0, 40.0], label="measured")
    getattr(grey.plot, kind)(0.0, ax=axes)
    assert labels(axes)[0] == "measured"
    assert axes.get_ylim()[1] > 40.0


def test_many_tables_have_colours_of_their_own_and_cleared_axes_begin_anew(grey: Table) -> None:
    axes = Figure().add_subplot()
    for number in range(12):
        scaled(0.1, f"{number}").plot.cuts(0.0, ax=axes)
    assert len({str(line.get_color()) for line in curves(axes).values()}) == 12
    axes.clear()
    grey.plot.lobe(30.0, ax=axes)
    assert labels(axes) == [r"$\theta_i$ = 30°"]
    assert axes.get_title(loc="left") == "random"


def test_axes_that_cannot_be_shared_are_refused(grey: Table) -> None:
    axes = Figure().add_subplot()
    grey.plot.slices(ax=axes)
    with pytest.raises(ParameterError, match="ax: shows slices of random; slices need axes of their own"):
        grey.plot.slices(ax=axes)
    with pytest.raises(ParameterError, match="ax: shows slices of random; cuts need axes of their own"):
        grey.plot.cuts(ax=axes)
    for wrong in (Figure().add_subplot(projection="polar"), Figure(), Figure().subplots(2)):
        with pytest.raises(ParameterError, match="ax: is not Axes with straight x and y axes"):
            grey.plot.lobe(ax=wrong)
