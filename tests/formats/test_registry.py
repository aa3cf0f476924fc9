"""A format that is added to the registry is a command and an address without any other change."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import brdfdb
from brdfdb import formats
from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats import EXPORTERS, FormatOption, parsed_options, served_options
from brdfdb.formats._written import Written
from brdfdb.materials import Material
from brdfdb.store.publication import publish_dataset
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import tabulate
from brdfdb_api.http.views import EXPORT_OPTIONS
from tests.api.a_store import client_of
from tests.formats.a_file import exported, read_table
from tests.formats.small_tables import ANISOTROPIC, GREY
from tests.pipelines.command import Captured, run


def write(table: Any, path: Path, *, digits: float = 4.0, verdict: str | None = None) -> Written:
    lines = ["theta_i,theta_r,delta_phi,brdf"]
    for index in np.ndindex(*table.grid.shape):
        at = [nodes[i] for nodes, i in zip(table.axes_deg.values(), index, strict=True)]
        lines.append(",".join(f"{value:.{digits:.0f}g}" for value in (*at, table.brdf[index])))
    path.write_text("\n".join([*lines, verdict or ""]) + "\n", encoding="utf-8")
    return Written((path,))


LIST = SimpleNamespace(
    suffix=".list",
    media_type="text/csv",
    summary="f_r at the nodes of a table as text",
    tools="people",
    kinds=(),
    options=(FormatOption("digits", 4.0, "significant digits", low=1.0, high=9.0),),
    write=write,
)
FIRST = "theta_i,theta_r,delta_phi,brdf\n0,0,0,0.159\n"


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A store with one grey table, and the format in the registry."""
    monkeypatch.setitem(EXPORTERS, "list", LIST)
    table = {"title": "Grey", "model": "lambert", "source": "no paper", "parameters": {"rho": 0.5}}
    grid = Grid({"theta_i": [0, 80], "theta_r": [0, 80], "delta_phi": [0, 90, 180]})
    publish_dataset(tmp_path / "store", "grey", tabulate(Layout(Material.from_table("grey", table), grid)))
    return tmp_path / "store"


def test_a_format_of_fifteen_lines_is_a_command(store: Path, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "out"
    assert run("export", "list", "grey", "--digits", "3", "--store", store, "--out", out) == 0
    assert capsys.readouterr().out.startswith("1 LIST file, ")
    assert (out / "grey.list").read_text(encoding="utf-8").startswith(FIRST)
    assert run("export", "list", "grey", "--digits", "12", "--store", store, "--out", out) == 2
    assert capsys.readouterr().err == "brdfdb: digits: '12' is not a number in [1, 9]\n"
    assert run("export", "exr", "--all", "--store", store, "--out", out, "--kind", "in_plane", "--half") == 0
    assert sorted(path.name for path in out.iterdir()) == ["grey.list", "grey_in_plane.exr"]


def test_a_format_of_fifteen_lines_is_an_address(store: Path) -> None:
    client = client_of(store)
    answer = client.get("/v1/materials/grey/export/list?digits=3")
    assert answer.text.startswith(FIRST)
    assert answer.headers["content-type"].startswith("text/csv")
    assert answer.headers["content-disposition"] == 'attachment; filename="grey.list"'
    assert client.get("/v1/materials/grey").json()["links"]["export/list"] == "/v1/materials/grey/export/list"
    assert client.problem("GET", "/v1/materials/grey/export/list?digits=x", 422)["parameter"] == "digits"
    assert client.problem("GET", "/v1/materials/grey/export/list?kind=lobe", 422)["parameter"] == "kind"
    assert ", exr, " in client.problem("GET", "/v1/materials/grey/export/paper", 404)["detail"]


def test_a_verdict_that_is_not_given_is_not_stated(store: Path, tmp_path: Path) -> None:
    table = brdfdb.open(store)["grey"]
    for verdict, stated in ((None, "not stated"), ("passes", "passes")):
        formats.write(table, tmp_path / "grey.csv", "csv", resolution=45.0, verdict=verdict)
        reading = read_table(tmp_path / "grey.csv")
        assert reading.record["audit"] == stated
    assert b"audit: not audited" in client_of(store).get("/v1/materials/grey/export/csv?resolution=45").content


@pytest.mark.parametrize("suffix", ["exr", "png", "glsl", "slang", "osl"])
def test_files_that_are_only_written_are_named(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"grey.{suffix}"
    path.write_bytes(b"something")
    sentence = f"files of {suffix} can be written, but not read"
    with pytest.raises(FileFormatError, match=sentence):
        formats.read(path)
    with pytest.raises(ParameterError, match=f"file_format: {sentence}"):
        formats.read(path, suffix)


def test_an_option_over_http_allows_what_any_format_allows() -> None:
    schemas = {parameter["name"]: parameter["schema"] for parameter in EXPORT_OPTIONS}
    for file_format in EXPORTERS:
        for name, option in served_options(file_format).items():
            schema = schemas[name]
            if isinstance(option.default, bool | str):
                assert {*option.choices} <= {*schema.get("enum", option.choices)}
            else:
                assert schema["minimum"] <= min(option.low, option.default)
                assert schema["maximum"] >= max(option.high, option.default)
    assert "enum" not in schemas["colour"]  # a switch of one format, and a choice of another


@pytest.mark.parametrize(
    ("texts", "sentence"),
    [
        ({"kind": "map"}, "kind: 'map' is not one of lobe, half_difference, in_plane, sphere"),
        ({"half": "perhaps"}, "half: 'perhaps' is neither true nor false"),
        ({"theta_i": "91"}, "theta_i: '91' is not a number in [0, 90]"),
        ({"theta_i": "nan"}, "theta_i: 'nan' is not a number in [0, 90]"),
        ({"phi_i": "east"}, "phi_i: 'east' is not a number in [-720, 720]"),
        ({"size": "3"}, "size: the options of this format are kind, theta_i, phi_i, half"),
    ],
)
def test_an_option_that_is_not_allowed_is_named(texts: dict[str, str], sentence: str) -> None:
    with pytest.raises(ParameterError) as caught:
        parsed_options(EXPORTERS["exr"], texts)
    assert (str(caught.value), caught.value.parameter) == (sentence, next(iter(texts)))


def test_options_are_parsed_to_the_types_of_their_defaults() -> None:
    texts = {"kind": "lobe", "theta_i": "30", "half": "true"}
    assert parsed_options(EXPORTERS["exr"], texts) == {"kind": "lobe", "theta_i": 30.0, "half": True}


@pytest.mark.parametrize("file_format", ["glsl", "materialx", "mitsuba", "osl", "radiance", "rgl", "slang"])
def test_files_for_renderers_state_the_frame_of_an_anisotropic_table_alone(tmp_path: Path, file_format: str) -> None:
    for kind in (ANISOTROPIC, GREY):
        exported(tmp_path, file_format, kind)
        text = b"".join(path.read_bytes() for path in tmp_path.iterdir())
        assert (b" x axis " in text) == (kind == ANISOTROPIC)
