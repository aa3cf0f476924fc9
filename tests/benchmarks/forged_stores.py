"""Stores with one leaf forged: what a table or its pointer says is changed, and every seal is made good again."""

from __future__ import annotations

import copy
import hashlib
import json
import re
from collections.abc import Mapping
from pathlib import Path as File
from typing import Any

import numpy as np

from brdfdb.materials import FunctionSource, presets
from brdfdb.measurements import MeasuredSource
from brdfdb.parameters import Floats
from brdfdb.store.files import read_sealed, write_sealed
from brdfdb.store.paths import manifest_path, pointer_path
from brdfdb.store.publication import publish, publish_layout
from brdfdb.store.records import summary_of
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.planner import plan
from tests.measurements.made_up import scattered
from tests.tables.test_mixture import NM, PAINTED
from tests.tables.test_polarisation import polarised, rough

Path = tuple[str | int, ...]


def leaves(value: Any, path: Path = ()) -> list[Path]:
    """Return the path of every leaf; an empty list or object is one."""
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [leaf for key, part in parts for leaf in leaves(part, (*path, key))] if parts and value else [path]


def changed(document: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Return a document with one leaf changed to a plausible value of its kind."""
    forged: Any = copy.deepcopy(dict(document))
    inside = forged
    for key in path[:-1]:
        inside = inside[key]
    inside[path[-1]] = plausible(inside[path[-1]])
    assert isinstance(forged, dict)
    return forged


def plausible(value: Any) -> Any:
    """Return another value of the same kind: a tenth more, the next whole number, the last digit of a text raised."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return 1.1 * value if abs(value) > 1e-6 else value + 1e-3 if value else 0.5
    if isinstance(value, str):
        at = [match.start() for match in re.finditer(r"\d", value)]
        return f"{value[: at[-1]]}{(int(value[at[-1]]) + 1) % 10}{value[at[-1] + 1 :]}" if at else f"{value} too"
    return {"rho": None} if value == {} else ["too"] if value == [] else 550.0


def forge_attributes(root: File, name: str, attributes: Mapping[str, Any]) -> None:
    """Give a table other attributes; its manifest and its pointer agree with them."""
    group = root / "materials" / name / "r000001"
    metadata = json.loads((group / "zarr.json").read_bytes())
    metadata["attributes"] = dict(attributes)
    data = json.dumps(metadata).encode()
    (group / "zarr.json").write_bytes(data)
    manifest = read_sealed(manifest_path(group), name)
    manifest["files"]["zarr.json"] = {"size": len(data), "sha256": hashlib.sha256(data).hexdigest()}
    stored = sum(entry["size"] for entry in manifest["files"].values())
    summary = summary_of(TableMetadata.read(attributes), stored, manifest["summary"]["created"])
    forge_summary(root, name, dict(summary), manifest)


def forge_summary(root: File, name: str, summary: Mapping[str, Any], manifest: dict[str, Any] | None = None) -> None:
    """Let manifest and pointer of a table say something else of it."""
    group = root / "materials" / name / "r000001"
    manifest = read_sealed(manifest_path(group), name) if manifest is None else manifest
    write_sealed(manifest_path(group), {**manifest, "summary": dict(summary)})
    digest = hashlib.sha256(manifest_path(group).read_bytes()).hexdigest()
    head = read_sealed(pointer_path(group.parent), name)
    write_sealed(pointer_path(group.parent), {**head, **summary, "manifests": {"r000001": digest}})


def _sheen(wi: Floats, wr: Floats, _: Floats | None) -> Floats:
    return 0.1 + 0.1 * (1.0 - wi[:, 2]) * (1.0 - wr[:, 2])


def _grey(wi: Floats, wr: Floats) -> Floats:
    return _sheen(wi, wr, None)[:, np.newaxis]


def build(root: File) -> dict[str, str]:
    """Build a small table of each kind; return what each name is."""
    known, painted = presets(), PAINTED.model_copy(update={"name": "painted", "source": "made up"})
    planned = {
        "scene-copper-sphere": (known["scene-copper-sphere"], [450.0, 550.0, 650.0], 0.1),  # spectral, specular part
        "rolled-brass": (known["rolled-brass"], None, 0.1),  # anisotropic
        "blue-plastic": (known["blue-plastic"], list(known["blue-plastic"].wavelengths_nm or ()), 0.1),  # known excess
        "cotton-towel": (known["cotton-towel"], None, 0.1),  # an approximation, whose error is measured
        "painted": (painted, NM[::8].tolist(), 0.1),  # a mixture
    }
    for name, (material, wavelengths, tolerance) in planned.items():
        at = None if wavelengths is None else np.array(wavelengths)
        layout = plan(material, at, tolerance)
        request = {**material.document(), "wavelength_nm": wavelengths, "grid": None, "tolerance": tolerance}
        publish_layout(root, name, layout, request)
    publish_layout(root, "made-up", polarised(rough(a=0.0), 0.05))
    publish(root, FunctionSource(brdf=_sheen, name="sheen", title="Sheen", provenance="made up"), tolerance=0.1)
    publish(
        root,
        MeasuredSource.of_samples(scattered(_grey, 400, 0.01), name="chip", title="Chip", provenance="made up"),
        tolerance=0.1,
    )
    kinds = dict.fromkeys((*planned, "made-up"), "table")
    return {**kinds, "sheen": "table of a function", "chip": "table of measured data"}
