"""The arguments `out` and `threads`: values are the same bit for bit, nothing is copied, and bad ones are refused."""

from __future__ import annotations

import re
import tracemalloc
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.models import MODELS, ggx_scaled_vectors, lambert, lambert_vectors, ward_vectors
from brdfdb.models.large_calls import PART_BY_ANGLES, STEP, cut
from brdfdb.parameters import ModelSpec
from tests.models.draws import drawn, every_model
from tests.tables.made_up import KINDS, WAVELENGTHS, made_up

COUNT = 3 * STEP + 5
DTYPES = pytest.mark.parametrize("dtype", [np.float32, np.float64])
WARD = {"rho_d": 0.1, "rho_s": 0.3, "alpha_x": 0.1, "alpha_y": 0.2}
# models whose vectors are read by a loop of their own, and not by NumPy first
WITHOUT_COPY = ("ward", "ward_duer", "oren_nayar", "oren_nayar_qualitative", "he_torrance", "ggx", "rpv", "lambert")


def angles(count: int, dtype: Any = np.float64) -> tuple[NDArray[Any], ...]:
    rng = np.random.default_rng(1992)
    theta, phi = np.arccos(rng.random((2, count))), rng.uniform(-4.0, 4.0, (2, count))
    return tuple(angle.astype(dtype) for angle in (theta[0], phi[0], theta[1], phi[1]))


def vectors(count: int, dtype: Any = np.float64) -> tuple[NDArray[Any], NDArray[Any]]:
    theta_i, phi_i, theta_r, phi_r = angles(count)
    return unit_vector(theta_i, phi_i).astype(dtype), unit_vector(theta_r, phi_r).astype(dtype)


@every_model
def test_parts_on_threads_are_the_whole_call_bit_for_bit(spec: ModelSpec) -> None:
    count = 2 * STEP + 3 if spec.slow else COUNT
    one, many = drawn(spec, np.random.default_rng(1)), drawn(spec, np.random.default_rng(2), count)
    for dtype in (np.float64, np.float32):
        wi, wr = vectors(count, dtype)
        whole = spec.vectors(wi, wr, **one)
        for threads in (1, 2, 3):
            out = np.full(count, 7.0, dtype)
            assert spec.vectors(wi, wr, **one, out=out, threads=threads) is out
            assert np.array_equal(out, whole, equal_nan=True)
    assert np.array_equal(spec.evaluate(*angles(count), **one, threads=3), spec.evaluate(*angles(count), **one))
    if not spec.slow:
        wi, wr = vectors(count)
        assert np.array_equal(spec.vectors(wi, wr, **many, threads=2), spec.vectors(wi, wr, **many))


@every_model
def test_grids_are_cut_along_their_first_axis(spec: ModelSpec) -> None:
    theta_i, _, theta_r, phi_r = angles(7, np.float32)
    axes = theta_i[:, np.newaxis, np.newaxis], np.float32(0.0), theta_r[:, np.newaxis], np.sort(phi_r)
    parameters = drawn(spec, np.random.default_rng(3))
    whole = spec.evaluate(*axes, **parameters)
    assert np.array_equal(spec.evaluate(*axes, **parameters, threads=3), whole)
    out = np.empty((1, *whole.shape), np.float32)
    assert spec.evaluate(axes[0][np.newaxis], *axes[1:], **parameters, out=out, threads=2) is out
    assert np.array_equal(out[0], whole)


@pytest.mark.parametrize("name", WITHOUT_COPY)
@DTYPES
def test_long_calls_by_angles_take_the_memory_of_a_part(name: str, dtype: Any) -> None:
    count = 4 * PART_BY_ANGLES + 7
    spec, directions = MODELS[name], angles(count, dtype)
    parameters = drawn(spec, np.random.default_rng(5))
    whole = spec.evaluate(*directions, **parameters)
    some = slice(2 * PART_BY_ANGLES, 2 * PART_BY_ANGLES + STEP)
    assert np.array_equal(whole[some], spec.evaluate(*(angle[some] for angle in directions), **parameters))
    held = allocated(spec.evaluate, *directions, **parameters)
    assert held < whole.nbytes + 20 * 8 * PART_BY_ANGLES  # angles, vectors and values of a part, in float64


def test_parts_begin_at_blocks_of_kernels_and_cover_the_axis() -> None:
    for length, values, step, threads in ((10, 10, 1024, 2), (5000, 5000, 1024, 3), (1 << 23, 1 << 23, 1024, 2)):
        parts = cut(length, values, step, threads)
        assert [part.start for part in parts[1:]] == [part.stop for part in parts[:-1]]
        assert parts[0].start == 0
        assert parts[-1].stop == length
        assert all(part.start % step == 0 for part in parts)
        assert len(parts) == 1 or min(part.stop - part.start for part in parts) >= step
    assert len(cut(1 << 23, 1 << 23, 1024, 3)) % 3 == 0


@pytest.mark.parametrize("name", WITHOUT_COPY)
@DTYPES
def test_nothing_of_the_size_of_the_input_is_allocated(name: str, dtype: Any) -> None:
    count = 40 * STEP
    spec, out = MODELS[name], np.empty(count, dtype)
    directions, parameters = vectors(count, dtype), drawn(spec, np.random.default_rng(4))
    spec.vectors(*directions, **parameters, out=out)  # compile first
    assert allocated(spec.vectors, *directions, **parameters, out=out) < directions[0].nbytes / 4


@DTYPES
def test_lookups_allocate_nothing_of_the_size_of_the_input(dtype: Any) -> None:
    table, count = made_up("isotropic"), 200 * STEP
    out = np.empty(count, dtype)
    for look, given in ((table.lookup, angles(count, dtype)), (table.lookup_vectors, vectors(count, dtype))):
        look(*given, out=out)
        assert allocated(look, *given, out=out) < out.nbytes / 4  # what is left are blocks


def allocated(call: Any, *given: Any, **named: Any) -> int:
    """The most memory [byte] that NumPy and Python held during a call, beyond what they held before."""
    tracemalloc.start()
    try:
        call(*given, **named)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@KINDS
@DTYPES
@pytest.mark.parametrize("wavelength_nm", [500.0, [410.0, 700.0, 2000.0], None])
def test_lookups_on_threads_are_the_same(kind: str, dtype: Any, wavelength_nm: Any) -> None:
    table = made_up(kind, WAVELENGTHS)
    for look, given in ((table.lookup, angles(COUNT, dtype)), (table.lookup_vectors, vectors(COUNT, dtype))):
        whole = look(*given, wavelength_nm)
        out = np.empty_like(whole)
        assert look(*given, wavelength_nm, out=out, threads=3) is out
        assert np.array_equal(out, whole)
        assert np.array_equal(look(*given, wavelength_nm, threads=2), whole)


def test_a_single_value_is_written_too() -> None:
    out = np.empty(())
    assert lambert(0.1, 0.2, 0.3, 0.4, rho=0.5, out=out) is out
    assert out == lambert(0.1, 0.2, 0.3, 0.4, rho=0.5) == lambert(0.1, 0.2, 0.3, 0.4, rho=0.5, threads=2)
    table = made_up("isotropic")
    assert table.lookup(0.1, 0.2, 0.3, 0.4, out=out) is out
    assert out == table.lookup(0.1, 0.2, 0.3, 0.4)


def test_values_that_depend_on_one_another_are_not_cut() -> None:
    alpha = np.random.default_rng(5).uniform(0.1, 0.9, COUNT)
    whole = ggx_scaled_vectors(*vectors(COUNT), f_0=0.5, alpha=alpha)
    assert np.array_equal(ggx_scaled_vectors(*vectors(COUNT), f_0=0.5, alpha=alpha, threads=3), whole)


CALLS: tuple[Any, ...] = (partial(ward_vectors, **WARD), made_up("isotropic").lookup_vectors)


@pytest.mark.parametrize("call", CALLS, ids=["model", "table"])
def test_a_number_of_threads_is_a_positive_whole_number_also_of_numpy(call: Any) -> None:
    given = vectors(4)
    assert np.array_equal(call(*given, threads=np.uint8(2)), call(*given))
    for threads in (0, -1, 1.5, "2", True, 1.0, None):
        with pytest.raises(ParameterError, match=f"^threads: {threads!r} is not a whole number of at least 1"):
            call(*given, threads=threads)


def test_mistakes_in_a_part_or_in_all_of_a_call_reach_the_caller() -> None:
    below = [angle.copy() for angle in angles(COUNT)]
    below[2][-1] = 4.0
    rho = np.append(np.zeros(COUNT - 1), 1.5)
    for words, call in (
        ("theta_r", lambda: lambert(*below, rho=0.5, threads=3)),
        ("theta_r", lambda: made_up("isotropic").lookup(*below, threads=3)),
        ("rho", lambda: lambert(*angles(COUNT), rho=rho, threads=2)),
        ("do not broadcast", lambda: lambert(np.zeros(2), 0.0, np.zeros(3), 0.0, rho=0.5, threads=2)),
        ("rho", lambda: lambert(0.0, 0.0, 0.0, 0.0, threads=2)),
        ("wi", lambda: lambert_vectors(np.zeros((5, 2)), np.zeros((5, 3)), rho=0.5, threads=2)),
    ):
        with pytest.raises((ParameterError, TypeError), match=words):
            call()


def read_only(count: int) -> NDArray[np.float64]:
    array = np.empty(count)
    array.flags.writeable = False
    return array


@pytest.mark.parametrize(
    ("out", "state"),
    [
        (np.empty(5), "float64 of shape (5,)"),
        (np.empty((4, 1)), "float64 of shape (4, 1)"),
        (np.empty(4, np.float32), "float32 of shape (4,)"),
        (np.empty(4, ">f8"), ">f8 of shape (4,)"),
        (np.empty(8)[::2], "the array is not C-contiguous and aligned"),
        (read_only(4), "the array is read-only"),
        ([0.0] * 4, "it is of type list"),
    ],
)
def test_an_array_that_the_result_does_not_fit_is_refused(out: Any, state: str) -> None:
    allowed = "allowed is a writable, C-contiguous array of float64 and shape (4,), as the result"
    for call in CALLS:
        with pytest.raises(ParameterError, match="^" + re.escape(f"out: {state}; {allowed}")):
            call(*vectors(4), out=out)


def test_the_result_does_not_share_memory_with_an_argument() -> None:
    rho = np.full(4, 0.5)
    with pytest.raises(ParameterError, match="out: it shares memory with rho"):
        lambert_vectors(*vectors(4), rho=rho, out=rho)
    given = angles(4)
    with pytest.raises(ParameterError, match="out: it shares memory with theta_r"):
        made_up("isotropic").lookup(*given, out=given[2])
