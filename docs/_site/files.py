"""Writing of generated pages."""

from __future__ import annotations

from pathlib import Path


def write_page(path: Path, text: str) -> None:
    """Write a page; a file that holds this text already is left alone, so that Sphinx does not read it again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def remove_others(folder: Path, names: set[str]) -> None:
    """Remove the files of a folder whose names are not among `names`: pages of what is gone."""
    for path in folder.iterdir():
        if path.is_file() and path.name not in names:
            path.unlink()
