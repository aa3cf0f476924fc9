"""Charts as SVG: the numbers of a figure are where its axes say, small, and in the colours of the page."""

from __future__ import annotations

import base64
import io
import re
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from brdfdb.figure import Curve, Map, Panel, Picture, Role, numbers
from brdfdb_pipelines import figure_look, figure_svg

RNG = np.random.default_rng(7)
X = np.linspace(0.0, 90.0, 40)
Y = RNG.uniform(0.1, 3.0, 40)  # no point lies on a line between its neighbours
THETA = np.linspace(-90.0, 90.0, 41)
RADIUS = RNG.uniform(0.2, 1.0, 41)
# Points of a path have one decimal: measured 0.057 points off, of 300 that a plot is wide
PATH_TOLERANCE = 0.06
# The same of a polar plot, relative: measured 5e-4
ROUND_TOLERANCE = 6e-4
# Measured 11 832 for a map of 60 x 30, and 8628 for two curves of 200 points
LARGEST = 12_000


def panel(*curves: Curve, title: str = "", **settings: bool) -> Panel:
    return Panel(title=title, x_label="theta_i, degrees", y_label="albedo", curves=list(curves), **settings)


def curve(y: np.ndarray, role: Role = "ours", label: str = "one", x: np.ndarray = X) -> Curve:
    return Curve(label=label, x=numbers(x, 12), y=numbers(y, 12), role=role)


def points(svg: str, index: int) -> np.ndarray:
    """The points of a curve, in those of the drawing, upwards."""
    (path,) = re.findall(rf'<g data-curve="{index}"><path d="([^"]*)"', svg)
    flat = np.array(re.findall(r"-?[\d.]+", path), dtype=float)
    return flat.reshape(-1, 2) * [1.0, -1.0]


def off(drawn: np.ndarray, values: np.ndarray) -> float:
    """How far points are from a scale of the values, one for each axis."""
    scale = [np.polyval(np.polyfit(v, d, 1), v) for v, d in zip(values.T, drawn.T, strict=True)]
    return float(np.abs(np.array(scale).T - drawn).max())


@pytest.mark.parametrize(("log_x", "log_y"), [(False, False), (True, False), (False, True), (True, True)])
def test_a_line_is_where_its_numbers_are(log_x: bool, log_y: bool) -> None:
    x = X + 1.0
    drawn = points(figure_svg.svg(panel(curve(Y, x=x), log_x=log_x, log_y=log_y), "key"), 0)
    values = np.stack([np.log(x) if log_x else x, np.log(Y) if log_y else Y], axis=1)
    assert len(drawn) == len(X)
    assert off(drawn, values) < PATH_TOLERANCE
    assert drawn[-1, 0] > drawn[0, 0]
    assert drawn[Y.argmax(), 1] > drawn[Y.argmin(), 1]


def test_a_point_that_was_moved_would_be_noticed() -> None:
    drawn = points(figure_svg.svg(panel(curve(Y)), "key"), 0)
    moved = Y.copy()
    moved[7] += 0.05
    assert off(drawn, np.stack([X, moved], axis=1)) > PATH_TOLERANCE


def test_a_polar_line_has_its_angle_from_the_normal_upwards() -> None:
    drawn = points(
        figure_svg.svg(Panel(kind="polar", x_label="", y_label="", curves=[curve(RADIUS, x=THETA)]), "key"), 0
    )
    across, up = RADIUS * np.sin(np.radians(THETA)), RADIUS * np.cos(np.radians(THETA))
    assert off(drawn, np.stack([across, up], axis=1)) < PATH_TOLERANCE
    width, height = np.ptp(drawn, axis=0)
    assert width / height == pytest.approx(np.ptp(across) / np.ptp(up), rel=ROUND_TOLERANCE)  # circles are round


def test_what_is_missing_is_a_gap() -> None:
    y = Y.copy()
    y[10:12] = np.nan
    svg = figure_svg.svg(panel(curve(y)), "key")
    (path,) = re.findall(r'<g data-curve="0"><path d="([^"]*)"', svg)
    assert path.count("M") == 2
    assert len(points(svg, 0)) == len(X) - 2


def test_what_has_no_logarithm_leaves_the_axes_downwards() -> None:
    y = Y.copy()
    y[10] = 0.0
    svg = figure_svg.svg(panel(curve(y), log_y=True), "key")
    drawn = points(svg, 0)
    (bottom,) = {float(v) for v in re.findall(r"V([\d.]+)H", svg)}
    assert -drawn[10, 1] > bottom
    assert -np.delete(drawn, 10, axis=0)[:, 1].max() < bottom
    assert "clip-path" in svg


def test_samples_are_dots_that_no_line_joins() -> None:
    svg = figure_svg.svg(panel(Curve(label="samples", x=[0.0, 1.0, 2.0], y=[1.0, None, 3.0], dots=True)), "key")
    (path,) = re.findall(r'<g data-curve="0"><path d="([^"]*)"[^>]*stroke-linecap:round', svg)
    assert re.fullmatch(r"(M[\d.]+ [\d.]+h0){2}", path)


def styles(*curves: Curve) -> list[str]:
    """Return the styles of the lines of a plot."""
    svg = figure_svg.svg(panel(*curves), "key")
    return [style for _, style in sorted(re.findall(r'<g data-curve="(\d)"><path [^>]*style="([^"]*)"', svg))]


def test_lines_of_a_role_look_the_same_whatever_is_beside_them() -> None:
    roles: list[Role] = ["ours", "printed", "textbook", "truth", "other", "other"]
    together = styles(*(curve(Y, role) for role in roles))
    assert together[:5] == [style for role in roles[:5] for style in styles(curve(Y, role))]
    assert len(set(together)) == len(roles)
    without_colours = {re.sub(r"stroke:var\([^)]*\)", "", style) for style in together[:4]}
    assert len(without_colours) == 4  # each role has dashes or a width of its own


def test_curves_of_one_role_are_told_apart_by_their_dashes() -> None:
    alike = styles(*(curve(Y, "ours") for _ in range(3)))
    assert len(set(alike)) == 3
    assert len({style[style.index("stroke:var(") :].partition(")")[0] for style in alike}) == 1


def error_map(values: np.ndarray, *, log: bool = False) -> Map:
    axes = {
        "x": np.linspace(-90.0, 90.0, values.shape[1]).tolist(),
        "y": np.linspace(0.0, 89.0, values.shape[0]).tolist(),
    }
    labels = {"x_label": "theta_r", "y_label": "theta_i", "value_label": "error"}
    return Map(title="Map", **labels, **axes, values=[numbers(row) for row in values], log=log)


SIGNED = np.outer(np.sin(np.linspace(0, 6, 30)), np.cos(np.linspace(0, 9, 60)))
DRAWINGS = {
    "curves": panel(*(curve(RNG.uniform(0, 1, 200), role, x=np.linspace(0, 90, 200)) for role in ("ours", "truth"))),
    "polar": Panel(kind="polar", x_label="", y_label="", curves=[curve(Y)]),
    "map": error_map(SIGNED),
    "positive map": error_map(np.abs(SIGNED) + 1e-3, log=True),
    "picture": Picture(radiance=[numbers(row) for row in np.abs(SIGNED)]),
    "nothing": panel(),
    "gaps only": panel(curve(np.full(40, np.nan)), log_y=True),
    "one point": panel(curve(Y[:1], x=X[:1])),
    "a constant": panel(curve(np.ones(40))),
    "a map without values": error_map(np.full((3, 3), np.nan)),
    "a map of one value": error_map(np.ones((3, 3)), log=True),
}


@pytest.mark.parametrize("name", DRAWINGS)
def test_a_drawing_is_small_well_formed_and_in_variables(name: str) -> None:
    svg = figure_svg.svg(DRAWINGS[name], "key")
    root = ET.fromstring(svg)
    assert root.get("role") == "img"
    assert root.get("aria-label")
    assert len(svg) < LARGEST
    assert set(re.findall(r"#[0-9a-f]{6}\b", svg)) <= {figure_svg.PLATE}
    assert set(re.findall(r"var\((--[\w-]+)\)", svg)) <= set(figure_look.VARIABLES.values())
    assert "http" not in svg
    assert "<style" not in svg  # would be one of the page
    wanted = {"M": 2, "L": 2, "H": 1, "V": 1, "h": 1, "A": 7, "z": 0}  # numbers of each step of a path
    for path in re.findall(r' d="([^"]*)"', svg):
        for step, rest in re.findall(r"([A-Za-z])([^A-Za-z]*)", path):
            count = len(rest.split())
            assert count == 0 if step == "z" else (count > 0 and count % wanted[step] == 0), (step, rest)


def test_a_polar_plot_stands_on_its_diameter() -> None:
    svg = figure_svg.svg(DRAWINGS["polar"], "key")
    arcs = np.array(re.findall(r"M([\d.]+) ([\d.]+)A([\d.]+) ([\d.]+) 0 0 1 ([\d.]+) ([\d.]+)z", svg), dtype=float)
    assert len(arcs) > 1
    left, height, radius, _, right, end = arcs.T
    assert len({*height, *end}) == 1
    assert len(set((left + right).round(0))) == 1  # of one centre
    assert np.abs(right - left - 2.0 * radius).max() <= 2.0 * PATH_TOLERANCE


def test_ids_of_two_drawings_differ_and_references_find_theirs() -> None:
    ids: list[str] = []
    for key in ("plot-1", "decade"):  # the second begins like a colour
        svg = figure_svg.svg(DRAWINGS["curves"], key)
        own = re.findall(r' id="([^"]+)"', svg)
        assert own
        assert set(re.findall(r"url\(#([^)]+)\)", svg)) == set(own)
        ids += own
    assert len(set(ids)) == len(ids)


def test_letters_that_mean_something_elsewhere_are_letters() -> None:
    title = '<i>&"$x_1$" it\'s'
    for drawing in (panel(curve(Y, label=title), title=title), Picture(title=title, radiance=[[0.5]])):
        root = ET.fromstring(figure_svg.svg(drawing, "key"))
        texts = [element.text for element in root.iter("text")]
        assert title in texts
        assert title in str(root.get("aria-label"))


def test_a_picture_is_in_srgb_and_its_background_is_clear() -> None:
    svg = figure_svg.svg(Picture(radiance=[[0.0, 0.18, 1.0], [2.0, -1.0, None]]), "key")
    (data,) = re.findall(r"base64,([^\"]+)", svg)
    image = imread(io.BytesIO(base64.b64decode(data)))
    # IEC 61966-2-1: 0.18 is encoded as 1.055 * 0.18**(1 / 2.4) - 0.055 = 0.4614, which is 118 of 255
    assert (255.0 * image[..., 0]).round().tolist() == [[0, 118, 255], [255, 0, 0]]
    assert image[..., 3].tolist() == [[1, 1, 1], [1, 1, 0]]


def test_a_map_has_a_colour_for_each_value_and_none_where_there_is_none() -> None:
    shown = image_of(error_map(np.array([[1.0, 2.0], [1.0, np.nan]])))
    lower, upper = shown[len(shown) // 4], shown[3 * len(shown) // 4]  # the first row of a map is the lowest
    left, right = shown.shape[1] // 4, 3 * shown.shape[1] // 4
    assert upper[right, 3] == 0.0
    assert upper[left].tolist() == lower[left].tolist()
    assert lower[left, :3].sum() < lower[right, :3].sum()  # brighter is more


def image_of(drawn: Map) -> Any:
    """The pixels of a map, the lowest row first, (rows, columns, RGBA)."""
    image, _bar = re.findall(r'<image [^>]*href="data:image/png;base64,([^"]+)"', figure_svg.svg(drawn, "key"))
    return imread(io.BytesIO(base64.b64decode(image)))[::-1]


def test_values_of_a_map_over_logarithmic_axes_meet_half_way_between_the_logarithms() -> None:
    axis = {"x": [1.0, 10.0, 100.0], "y": [1.0, 10.0, 100.0], "log_x": True, "log_y": True}
    shown = image_of(error_map(np.array([[1.0, 2.0, 3.0]] * 3)).model_copy(update=axis))
    row, columns = shown[len(shown) // 2], shown.shape[1]
    left, middle, right = row[columns // 8], row[columns // 2], row[7 * columns // 8]
    assert left[:3].sum() < middle[:3].sum() < right[:3].sum()
    for at, expected in ((0.22, left), (0.28, middle), (0.72, middle), (0.78, right)):
        assert row[round(at * columns)].tolist() == expected.tolist()


def test_maps_with_the_same_limits_have_the_same_colours() -> None:
    limits = {"low": 0.0, "high": 4.0}
    small, large = (
        image_of(error_map(values).model_copy(update=limits))
        for values in (np.array([[1.0, 2.0], [1.0, 2.0]]), np.array([[2.0, 9.0], [2.0, 9.0]]))
    )
    row, columns = len(small) // 2, small.shape[1]
    assert small[row, -columns // 4].tolist() == large[row, columns // 4].tolist()
    brightest = image_of(error_map(np.array([[0.0, 4.0], [0.0, 4.0]])))[row, -columns // 4]
    assert large[row, -columns // 4].tolist() == brightest.tolist()  # what is beyond has the last one


def test_polar_panels_refuse_what_they_cannot_show() -> None:
    shown = Panel(kind="polar", x_label="", y_label="", curves=[curve(Y)], log_y=True)
    with pytest.raises(ValueError, match="linear"):
        figure_svg.svg(shown, "key")
    beyond = Panel(kind="polar", x_label="", y_label="", curves=[curve(Y, x=X + 1.0)])
    with pytest.raises(ValueError, match="between -90 and 90"):
        figure_svg.svg(beyond, "key")
