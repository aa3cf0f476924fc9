"""The command `brdfdb photograph`: pictures that are read as samples, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.measurements import Samples
from tests.pipelines.command import Captured, refused, run


def test_pictures_are_written_and_read_as_samples(tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "new" / "pictures"
    small = ["--set", "width=108", "--set", "height=80"]
    assert run("photograph", "rolled-brass", "--light", 30, 90, *small, "--out", out) == 0
    path = out / "rolled-brass_30_90.exr"
    assert capsys.readouterr().out.strip() == str(path)
    samples = formats.read(path)
    assert isinstance(samples, Samples)
    assert samples.name == "rolled-brass"
    np.testing.assert_allclose(np.degrees([samples.theta_i[0], samples.phi_i[0]]), [30.0, 90.0])
    mirror = np.argmin(np.hypot(np.degrees(samples.theta_r) - 30.0, np.degrees(samples.phi_r) % 360.0 - 270.0))
    assert samples.values[mirror, 0] > 0.5 * samples.values.max()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["no-such"], "no such material"),
        (["rolled-brass", "--light", "95", "0"], "--light: 95 degrees is not in [0, 90)"),
        (["rolled-brass", "--wavelength-nm", "0.55"], "--wavelength-nm: 0.55 is below 1 nm; is it in micrometres?"),
        (["rolled-brass", "--set", "blur=1"], "--set blur=1: the settings are width"),
        (["rolled-brass", "--set", "blur_px=x"], "'x' is no number"),
        (["rolled-brass", "--set", "bits=99"], "bits: 99 is not in [4, 24]"),
    ],
)
def test_a_mistake_is_one_sentence_and_writes_nothing(
    arguments: list[str], sentence: str, tmp_path: Path, capsys: Captured
) -> None:
    folders = ("--store", tmp_path / "store", "--out", tmp_path / "pictures")
    assert sentence in refused(capsys, "photograph", *arguments, *folders)
    assert not (tmp_path / "pictures").exists()
