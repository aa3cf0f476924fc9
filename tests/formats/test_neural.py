"""Networks that stand for materials: one file of Keras, an archive of them, and what is refused."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import ParameterError
from brdfdb.geometry import unit_vector
from tests.formats.a_file import check_refused, read_table

SHAPES = {"dense_1": (6, 21), "dense_2": (21, 21), "dense_3": (21, 3)}


def network(changes: dict[str, Any] | None = None) -> bytes:
    """A network with f_r = exp(h_z d_z) - 1 in R, exp(abs(d_y)) - 1 in G and 0.2 in B, as Keras writes it."""
    weights = {name: np.zeros(shape, np.float32) for name, shape in SHAPES.items()}
    biases = {name: np.zeros(shape[1], np.float32) for name, shape in SHAPES.items()}
    weights["dense_1"][2, 0] = 1.0  # cos(theta_h)
    weights["dense_1"][4, 1], weights["dense_1"][4, 2] = 1.0, -1.0  # the parts of d_y above and below 0
    weights["dense_1"][5, 3] = 1.0  # cos(theta_d)
    weights["dense_2"][[0, 3], 0], weights["dense_2"][[1, 2], 1] = 1.0, 1.0
    weights["dense_3"][0, 0], weights["dense_3"][1, 1] = 1.0, 1.0
    biases["dense_3"][:] = [0.0, 0.0, np.log(1.2)]
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        for name in SHAPES:
            file[f"{name}/{name}/kernel:0"] = weights[name]
            file[f"{name}/{name}/bias:0"] = biases[name]
        for field, value in (changes or {}).items():
            del file[field]
            if value is not None:
                file[field] = value
    return stream.getvalue()


def test_the_input_is_half_and_difference_vector_and_the_output_f_r(tmp_path: Path) -> None:
    path = tmp_path / "paper.h5"
    path.write_bytes(network())
    table = read_table(path)
    assert table.channels == ("R", "G", "B")
    wi, wr = unit_vector([0.3, 0.3], [1.0, 1.0]), unit_vector([0.7, 0.5], [1.0 + np.pi, 2.5])
    values = table.lookup_vectors(wi, wr)
    half = (wi + wr) / np.linalg.norm(wi + wr, axis=1, keepdims=True)
    cos_d = np.sum(wi * half, axis=1)
    assert values[:, 0] == pytest.approx(np.expm1(half[:, 2] + cos_d))
    across = np.cross(half, [0.0, 0.0, 1.0])  # the y axis of the difference vector, but for its sign
    d_y = np.abs(np.sum(wi * across, axis=1)) / np.linalg.norm(across, axis=1)
    assert values[:, 1] == pytest.approx(np.expm1(d_y), abs=1e-12)
    assert values[:, 2] == pytest.approx([0.2, 0.2])
    samples = formats.samples(path)
    assert samples.values[:, 2] == pytest.approx(0.2)
    assert "no values of its own" in samples.record["network"]


def test_a_member_of_an_archive_is_named_without_folder_and_suffix(tmp_path: Path) -> None:
    path = tmp_path / "materials.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("materials/", b"")
        archive.writestr("materials/white.h5", network())
        archive.writestr("materials/white.json", b"{}")
        archive.writestr("materials/red.h5", network())
    assert formats.samples(path, member="white").name == "white"
    assert formats.samples(path, member="materials/red.h5").name == "red"
    with pytest.raises(ParameterError, match=r"member: name one of the members of .*: red, white"):
        formats.samples(path)
    with pytest.raises(ParameterError, match="member: 'blue' is not one of the members"):
        formats.samples(path, member="blue")


KERNEL, BIAS = "dense_2/dense_2/kernel:0", "dense_3/dense_3/bias:0"


def test_another_network_and_damaged_files_are_refused(tmp_path: Path) -> None:
    for name, content, sentence in (
        ("other.h5", network({KERNEL: np.zeros((21, 20), np.float32)}), r"dense_2/kernel is float32 of shape \(21, 20"),
        ("other.h5", network({BIAS: np.full(3, np.nan, np.float32)}), "a weight is not finite"),
        ("other.h5", network({"dense_1": None}), "not a network of Keras with the layers dense_1, dense_2, dense_3"),
        ("cut.h5", network()[:900], ""),
        ("cut.zip", b"PK\x03\x04" + b"\0" * 22 + b"\x04\0\0\0x.h5", ""),
    ):
        (tmp_path / name).write_bytes(content)
        check_refused(tmp_path / name, sentence)
    bomb = tmp_path / "bomb.zip"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("x.h5", "w") as member:
        for _ in range(20):
            member.write(bytes(1 << 20))
    check_refused(bomb, r"x\.h5 has 20971520 bytes")


def test_a_damaged_member_of_an_archive_is_named(tmp_path: Path) -> None:
    path = tmp_path / "materials.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("red", "white"):
            archive.writestr(f"{name}.h5", network())
    content = bytearray(path.read_bytes())
    content[content.index(b"PK\x03\x04", 4) + 200] ^= 255
    path.write_bytes(content)
    assert formats.samples(path, member="red").name == "red"
    check_refused(path, r"materials\.zip: white is damaged \(Bad CRC-32", member="white")
