"""Height maps as instruments and programs write them: profilometers, microscopes, arrays and 16-bit pictures.

The package SurfaceTopography reads the formats of instruments, and recognises them by their content. Left out is its
reader of terrain (HGT), which accepts every file. Arrays (.npy, .npz, .csv) and pictures (TIFF, PNG) state no lengths,
so that the caller gives them.

Arrays, texts and pictures have the same axes: a row of numbers runs along x, and the first row is the uppermost, at the
largest y. The same numbers are the same map in each of these formats. SurfaceTopography turns the maps of instruments
so that the first row is the uppermost, as Gwyddion shows them, and counts it as y = 0; here y is turned upwards. A few
formats state x and y themselves.
"""

from __future__ import annotations

import contextlib
import logging
import math
import re
import struct
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError, ParameterError, import_extra
from brdfdb.microgeometry.height_map import STEPS_UM

Array = NDArray[np.float64]

MEMORY_GB = 2.0  # memory that reading and statistics may take
BYTES_PER_HEIGHT = 115  # measured: 104 bytes a height of 2048 x 2048, 92 of 4096 x 4096
FEWEST = 32  # nodes of a map along each axis
LARGEST_FILE_GB = 1.0
HIGHEST_UM = 1e9  # largest height, so that no square overflows
LEAST_RANGE_UM = 1e-9  # least difference of heights
ROWS = "x along a row, to the right; y upwards, so that the first row is the uppermost"
_MOST_PAGES = 1000  # of a TIFF file
_LEFT_OUT = ("hgt", "npy")
_OF_TIFF = ("lext", "jpk", "ps")  # formats of instruments that are TIFF files
_STATE_XY = ("sdf", "x3p", "xyz", "nc", "nmm", "mat", "h5")  # formats whose first index is x and whose second is y
_UNITS_UM = {"m": 1e6, "mm": 1e3, "um": 1.0, "µm": 1.0, "μm": 1.0, "nm": 1e-3, "pm": 1e-6, "Å": 1e-4, "A": 1e-4}
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_PNG = b"\x89PNG\r\n\x1a\n"
_NPY = b"\x93NUMPY"
_IMAGEJ_UNITS_UM = {**_UNITS_UM, "micron": 1.0, "microns": 1.0, r"\u00B5m": 1.0, "cm": 1e4, "inch": 25_400.0}
#: some suffixes of files of instruments, to be named in sentences
SUFFIXES = ("sur", "sdf", "x3p", "plu", "opd", "al3d", "vk4", "lext", "gwy", "spm", "jpk")
_PNG_COLOURS = {0: "grey", 2: "colour", 3: "a palette", 4: "grey with transparency", 6: "colour with transparency"}


@dataclass(frozen=True)
class MapOptions:
    """Facts that a file of heights does not state.

    ParameterError if a length is out of range, or the unit is unknown.
    """

    pixel_um: tuple[float, ...] = ()  #: distance of nodes, one number, or those along x and y [um]
    height_um: float | None = None  #: height of the number 1 in the file [um]
    unit: str | None = None  #: unit of lengths and heights of a file that has sizes without a unit
    hole: float | None = None  #: number in the file that stands for a height that was not measured
    channel: str | None = None  #: name or number of the channel

    def __post_init__(self) -> None:
        if len(self.pixel_um) > 2:
            count = len(self.pixel_um)
            raise ParameterError("pixel_um", f"{count} numbers are given; allowed are 1 or 2", self.pixel_um, (1, 2))
        lengths = [("pixel_um", pixel) for pixel in self.pixel_um]
        lengths += [] if self.height_um is None else [("height_um", self.height_um)]
        for name, length in lengths:
            low, high = STEPS_UM if name == "pixel_um" else (1e-15, HIGHEST_UM)
            if not low <= length <= high:
                raise ParameterError(name, f"{length:g} um is outside [{low:g}, {high:g}] um", length, (low, high))
        if self.unit is not None and self.unit not in _UNITS_UM:
            raise ParameterError(
                "unit", f"{self.unit!r} is not one of {', '.join(_UNITS_UM)}", self.unit, tuple(_UNITS_UM)
            )

    @property
    def steps_um(self) -> tuple[float, float]:
        """Return the distances of nodes along x and y [um]."""
        return self.pixel_um[0], self.pixel_um[-1]


@dataclass(frozen=True)
class MeasuredHeights:
    """Heights as a file states them.

    Nothing is levelled, filled or left out.
    """

    heights_um: Array = field(repr=False)  #: heights at x = i step_x, y = j step_y, (nx, ny); nan are holes [um]
    step_x_um: float  #: distance of nodes along x [um]
    step_y_um: float  #: distance of nodes along y [um]
    name: str = "surface"  #: name of the file
    format: str = ""  #: format of the file, in words
    notes: tuple[str, ...] = ()  #: what was chosen while the file was read, in sentences
    axes: str = ROWS  #: where x and y are in the file

    @property
    def holes(self) -> int:
        """Return the number of heights that were not measured."""
        return int(np.count_nonzero(~np.isfinite(self.heights_um)))

    @property
    def widths_um(self) -> tuple[float, float]:
        """Return the lengths of the map along x and y [um]."""
        nx, ny = self.heights_um.shape
        return nx * self.step_x_um, ny * self.step_y_um


def read_heights(path: Path, options: MapOptions | None = None) -> MeasuredHeights:
    """Return the height map in a file.

    Parameters
    ----------
    path : Path
        A file of a profilometer or a microscope; an array (.npy, .npz, .csv, .txt); or a grey picture with 16 or more
        bits (TIFF, PNG). Rows of arrays and pictures run along x, and the first row is the uppermost, at the largest y.
    options : MapOptions, optional
        Lengths that the file does not state. They are refused where the file states them.

    Returns
    -------
    MeasuredHeights

    Raises
    ------
    FileFormatError
        If the file cannot be read, is no map of heights, is a picture of 8 bits or in colour, is smaller than 32 x 32
        nodes, is larger than 1 GB, has heights above 1e9 um, or if its statistics would need more than 2 GB of memory.
    ParameterError
        If a length or a unit is missing, or given although the file states it; or if a channel does not exist.
    """
    given = MapOptions() if options is None else options
    size = path.stat().st_size
    if size > LARGEST_FILE_GB * 1e9:
        raise FileFormatError(f"{path}: {size / 1e9:.3g} GB are more than the {LARGEST_FILE_GB:g} GB that are allowed")
    with path.open("rb") as file:
        head = file.read(512)
    if not head:
        raise FileFormatError(f"{path}: the file is empty")
    if head.startswith(_NPY):
        return _of_npy(path, given)
    if head.startswith(_PNG):
        return _of_png(path, head, given)
    if head.startswith(_TIFF):
        return _of_tiff(path, head, given)
    separator = _separator(path)
    if separator is not None:
        return _of_csv(path, separator, given)
    reader = _instrument(path, head)
    if reader is None:
        _check_text(path)
        suffixes = ", ".join(f".{suffix}" for suffix in SUFFIXES)
        raise FileFormatError(
            f"{path}: no reader recognises the file as a height map; allowed are files of profilometers and "
            f"microscopes ({suffixes} and more), arrays (.npy, .npz, .csv, .txt), and pictures of 16 bits (.tif, .png)"
        )
    return _of_npz(path, reader, given) if reader.format() == "npz" else _of_instrument(path, reader, given)


@contextlib.contextmanager
def _reading(path: Path, what: str) -> Iterator[None]:
    """Say in a sentence that a file is damaged: libraries raise errors of all kinds."""
    try:
        yield
    except (FileFormatError, ParameterError):
        raise
    except Exception as error:
        lines = str(error).strip().splitlines()
        words = lines[0][:120] if lines else type(error).__name__
        raise FileFormatError(f"{path}: {what} cannot be read ({words})") from None


def _check_size(path: Path, shape: Sequence[int]) -> None:
    """Refuse a map that has too few nodes, or too many for the memory."""
    if len(shape) != 2:
        raise FileFormatError(f"{path}: an array of shape {tuple(shape)} is no map of heights; it needs two axes")
    if min(shape) < FEWEST:
        raise FileFormatError(
            f"{path}: {shape[0]} x {shape[1]} heights are too few; at least {FEWEST} x {FEWEST} are needed"
        )
    most = int(MEMORY_GB * 1e9 / BYTES_PER_HEIGHT)
    if shape[0] * shape[1] > most:
        needed = shape[0] * shape[1] * BYTES_PER_HEIGHT / 1e9
        raise FileFormatError(
            f"{path}: statistics of {shape[0]} x {shape[1]} heights need {needed:.3g} GB of memory, more than the "
            f"{MEMORY_GB:g} GB that are allowed; cut the map or average its pixels"
        )


class _PictureFacts(NamedTuple):
    """Facts that a picture states about its pixels and numbers."""

    pixel_um: tuple[float, float] | None = None  # distances of its pixels along x and y of the stored rows [um]
    by: str = ""  # field of the file that states them
    hole: float | None = None  # number that stands for a missing height
    hole_by: str = ""
    orientation: int = 1  # of TIFF and EXIF
    notes: tuple[str, ...] = ()


def _scaled(
    path: Path, numbers: NDArray[Any], given: MapOptions, format_: str, facts: _PictureFacts | None = None
) -> MeasuredHeights:
    """Return heights of rows of numbers, the uppermost first, whose pixel and unit the caller gives."""
    facts = _PictureFacts() if facts is None else facts
    notes = list(facts.notes)
    stated = facts.pixel_um if facts.orientation < 5 or facts.pixel_um is None else facts.pixel_um[::-1]
    in_words = f"states pixels of {stated[0]:.4g} x {stated[1]:.4g} um by its {facts.by}" if stated is not None else ""
    if given.channel is not None:
        raise ParameterError("channel", f"{path} has a single map; leave the option out", given.channel)
    if given.unit is not None:
        raise ParameterError("unit", f"{path} states no lengths; give pixel_um and height_um instead", given.unit)
    if not given.pixel_um:
        words = f"{in_words}, which may be those of a print" if in_words else "does not state the distance of its nodes"
        raise ParameterError("pixel_um", f"{path} {words}; give it in um")
    if given.height_um is None:
        raise ParameterError("height_um", f"{path} does not state the height of the number 1; give it in um")
    if stated is not None and not np.allclose(stated, given.steps_um, rtol=0.005, atol=0.0):
        steps = " x ".join(f"{step:.4g}" for step in given.steps_um)
        notes.append(f"the file {in_words}, which differ from pixel_um, {steps} um; pixel_um is used")
    if not 1 <= facts.orientation <= 8:
        raise FileFormatError(f"{path}: Orientation is {facts.orientation}; allowed are 1 to 8")
    if facts.orientation != 1:
        notes.append(f"rows and columns are turned as the file states by Orientation {facts.orientation}")
    rows = numbers.T if facts.orientation >= 5 else numbers
    rows = rows[::-1] if facts.orientation in (3, 4, 7, 8) else rows
    rows = rows[:, ::-1] if facts.orientation in (2, 3, 6, 7) else rows
    heights = np.array(rows[::-1].T, np.float64, order="C")
    if given.hole is not None:
        heights[heights == given.hole] = np.nan
    if facts.hole is not None:
        notes.append(f"the number {facts.hole:g} is a hole, as the file states by {facts.hole_by}")
        heights[heights == facts.hole] = np.nan
    _to_um(path, heights, given.height_um)
    return MeasuredHeights(heights, *given.steps_um, name=path.stem, format=format_, notes=tuple(notes))


def _to_um(path: Path, heights: Array, height_um: float) -> None:
    """Multiply heights by the height of the number 1, in place; FileFormatError if they are out of range."""
    heights[~np.isfinite(heights)] = np.nan
    if np.all(np.isnan(heights)):
        raise FileFormatError(f"{path}: all heights are holes")
    low, high = float(np.nanmin(heights)) * height_um, float(np.nanmax(heights)) * height_um
    highest = max(abs(low), abs(high))
    if highest > HIGHEST_UM:
        raise FileFormatError(
            f"{path}: heights reach {highest:.3g} um, more than the {HIGHEST_UM:g} um that are allowed; give the "
            "number of holes if they are holes, or another unit"
        )
    if 0.0 < high - low < LEAST_RANGE_UM:
        raise FileFormatError(
            f"{path}: heights differ by {high - low:.3g} um, less than the {LEAST_RANGE_UM:g} um that are allowed; "
            "give another unit"
        )
    heights *= height_um


def _of_npy(path: Path, given: MapOptions) -> MeasuredHeights:
    with _reading(path, "the array"):
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    _check_size(path, array.shape[::-1] if array.ndim == 2 else array.shape)
    return _of_array(path, array, given)


def _of_npz(path: Path, reader: Any, given: MapOptions) -> MeasuredHeights:
    """Return the heights of an array in an archive, whose names and shapes SurfaceTopography tells."""
    channel, notes = _channel(path, reader.channels, given.channel)
    _check_size(path, channel.nb_grid_pts[::-1])
    with _reading(path, "the array"), np.load(path, allow_pickle=False) as archive:
        array = archive[channel.name]
    return _of_array(path, array, replace(given, channel=None), tuple(notes))


def _of_array(path: Path, array: NDArray[Any], given: MapOptions, notes: tuple[str, ...] = ()) -> MeasuredHeights:
    if array.dtype.kind not in "fiu" or array.dtype.itemsize == 1:
        raise FileFormatError(
            f"{path}: numbers of type {array.dtype} are no heights; real numbers of 16 bits or more are needed"
        )
    return _scaled(path, array, given, "NumPy array", _PictureFacts(notes=notes))


def _separator(path: Path) -> str | None:
    """Return the character between four or more numbers in the first line of a text, a comma or semicolon, or None."""
    with path.open("rb") as file:
        start = file.read(1_000_000).removeprefix(b"\xef\xbb\xbf")
    line = next((line for line in start.splitlines() if line.strip() and not line.startswith(b"#")), b"")
    separator = b";" if b";" in line else b","
    parts = line.split(separator)
    try:
        [float(part) for part in parts[:-1]]
    except ValueError:
        return None
    return separator.decode() if len(parts) >= 4 else None


def _check_text(path: Path) -> None:
    """Raise FileFormatError for the first line of a table (.csv, .txt) that has other than numbers."""
    if path.suffix.lower() not in (".csv", ".txt"):
        return
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        for number, line in enumerate(file, 1):
            text = line.partition("#")[0].strip()
            try:
                [float(part) for part in re.split(r"\s*[;,]\s*|\s+", text) if part]
            except ValueError:
                shown = text if len(text) <= 40 else f"{text[:40]}..."
                raise FileFormatError(
                    f"{path}: line {number} is no row of numbers: {shown!r}; allowed are numbers with commas, "
                    "semicolons or spaces between them, and comments that begin with #"
                ) from None


def _of_csv(path: Path, separator: str, given: MapOptions) -> MeasuredHeights:
    with _reading(path, "the table"):
        numbers = np.loadtxt(path, delimiter=separator, ndmin=2, encoding="utf-8-sig")
    _check_size(path, numbers.shape[::-1])
    return _scaled(path, numbers, given, "text of numbers")


def _of_png(path: Path, head: bytes, given: MapOptions) -> MeasuredHeights:
    try:
        width, height, bits, colour = struct.unpack(">IIBB", head[16:26])
    except struct.error:
        raise FileFormatError(f"{path}: the picture is truncated") from None
    if colour != 0:
        kind = _PNG_COLOURS.get(colour, "unknown")
        raise FileFormatError(f"{path}: the picture is in {kind}; heights need a grey picture of 16 bits")
    if bits != 16:
        raise FileFormatError(f"{path}: the picture has {bits} bits; heights need a grey picture of 16 bits")
    _check_size(path, (width, height))
    pillow = import_extra("PIL.Image")
    with _reading(path, "the picture"), pillow.open(path) as picture:
        frames = getattr(picture, "n_frames", 1)
        numbers = np.asarray(picture)
        transparent, dpi = picture.info.get("transparency"), picture.info.get("dpi")
        orientation = int(picture.getexif().get(274, 1))
        pixel = (25_400.0 / dpi[0], 25_400.0 / dpi[1]) if dpi and min(dpi) > 0 else None
        hole = None if transparent is None else float(transparent)
    if frames != 1:
        raise FileFormatError(f"{path}: the file has {frames} pictures; a height map is a single picture")
    facts = _PictureFacts(pixel, "pHYs", hole, "tRNS", orientation)
    return _scaled(path, numbers, given, "PNG picture of 16 bits", facts)


def _pages(path: Path, file: BinaryIO) -> int:
    """Return the number of pictures in a TIFF file; FileFormatError if their chain is damaged or has no end."""
    head = file.read(16)
    order = "<" if head.startswith(b"II") else ">"
    big = head[2:4] in (b"+\0", b"\0+")
    count_code, entry, code = ("Q", 20, "Q") if big else ("H", 12, "I")
    seen: set[int] = set()
    try:
        (offset,) = struct.unpack_from(order + code, head, 8 if big else 4)
        while offset:
            if offset in seen:
                raise FileFormatError(f"{path}: the picture cannot be read (its pages follow each other in a circle)")
            if len(seen) >= _MOST_PAGES:
                raise FileFormatError(f"{path}: the file has more than {_MOST_PAGES} pictures")
            seen.add(offset)
            file.seek(offset)
            (tags,) = struct.unpack(order + count_code, file.read(struct.calcsize(count_code)))
            file.seek(offset + struct.calcsize(count_code) + entry * tags)
            (offset,) = struct.unpack(order + code, file.read(struct.calcsize(code)))
    except FileFormatError:
        raise
    except (struct.error, OverflowError, OSError, ValueError):
        raise FileFormatError(f"{path}: the picture cannot be read (it is truncated)") from None
    return len(seen)


def _of_tiff(path: Path, head: bytes, given: MapOptions) -> MeasuredHeights:
    with path.open("rb") as stream:
        pages = _pages(path, stream)
    messages: list[str] = []
    log = logging.getLogger("tifffile")

    def gather(record: logging.LogRecord) -> bool:
        messages.append(record.getMessage())
        return False  # not printed

    log.addFilter(gather)
    try:
        reader = _instrument(path, head, _OF_TIFF)
        if reader is not None:
            return _of_instrument(path, reader, given)
        if pages != 1:
            raise FileFormatError(
                f"{path}: the file has {pages} pictures, and is not of a microscope that is known (.lext, .jpk, Park's "
                ".tiff); export the heights as a single picture, or as .sdf, .sur or .x3p"
            )
        messages.clear()
        with _reading(path, "the picture"), import_extra("tifffile").TiffFile(path) as file:
            page = file.pages.first
            if page.ndim != 2 or page.samplesperpixel != 1 or int(page.photometric) not in (0, 1):
                raise FileFormatError(f"{path}: the picture is in colour; heights need a grey picture")
            if page.dtype is None or page.dtype.kind not in "fiu" or page.dtype.itemsize < 2:
                raise FileFormatError(
                    f"{path}: the picture has {page.bitspersample} bits; heights need a grey picture of 16 bits or more"
                )
            _check_size(path, page.shape[::-1])
            if math.prod(page.chunks) > 4 * MEMORY_GB * 1e9 / BYTES_PER_HEIGHT:
                raise FileFormatError(f"{path}: the picture cannot be read (a tile is larger than the memory allows)")
            facts = _facts_of_tiff(path, page)
            numbers = page.asarray()
    finally:
        log.removeFilter(gather)
    if messages:
        raise FileFormatError(f"{path}: the picture cannot be read (its header is damaged: {messages[0][:120]})")
    bits = numbers.dtype.itemsize * 8
    return _scaled(path, numbers, given, f"TIFF picture of {bits} bits", facts)


def _facts_of_tiff(path: Path, page: Any) -> _PictureFacts:
    """Return what the tags of a page state about pixels, holes and orientation."""
    tags = {tag.code: tag.value for tag in page.tags}
    described = str(tags.get(270, ""))
    imagej = dict(re.findall(r"^(\w+)=(.*?)\s*$", described, re.MULTILINE)) if described.startswith("ImageJ=") else {}
    notes = []
    if int(imagej.get("images", 1)) > 1:
        raise FileFormatError(f"{path}: the file has {imagej['images']} pictures; a height map is a single picture")
    if int(page.photometric) == 0:
        notes.append("the file states that 0 is white (WhiteIsZero); larger numbers are higher, as in all files")
    stated = [f"{key} = {imagej[key]}" for key in ("spacing", "c0", "c1", "vunit") if key in imagej]
    if stated:
        notes.append(f"ImageJ states {', '.join(stated)}, which is not used: height_um is the height of the number 1")
    unit = {2: 25_400.0, 3: 1e4}.get(int(tags.get(296, 2)))  # inch by default, centimetre
    if imagej.get("unit"):
        unit = _IMAGEJ_UNITS_UM.get(imagej["unit"])
        if unit is None and imagej["unit"] not in ("pixel", "pixels"):
            notes.append(f"ImageJ states lengths in {imagej['unit']}, which is no known unit; pixel_um is used")
    pixel = None
    if unit is not None and 282 in tags and 283 in tags:
        (x, per_x), (y, per_y) = (tags[code] for code in (282, 283))
        if min(x, y, per_x, per_y) > 0:
            pixel = (unit * per_x / x, unit * per_y / y)
    hole = float(tags[42113]) if 42113 in tags else None
    return _PictureFacts(pixel, "X- and YResolution", hole, "GDAL_NODATA", int(tags.get(274, 1)), tuple(notes))


def _instrument(path: Path, head: bytes, formats: tuple[str, ...] = ()) -> Any | None:
    """Return the reader of SurfaceTopography that recognises a file, of all formats by default, or None."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of packages that it would use if they were there, and of odd headers
        io = import_extra("SurfaceTopography.IO")
        for kind in io.readers:
            if kind.format() in _LEFT_OUT or (formats and kind.format() not in formats):
                continue
            if kind.can_read(head) == io.MagicMatch.NO:
                continue
            try:
                reader = kind(str(path))
                channels = reader.channels
            except Exception:  # readers of damaged files raise errors of all kinds
                continue
            if channels or not formats:  # other TIFF files may be those of JPK without a channel
                return reader
    return None


def _of_instrument(path: Path, reader: Any, given: MapOptions) -> MeasuredHeights:
    """Return the heights of a file that SurfaceTopography reads."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        channels = list(reader.channels)
        if not channels:
            raise FileFormatError(f"{path}: the file has no channel of heights")
        channel, notes = _channel(path, channels, given.channel)
        shape = channel.nb_grid_pts
        _check_size(path, shape)
        lengths = _lengths(path, channel, given)
        with _reading(path, "the heights"):
            keys = {} if channel.physical_sizes is not None else {"physical_sizes": tuple(map(float, shape))}
            stored = reader.topography(channel_index=channel.index, **keys).heights()
    heights = np.array(np.ma.filled(np.ma.asarray(stored, np.float64), np.nan))
    _check_size(path, heights.shape)
    if given.hole is not None:
        heights[heights == given.hole] = np.nan
    _to_um(path, heights, lengths[2])
    turned = reader.format() not in _STATE_XY
    if turned:
        heights = np.ascontiguousarray(heights[:, ::-1])
    axes = ROWS if turned else "x and y of the file"
    return MeasuredHeights(heights, lengths[0], lengths[1], path.stem, reader.name(), tuple(notes), axes)


def _channel(path: Path, channels: Sequence[Any], wanted: str | None) -> tuple[Any, list[str]]:
    """Return the channel of heights, and a note on the choice if there was any."""
    maps = [channel for channel in channels if channel.dim == 2 and channel.data_kind.value == "height"]
    names = [channel.name for channel in channels]
    if wanted is not None:
        named = [channel for channel in channels if wanted in (channel.name, str(channel.index))]
        if not named:
            raise ParameterError("channel", f"{wanted!r} is not one of {', '.join(names)}", wanted, tuple(names))
        if named[0] not in maps:
            raise ParameterError("channel", f"{wanted!r} of {path} is no map of heights", wanted, tuple(names))
        return named[0], []
    if not maps:
        lines = any(channel.dim == 1 for channel in channels)
        what = "a profile along a line, no map" if lines else f"no channel of heights, but {', '.join(names)}"
        raise FileFormatError(f"{path}: the file has {what}")
    # some readers call forces and voltages heights, too
    maps = [channel for channel in maps if channel.unit is None or channel.unit in _UNITS_UM] or maps
    if len(maps) > 1:
        others = ", ".join(channel.name for channel in maps[1:])
        return maps[0], [f"channel {maps[0].name!r} was read; other channels of heights: {others}"]
    return maps[0], []


def _lengths(path: Path, channel: Any, given: MapOptions) -> tuple[float, float, float]:
    """Return the distances of nodes along x and y, and the height of the number 1 [um]."""
    sizes = channel.physical_sizes
    unit = channel.unit
    if unit is not None and unit not in _UNITS_UM:
        raise FileFormatError(f"{path}: the file states lengths in {unit!r}, which is no known unit of length")
    if sizes is not None and not all(math.isfinite(size) and size > 0.0 for size in sizes):
        raise FileFormatError(f"{path}: the file states a map of {sizes[0]:g} x {sizes[1]:g}, which is no area")
    if unit is not None and given.unit is not None:
        raise ParameterError("unit", f"{path} states lengths in {unit}; leave the option out", given.unit)
    if sizes is not None and given.pixel_um:
        raise ParameterError("pixel_um", f"{path} states its own pixel size; leave the option out", given.pixel_um)
    if unit is not None and given.height_um is not None:
        raise ParameterError("height_um", f"{path} states the unit of its heights; leave it out", given.height_um)
    unit = unit or given.unit
    if sizes is None and not given.pixel_um:
        raise ParameterError("pixel_um", f"{path} does not state the distance of its nodes; give it in um")
    if unit is None and (sizes is not None or given.height_um is None):
        name = "unit" if sizes is not None else "height_um"
        raise ParameterError(name, f"{path} states no unit of its heights; give it")
    scale = _UNITS_UM[unit] if unit is not None else 1.0
    height = scale if given.height_um is None else given.height_um
    if sizes is None:
        return (*given.steps_um, height)
    step_x, step_y = (float(size) / count * scale for size, count in zip(sizes, channel.nb_grid_pts, strict=True))
    for step in (step_x, step_y):
        if not STEPS_UM[0] <= step <= STEPS_UM[1]:
            allowed = f"[{STEPS_UM[0]:g}, {STEPS_UM[1]:g}] um"
            raise FileFormatError(f"{path}: the file states pixels of {step:.3g} um, outside {allowed}")
    return step_x, step_y, height
