"""Sentences on what a reader noted in the record of samples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from brdfdb.errors import counted

_QUANTITIES = {
    "reflectance_factor": "reflectance factors",
    "f_r_cos": "values with the cosine of the viewer",
    "f_r_cos_i": "values with the cosine of the light",
}


def percent(share: float) -> str:
    """Return a share as text in percent: a plain number, with two digits below 10 %."""
    return f"{100.0 * share:.0f} %" if not abs(share) < 0.0995 else f"{100.0 * share:.2g} %"


def notes_of(record: Mapping[str, Any]) -> tuple[str, ...]:
    """Return what a reader noted in a record, in sentences."""
    notes = [str(note) for note in record.get("notes", ())]
    if text := _QUANTITIES.get(record.get("quantity", "")):
        notes.append(f"The file holds {text}: f_r was made of them.")
    if record.get("azimuth") == "forward":
        notes.append("Azimuths count from the forward direction, as was stated: 180 degrees were added.")
    elif title := record.get("forward_title"):
        notes.append(
            f"Azimuths? A title says {title!r}. If 0 is the direction into which the light travels, import the file "
            "with --azimuth forward."
        )
    if "exchanged" in record:
        notes.append(f"Letters exchanged: {record['exchanged']}.")
    if count := record.get("below_the_horizon"):
        notes.append(f"{counted(count, 'row')} below the horizon {'was' if count == 1 else 'were'} left out.")
    if count := record.get("repeated"):
        verb = "repeats the directions and values of another and was"
        verb = verb if count == 1 else "repeat the directions and values of others and were"
        notes.append(f"{counted(count, 'row')} {verb} left out.")
    if sentence := record.get("contradiction"):
        notes.append(sentence)
    if left := record.get("columns_left_out"):
        notes.append(f"Columns left out: {', '.join(left)}.")
    if side := record.get("side"):
        notes.append(f"Side: {side}, as the file names it.")
    if network := record.get("network"):
        notes.append(f"{network}.")
    return tuple(notes)
