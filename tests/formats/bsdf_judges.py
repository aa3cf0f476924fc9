"""Radiance and WINDOW's engine as judges of their files, each in a process of its own: some files crash them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb.formats._channels import channels_of
from brdfdb.integrals.patches import Basis
from brdfdb.materials import Material
from brdfdb.parameters import Floats
from brdfdb.tables.albedo import directional_albedo
from brdfdb.tables.planner import plan
from brdfdb.tables.table import Table
from tests.formats.small_tables import table_of

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
_ALBEDO_TOLERANCE = 3e-4
_QUERY = """
import sys
import numpy as np
from pyradiance import bsdf
data = bsdf.load_file(sys.argv[1])
angles = np.load(sys.argv[2])
np.save(sys.argv[3], np.array([bsdf.query(data, *row) for row in angles.tolist()]))
"""
_WINDOW = """
import json
import sys
import pywincalc
product = pywincalc.parse_bsdf_xml_file(sys.argv[1])
shares = []
if sys.argv[2] == "full":
    standard = pywincalc.load_standard(str(pywincalc.standard_path / "W5_NFRC_2003.std"))
    basis = pywincalc.BSDFHemisphere.create(pywincalc.BSDFBasisType.FULL)
    system = pywincalc.GlazingSystem(solid_layers=[product], optical_standard=standard, bsdf_hemisphere=basis)
    for method in sys.argv[3:]:
        sides = system.optical_method_results(method, 0.0, 0.0).system_results
        shares += [side.reflectance.direct_hemispherical for side in (sides.front, sides.back)]
print(json.dumps(shares))
"""
_THERMAL = """
import json
import re
import sys
import pywincalc
text = open(sys.argv[1], encoding="utf-8").read()
standard = pywincalc.load_standard(str(pywincalc.standard_path / "W5_NFRC_2003.std"))
basis = pywincalc.BSDFHemisphere.create(pywincalc.BSDFBasisType.FULL)
answer = []
for front, back in json.loads(sys.argv[2]):
    for side, value in (("Front", front), ("Back", back)):
        text = re.sub(f"<Emissivity{side}>[^<]*", f"<Emissivity{side}>{value}", text) if value else text
    product = pywincalc.parse_bsdf_xml_string(text)
    system = pywincalc.GlazingSystem(solid_layers=[product], optical_standard=standard, bsdf_hemisphere=basis)
    answer.append([product.emissivity_front, product.emissivity_back, system.u()])
print(json.dumps(answer))
"""


def made(
    model: str,
    parameters: dict[str, Any],
    wavelength_nm: Any = None,
    tolerance: float = 0.02,
    index: str | None = "main/Cu/Johnson",
) -> Table:
    """Return the table of a model, as a store holds it."""
    spectral = {} if wavelength_nm is None or index is None else {"refractive_index": index}
    written = {"title": "Made <up> & down", "model": model, "source": "no paper", "parameters": parameters, **spectral}
    return table_of(plan(Material.from_table("made-up", written), wavelength_nm, tolerance))


def _environment() -> dict[str, str]:
    pytest.importorskip("pyradiance")
    spec = find_spec("pyradiance")
    assert spec is not None
    assert spec.origin is not None
    home = Path(spec.origin).parent
    search = f"{home / 'bin'}{os.pathsep}{os.environ['PATH']}"
    return {**os.environ, "PATH": search, "RAYPATH": f".{os.pathsep}{home / 'lib'}"}


def _run(command: list[str], folder: Path, text: str | None = None) -> str:
    done = subprocess.run(
        command, cwd=folder, env=_environment(), input=text, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{command[0]}: {done.stderr}"
    return done.stdout


def queried(path: Path, wi: Floats, wr: Floats) -> Floats:
    """Return X, Y, Z of f_r [1/sr], shape (N, 3), as Radiance evaluates a file at unit vectors (N, 3)."""
    rows = [
        angle
        for w in (wi, wr)
        for angle in (np.degrees(np.arccos(w[:, 2])), np.degrees(np.arctan2(w[:, 1], w[:, 0])) % 360.0)
    ]
    given, answer = path.with_suffix(".in.npy"), path.with_suffix(".out.npy")
    np.save(given, np.stack(rows, axis=-1))
    _run([sys.executable, "-c", _QUERY, str(path), str(given), str(answer)], path.parent)
    values = np.load(answer)
    given.unlink()
    answer.unlink()
    return np.asarray(values)


def check_bsdf(path: Path) -> tuple[str, float]:
    """Return the type of a file and its largest total reflectance [1] of the front, as checkBSDF prints them."""
    lines = _run(["checkBSDF", path.name], path.parent).splitlines()
    (kind,) = [line.removeprefix("Type: ") for line in lines if line.startswith("Type: ")]
    front = next(line for line in lines if line.startswith("Interior Refl"))
    if kind == "Pure_Lambertian":  # of which checkBSDF prints a hundredth of the total
        return kind, 0.01 * float(front.split()[3])
    return kind, 0.01 * float(front.split("%")[0].split()[-1])


def in_window(path: Path, kind: str, *methods: str) -> list[float]:
    """Return reflectances [1] for light along the normal, front and back, by methods; computed of "full" alone."""
    pytest.importorskip("pywincalc")
    answer = _run([sys.executable, "-c", _WINDOW, str(path), kind, *methods], path.parent)
    return [float(share) for share in json.loads(answer)]


def thermal(path: Path, *emissivities: tuple[float, float]) -> list[list[float]]:
    """Return the emissivities of front and back, and U [W/(m2 K)] of one sheet, that WINDOW's engine finds in a file.

    A row for each pair of emissivities, which replace those of the file; 0 leaves that of the file.
    """
    pytest.importorskip("pywincalc")
    asked = json.dumps(emissivities or [(0.0, 0.0)])
    return list(json.loads(_run([sys.executable, "-c", _THERMAL, str(path), asked], path.parent)))


def traced(scene: str, rays: Floats, folder: Path, *options: str) -> Floats:
    """Return the radiance, green, that rtrace sees along rays (N, 6) of origins and directions."""
    (folder / "scene.rad").write_text(scene, encoding="utf-8")
    octree = subprocess.run(
        ["oconv", "scene.rad"], cwd=folder, env=_environment(), capture_output=True, check=True
    ).stdout
    (folder / "scene.oct").write_bytes(octree)
    text = "\n".join(" ".join(f"{number:.9g}" for number in ray) for ray in rays)
    command = ["rtrace", "-h", "-w", "-ab", "0", "-dj", "0", "-ds", "0", "-dt", "0", *options, "scene.oct"]
    return np.array([line.split()[1] for line in _run(command, folder, text).splitlines()], dtype=np.float64)


def _luminous(table: Table, theta_i: Floats) -> tuple[Floats, Floats]:
    """Return azimuths [degree] and luminous albedos [1], shape (theta_i, azimuths), at polar angles [rad]."""
    channels = channels_of(table, "auto")
    of_table = directional_albedo(table, np.degrees(theta_i), _ALBEDO_TOLERANCE)
    albedo = of_table.albedo[..., 0] if table.wavelength_nm is None else channels.of_spectra(of_table.albedo)
    return of_table.phi_i_deg, albedo if albedo.ndim == 2 else albedo[..., len(channels.names) // 2]


def _within(low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Return three nodes in each of some intervals, shape (N, 3), and their weights."""
    return low[:, np.newaxis] + (high - low)[:, np.newaxis] * (0.5 + 0.5 * _NODES), 0.5 * _WEIGHTS


def tree_total(table: Table) -> float:
    """Return the albedo [1] of a table averaged as checkBSDF averages in trees: the largest of 1/32 of an axis.

    Of isotropic tables these are rings of equal width in sin(theta). Of others they are squares; their albedo is that
    of the rings in the direction where it is largest, because they are small.
    """
    step = 1.0 / 16.0
    sine, weights = _within(np.arange(0.0, 1.0, step), np.arange(step, 1.0 + step, step))
    _, albedo = _luminous(table, np.arcsin(sine.reshape(-1)))
    return float(np.max(albedo.reshape(len(sine), 3, -1).transpose(0, 2, 1) @ weights))


def klems_total(table: Table, basis: Basis) -> tuple[float, float]:
    """Return the albedo [1] of a table averaged over patches: the largest one, and that of light along the normal."""
    bounds = np.sin(np.radians(np.array(basis.bounds_deg))) ** 2
    sine2, weights = _within(bounds[:-1], bounds[1:])
    phi, albedo = _luminous(table, np.arcsin(np.sqrt(sine2.reshape(-1))))
    of_rings = albedo.reshape(len(sine2), 3, -1).transpose(0, 2, 1) @ weights
    if phi.size == 1:
        return float(of_rings.max()), float(of_rings[0, 0])
    largest = float(of_rings[0].mean())
    for ring, count in zip(of_rings[1:], basis.counts[1:], strict=True):
        middle = 360.0 / count * np.arange(count)[:, np.newaxis] + 180.0 / count * _NODES
        folded = np.abs((middle + phi[-1]) % (2.0 * phi[-1]) - phi[-1])
        largest = max(largest, float(np.max(np.interp(folded, phi, ring) @ (0.5 * _WEIGHTS))))
    return largest, float(np.interp(np.linspace(0.0, phi[-1], 13), phi, of_rings[0]).mean())
