"""A store behind a service: the same code, and the same numbers, as with the directory."""

from __future__ import annotations

import pickle
import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import brdfdb
from brdfdb.audit import audit
from brdfdb.errors import ParameterError, StoreError, UnknownMaterialError, UnknownRevisionError
from brdfdb.geometry import unit_vector
from brdfdb.store import http_client
from brdfdb.store.reader import Store
from tests.api.a_store import angles, publish, same, serving

KEPT = ("white-tile", "r000001")
NAMES = ("white-tile", "grey-felt", "brushed-metal", "copper-foil")


@pytest.fixture(scope="module")
def address(root: Path) -> Iterator[str]:
    with serving(root) as url:
        yield url


@pytest.fixture(params=["directory", "service"])
def opened(request: pytest.FixtureRequest, root: Path, address: str) -> Any:
    """The store, opened in one way and in the other."""
    return brdfdb.open(root if request.param == "directory" else address)


# The same code, from a directory and from a service


def test_a_store_is_a_mapping(opened: Any) -> None:
    assert list(opened) == sorted(NAMES)
    assert len(opened) == 4
    assert "grey-felt" in opened
    for name in ("grey-fell", "grey", "", "../grey-felt", "\ud800", "a" * 100_000, None, 7):
        assert name not in opened
    line = opened.summary("grey-felt")
    assert (line["title"], line["model"], line["revision"]) == ("Test grey-felt", "oren_nayar", "r000001")
    assert opened.head("grey-felt") == "r000001"
    assert opened.revisions("grey-felt") == ["r000001"]
    assert opened.metadata("grey-felt").parameters["sigma_deg"] == 20.0
    assert opened["grey-felt"].attrs["source"] == "no paper, grey-felt"


def test_tables_are_drawn_and_shown_in_notebooks(opened: Any) -> None:
    table = opened["brushed-metal"]
    assert "Test brushed-metal" in table._repr_html_()
    assert ("<svg" in table._repr_html_()) is isinstance(opened, Store)  # showing it asks no service
    axes = table.plot.cuts(20.0, ax=Figure().add_subplot())
    line = axes.lines[0]
    at = int(np.argmax(line.get_ydata()))
    expected = table.lookup(*np.radians([20.0, 0.0, line.get_xdata()[at], 180.0]))
    assert line.get_ydata()[at] == pytest.approx(expected)


def test_an_unknown_name(opened: Any) -> None:
    for name in ["grey-fell", "GREY-FELT", "..", "grey-felt/..", ""]:
        for ask in ["__getitem__", "summary", "head", "metadata", "revisions", "dataset"]:
            with pytest.raises(UnknownMaterialError, match=r"^no material '.*' in the store") as raised:
                getattr(opened, ask)(name)
            assert raised.value.name == name
            assert raised.value.closest[:1] == (["grey-felt"] if "grey" in name else [])
    with pytest.raises(UnknownRevisionError, match=r"^grey-felt has no revision 'r000007'; the current one is"):
        opened.table("grey-felt", "r000007")
    with pytest.raises(UnknownMaterialError):
        opened.table("grey-fell", "r000001")


def test_wrong_arguments_are_refused_in_the_same_words(opened: Any) -> None:
    for name, arguments, said in [
        ("grey-felt", (2.0, 0.0, 4.0, 0.0), r"^theta_r: 4 rad \(229.183 degrees\) is outside \[0, pi\] rad$"),
        ("grey-felt", (1.0, np.inf, 1.0, 0.0), r"^phi_i: inf rad is outside \[-1e\+15, 1e\+15\] rad$"),
        ("grey-felt", ("1", 0.0, 1.0, 0.0), r"^theta_i: '1' is not a number of radians$"),
        ("grey-felt", ([1.0, 2.0], 0.0, [1.0, 2.0, 3.0], 0.0), "do not broadcast"),
        ("grey-felt", (1.0, 0.0, 1.0, 0.0, np.nan), "^wavelength_nm: nan is not a positive number of nanometres$"),
        ("copper-foil", (1.0, 0.0, 1.0, 0.0, 300), r"^wavelength_nm: 300 is outside \[400, 700\] nm of copper-foil$"),
        ("copper-foil", (1.0, 0.0, 1.0, 0.0, [[500]]), "^wavelength_nm: 2 axes; allowed are"),
    ]:
        with pytest.raises(ValueError, match=said):
            opened[name].lookup(*arguments)
    assert opened["white-tile"].error is None
    with pytest.raises(ValueError, match=r"^error: the table of white-tile states no error; build it anew$"):
        opened["white-tile"].lookup_with_error(0.5, 0.0, 0.5, 0.0)


# The same numbers


@pytest.fixture(params=NAMES)
def pair(request: pytest.FixtureRequest, root: Path, address: str) -> tuple[Any, Any]:
    """A table behind the service, and the same in the directory."""
    return brdfdb.open(address)[request.param], brdfdb.open(root)[request.param]


def test_what_a_table_says_of_itself(pair: Any) -> None:
    there, here = pair
    assert (there.name, there.revision, there.anisotropic) == (here.name, here.revision, here.anisotropic)
    assert there.attrs == {key: value for key, value in here.attrs.items() if key != "request"}
    assert there.error == here.error
    assert list(there.axes_deg) == list(here.axes_deg)
    for axis in here.axes_deg:
        np.testing.assert_array_equal(there.axes_deg[axis], here.axes_deg[axis])
    np.testing.assert_array_equal(there.wavelength_nm, here.wavelength_nm)


@pytest.mark.parametrize("wavelength_nm", [None, 455.5, [455.5], (650, 450), []], ids=str)
def test_lookups_agree(pair: Any, wavelength_nm: Any) -> None:
    there, here = pair
    theta_i, phi_i, theta_r, phi_r = angles()
    shapes = [(theta_i[:7, None], 0.25, theta_r[:9], phi_r[:9]), (theta_i, phi_i, theta_r, phi_r), (0.5, 0.0, 0.5, 3.1)]
    for given in [*shapes, ([], 0.0, 0.1, 0.2), (0.5, 1, 0, np.pi), (np.pi / 2, 0.0, np.pi / 2, 1.0)]:
        same(there.lookup(*given, wavelength_nm), here.lookup(*given, wavelength_nm))
    wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    same(there.lookup_vectors(wi, wr, wavelength_nm), here.lookup_vectors(wi, wr, wavelength_nm))
    same(there.lookup_vectors(wi[0], wr, wavelength_nm), here.lookup_vectors(wi[0], wr, wavelength_nm))
    for theta in (theta_i, theta_i.reshape(4, -1), 0.5, np.pi / 2, np.float32(0.5)):
        same(there.specular_reflectance(theta, wavelength_nm), here.specular_reflectance(theta, wavelength_nm))


def test_float32_and_nan_come_back_as_they_do_from_a_table(pair: Any) -> None:
    there, here = pair
    given = [angle.astype(np.float32) for angle in angles()]
    given[0][0] = np.float32(np.pi / 2)  # lies above pi/2, and is the horizon all the same
    given[0][1], given[3][2] = np.nan, np.nan
    single = np.finfo(np.float32).eps
    same(there.lookup(*given), here.lookup(*given), single)
    same(there.specular_reflectance(given[0]), here.specular_reflectance(given[0]), single)
    wi, wr = (unit_vector(*given[each : each + 2]).astype(np.float32) for each in (0, 2))
    same(there.lookup_vectors(wi, wr), here.lookup_vectors(wi, wr), single)


@pytest.mark.parametrize("wavelength_nm", [None, 455.5, [455.5, 600]], ids=str)
@pytest.mark.parametrize("name", ["grey-felt", "copper-foil"])
def test_errors_are_stated_as_by_a_table(root: Path, address: str, name: str, wavelength_nm: Any) -> None:
    there, here = brdfdb.open(address)[name], brdfdb.open(root)[name]
    given = angles()
    wi, wr = unit_vector(given[0], given[1]), unit_vector(given[2], given[3])
    for found, expected in [
        tuple(table.lookup_with_error(*given, wavelength_nm) for table in (there, here)),
        tuple(table.lookup_vectors_with_error(wi, wr, wavelength_nm) for table in (there, here)),
    ]:
        same(found.brdf, expected.brdf)
        # an error is a value times a limit: where the limits are the same, it is off by as much as the value
        some = expected.error > 0.0  # it is 0 below the horizon
        np.testing.assert_array_equal(found.error[~some], expected.error[~some])
        same(found.error[some] * (expected.brdf[some] / expected.error[some]), expected.brdf[some])


def test_an_address_inside_a_service_is_recognised(address: str) -> None:
    service = address.rstrip("/")
    for inside in ["v1", "v1/materials", "v1/store/materials/grey-felt/r000001", "v1/materials/grey-felt/"]:
        with pytest.raises(StoreError, match=f"^{service}/{inside.rstrip('/')} lies in the service at {service};"):
            brdfdb.open(f"{service}/{inside}")


def test_a_dataset_is_that_of_the_directory(root: Path, address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("aiohttp")
    there, here = brdfdb.open(address).dataset("copper-foil"), brdfdb.open(root).dataset("copper-foil")
    assert there.load().identical(here.load())
    monkeypatch.setattr(http_client, "find_spec", lambda _: None)
    with pytest.raises(StoreError, match=r"needs fsspec and aiohttp: pip install .*\[http\]'"):
        brdfdb.open(address).dataset("grey-felt")


# A service is not a directory


def test_more_points_than_one_answer_holds(root: Path) -> None:
    here = brdfdb.open(root)["copper-foil"]
    given = angles(2000)
    with serving(root, max_points=4, max_body_bytes=20_000) as url:
        there = brdfdb.open(url)["copper-foil"]
        same(there.lookup(*given), here.lookup(*given))
        theta = given[0][:100]
        same(there.specular_reflectance(theta), here.specular_reflectance(theta))
        many = np.linspace(400, 700, 2001)
        same(there.lookup(0.1, 0.2, [0.3, 0.4], 0.4, many), here.lookup(0.1, 0.2, [0.3, 0.4], 0.4, many))
        with pytest.raises(
            StoreError, match=r"^http://\S+ answered 413 [A-Za-z ]+: 2001 values are more than the 400 "
        ):
            there.specular_reflectance([0.1, 0.2], many)


def test_a_table_stays_that_of_its_revision(own: Path) -> None:
    with serving(own) as url:
        there = brdfdb.open(url)
        first = there["white-tile"]
        assert publish(own, "white-tile", "lambert", rho=0.25) == "r000002"
        assert there["white-tile"].revision == there.head("white-tile") == "r000002"
        assert there.revisions("white-tile") == ["r000001", "r000002"]
        values = [each.lookup(0.5, 0.0, 0.5, 0.0) for each in (first, there["white-tile"], there.table(*KEPT))]
        np.testing.assert_allclose(np.pi * np.array(values), [1.0, 0.25, 1.0], rtol=1e-6)  # float32
        shutil.rmtree(own / "materials" / "white-tile" / "r000001")
        (own / "materials" / "white-tile" / "r000001.MANIFEST.json").unlink()
    with serving(own) as url, pytest.raises(UnknownRevisionError, match=r"^white-tile has no revision 'r000001'"):
        brdfdb.open(url).table(*KEPT)


def test_a_damaged_material_is_an_error_of_the_store(own: Path) -> None:
    (own / "materials" / "grey-felt" / "r000001" / "zarr.json").write_bytes(b"{}")
    with serving(own) as url:
        there = brdfdb.open(url)
        assert "grey-felt" in there
        assert "grey-felt" in there.summary("grey-felt")["damaged"]
        for ask in (there.__getitem__, there.metadata, there.head):
            with pytest.raises(StoreError, match=r"^grey-felt r000001 is damaged: "):
                ask("grey-felt")
        assert there["white-tile"].lookup(0.5, 0.0, 0.5, 0.0) > 0.0


def test_families_and_audits_need_the_directory(address: str) -> None:
    there = brdfdb.open(address)
    for ask in (there.families, lambda: there.family("copper")):
        with pytest.raises(StoreError, match=r"^http://.* has families for POST requests alone; open the directory"):
            ask()
    with pytest.raises(ParameterError, match=r"^table: RemoteTable: an audit needs a table that is decoded in this"):
        audit(there["white-tile"])


def test_threads_and_processes_ask_at_the_same_time(address: str, store: Store) -> None:
    there, here = brdfdb.open(address)["brushed-metal"], store["brushed-metal"]
    copy = pickle.loads(pickle.dumps(there))
    thetas = np.linspace(0.0, 1.4, 64)
    with ThreadPoolExecutor(8) as pool:
        found = np.array(list(pool.map(lambda theta: copy.lookup(theta, 0.1, 0.5, 2.0), thetas)))
    same(found, here.lookup(thetas, 0.1, 0.5, 2.0))
