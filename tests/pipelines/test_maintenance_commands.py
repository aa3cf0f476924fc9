"""history, rollback, verify and gc at the command line: what they print, and what they exit with."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import brdfdb
from brdfdb_pipelines import cli
from tests.pipelines.command import Captured


@pytest.fixture
def root(store_copy: Path, changed_recipe: Path, capsys: Captured) -> Path:
    """A store with two revisions of foam and blue-plastic."""
    assert cli.main(["build", str(changed_recipe), "--store", str(store_copy)]) == 0
    capsys.readouterr()
    return store_copy


def run(root: Path, *arguments: str) -> int:
    return cli.main([*arguments, "--store", str(root)])


def test_history_is_a_line_a_revision(root: Path, capsys: Captured) -> None:
    assert run(root, "history", "foam") == 0
    title, head, first, second = capsys.readouterr().out.splitlines()
    assert title.strip() == f"2 revisions of foam in {root}"
    assert head.split() == ["revision", "built", "model", "version", "stored", "request"]
    assert first.split()[::2][:2] == ["r000001", "oren_nayar_body_surface"]
    assert second.split()[-1] == "current"
    digest = brdfdb.open(root).metadata("foam").request_sha256
    assert second.split()[-2] == digest[:8]


def test_rollback_says_what_was_current(root: Path, capsys: Captured) -> None:
    assert run(root, "rollback", "foam", "r000001") == 0
    assert capsys.readouterr().out == "foam: r000001 is current now, instead of r000002\n"
    assert run(root, "rollback", "foam", "r000001") == 0
    assert capsys.readouterr().out == "foam: r000001 was current already\n"
    assert run(root, "rollback", "foam", "r000007") == 2
    assert capsys.readouterr().err == "brdfdb: foam has no revision 'r000007'; it has r000001, r000002\n"


def test_verify_names_all_that_is_damaged(root: Path, capsys: Captured) -> None:
    assert run(root, "verify") == 0
    out, err = capsys.readouterr()
    assert out.startswith("5 materials verified, ")
    assert out.endswith(": none damaged\n")
    assert "verifying" in err
    store = brdfdb.open(root)
    (store.path("foam") / "brdf" / "c" / "0" / "0" / "0").unlink()
    (store.path("mirror") / "zarr.json").write_bytes(b"")
    assert run(root, "verify") == 2
    out, err = capsys.readouterr()
    assert ": 2 damaged\n" in out
    repair = "`brdfdb build` with its recipe makes it anew, then `brdfdb gc --damaged` removes this revision\n"
    assert f"brdfdb: foam r000002 is damaged: brdf/c/0/0/0 is missing; {repair}" in err
    assert re.search(rf"brdfdb: mirror r000001 is damaged: zarr.json has 0 bytes, not \d+; {repair}", err)
    assert run(root, "verify", "blue-plastic") == 0


def test_gc_says_what_it_removed(root: Path, capsys: Captured) -> None:
    (root / ".staging" / "foam" / "0123456789abcdef").mkdir(parents=True)
    assert run(root, "gc") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "removed .staging/foam/0123456789abcdef"
    assert lines[1] == f"0 B freed in {root}"
    assert run(root, "gc", "--keep", "1") == 0
    lines = capsys.readouterr().out.splitlines()
    assert "removed materials/foam/r000001" in lines
    assert "removed materials/blue-plastic/r000001" in lines
    assert run(root, "verify") == 0


def test_a_snapshot_is_made_listed_read_and_removed(root: Path, capsys: Captured) -> None:
    assert run(root, "snapshot", "paper") == 0
    said = capsys.readouterr().out
    assert re.fullmatch(r"paper: 5 materials, 0 families; sha256 [0-9a-f]{64}\n", said)
    before = brdfdb.open(root).head("foam")
    assert run(root, "rollback", "foam", "r000001") == 0
    capsys.readouterr()
    for command in (["list"], ["show", "foam"], ["lookup", "foam", "30", "0", "30", "180", "--json"]):
        assert run(root, *command, "--snapshot", "paper") == 0
        assert before in capsys.readouterr().out
        assert run(root, *command) == 0
        assert "r000001" in capsys.readouterr().out
    assert run(root, "snapshot") == 0
    assert capsys.readouterr().out == said
    assert run(root, "gc", "--keep", "1") == 0
    assert run(root, "verify") == 0
    capsys.readouterr()
    assert run(root, "snapshot", "--remove", "paper") == 0
    assert capsys.readouterr().out.startswith("paper was removed")
    assert run(root, "lookup", "foam", "30", "0", "30", "180", "--snapshot", "paper") == 2
    assert capsys.readouterr().err == f"brdfdb: no snapshot 'paper' in the store at {root}; it has none\n"
    assert run(root, "snapshot", "--remove") == 2
    assert capsys.readouterr().err.startswith("brdfdb: snapshot: ")
