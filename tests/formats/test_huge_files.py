"""Hostile files: a gigabyte of zeros, files that lie about their size, bombs. One sentence each, in little memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError
from tests.formats.refusals import check_refused

GIGABYTE = 10**9
MOST_KB = 400_000  # of a process that imports the library and reads such a file
CODE = """
import re, sys
from pathlib import Path
from brdfdb import formats
from brdfdb.errors import FileFormatError
for text in sys.argv[1:]:
    path, _, name = text.partition("@")
    try:
        formats.samples(path, name)
    except FileFormatError as error:
        assert "\\n" not in str(error), error
        print(path, error)
# of this program alone: ru_maxrss may be that of the process that started it
print(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1])
"""
HEADS = {
    "table.csv": b"theta_i,theta_r,delta_phi,brdf\n",
    "sheet.txt": b"sza\tvza\traa\t550nm\n1\t2\t3\t.4\n",
    "paint.bsdf": b"Source Measured\nSymmetry PlaneSymmetrical\nAngleOfIncidence 999999999\n",
    "window.xml": b'<?xml version="1.0"?><WindowElement><Optical>',
    "merl.binary": b"Z\0\0\0Z\0\0\0\xb4\0\0\0",
    "bird.json": b'{"metadata":{"type":"BRDF"',
    "network.h5": b"\x89HDF\r\n\x1a\n",
    "rgl.bsdf": b"tensor_file\0\x01\0\xff\0\0\0vndf",
    "scatter.fred.txt": b"type bsdf_data\nformat angles=deg bsdf=value scale=1\n",
    "table.ssdd": b"VERSION 0.3\n",
    "shade.dat": b"#format: theta phi DSF\n",
    "asphalt.xompt": b'{"$schema":"material_brdf_schema"',
}


def sparse(path: Path, head: bytes = b"") -> Path:
    """Write a file of a gigabyte that takes no room."""
    with path.open("wb") as file:
        file.write(head)
        file.truncate(GIGABYTE)
    return path


def test_a_gigabyte_of_zeros_is_one_sentence_in_little_memory(tmp_path: Path) -> None:
    names = (".csv", ".bsdf", ".xml", ".binary", ".json", ".h5", ".zip", ".npz", ".bin")
    files = [f"{sparse(tmp_path / f'zeros{name}')}@" for name in names]
    files += [f"{sparse(tmp_path / name, head)}@" for name, head in HEADS.items()]
    by_force = ("csv", "text", "fred", "zemax", "astm", "ssdd", "rgl", "kaist", "klems", "bird", "neural", "pabopto")
    files += [f"{tmp_path / 'zeros.csv'}@{name}" for name in by_force]
    done = subprocess.run([sys.executable, "-c", CODE, *files], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    *sentences, peak_kb = done.stdout.splitlines()
    assert len(sentences) == len(files)
    assert int(peak_kb) < MOST_KB


def test_what_is_nothing_is_refused(tmp_path: Path) -> None:
    for suffix in (".csv", ".bsdf", ".xml", ".json", ".h5", ".zip", ".txt"):
        for content in (b"", b"\0" * 5000, b"\xff" * 5000, b"\xff\xfe\xff", b"theta_i,theta_r"):
            path = tmp_path / f"nothing{suffix}"
            path.write_bytes(content)
            check_refused(path, "no format recognises it")


def test_every_reader_refuses_other_files_in_a_sentence(tmp_path: Path) -> None:
    for number, content in enumerate((b"", b"one two\n", b"\0" * 100, b"\x89PNG\r\n" + bytes(range(256)) * 40)):
        path = tmp_path / f"other{number}"
        path.write_bytes(content)
        for name in formats.IMPORTERS:
            check_refused(path, "", name)


def test_xml_that_declares_entities_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.xml"
    entities = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10}">' for n in range(1, 12))
    path.write_text(f'<!DOCTYPE x [<!ENTITY e0 "aaaaaaaaaa">{entities}]><WindowElement>&e11;</WindowElement>')
    with pytest.raises(FileFormatError, match="declares a document type"):
        formats.samples(path)
