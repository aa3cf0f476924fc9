"""The files of the explorer: which are served, how they may be kept, and that nothing comes from elsewhere."""

from __future__ import annotations

import asyncio
import gzip
import importlib.metadata
import re
from importlib.resources import files
from pathlib import Path

import httpx
import pytest

from brdfdb_api.http import pages
from brdfdb_api.http.app import create_app
from brdfdb_api.serving.settings import Settings

FOLDER = Path(pages.__file__).parents[1] / "explorer"
NAMES = sorted(path.name for path in FOLDER.iterdir())
PLOTLY = f"/explorer/plotly.js?{importlib.metadata.version('plotly')}"
OUTSIDE = re.compile(r"(?:https?:)?//[a-z0-9-]+\.[a-z0-9.-]+[^\s\"']*")
SVG = "http://www.w3.org/2000/svg"  # a name, not an address


def get(path: str, **headers: str) -> httpx.Response:
    """What an application without a store answers."""

    async def send() -> httpx.Response:
        transport = httpx.ASGITransport(create_app(Settings(store=Path("no-store"))))
        async with httpx.AsyncClient(transport=transport, base_url="http://test") as client:
            return await client.get(path, headers={name.replace("_", "-"): value for name, value in headers.items()})

    return asyncio.run(send())


def test_what_is_served_is_what_there_is() -> None:
    assert sorted(pages.MEDIA) == sorted([*NAMES, "views.js"])


def test_the_page_finds_the_views_by_the_names_of_their_modules() -> None:
    found = [name for name in NAMES if name.startswith("view_")]
    assert len(found) >= 6
    script = get("/explorer/views.js").text
    assert re.findall(r'from "\./(.*?)"', script) == found
    others = [(FOLDER / name).read_text(encoding="utf-8") for name in NAMES if name not in found]
    assert not any("view_" in text for text in others)  # nothing else names a module of a view


@pytest.mark.parametrize("name", NAMES)
def test_a_file_is_served_to_be_asked_for_again(name: str) -> None:
    answer = get(f"/explorer/{name}")
    kind = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}[Path(name).suffix]
    assert (answer.status_code, answer.headers["content-type"]) == (200, f"{kind}; charset=utf-8")
    assert answer.headers["cache-control"] == "no-cache"
    again = get(f"/explorer/{name}", if_none_match=answer.headers["etag"])
    assert (again.status_code, again.content) == (304, b"")
    assert answer.headers["etag"] == again.headers["etag"]


@pytest.mark.parametrize("name", NAMES)
def test_a_file_of_the_explorer_says_in_its_first_lines_what_lives_there(name: str) -> None:
    first = "\n".join((FOLDER / name).read_text(encoding="utf-8").splitlines()[:2])
    assert re.search(r"^(// |/\* |<!-- )[A-Z].*\.( \*/| -->)?$", first, re.MULTILINE), first


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_fetched_from_elsewhere(name: str) -> None:
    text = (FOLDER / name).read_text(encoding="utf-8").replace(SVG, "")
    assert OUTSIDE.findall(text) == []
    assert set(re.findall(r'from "\./(.*?)"', text)) <= {*NAMES, "views.js"}


def test_the_page_is_at_the_root_and_names_the_version_of_plotly() -> None:
    answer = get("/")
    assert answer.text == get("/explorer/index.html").text
    assert f'href="{PLOTLY[1:]}"' in answer.text
    assert 'rel="icon" href="data:,"' in answer.text
    assert "PLOTLY_VERSION" not in answer.text


def test_scripts_come_from_here_alone() -> None:
    for path in ("/", PLOTLY, *(f"/explorer/{name}" for name in NAMES)):
        policy = dict(part.split(" ", 1) for part in get(path).headers["content-security-policy"].split("; "))
        assert (policy["default-src"], policy["script-src"], policy["connect-src"]) == ("'none'", "'self'", "'self'")
        assert not OUTSIDE.search(" ".join(policy.values()))


def test_plotly_is_that_of_the_package_and_kept_for_good() -> None:
    content = files("plotly").joinpath("package_data", "plotly.min.js").read_bytes()
    plain = get(PLOTLY, accept_encoding="identity")
    assert plain.content == content
    assert "content-encoding" not in plain.headers
    packed = get(PLOTLY, accept_encoding="gzip")
    assert (packed.headers["content-encoding"], packed.content) == ("gzip", content)
    assert int(packed.headers["content-length"]) == len(gzip.compress(content, 6))
    for answer in (plain, packed):
        assert "immutable" in answer.headers["cache-control"]
        assert answer.headers["vary"] == "Accept-Encoding"
    assert plain.headers["etag"] != packed.headers["etag"]
    assert get(PLOTLY, accept_encoding="gzip", if_none_match=packed.headers["etag"]).status_code == 304


@pytest.mark.parametrize("path", ["nothing.js", "..%2fpages.py", "%2e%2e/pages.py", "explorer%2fmain.js", "main.js%00"])
def test_any_other_file_is_unknown(path: str) -> None:
    answer = get(f"/explorer/{path}")
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"
    assert b"import" not in answer.content


def test_pages_are_no_part_of_the_interface() -> None:
    paths = create_app(Settings()).openapi()["paths"]
    assert [path for path in paths if path == "/" or path.startswith("/explorer")] == []
