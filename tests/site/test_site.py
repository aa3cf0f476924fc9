"""The site: it builds without a warning, every link leads somewhere, and nothing that it promises is missing."""

from __future__ import annotations

import functools
import importlib
import inspect
import pkgutil
import runpy
import threading
import tomllib
from collections.abc import Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from numba.core.dispatcher import Dispatcher

import brdfdb
from brdfdb.atlas import ATLAS
from brdfdb.gallery import GALLERY
from tests.api.chromium import Chromium
from tests.site.conftest import ROOT
from tests.site.pages import Page, broken_links, read_pages

NARROW = 390  # pixels of a phone


def public_modules() -> list[str]:
    """The names of all modules of the library without an underscore in front."""
    names = [module.name for module in pkgutil.walk_packages(brdfdb.__path__, "brdfdb.")]
    return ["brdfdb", *(name for name in names if not any(part.startswith("_") for part in name.split(".")))]


def public_names(module_name: str) -> list[set[str]]:
    """Names under which the site may have each public function and class of a module, and each of its exports."""
    module = importlib.import_module(module_name)
    names = []
    for name, value in vars(module).items():
        called = inspect.isclass(value) or inspect.isfunction(value) or isinstance(value, Dispatcher)
        if called and not name.startswith("_") and value.__module__ == module_name:
            names.append({f"{module_name}.{name}"})
    for name in getattr(module, "__all__", ()):
        value = getattr(module, name)
        if not inspect.ismodule(value):
            home = f"{value.__module__}.{value.__qualname__}" if hasattr(value, "__qualname__") else ""
            names.append({f"{module_name}.{name}", home} - {""})
    return names


def test_every_link_inside_the_site_leads_somewhere(pages: dict[Path, Page]) -> None:
    assert len(pages) > 200
    assert broken_links(pages) == []


def test_a_broken_link_is_noticed(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text('<p id="here"><a href="b.html"></a><a href="#here"></a><a href="#gone"></a>')
    (tmp_path / "c.html").write_text('<img src="picture.png"><a href="a.html#gone"></a><a href="a.html#here"></a>')
    assert sorted(broken_links(read_pages(tmp_path))) == [
        "a.html: #gone",
        "a.html: b.html",
        "c.html: a.html#gone",
        "c.html: picture.png",
    ]


def test_every_public_name_is_on_the_site(site: Path, pages: dict[Path, Page]) -> None:
    from sphinx.util.inventory import InventoryFile

    inventory = InventoryFile.loads((site / "objects.inv").read_bytes(), uri="")
    documented = {}
    for kind, items in inventory.data.items():
        if kind.startswith("py:"):
            documented.update({name: item.uri for name, item in items.items()})
    names = [allowed for module in public_modules() for allowed in public_names(module)]
    assert len(names) > 500
    assert [sorted(allowed) for allowed in names if allowed.isdisjoint(documented)] == []
    for allowed in names:
        address, _, anchor = documented[min(allowed & documented.keys())].partition("#")
        assert anchor in pages[site / address].anchors, allowed


def test_every_figure_has_a_page_with_its_plots_and_statements(site: Path, pages: dict[Path, Page]) -> None:
    for key in (*GALLERY, *ATLAS):
        path = site / "gallery" / "figures" / f"{key}.html"
        assert {"plots"} <= pages[path].classes
        text = path.read_text(encoding="utf-8")
        assert "<svg" in text
        assert "<em>Seen:</em>" in text


def test_every_material_has_a_page_with_its_verdict_and_files(site: Path, pages: dict[Path, Page]) -> None:
    for name in brdfdb.presets():
        page = pages[site / "gallery" / "materials" / f"{name}.html"]
        assert {"chip", "plots"} <= page.classes
        files = {link.rpartition("/")[2] for link in page.links if "_downloads" in link}
        assert {f"{name}.zarr.zip", f"{name}.exr", f"{name}.svg", f"{name}.toml"} <= files
        assert f"gallery/materials/{name}.html" in {
            path.relative_to(site).as_posix() for path in pages if path.parent.name == "materials"
        }


def test_the_recipe_of_a_material_builds_that_material(site: Path) -> None:
    (path,) = site.rglob("scene-copper-sphere.toml")
    default = tomllib.loads((ROOT / "pipelines/brdfdb_pipelines/recipes/default.toml").read_text(encoding="utf-8"))
    recipe = tomllib.loads(path.read_text(encoding="utf-8"))
    assert recipe.pop("title") != default.pop("title")
    assert recipe == {**default, "materials": ["scene-copper-sphere"]}


def test_pages_with_code_have_run(site: Path, pages: dict[Path, Page]) -> None:
    executed = [path for path in (ROOT / "docs").rglob("*.md") if "file_format: mystnb" in path.read_text("utf-8")[:99]]
    tutorials = {path for path in (ROOT / "docs" / "tutorials").glob("*.md") if path.stem != "index"}
    assert tutorials <= set(executed)
    has_llvm = runpy.run_path(str(ROOT / "docs" / "conf.py"))["llvm_path"]() != ""
    for path in executed:
        built = site / path.relative_to(ROOT / "docs").with_suffix(".html")
        page = pages[built]
        if path.stem != "mitsuba" or has_llvm:  # that page runs where LLVM 19 is installed
            assert "cell_output" in page.classes, path
        assert "traceback" not in page.classes, path
        assert "&lt;Figure size" not in built.read_text(encoding="utf-8"), path  # the words in place of a picture


@pytest.fixture
def address(site: Path) -> Iterator[str]:
    """Serve the site, and yield its address."""

    class Handler(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Handler, directory=str(site))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


def opened(chromium: Chromium, page: str, width: int = NARROW, scheme: str = "light") -> int:
    """Open a page, and return the width of its content."""
    chromium.open(page, width=width, scheme=scheme)
    chromium.until("document.readyState == 'complete' && location.protocol == 'http:'")
    return int(chromium.evaluate("document.documentElement.scrollWidth"))


def test_no_page_is_wider_than_a_phone(site: Path, pages: dict[Path, Page], chromium: Chromium, address: str) -> None:
    names = [path.relative_to(site).as_posix() for path in pages]
    alike = ("reference/api/", "gallery/figures/", "gallery/materials/")  # of these, some
    shown = [name for index, name in enumerate(names) if not name.startswith(alike) or index % 30 == 0]
    widths = {name: opened(chromium, f"{address}/{name}") for name in shown}
    assert {name: width for name, width in widths.items() if width > NARROW} == {}
    (site / "wide.html").write_text("<p style='width: 500px'>wide</p>", encoding="utf-8")
    assert opened(chromium, f"{address}/wide.html") > NARROW
    (site / "wide.html").unlink()


def test_plots_are_light_in_the_dark(chromium: Chromium, address: str) -> None:
    colour = "getComputedStyle(document.documentElement).getPropertyValue('--truth')"
    for scheme, expected in (("light", "#1b2028"), ("dark", "#e4e8ee")):
        opened(chromium, f"{address}/gallery/figures/ward-1992-fig-06.html", 1280, scheme)
        assert chromium.evaluate("document.documentElement.dataset.theme") == scheme
        assert chromium.evaluate(colour).strip() == expected
