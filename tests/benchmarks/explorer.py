"""The times of the explorer: ``python tests/benchmarks/explorer.py [--store brdf-store]``.

Opens pages of `brdfdb serve` in Chromium, each with an empty cache, and prints the time from the request of the page to
its first picture, and to all of its pictures: of the first page, of each view by a link, and over a connection of
400 kbit/s that delays each answer by 400 ms. Then a slider moves, and the time from its move is printed.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.api.chromium import Chromium, milliseconds, shown
from tests.benchmarks.recording import Column, Run
from tests.benchmarks.service import NAMES, made_store, served

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
SLOW = {"latency": 400, "downloadThroughput": 50_000, "uploadThroughput": 50_000}  # [ms], [byte/s]
FAST = {"latency": 0, "downloadThroughput": -1, "uploadThroughput": -1}
VIEWS = ("together", "sphere", "cut", "hemisphere", "slice", "albedo", "spectrum")
SLID = ("cut", "sphere", "together")
LOADED = "[...document.querySelectorAll('#list img')].every((each) => !each.src || each.complete)"
REPEATS, SLID_TIMES = 5, 10
MEASURED = "Time from the request of a page of the explorer, or the move of a slider, to the picture."


def program() -> str | None:
    """Return the path of a Chromium, or None."""
    return next((path for name in PROGRAMS if (path := shutil.which(name))), None)


def main(arguments: Sequence[str] | None = None) -> int:
    """Open pages, move a slider, and print the times."""
    run = Run("explorer", "speed", "The explorer", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--store", help="by default two tables are built")
    options = run.parse(parser, arguments)
    binary = program()
    if binary is None:
        parser.error(f"none of {', '.join(PROGRAMS)} is on PATH")
    with tempfile.TemporaryDirectory() as folder:
        store = options.store or str(Path(folder, "store"))
        if options.store is None:
            made_store(Path(store), options.quick)
        with served(store) as (port, _, _), Chromium(binary, Path(folder, "profile")) as browser:
            measure(run, browser, f"http://127.0.0.1:{port}/", options.quick)
    run.end()
    return 0


def measure(run: Run, browser: Chromium, address: str, quick: bool) -> None:
    """Add the tables."""
    repeats = 1 if quick else REPEATS
    browser.send("Network.enable")
    browser.send("Network.setCacheDisabled", cacheDisabled=True)
    names = ("first, median", "first, longest", "all, median", "all, longest")
    columns = (Column(name=name, unit="ms") for name in names)
    table = run.table("From the request to the pictures", Column(name="page", width=36), "times", *columns)

    def add(title: str, link: str, network: dict[str, int]) -> None:
        browser.send("Network.emulateNetworkConditions", offline=False, **network)
        first, whole = [], []
        for _ in range(repeats):
            browser.open(address + link)
            shown(browser)
            first.append(browser.until("performance.getEntriesByName('first')[0]?.duration"))
            whole.append(milliseconds(browser))
            browser.until(LOADED)  # what still comes would take its share of the connection from the next page
        table.add(title, repeats, *(float(each(times)) for times in (first, whole) for each in (np.median, max)))

    add("the first page", "", FAST)
    for view in VIEWS[:2] if quick else VIEWS:
        add(f"a link to the view {view}", f"#material={NAMES[1]}&view={view}", FAST)
    add("the first page, 400 kbit/s and 400 ms", "", SLOW)
    browser.send("Network.emulateNetworkConditions", offline=False, **FAST)
    slid = run.table(
        "From the move of a slider to the pictures",
        Column(name="view", width=12),
        "times",
        *(Column(name=name, unit="ms") for name in ("median", "longest")),
    )
    for view in SLID[:1] if quick else SLID:
        browser.open(f"{address}#material={NAMES[1]}&view={view}")
        shown(browser)
        times = []
        for angle in range(20, 20 + (2 if quick else SLID_TIMES)):
            browser.evaluate(
                f"performance.clearMeasures(); controls.elements.theta_i.value = {angle};"
                "controls.elements.theta_i.dispatchEvent(new Event('input', { bubbles: true }))"
            )
            shown(browser, f"theta_i={angle}")
            times.append(milliseconds(browser))
        slid.add(view, len(times), float(np.median(times)), max(times))


if __name__ == "__main__":
    sys.exit(main())
