"""The page of an audit: whole, well formed, quiet on the network, and readable in a browser."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from collections import Counter
from datetime import UTC, datetime
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from brdfdb.audit.findings import (
    Asymmetry,
    AuditReport,
    Energy,
    EnergyVerdict,
    Furnace,
    Jump,
    Limit,
    MaterialAudit,
    ModelEnergy,
    Reciprocity,
    Sampling,
    Smoothness,
    TableEnergy,
    TableError,
    UniformBound,
    Validity,
    Values,
    Verdict,
)
from brdfdb.figure import Curve, Figure, Map, Panel, Picture, Statement, numbers
from brdfdb_pipelines import charts, page

THETA = np.linspace(0.0, 89.0, 60)
ODD = '<b>&"it\'s" $größe$'


def asymmetry(largest: float = 1e-14) -> Asymmetry:
    return Asymmetry(pairs=2000, min=0.0, mean=largest / 10.0, max=largest, tolerance=1e-11)


def error_map(title: str = "550 nm") -> Map:
    x, y = np.linspace(-88.0, 88.0, 45), np.linspace(0.0, 88.0, 23)
    rows = [numbers(0.02 * np.sin(x / 9.0 + each / 11.0)) for each in y]
    labels = {"x_label": "theta_r, degrees", "y_label": "theta_i, degrees", "value_label": "relative error"}
    return Map(title=title, x=x.tolist(), y=y.tolist(), values=rows, **labels)


def panel(title: str = "Relative error of the series", **settings: object) -> Panel:
    g = np.geomspace(0.01, 1e6, 80)
    curves = [
        Curve(label="ours", x=numbers(g), y=numbers(1e-15 * (1.0 + np.log1p(g))), role="ours"),
        Curve(label="ten terms", x=numbers(g), y=numbers(np.minimum(1.0, 1e-13 * g**3)), role="printed"),
        Curve(label="Beckmann's limit", x=numbers(g), y=numbers(1.0 / (1.0 + g)), role="textbook"),
    ]
    return Panel(title=title, x_label="g", y_label="relative error", curves=curves, log_x=True, log_y=True, **settings)


def polar() -> Panel:
    theta = np.linspace(-90.0, 90.0, 121)
    lobe = np.exp(-(((theta - 45.0) / 15.0) ** 2)) + 0.2
    curves = [
        Curve(label="as printed", x=numbers(theta), y=numbers(0.8 * lobe), role="printed"),
        Curve(label="truth", x=numbers(theta), y=numbers(lobe), role="truth"),
        Curve(label="ours", x=numbers(theta), y=numbers(lobe), role="ours"),
    ]
    return Panel(kind="polar", title="Light from 45°", x_label="theta_r", y_label="f_r, 1/sr", curves=curves)


def sphere(title: str = "sigma 0°", flatness: float = 1.0, side: int = 96) -> Picture:
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, side), np.linspace(1.0, -1.0, side))
    z = 1.0 - x**2 - y**2
    shade = np.where(z > 0.0, 0.9 * np.maximum(z, 0.0) ** (0.5 * flatness), np.nan)
    return Picture(title=title, radiance=[numbers(row) for row in shade])


def material(
    name: str, verdict: EnergyVerdict = "conserves", strength: float = 0.7, *, spectral: bool = False
) -> MaterialAudit:
    """All findings on a material that reflects so much at normal incidence."""
    wavelengths = [400.0, 500.0, 600.0, 700.0] if spectral else None
    scale = np.linspace(0.8, 1.0, 4) if spectral else np.ones(1)
    rows = strength * (1.0 + (THETA / 90.0) ** 3 / 5.0)[:, np.newaxis] * scale
    albedo = [numbers(row) for row in rows]
    dirac = [numbers(np.zeros(scale.size)) for _ in THETA]
    overall: Verdict = "passes" if verdict in ("conserves", "loses") else verdict  # type: ignore[assignment]
    reason = f"reflects up to {rows.max():.4g} at 89 degrees"
    shared = {"theta_i_deg": THETA.tolist(), "wavelength_nm": wavelengths, "albedo": albedo, "specular": dirac}
    shared |= {"max_albedo": float(rows.max()), "max_at_theta_i_deg": 89.0, "exceeds_1_from_theta_i_deg": None}
    shared |= {"max_at_wavelength_nm": 700.0 if spectral else None, "reason": reason}
    furnace = Furnace(
        lossless="rho = 1",
        theta_i_deg=THETA.tolist(),
        albedo=[numbers(row / strength) for row in rows],
        hemispherical=numbers(scale),
        smallest=0.8,
        smallest_at_theta_i_deg=0.0,
        largest=1.2,
        largest_at_theta_i_deg=89.0,
    )
    bound = UniformBound(wavelength_nm=[400.0, 700.0], largest=[0.6, 0.7], preset=[0.5, 0.65], keeps=True)
    p = [0.31, 0.0004, None]
    limit = {"quantity": "alpha", "valid": "at most 0.2", "words": "up to about 0.2", "where": "section 4"}
    return MaterialAudit(
        material=name,
        revision="r000001",
        model="he_torrance" if spectral else "ward",
        energy=Energy(
            model=ModelEnergy(
                **shared,
                integration_error=1e-9,
                hemispherical=numbers(0.7 * scale),
                furnace=furnace,
                bound_on_a=bound if spectral else None,
                verdict=verdict,
            ),
            table=TableEnergy(
                **shared,
                integration_error=1e-4,
                bands=None,
                exceeds_1_beyond_error_from_theta_i_deg=None,
                verdict=overall,
            ),
            verdict=verdict,
            reason=reason,
        ),
        reciprocity=Reciprocity(
            model_random=asymmetry(),
            model_lobe=asymmetry(3e-13),
            table_random=asymmetry(),
            table_lobe=asymmetry(),
            table_nodes=asymmetry(0.0),
            verdict="passes",
        ),
        values=Values(
            count=720,
            looked_up=5000,
            smallest=0.0123,
            negative=0,
            not_finite=0,
            positivity="passes",
            finiteness="passes",
        ),
        smoothness=Smoothness(
            model=[Jump(seam="alpha = 45°", largest=2e-7, where="theta_i 45°, theta_r 45°", tolerance=1e-5)],
            table=[Jump(seam="delta_phi = 180°", largest=1e-4, where="theta_i 80°", tolerance=1e-2)],
            verdict="passes",
        ),
        table_error=TableError(stated_p99=0.0093, fresh_p99=0.0091, maps=[error_map()], verdict="passes"),
        sampling=Sampling(
            samples=100_000,
            theta_i_deg=[0.0, 45.0, 80.0],
            wavelength_nm=550.0 if spectral else None,
            chi_square_p=p,
            largest_weight=[1.2, 1.5, 4.0],
            weight_spread=[0.1, 0.2, 0.5],
            monte_carlo=[0.7, 0.69, 0.6],
            monte_carlo_error=[1e-3] * 3,
            quadrature=[0.7, 0.69, 0.6],
            verdict="passes",
        ),
        validity=Validity(
            limits=[
                Limit(value="0.05", standing="inside", **limit),
                Limit(value="0.2", standing="at the edge", **limit),
            ],
            standing="at the edge",
        ),
        verdict=overall,
    )


def figure(key: str, paper: str, panels: list[Panel | Map | Picture]) -> Figure:
    statements = [
        Statement(says=f"{key}: it peaks at 45°", where="Fig. 3", seen="the peak is at 45.0°", holds=True),
        Statement(says=f"{key}: ten terms are enough", where="eq. 78", seen="81 % of the sum at g = 9", holds=False),
    ]
    caption = "He et al.'s eq. 78 against 50 digits, V = 3."
    return Figure(key=key, paper=paper, title=f"Title of {key}", caption=caption, panels=panels, statements=statements)


def whole() -> AuditReport:
    """A report with one material of every verdict and one drawing of every kind."""
    materials = [
        material("brass"),
        material("paint", "loses", 0.4),
        material("oxide", "known published excess", 0.9, spectral=True),
        material(ODD, "violates", 1.3),
    ]
    atlas = [
        figure("series", "he1991", [panel()]),
        figure("lobes", "ward1992", [polar()]),
        figure("error-map", "he1991", [error_map(), error_map("600 nm")]),
    ]
    gallery = [
        figure("vases", "orennayar1994", [sphere(), sphere("sigma 20°", 0.6), sphere("sigma 40°", 0.3)]),
        figure("fig-3", "ward1992", [polar(), panel()]),
        figure("fig-4", "orennayar1994", [polar()]),
    ]
    return AuditReport(materials=materials, atlas=atlas, gallery=gallery, violations=[ODD])


# The document


class Document(HTMLParser):
    """Elements, their attributes and the text of a page, of which every tag is closed."""

    VOID = frozenset({"meta", "link", "br", "input"})

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.unbalanced: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[tuple[str, str]] = []
        self.feed(html)
        self.close()
        self.unbalanced += self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if self.open and self.open[-1] == tag:
            self.open.pop()
        else:
            self.unbalanced.append(tag)

    def handle_data(self, data: str) -> None:
        self.text.append((self.open[-1] if self.open else "", data))

    def attributes(self, name: str) -> list[str]:
        return [value for _, attributes in self.elements if (value := attributes.get(name)) is not None]

    def words(self) -> str:
        return "".join(text for tag, text in self.text if tag not in ("script", "style"))


@pytest.fixture(scope="module")
def report() -> AuditReport:
    return whole()


@pytest.fixture(scope="module")
def html(report: AuditReport) -> str:
    return page.render(
        report, store=f"the store {ODD}", version="1.2.3", when=datetime(2026, 11, 21, 12, 34, tzinfo=UTC)
    )


@pytest.fixture(scope="module")
def document(html: str) -> Document:
    return Document(html)


def test_every_tag_is_closed_where_it_should_be(document: Document) -> None:
    assert document.unbalanced == []
    assert len(document.elements) > 1000


def test_a_tag_left_open_would_be_noticed() -> None:
    assert Document("<p><b>bold</p>").unbalanced == ["p", "p", "b"]


def test_ids_are_unique_and_every_link_has_its_target(document: Document) -> None:
    ids = Counter(document.attributes("id"))
    assert [name for name, count in ids.items() if count > 1] == []
    local = [link[1:] for link in document.attributes("href") if link.startswith("#")]
    local += [found for path in document.attributes("clip-path") for found in re.findall(r"url\(#(.+)\)", path)]
    local += document.attributes("aria-controls")
    assert len(local) > 50
    assert set(local) <= set(ids)


def test_nothing_is_fetched_from_anywhere(document: Document) -> None:
    fetched = [value for name in ("src", "href", "srcset", "data", "action") for value in document.attributes(name)]
    assert {value[:5] for value in fetched if not value.startswith("#")} == {"data:"}
    styles = " ".join(text for tag, text in document.text if tag == "style")
    assert "url(" not in styles
    assert "@import" not in styles
    (policy,) = [value for value in document.attributes("content") if "default-src" in value]
    assert policy.startswith("default-src 'none'; ")


def test_every_material_figure_and_statement_is_there(document: Document, report: AuditReport) -> None:
    words = document.words()
    for each in report.materials:
        assert words.count(each.material) >= 2  # in the table, and on top of its section
        assert page.anchor(each.material) in document.attributes("id")
    for each in (*report.atlas, *report.gallery):
        assert each.title in words
        assert each.caption in words
        for statement in each.statements:
            assert statement.says in words
            assert statement.seen in words
    drawings = sum(len(each.panels) for each in (*report.atlas, *report.gallery))
    drawings += sum(len(each.table_error.maps) for each in report.materials)
    drawings += 3 * 2 + 4  # grey: model and table, furnace; spectral: the model alone and the bound, too
    assert sum(tag == "svg" for tag, _ in document.elements) == drawings


def test_what_holds_and_what_does_not_is_said_in_words(document: Document, report: AuditReport) -> None:
    found = [each.holds for figure in (*report.atlas, *report.gallery) for each in figure.statements]
    words = document.words()
    assert words.count("Does not hold:") == found.count(False) > 0
    assert words.count("Holds:") == found.count(True) > 0


def test_reasons_are_sentences_and_said_once(document: Document) -> None:
    words = re.sub(r"\s+", " ", document.words())
    assert words.count("Reflects up to 0.4774 at 89 degrees.") == 1  # of model and table alike
    assert "Energy of the model: loses. Reflects" in words
    assert "Energy of the table: passes. As the model." in words
    assert "Reciprocity: passes. Asymmetry up to 3·10⁻¹³, of 1·10⁻¹¹ allowed." in words
    assert "Smoothness: passes. Jumps by 0.0001 of f_r across delta_phi = 180°, of 0.01 allowed." in words
    assert "Sampling: passes. The smallest p of 3 lights is below 0.001." in words
    assert "Validity: at the edge. Inside 1 of the 2 limits that its paper states." in words


def test_violations_come_first_then_known_excess_then_losses(html: str) -> None:
    rows = re.findall(r'<th scope="row"><a href="#([^"]+)">', html)
    assert rows == [page.anchor(name) for name in (ODD, "oxide", "paint", "brass")]


def test_names_with_markup_in_them_stay_names(html: str, document: Document) -> None:
    assert ODD not in html
    assert ODD in document.words()


def test_anchors_of_different_names_differ() -> None:
    names = ["a b", "a_b", "a-b", "a_20_b", "ä", "a.b", "a/b"]
    anchors = [page.anchor(name) for name in names]
    assert len(set(anchors)) == len(names)
    assert all(re.fullmatch(r"m-[A-Za-z0-9_-]+", anchor) for anchor in anchors)


def test_the_dark_page_has_a_colour_for_every_variable(html: str) -> None:
    dark = html[html.index("prefers-color-scheme: dark") :]
    dark = dark[: dark.index("}")]
    for variable in {*charts.VARIABLES.values(), *re.findall(r"var\((--[a-z0-9-]+)\)", html)}:
        if variable not in ("--text", "--display", "--tone", "--back"):
            assert f"{variable}: #" in dark, variable


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.01234, "0.0123"), (-2.0, "−2"), (3e-13, "3·10⁻¹³"), (1.26e5, "1.3·10⁵"), (None, "–"), (1.0, "1")],
)
def test_numbers_are_those_that_people_write(value: float | None, text: str) -> None:
    assert page.number(value) == text


def test_a_report_of_nothing_is_a_page(document: Document) -> None:
    nothing = AuditReport(materials=[], atlas=[], gallery=[], violations=[])
    empty = Document(page.render(nothing, store="empty", version="1", when=datetime(2026, 1, 1, tzinfo=UTC)))
    assert empty.unbalanced == []
    assert "atlas" in document.attributes("id")
    assert "atlas" not in empty.attributes("id")


# In a browser

PROBE = """<script>
const seen = [];
addEventListener("error", event => seen.push(event.message));
addEventListener("securitypolicyviolation", event => seen.push(event.blockedURI));
console.error = console.warn = (...words) => seen.push(words.join(" "));
addEventListener("load", () => {
  const rows = () => [...document.querySelectorAll("#findings tbody tr")].filter(row => !row.hidden);
  const names = () => rows().map(row => row.cells[0].textContent);
  const sort = index => document.querySelectorAll("#findings thead button")[index].click();
  const sorted = () => document.querySelector("#findings [aria-sort]").getAttribute("aria-sort");
  const result = { width: innerWidth, content: document.documentElement.scrollWidth, first: names() };
  sort(0); result.named = names(); result.direction = sorted();
  sort(0); result.reversed = names(); result.turned = sorted();
  sort(3); result.numbers = names();
  const filter = document.getElementById("filter");
  filter.value = "he_torrance"; filter.dispatchEvent(new Event("input")); result.filtered = names();
  filter.value = ""; filter.dispatchEvent(new Event("input"));
  location.hash = "m-brass";
  setTimeout(() => {
    result.open = [...document.querySelectorAll("details[open]")].map(each => each.id);
    for (const each of document.querySelectorAll("details")) each.open = true;
    result.opened = document.documentElement.scrollWidth;
    const fetched = performance.getEntriesByType("resource").map(each => each.name);
    result.fetched = fetched.filter(name => !name.startsWith("data:"));
    parent.postMessage({ ...result, seen }, "*");
  }, 200);
});
</script>"""
FRAMES = """<!doctype html><meta charset="utf-8">
<style>body {{ margin: 0 }} iframe {{ border: 0; height: 1600px }}</style>
<script>addEventListener("message", event => {{
  const line = document.createElement("pre");
  line.textContent = JSON.stringify(event.data);
  document.body.append(line);
}});</script><body>{frames}"""


@pytest.fixture(scope="module")
def browser() -> str:
    """A Chromium; without one the tests that look at pixels are skipped, or fail where it is known to be there."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if found := shutil.which(name):
            return found
    if os.environ.get("BRDFDB_NEEDS_BROWSER"):
        pytest.fail("BRDFDB_NEEDS_BROWSER is set, and no chromium, chromium-browser or google-chrome is on PATH")
    pytest.skip("no chromium, chromium-browser or google-chrome on PATH")


def browse(browser: str, directory: Path, content: str, *options: str) -> str:
    """What a browser without a window prints of a file."""
    path = directory / "frames.html"
    path.write_text(content, encoding="utf-8")
    quiet = ("gpu", "quic", "background-networking", "component-update", "sync", "dev-shm-usage")
    flags = ["--headless", "--no-sandbox", "--no-first-run", "--hide-scrollbars", "--virtual-time-budget=4000"]
    flags += [f"--user-data-dir={directory / 'profile'}", *(f"--disable-{each}" for each in quiet), *options]
    run = [browser, *flags, path.as_uri()]
    return subprocess.run(run, capture_output=True, text=True, check=True, timeout=120).stdout


def frame(width: int) -> str:
    # in a frame: a window without a screen is no narrower than 500 pixels
    return f'<iframe src="page.html" style="width: {width}px"></iframe>'


def picture(browser: str, directory: Path, html: str, width: int, *options: str) -> np.ndarray:
    """The luminance of what is shown, 0 to 1."""
    (directory / "page.html").write_text(html, encoding="utf-8")
    shot = directory / "shot.png"
    browse(
        browser,
        directory,
        FRAMES.format(frames=frame(width)),
        f"--screenshot={shot}",
        "--window-size=1280,1600",
        *options,
    )
    return np.asarray(imread(shot))[:, :width, :3].mean(axis=-1)


def test_the_page_works_in_a_browser_at_any_width(browser: str, tmp_path: Path, html: str) -> None:
    (tmp_path / "page.html").write_text(html.replace("<head>", f"<head>{PROBE}"), encoding="utf-8")
    widths = (1280, 390, 320)
    shown = browse(browser, tmp_path, FRAMES.format(frames="".join(map(frame, widths))), "--dump-dom")
    found = [json.loads(unescape(line)) for line in re.findall(r"<pre>(.*?)</pre>", shown)]
    assert sorted(each["width"] for each in found) == sorted(widths)
    for each in found:
        assert each["content"] <= each["width"]
        assert each["opened"] <= each["width"]
        assert (each["seen"], each["fetched"]) == ([], [])
        assert each["first"] == [ODD, "oxide", "paint", "brass"]
        assert (each["named"], each["direction"]) == ([ODD, "brass", "oxide", "paint"], "ascending")
        assert (each["reversed"], each["turned"]) == (["paint", "oxide", "brass", ODD], "descending")
        assert each["numbers"] == ["paint", "brass", "oxide", ODD]  # by the albedo of the model
        assert each["filtered"] == ["oxide"]
        assert each["open"] == ["m-brass"]


@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_is_ink_on_paper(browser: str, tmp_path: Path, html: str, width: int) -> None:
    light = picture(browser, tmp_path, html, width)
    assert np.median(light) > 0.95
    assert (light < 0.4).mean() > 0.01


def test_the_dark_page_is_dark(browser: str, tmp_path: Path, html: str) -> None:
    dark = picture(browser, tmp_path, html, 1280, "--blink-settings=preferredColorScheme=0")
    assert np.median(dark) < 0.1
    assert (dark > 0.6).mean() > 0.01
    assert (dark > 0.9).mean() < 0.05
