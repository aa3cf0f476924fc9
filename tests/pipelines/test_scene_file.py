"""Scene files: all that come with the program can be seen, and one sentence for every way to get one wrong."""

from __future__ import annotations

import json
import tomllib
from importlib import resources
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from matplotlib.image import imread

from brdfdb.scenes.gbuffer import gather
from brdfdb.scenes.renderer import render
from brdfdb_pipelines.documents import schema
from brdfdb_pipelines.scene_file import SceneError, load, shipped
from tests.pipelines.command import Captured, refused, run

COARSE = [float(wavelength) for wavelength in range(420, 681, 20)]
GOOD = """\
title = "one"
ambient = 0.1
lights = [{ direction = [0, -1, 0] }]
camera = { position = [0, -5, 0], height = 2.5 }
[[objects]]
name = "ball"
material = "mine"
shape = { kind = "sphere", radius = 1 }
[define.mine]
title = "My own"
model = "lambert"
source = "me"
parameters = { rho = 0.5 }
"""


MAGNESIA = """"he_torrance"
source = "me"
refractive_index = "main/MgO/Stephens-vis"
parameters = { sigma_0_um = 0.1, tau_um = 1 }
"""
TWIN = '[[objects]]\nname = "ball"\nmaterial = "foam"\nshape = { kind = "plane" }\n'


def changed(tmp_path: Path, old: str = "", new: str = "") -> str:
    assert old in GOOD
    path = tmp_path / "scene.toml"
    path.write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("name", shipped())
def test_a_scene_that_comes_with_the_program_keeps_to_the_schema_and_can_be_seen(name: str) -> None:
    text = (resources.files("brdfdb_pipelines") / "scenes" / f"{name}.toml").read_text(encoding="utf-8")
    jsonschema.validate(tomllib.loads(text), json.loads(schema("scene")))
    scene = load(name).model_copy(update={"wavelengths_nm": COARSE})
    image = render(scene, gather(scene, 48))
    assert image.shape[1:] == (48, len(COARSE))
    assert np.all(np.isfinite(image))
    assert image.min() >= 0.0
    assert image.max() > 0.3
    assert np.std(image) > 0.05


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('title = "one"', "colour = 5", "colour: unknown key"),
        ("radius = 1", "radius = 0", "objects.0.shape.radius: 0 must be greater than 0"),
        ("radius = 1", 'radius = "1"', "objects.0.shape.radius: '1' is not a number"),
        ("radius = 1", "raduis = 1", "objects.0.shape.raduis: unknown key; closest: radius"),
        ("height = 2.5", "hieght = 2.5", "camera.hieght: unknown key"),
        (
            'kind = "sphere"',
            'kind = "torus"',
            "objects.0.shape.kind: 'torus' is not one of plane, sphere, box, ",
        ),
        ('kind = "sphere", ', "", "objects.0.shape.kind: is missing"),
        ('material = "mine"', 'material = "foan"', "objects.ball.material: 'foan' is unknown; closest: foam"),
        ("rho = 0.5", "rho = 5", "define.mine: rho: 5 is outside [0, 1]"),
        ("[define.mine]", "[define.foam]", "define.foam: is the name of a preset; give yours another"),
        ('title = "one"', 'illuminant = "D66"', "illuminant: 'D66' is unknown; closest: D65"),
        ('title = "one"', 'observer = "CIE 1931"', "observer: 'CIE 1931' is not one of CIE 1931 2 Degree Standard "),
        ('title = "one"', "wavelengths_nm = [500, 600]", "wavelengths_nm: must increase from 420 or less"),
        ("[0, -1, 0]", "[0, 0, 0]", "lights.0.direction: [0.0, 0.0, 0.0] points nowhere"),
        ("[0, -1, 0]", "[0, 1]", "lights.0.direction.2: is missing"),
        ("height = 2.5", "height = 2.5, fov_deg = 3", "camera.fov_deg, height: give one of the two"),
        ("[0, -5, 0]", "[0, 0, 5]", "camera.target: the camera must look neither at its own position"),
        ("ambient = 0.1\nlights = [{ direction = [0, -1, 0] }]", "", "lights, ambient, environment: there is no light"),
        ('title = "one"', "tolerance = {}", "tolerance.relative, ciede2000: give one of the two"),
        ('title = "one"', "tolerance = { relative = -1 }", "tolerance.relative: -1 must be greater than 0"),
        ('title = "one"', "title = ", "not TOML: Invalid value (at line 1"),
        ("[[objects]]", TWIN + "[[objects]]", "objects: 'ball' is the name of two"),
    ],
)
def test_a_bad_scene_is_one_sentence_with_the_field(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = changed(tmp_path, old, new)
    with pytest.raises(SceneError) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: {said}")
    assert "\n" not in str(caught.value)


def test_a_scene_that_is_not_there_is_said_so() -> None:
    with pytest.raises(SceneError, match=r"^clay-vas: is not a scene; closest: clay-vase, clay-vase-20deg; "):
        load("clay-vas")
    with pytest.raises(SceneError, match=r"^missing.toml: No such file or directory"):
        load("missing.toml")


def test_the_command_line_renders_a_scene(tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "pictures"
    assert run("render", changed(tmp_path), "--out", out, "--width", 40, "--across", 2) == 0
    assert sorted(path.name for path in out.iterdir()) == ["scene.exr", "scene.png"]
    assert imread(out / "scene.png").shape[:2] == (30, 40)
    assert "40 x 30 pixels" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[0, -1, 0]", "[0, 1, 0]", "lights.0: lights no visible point"),
        ("radius = 1", "radius = 1, position = [0, -9, 0]", "objects: no ray of 256 x 192 pixels meets ball"),
        ('kind = "sphere", radius = 1', 'kind = "recorded", file = "no.exr"', "there is no such file"),
        (
            '"lambert"\nsource = "me"\nparameters = { rho = 0.5 }',
            MAGNESIA,
            "380 has no refractive index in main/MgO",
        ),
    ],
)
def test_a_scene_that_shows_nothing_is_one_sentence(
    tmp_path: Path, capsys: Captured, old: str, new: str, said: str
) -> None:
    assert said in refused(capsys, "render", changed(tmp_path, old, new), "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_recorded_scene_has_the_pixels_of_its_file(tmp_path: Path, capsys: Captured) -> None:
    np.savez(tmp_path / "flat.npz", normal=np.tile([0.0, -1.0, 0.0], (2, 3, 1)))
    path = changed(tmp_path, 'kind = "sphere", radius = 1', 'kind = "recorded", file = "flat.npz"')
    for option in ("--width", "--across"):
        said = refused(capsys, "render", path, "--out", tmp_path, option, "8")
        assert said.startswith(f"{path}: is recorded ")
    assert run("render", path, "--out", tmp_path) == 0
    assert "3 x 2 pixels" in capsys.readouterr().out
    scene = load(path)  # files that a scene names lie beside it
    image = render(scene, gather(scene, 1))
    assert np.abs(image - 0.55).max() < 1e-15  # half of a light of strength 1 and of the ambient tenth
