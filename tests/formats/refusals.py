"""Files that are refused: each in one line, which names the file and what is wrong."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError


def check_refused(path: Path, pattern: str = "", file_format: str = "", **keywords: Any) -> None:
    """Check that a file is refused with a pattern in its sentence."""
    with pytest.raises(FileFormatError, match=pattern or None) as refusal:
        formats.samples(path, file_format, **keywords)
    assert path.stem in str(refusal.value)
    assert "\n" not in str(refusal.value)


def check_texts_refused(
    path: Path, damages: Mapping[str, str] | Iterable[tuple[str, str]], file_format: str = "", **keywords: Any
) -> None:
    """Check that a file is refused with each of some texts, by the pattern that belongs to the text."""
    for text, pattern in damages.items() if isinstance(damages, Mapping) else damages:
        path.write_text(text, encoding="utf-8")
        check_refused(path, pattern, file_format, **keywords)


def check_changes_refused(
    path: Path, text: str, changes: Iterable[tuple[str, str, str]], file_format: str = "", **keywords: Any
) -> None:
    """Check that a text is refused after each change, an old part, a new one and the pattern of the sentence."""
    for old, new, pattern in changes:
        assert old in text
        check_texts_refused(path, [(text.replace(old, new), pattern)], file_format, **keywords)
