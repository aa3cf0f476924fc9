"""Pictures of Ward's imaging gonioreflectometer as OpenEXR files: counts of the camera, and the settings of instrument.

A file is one direction of the light. Its channels are counts as 32-bit floats, an array each exposure: ``sample.0``,
``standard.0``, ``background.0``, and the same with 1, 2, ... for shorter exposures. The attribute
``brdf:gonioreflectometer`` is JSON: ``theta_i_deg`` and ``phi_i_deg`` of the light, ``name``, ``provenance``, and
``settings``, the attributes of `brdfdb.measurements.gonioreflectometer.Gonioreflectometer`. A measured picture needs no
other data. Reading gives samples; the tables of a store are not written in this form.
"""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from brdfdb.errors import FileFormatError, ParameterError, WriteError
from brdfdb.formats._written import whole
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.measurements.gonioreflectometer import CameraPicture
    from brdfdb.measurements.samples import Samples

suffix = ".exr"

_KEY = "brdf:gonioreflectometer"
_MAGIC = b"\x76\x2f\x31\x01"
_PARTS = ("sample", "standard", "background")
_MOST_BYTES = 2**30


def write_picture(picture: CameraPicture, path: str | os.PathLike[str]) -> None:
    """Write a simulated or measured picture of the instrument, ZIP compressed; WriteError if it cannot be written."""
    import OpenEXR

    from brdfdb.geometry import degrees

    path = path_of(path)
    document = {
        "name": picture.name,
        "provenance": picture.provenance,
        "theta_i_deg": float(degrees(picture.theta_i)),
        "phi_i_deg": float(degrees(picture.phi_i)),
        "settings": picture.settings.settings(),
    }
    channels = {
        f"{part}.{number}": np.ascontiguousarray(counts)
        for part in _PARTS
        for number, counts in enumerate(getattr(picture, part))
    }
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, _KEY: json.dumps(document)}
    with whole(path) as (temporary,):
        try:
            OpenEXR.File(header, channels).write(str(temporary))
        except RuntimeError as error:  # raised by OpenEXR both for a missing directory and for a full disk
            raise WriteError(f"cannot write {path}: {error}") from error


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of an OpenEXR file with the attribute of the instrument."""
    return head.startswith(_MAGIC) and _KEY.encode() in head


def read_picture(path: str | os.PathLike[str]) -> CameraPicture:
    """Return the picture of a file; FileFormatError if it is no such picture, or damaged."""
    import OpenEXR

    from brdfdb.geometry import radians
    from brdfdb.measurements.gonioreflectometer import CameraPicture, Gonioreflectometer

    path = path_of(path)
    if path.stat().st_size > _MOST_BYTES:
        raise FileFormatError(f"{path}: it is larger than {_MOST_BYTES >> 20} MiB")
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            document: Any = json.loads(file.header().get(_KEY, "null"))
            counts = {name: np.array(channel.pixels, dtype=np.float32) for name, channel in file.channels().items()}
    except (RuntimeError, ValueError, RecursionError) as error:
        raise FileFormatError(f"{path}: it cannot be read as OpenEXR ({error})") from None
    try:
        known = dict(document["settings"])
        settings = Gonioreflectometer(**known | {"exposures": tuple(known["exposures"])})
        stacks = {
            part: np.stack([counts[f"{part}.{number}"] for number in range(len(settings.exposures))]) for part in _PARTS
        }
        theta_i, phi_i = (float(radians(document[name])) for name in ("theta_i_deg", "phi_i_deg"))
        name, provenance = (str(document.get(key, "")) for key in ("name", "provenance"))
        sample, standard, background = (stacks[part] for part in _PARTS)
        return CameraPicture(settings, theta_i, phi_i, sample, standard, background, name, provenance)
    except KeyError as error:
        raise FileFormatError(f"{path}: it has no {error}") from None
    except (ParameterError, TypeError, ValueError) as error:
        raise FileFormatError(f"{path}: {error}") from None


def read(path: str | os.PathLike[str]) -> Samples:
    """Return the samples of a picture, as `brdfdb.measurements.gonioreflectometer.reduced` gives them."""
    from brdfdb.measurements.gonioreflectometer import reduced

    return reduced(read_picture(path))
