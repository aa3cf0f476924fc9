"""The page of an audit in a browser: nothing wider than its window, what can be clicked works, dark is dark."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from brdfdb_pipelines import audit_page, figure_look
from tests.pipelines.a_report import ODD, whole

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
  sort(4); result.numbers = names();
  const filter = document.getElementById("filter");
  filter.value = "he_torrance"; filter.dispatchEvent(new Event("input")); result.filtered = names();
  filter.value = ""; filter.dispatchEvent(new Event("input"));
  location.hash = "m-brass";
  URL.createObjectURL = blob => { result.saved = blob.text(); return "blob:"; };
  HTMLAnchorElement.prototype.click = () => {};
  document.querySelector(".save").click();
  setTimeout(async () => {
    result.saved = await result.saved;
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
def html() -> str:
    return audit_page.render(whole())


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
    return subprocess.run(run, capture_output=True, text=True, check=True, timeout=300).stdout


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
        assert each["first"] == [ODD, "gold", "oxide", "paint", "brass"]
        assert (each["named"], each["direction"]) == ([ODD, "brass", "gold", "oxide", "paint"], "ascending")
        assert (each["reversed"], each["turned"]) == (["paint", "oxide", "gold", "brass", ODD], "descending")
        assert each["numbers"] == ["paint", "brass", "oxide", "gold", ODD]  # by the albedo of the model
        assert each["filtered"] == ["oxide"]
        assert each["open"] == ["m-brass"]
        assert ET.fromstring(each["saved"]).tag == "{http://www.w3.org/2000/svg}svg"
        assert figure_look.OURS in each["saved"]
        assert "var(" not in each["saved"]


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
