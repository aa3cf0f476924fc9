"""The files of the explorer: which are served, how they may be cached, and that nothing comes from other servers."""

from __future__ import annotations

import gzip
import os
import re
import shutil
import subprocess
from pathlib import Path

import httpx
import pytest

from brdfdb_api.http import pages
from tests.api.a_store import client_of

FOLDER = Path(str(pages.FOLDER))
NAMES = sorted(path.name for path in FOLDER.iterdir() if path.suffix in (".html", ".css", ".js"))
SCRIPTS = [name for name in NAMES if name.endswith(".js")]
OUTSIDE = re.compile(r"(?:https?:)?//[a-z0-9-]+\.[a-z0-9.-]+[^\s\"']*")
FIRST = ("index.html", "begin.js", "explorer.css", "explorer.js")  # before there is a picture
IMPORTED = r'from "\./(.*?)"'
VIEWS = """\
/** @type {Record<string, import("./main.js").View>} */
export const VIEWS = {};
"""
SVG = "http://www.w3.org/2000/svg"  # a name, not an address
CLIENT = client_of(Path("no-store"))


def get(path: str, **headers: str) -> httpx.Response:
    """The answer of an application without a store."""
    return CLIENT.get(path, headers={name.replace("_", "-"): value for name, value in headers.items()})


def test_a_file_is_served_to_be_asked_for_again() -> None:
    assert sorted(pages.MEDIA) == sorted([*NAMES, "explorer.js", "views.js"])
    for name in NAMES:
        answer = get(f"/explorer/{name}")
        kind = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}[Path(name).suffix]
        assert (answer.status_code, answer.headers["content-type"]) == (200, f"{kind}; charset=utf-8")
        assert answer.headers["cache-control"] == "no-cache"
        again = get(f"/explorer/{name}", if_none_match=answer.headers["etag"])
        assert (again.status_code, again.content) == (304, b"")
        assert answer.headers["etag"] == again.headers["etag"]


def test_the_page_finds_the_views_by_the_names_of_their_modules() -> None:
    views = [name for name in NAMES if name.startswith("view_")]
    assert len(views) >= 6
    assert re.findall(IMPORTED, get("/explorer/views.js").text) == views
    others = [(FOLDER / name).read_text(encoding="utf-8") for name in NAMES if name not in views]
    assert not any("view_" in text for text in others)  # no other file names a module of a view


def test_nothing_is_fetched_from_other_servers() -> None:
    for name in NAMES:
        text = (FOLDER / name).read_text(encoding="utf-8").replace(SVG, "")
        assert OUTSIDE.findall(text) == []
        assert set(re.findall(IMPORTED, text)) <= {*NAMES, "views.js"}
    for path in ("/", *(f"/explorer/{name}" for name in NAMES)):
        policy = dict(part.split(" ", 1) for part in get(path).headers["content-security-policy"].split("; "))
        assert (policy["default-src"], policy["script-src"], policy["connect-src"]) == ("'none'", "'self'", "'self'")
        assert policy["style-src"] == "'self'"
        assert not OUTSIDE.search(" ".join(policy.values()))


def test_the_page_is_at_the_root_and_asks_for_one_script_after_early_requests() -> None:
    answer = get("/")
    assert answer.text == get("/explorer/index.html").text
    assert re.findall(r'<script .*src="(.*?)"', answer.text) == ["explorer/begin.js", "explorer/explorer.js"]
    assert 'rel="icon" href="data:,"' in answer.text
    sizes = [get(f"/explorer/{name}", accept_encoding="gzip").headers["content-length"] for name in FIRST]
    assert sum(int(size) for size in sizes) < 45_000  # a second of a slow connection


def test_the_script_has_every_module_after_those_that_it_imports() -> None:
    script = get("/explorer/explorer.js").text
    order = re.findall(r"^modules\['(.*?)'\] = ", script, re.MULTILINE)
    assert sorted(order) == sorted([*SCRIPTS, "views.js"])
    for name in order:
        text = get(f"/explorer/{name}").text
        assert {order.index(each) for each in re.findall(IMPORTED, text)} <= set(range(order.index(name)))
        if name in SCRIPTS:  # imports and exports have the forms that the script can join
            imports = r"^import (?:\{[\w\s,]+\}|\* as \w+) from \"\./[\w.]+\";$"
            exports = r"^export (?:(?:async )?(?:const|function\*?|class) \w+|default \{)"
            joined = [*re.findall(imports, text, re.MULTILINE), *re.findall(exports, text, re.MULTILINE)]
            assert len(joined) == len(re.findall(r"^(?:import|export)\b", text, re.MULTILINE)), name


@pytest.mark.judge
def test_the_script_runs_where_node_reads_it(tmp_path: Path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    (tmp_path / "explorer.mjs").write_text(get("/explorer/explorer.js").text, encoding="utf-8")
    assert subprocess.run([node, "--check", tmp_path / "explorer.mjs"]).returncode == 0


@pytest.mark.judge
def test_types_are_what_their_comments_say(tmp_path: Path) -> None:
    tsc = shutil.which("tsc", path=os.pathsep.join([os.environ.get("BRDFDB_NODE", ""), os.environ["PATH"]]))
    if tsc is None:
        pytest.skip("tsc is not installed; BRDFDB_NODE names the folder of the programs of npm")
    for name in SCRIPTS:
        shutil.copy(FOLDER / name, tmp_path)
    (tmp_path / "views.js").write_text(VIEWS, encoding="utf-8")
    options = "--allowJs --checkJs --noEmit --strict --noUnusedLocals --target es2022 --module es2022"
    libraries = "--lib es2023,dom,dom.iterable --moduleResolution bundler"
    command = [tsc, *options.split(), *libraries.split(), *sorted(path.name for path in tmp_path.iterdir())]
    answer = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (answer.returncode, answer.stdout) == (0, "")


def test_files_are_compressed_for_those_who_accept_it() -> None:
    for name in ["index.html", "explorer.css", "explorer.js", "main.js"]:
        plain, packed = (get(f"/explorer/{name}", accept_encoding=each) for each in ("identity", "gzip"))
        assert "content-encoding" not in plain.headers
        assert (packed.headers["content-encoding"], packed.content) == ("gzip", plain.content)
        assert int(packed.headers["content-length"]) == len(gzip.compress(plain.content, 9))
        assert plain.headers["vary"] == packed.headers["vary"] == "Accept-Encoding"
        assert plain.headers["etag"] != packed.headers["etag"]
        again = get(f"/explorer/{name}", accept_encoding="gzip", if_none_match=packed.headers["etag"])
        assert again.status_code == 304


def test_any_other_file_is_unknown() -> None:
    for path in ["nothing.js", "..%2fpages.py", "%2e%2e/pages.py", "explorer%2fmain.js", "main.js%00"]:
        answer = get(f"/explorer/{path}")
        assert answer.status_code == 404
        assert answer.headers["content-type"] == "application/problem+json"
        assert b"import" not in answer.content
