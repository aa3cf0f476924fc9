"""The site: it builds without a warning, every link leads somewhere, and nothing that it promises is missing."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import tomllib
from pathlib import Path

import pytest
from numba.core.dispatcher import Dispatcher
from sphinx.util.inventory import InventoryFile

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


def public_names(module_name: str) -> set[str]:
    """The public functions and classes of a module, and what it exports, by the names of their homes."""
    module = importlib.import_module(module_name)
    exported = getattr(module, "__all__", ())
    names = set()
    for name, value in vars(module).items():
        called = inspect.isclass(value) or inspect.isfunction(value) or isinstance(value, Dispatcher)
        if called and not name.startswith("_") and value.__module__ == module_name:
            names.add(f"{module_name}.{name}")
    for name in exported:
        value = getattr(module, name)
        if inspect.isclass(value) or inspect.isfunction(value):
            names.add(f"{value.__module__}.{value.__qualname__}")
        elif not inspect.ismodule(value):
            names.add(f"{module_name}.{name}")
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
    inventory = InventoryFile.loads((site / "objects.inv").read_bytes(), uri="")
    documented = {}
    for kind, items in inventory.data.items():
        if kind.startswith("py:"):
            documented.update({name: item.uri for name, item in items.items()})
    names = {name for module in public_modules() for name in public_names(module)}
    assert len(names) > 400
    assert sorted(names - documented.keys()) == []
    for name in names:
        address, _, anchor = documented[name].partition("#")
        assert anchor in pages[site / address].anchors, name


def test_every_figure_has_a_page_with_its_plots_and_statements(site: Path, pages: dict[Path, Page]) -> None:
    for key in (*GALLERY, *ATLAS):
        path = site / "gallery" / "figures" / f"{key}.html"
        assert {"plots"} <= pages[path].classes
        text = path.read_text(encoding="utf-8")
        assert "<svg" in text
        assert "<em>Seen:</em>" in text
        assert "Does not hold" not in text or key in KNOWN_NOT_TO_HOLD


# Statements of the papers that our computation contradicts, each said so on its page
KNOWN_NOT_TO_HOLD: set[str] = set()


def test_every_material_has_a_page_with_its_verdict_and_files(site: Path, pages: dict[Path, Page]) -> None:
    for name in brdfdb.presets():
        page = pages[site / "gallery" / "materials" / f"{name}.html"]
        assert {"chip", "plots"} <= page.classes
        files = {link.rpartition("/")[2] for link in page.links if "_downloads" in link}
        assert {f"{name}.zarr.zip", f"{name}.exr", f"{name}.toml"} <= files
        assert f"gallery/materials/{name}.html" in {
            path.relative_to(site).as_posix() for path in pages if path.parent.name == "materials"
        }


def test_the_recipe_of_a_material_builds_that_material(site: Path, tmp_path: Path) -> None:
    (path,) = site.rglob("scene-copper-sphere.toml")
    default = tomllib.loads((ROOT / "pipelines/brdfdb_pipelines/recipes/default.toml").read_text(encoding="utf-8"))
    recipe = tomllib.loads(path.read_text(encoding="utf-8"))
    assert recipe.pop("title") != default.pop("title")
    assert recipe == {**default, "materials": ["scene-copper-sphere"]}


def test_pages_with_code_have_run(site: Path, pages: dict[Path, Page]) -> None:
    executed = [path for path in (ROOT / "docs").rglob("*.md") if "file_format: mystnb" in path.read_text("utf-8")[:99]]
    tutorials = {path for path in (ROOT / "docs" / "tutorials").glob("*.md") if path.stem != "index"}
    assert tutorials <= set(executed)
    for path in executed:
        page = pages[site / path.relative_to(ROOT / "docs").with_suffix(".html")]
        assert "cell_output" in page.classes, path
        assert "traceback" not in page.classes, path


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_page_is_wider_than_a_phone(site: Path, pages: dict[Path, Page], chromium: Chromium, scheme: str) -> None:
    wide = {}
    for path in pages:
        chromium.open(path.as_uri(), width=NARROW, scheme=scheme, touch=True)
        chromium.until("document.readyState == 'complete' && location.protocol == 'file:'")
        if (width := chromium.evaluate("document.documentElement.scrollWidth")) > NARROW:
            wide[path.relative_to(site).as_posix()] = width
        assert chromium.evaluate("document.documentElement.dataset.theme") == scheme
    assert wide == {}
