"""The page of an audit in a browser: it is not wider than its window, its controls work, and the dark page is dark."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from brdfdb_pipelines import audit_page, figure_look
from tests.api.chromium import Chromium
from tests.pipelines.a_report import ODD, whole

USE = """(async () => {
  const rows = () => [...document.querySelectorAll("#findings tbody tr")].filter(row => !row.hidden);
  const names = () => rows().map(row => row.cells[0].textContent);
  const sort = index => document.querySelectorAll("#findings thead button")[index].click();
  const sorted = () => document.querySelector("#findings [aria-sort]").getAttribute("aria-sort");
  const result = { content: document.documentElement.scrollWidth, first: names() };
  sort(0); result.named = names(); result.direction = sorted();
  sort(0); result.reversed = names(); result.turned = sorted();
  sort(4); result.numbers = names();
  const filter = document.getElementById("filter");
  filter.value = "he_torrance"; filter.dispatchEvent(new Event("input")); result.filtered = names();
  filter.value = ""; filter.dispatchEvent(new Event("input"));
  const jumped = new Promise(done => addEventListener("hashchange", () => setTimeout(done)));
  location.hash = "m-brass";
  await jumped;
  result.open = [...document.querySelectorAll("details[open]")].map(each => each.id);
  URL.createObjectURL = blob => { result.saved = blob.text(); return "blob:"; };
  HTMLAnchorElement.prototype.click = () => {};
  document.querySelector(".save").click();
  result.saved = await result.saved;
  for (const each of document.querySelectorAll("details")) each.open = true;
  result.opened = document.documentElement.scrollWidth;
  const fetched = performance.getEntriesByType("resource").map(each => each.name);
  result.fetched = fetched.filter(name => !name.startsWith("data:"));
  return result;
})()"""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The address of the page of a report."""
    path: Path = tmp_path_factory.mktemp("page") / "page.html"
    path.write_text(audit_page.render(whole()), encoding="utf-8")
    return path.as_uri()


def opened(chromium: Chromium, page: str, width: int, scheme: str = "light") -> None:
    chromium.open(page, width=width, height=1600, scheme=scheme)
    chromium.until("document.readyState == 'complete' && location.protocol == 'file:'")


@pytest.mark.parametrize("width", [1280, 390, 320])
def test_the_page_works_in_a_browser_at_any_width(chromium: Chromium, page: str, width: int) -> None:
    opened(chromium, page, width)
    found = chromium.evaluate(USE)
    assert chromium.errors == []
    assert found["fetched"] == []
    assert max(found["content"], found["opened"]) <= width
    assert found["first"] == [ODD, "gold", "oxide", "paint", "brass"]
    assert (found["named"], found["direction"]) == ([ODD, "brass", "gold", "oxide", "paint"], "ascending")
    assert (found["reversed"], found["turned"]) == (["paint", "oxide", "gold", "brass", ODD], "descending")
    assert found["numbers"] == ["paint", "brass", "oxide", "gold", ODD]  # by the albedo of the model
    assert found["filtered"] == ["oxide"]
    assert found["open"] == ["m-brass"]
    assert ET.fromstring(found["saved"]).tag == "{http://www.w3.org/2000/svg}svg"
    assert figure_look.OURS in found["saved"]
    assert "var(" not in found["saved"]


@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_is_ink_on_paper(chromium: Chromium, page: str, width: int) -> None:
    opened(chromium, page, width)
    light = chromium.picture()
    assert np.median(light) > 0.95
    assert (light < 0.4).mean() > 0.01


def test_the_dark_page_is_dark(chromium: Chromium, page: str) -> None:
    opened(chromium, page, 1280, "dark")
    dark = chromium.picture()
    assert np.median(dark) < 0.1
    assert (dark > 0.6).mean() > 0.01
    assert (dark > 0.9).mean() < 0.05
