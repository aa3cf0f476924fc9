"""Publication of the tables of a choice, with their errors measured as in a build."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import StoreError
from brdfdb.store.publication import publish_layout
from brdfdb.store.reader import Store
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import frame
from brdfdb_pipelines import terminal


class Built(NamedTuple):
    """The revision that holds the table of a choice, and a sentence on the revision before it."""

    revision: str
    sentence: str


def build(
    root: Path, layouts: Mapping[str, Layout], values: Mapping[str, NDArray[np.float32] | None] | None = None
) -> dict[str, Built]:
    """Publish tables under names of materials, each with its error against the model that it stands for.

    Parameters
    ----------
    root : Path
        Directory of an existing store.
    layouts : mapping
        Layouts by the name under which their table is published. A table that is current already stays.
    values : mapping, optional
        Values of tables by the same names, where they are known. Other tables are tabulated.

    Raises
    ------
    StoreError
        If the store cannot be written.
    """
    built = {}
    with terminal.progress() as bar:
        task = bar.add_task("building tables", total=len(layouts))
        for name, layout in layouts.items():
            built[name] = _build(root, name, layout, (values or {}).get(name))
            bar.advance(task)
    return built


def _build(root: Path, name: str, layout: Layout, values: NDArray[np.float32] | None) -> Built:
    store = Store(root)
    if _is_there(store, name, layout):
        return Built(store.head(name), f"{store.head(name)} of the store is this table")
    before = _before(store, name)
    revision, _, error = publish_layout(root, name, layout, values=values)
    model = layout.source.attributes().get("model", "a function")
    stated = f"{model}, whose error (p99) is {terminal.error(error.overall.p99)}"
    return Built(revision, f"{revision} is a table of {stated}; it {before}")


def _before(store: Store, name: str) -> str:
    """Return a phrase on what a new revision does to the current one."""
    if name not in store:
        return "is new in the store"
    try:
        head = store.summary(name)
    except StoreError:
        return "replaces one that was damaged"
    return f"replaces {head['revision']}, of {head['model']}, whose error was {terminal.error(head.get('error_p99'))}"


def _is_there(store: Store, name: str, layout: Layout) -> bool:
    """Return True if the current table has this layout, for any reason, states its error, and is undamaged."""
    if name not in store:
        return False
    wanted = frame(layout)
    arrays = {**wanted.variables, **wanted.coordinates}
    try:
        store.verify(name)
        stored, metadata = store.dataset(name), store.metadata(name)
    except StoreError:
        return False
    known = metadata.attributes()
    return (
        metadata.error is not None
        and all(known.get(key) == value for key, value in wanted.attrs.items() if key != "reason")
        and all(key in stored and np.array_equal(stored[key], array.values) for key, array in arrays.items())
    )


def with_reason(layout: Layout, title: str, wanted: str) -> Layout:
    """Return a layout whose reason names the scene that it was chosen for."""
    planned = f"; {layout.reason}" if layout.reason else ""
    return replace(layout, reason=f"{title}, chosen for {wanted}{planned}")
