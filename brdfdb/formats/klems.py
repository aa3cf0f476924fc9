"""Klems matrices: averages over patches of the hemisphere, for WINDOW, EnergyPlus and Radiance.

The hemisphere is cut into 145, 77 or 41 patches. A number is the average of f_r in 1/sr over a patch of the light and a
patch of the viewer. Readers do not interpolate. The patches are fixed, and lobes narrower than a patch become wide.

A file can hold anisotropic tables. The file has one value, CIE Y. With ``--colour`` it has CIE X and Z as well, which
Radiance reads. The specular part is left out.
"""

from __future__ import annotations

import functools
import itertools
import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats import _bsdf_xml
from brdfdb.formats._bsdf_xml import FRONT_OF_RADIANCE, VISIBLE, BsdfBlock, BsdfFile
from brdfdb.formats._channels import LUMINOUS, XYZ, channels_of
from brdfdb.formats._interface import FIXED, FormatOption
from brdfdb.formats._nodes import rows_at_vectors
from brdfdb.formats._written import Written, whole
from brdfdb.integrals.patches import BASES, Basis, Index
from brdfdb.parameters import Floats
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.measurements.conventions import ListedRows
    from brdfdb.tables.table import Table

suffix = ".xml"
keywords = ("side",)
media_type = "application/xml"
summary = "BSDF files of WINDOW: averages over the patches of Klems"
tools = "WINDOW and pyWinCalc, EnergyPlus, Radiance"
kinds = tuple(BASES)
options = (
    FIXED,
    FormatOption("colour", False, "blocks of colour for Radiance; pyWinCalc refuses files that have them"),
    *(
        FormatOption(
            f"emissivity_{side}",
            0.0,
            f"emissivity of the {side} [1]; 0 takes that of the table if it covers 5 to 40 um, and 0.9 otherwise",
            low=0.001,
            high=1.0,
        )
        for side in ("front", "back")
    ),
)

SOLAR = "Solar"
CIE_X = "CIE-X"
CIE_Z = "CIE-Z"
_ONE_SHEET = "both sides reflect alike and nothing is transmitted; thickness and conductivity are placeholders"
_SOLAR = "the block of solar light repeats that of visible light"
_HOLDS = (
    "f_r [1/sr] without the cosine, as averages over patches of light and viewer with projected solid angles as "
    "weights; Visible is CIE Y under equal energy"
)
_ASSUMED = 0.9  # emissivity of paints, glass and most other surfaces but bare metals
_EFFECT = (
    "WINDOW demands a value; U of one sheet is 6.18 W/(m2 K) with 0.9 on both sides, 6.02 with 0.05 on the front, 3.34 "
    "with 0.05 on the back, which faces the room, and 3.29 with 0.05 on both"
)
_INFRARED_UM, _KELVIN, _C2 = (5.0, 40.0), 300.0, 14387.769  # C2: second radiation constant [um K]
_MOST_RINGS, _MOST_PATCHES = 46, 100_000  # of a basis that a file defines; Radiance has room for so many rings
Evaluate = Callable[[Floats, Floats], Floats]  # f_r (..., C) at unit vectors (..., 3) of light and viewer

_NODE = 0.5 / np.sqrt(3.0)  # distance of the two Gauss-Legendre nodes of an axis from the middle of a cell of length 1
_AT_ONCE = 1 << 13  # cells that are evaluated at a time
_LIGHTS = {145: 4, 77: 5, 41: 6}  # nodes of the light along each axis of a patch, by the number of patches
_DEEPEST = 6  # halvings of a patch of the viewer
_AROUND = 2  # halvings of the patch that is a whole ring
_AT_LEAST = 4  # halvings at the mirror direction
_NEXT = 1.3  # radii of a cell from its middle to the mirror direction, at which its nodes may miss the lobe
# A cell is divided if its nodes differ by more than a share of their average, and by more than a share of the albedo
_STEEP = 0.15
_NEGLIGIBLE = 3e-4


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    kind: str = "full",
    tolerance: float = 0.02,
    colour: bool = False,
    emissivity_front: float = 0.0,
    emissivity_back: float = 0.0,
    verdict: str | None = None,
) -> Written:
    """Write a table as a Klems matrix.

    WINDOW's front is outdoors and Radiance's indoors: the block Reflection Back is Radiance's front. The blocks CIE-X
    and CIE-Z of `colour` are for Radiance alone: WINDOW's engine refuses such files. By default, 0, the emissivities
    are those of the table, 1 minus its hemispherical albedo weighted by Planck's law at 300 K, if its wavelengths reach
    from 5 to 40 um; or else 0.9, which a remark names as assumed, with its effect on U.
    """
    from brdfdb.formats._record import record, specular_remark
    from brdfdb.formats._stated_error import Comparison

    basis = BASES[kind]
    channels = channels_of(table, "auto" if colour else "grey")

    def brdf(wi: Floats, wr: Floats) -> Floats:
        return np.maximum(channels.values(table, wi, wr), 0.0)

    matrix = averages(brdf, basis, len(channels.names), isotropic=not table.anisotropic)
    texts = [_text(matrix[..., channel]) for channel in range(matrix.shape[-1])]
    read_back = np.stack([_numbers(text) for text in texts], axis=-1).reshape(matrix.shape)
    error = Comparison(table, channels).error_of(functools.partial(evaluated, read_back, basis, basis))
    emissivity = {"front": emissivity_front, "back": emissivity_back}
    thermal = _completed(table, emissivity)
    remarks = (*channels.remarks, *specular_remark(table), _ONE_SHEET, _SOLAR, *thermal)
    document = record(table, error, verdict, holds=_HOLDS, remarks=remarks, tolerance=tolerance)
    definition = ["<IncidentDataStructure>Columns</IncidentDataStructure>", *_definition(basis)]
    with whole(path) as (half,), half.open("w", encoding="utf-8") as file:
        title = table.metadata.title or ""
        file.writelines(
            _bsdf_xml.text_of(table.name, title, _material(emissivity), definition, _blocks(basis, texts), document)
        )
    return Written((path_of(path),), error, tolerance, remarks)


def _completed(table: Table, emissivity: dict[str, float]) -> tuple[str, ...]:
    """Fill in the emissivities that were not given, 0, and return a remark on where they come from."""
    sides = [side for side, value in emissivity.items() if value == 0.0]
    if not sides:
        return ()
    of_table = _ASSUMED
    at = table.wavelength_nm
    reason = f"is assumed: {_EFFECT}"
    if at is not None and at[0] <= 1e3 * _INFRARED_UM[0] and at[-1] >= 1e3 * _INFRARED_UM[1]:
        from brdfdb.tables.albedo import reflected

        um = np.linspace(*_INFRARED_UM, 1401)
        planck = um**-5 / np.expm1(_C2 / (um * _KELVIN))
        absorbed = 1.0 - np.interp(1e3 * um, at, reflected(table).hemispherical)
        of_table = float(np.clip(np.trapezoid(planck * absorbed, um) / np.trapezoid(planck, um), 0.0, 1.0))
        reason = "is that of the table from 5 to 40 um, weighted by Planck's law at 300 K"
    emissivity.update(dict.fromkeys(sides, of_table))
    return (f"emissivity {of_table:.4g} of the {' and the '.join(sides)} {reason}",)


def _material(emissivity: Mapping[str, float]) -> Iterator[str]:
    """Yield the lines of XML on the material. WINDOW needs them all, and an empty <Thickness> stops its reader."""
    yield '<Thickness unit="Millimeter">1</Thickness>'
    yield "<DeviceType>Other</DeviceType>\n<ThermalConductivity>1</ThermalConductivity>"
    for side, value in emissivity.items():
        yield f"<Emissivity{side.title()}>{value:.4g}</Emissivity{side.title()}>"
    yield "<TIR>0</TIR>"


def _blocks(basis: Basis, texts: list[str]) -> Iterator[BsdfBlock]:
    """Yield the blocks of a file: both sides and both spectra for WINDOW, the colour for Radiance."""
    visible = texts[1] if len(texts) > 1 else texts[0]
    dark = _text(np.zeros((len(basis), len(basis))))
    for wavelength in (VISIBLE, SOLAR):
        for side, text in (
            ("Transmission Front", dark),
            ("Transmission Back", dark),
            ("Reflection Front", visible),
            (FRONT_OF_RADIANCE, visible),
        ):
            yield BsdfBlock(wavelength, side, basis.name, basis.name, text)
    if len(texts) > 1:
        yield BsdfBlock(CIE_X, FRONT_OF_RADIANCE, basis.name, basis.name, texts[0])
        yield BsdfBlock(CIE_Z, FRONT_OF_RADIANCE, basis.name, basis.name, texts[2])


def _text(matrix: Floats) -> str:
    """Return a matrix as text: a line a row, and a comma after each number, which WINDOW's reader wants."""
    return "\n".join("".join([f"{value:.4g}," for value in row]) for row in matrix.tolist())


def _numbers(text: str) -> Floats:
    if "_" in text:
        raise ValueError("could not convert string to float: a number has the sign _")
    return np.array(text.replace(",", " ").split(), dtype=np.float64)


def _definition(basis: Basis) -> Iterator[str]:
    """Yield the lines of XML that define a basis."""
    yield f"<AngleBasis>\n<AngleBasisName>{basis.name}</AngleBasisName>"
    for low, high, count in zip(basis.bounds_deg[:-1], basis.bounds_deg[1:], basis.counts, strict=True):
        middle = 0.0 if low == 0.0 else 0.5 * (low + high)
        yield (
            f"<AngleBasisBlock>\n<Theta>{middle:g}</Theta>\n<ThetaBounds><LowerTheta>{low:g}</LowerTheta>"
            f"<UpperTheta>{high:g}</UpperTheta></ThetaBounds>\n<nPhis>{count}</nPhis>\n</AngleBasisBlock>"
        )
    yield "</AngleBasis>"


def evaluated(matrix: Floats, viewers: Basis, lights: Basis, wi: Floats, wr: Floats) -> Floats:
    """Return f_r [1/sr] of a matrix (viewers, lights, C) as Radiance evaluates it, at unit vectors (N, 3)."""
    return np.asarray(matrix[viewers.patches(wr), lights.patches(wi * FLIPPED)])


def recognises(head: bytes) -> bool:
    """Return True if the first bytes of a file are those of a BSDF file without a tensor tree."""
    return _bsdf_xml.is_window_element(head) and b"TensorTree" not in head


def read(path: str | os.PathLike[str], side: str = "back") -> FileTable:
    """Return f_r of one side, evaluated as Radiance does: the value of the pair of patches.

    Radiance varies the values by up to 3e-4 from pair to pair, and keeps 8 bits of each chromaticity; both is left out.
    The format has no holes: a negative number is 0, as for Radiance.

    Parameters
    ----------
    path : path
        File of this package, or of others: in bases of Klems or in one that it defines itself.
    side : {"back", "front"}
        Side of reflection as the file names it. The back is Radiance's front.
    """
    from brdfdb.formats._readings import FileTable

    if side not in _bsdf_xml.SIDES:
        raise ParameterError("side", f"{side!r} is not one of {', '.join(_bsdf_xml.SIDES)}", side, (*_bsdf_xml.SIDES,))
    file = _bsdf_xml.read(path, _bsdf_xml.SIDES[side])
    if file.structure.lower() not in ("columns", "rows"):
        raise FileFormatError(
            f"{path}: field IncidentDataStructure: its structure {file.structure!r} is not Columns or Rows"
        )
    bases = {basis.name.lower(): basis for basis in BASES.values()}
    for element in file.definition.findall("{*}AngleBasis"):
        basis = _defined(path, element)
        known = bases.setdefault(basis.name.lower(), basis)  # names that are known keep their meaning, as in Radiance
        if (known.counts, known.bounds_deg) != (basis.counts, basis.bounds_deg):
            wrong = f"patches {basis.counts} between {basis.bounds_deg} degrees"
            right = f"this name means patches {known.counts} between {known.bounds_deg}; rename it, or correct it"
            raise FileFormatError(f"{path}: field AngleBasis {basis.name!r}: {wrong}; {right}")
    names = [CIE_X, VISIBLE, CIE_Z] if {CIE_X.lower(), CIE_Z.lower()} <= set(file.blocks) else [VISIBLE]
    visible = file.blocks[VISIBLE.lower()]
    for name in (visible.basis, visible.row_basis):
        if name.lower() not in bases:
            raise FileFormatError(f"{path}: the angle basis {name!r} is not defined")
    lights, viewers = bases[visible.basis.lower()], bases[visible.row_basis.lower()]
    matrix = np.stack([_matrix(path, file, name, viewers, lights) for name in names], axis=-1)
    of_colour = XYZ if len(names) > 1 else LUMINOUS
    evaluate = functools.partial(evaluated, np.maximum(matrix, 0.0), viewers, lights)
    rows = functools.partial(_rows, path, file, viewers, lights)
    return FileTable(file.name, of_colour, None, evaluate, file.record, rows)


def _rows(path: str | os.PathLike[str], file: BsdfFile, viewers: Basis, lights: Basis) -> ListedRows:
    """Return all blocks of the front in these bases at the middles of patches; a channel is a block."""
    names = [
        block.wavelength
        for block in file.blocks.values()
        if (block.basis.lower(), block.row_basis.lower()) == (lights.name.lower(), viewers.name.lower())
    ]
    matrix = np.stack([_matrix(path, file, name, viewers, lights) for name in names], axis=-1)
    viewer, light = np.divmod(np.arange(len(viewers) * len(lights)), len(lights))
    channels = [LUMINOUS[0] if name == VISIBLE else name for name in names]
    return rows_at_vectors(
        lights.middles[light] * FLIPPED,
        viewers.middles[viewer],
        matrix.reshape(len(viewer), -1),
        file.name,
        channels,
        None,
        {**file.record, "side": file.blocks[VISIBLE.lower()].side, "patches": f"{viewers.name}, f_r is their average"},
    )


def _matrix(path: str | os.PathLike[str], file: BsdfFile, name: str, viewers: Basis, lights: Basis) -> Floats:
    """Return the matrix (viewers, lights) of a block."""
    block = file.blocks[name.lower()]
    if (block.basis.lower(), block.row_basis.lower()) != (lights.name.lower(), viewers.name.lower()):
        raise FileFormatError(f"{path}: block {name} has other angle bases than block {VISIBLE}")
    try:
        numbers = _numbers(block.numbers)
    except ValueError as error:
        raise FileFormatError(f"{path}: field ScatteringData of block {name}: {error}") from None
    if numbers.size != len(viewers) * len(lights) or not np.all(np.isfinite(numbers)):
        wanted = f"{len(viewers)} x {len(lights)}"
        raise FileFormatError(
            f"{path}: field ScatteringData: block {name} has {numbers.size} numbers instead of {wanted} finite numbers"
        )
    if file.structure.lower() == "rows":
        return numbers.reshape(len(lights), len(viewers)).T
    return numbers.reshape(len(viewers), len(lights))


def _defined(path: str | os.PathLike[str], element: ElementTree.Element) -> Basis:
    """Return a basis that a file defines."""
    name = (element.findtext("{*}AngleBasisName") or "").strip()
    bounds = [0.0]
    counts = []
    try:
        for ring in element.findall("{*}AngleBasisBlock"):
            lower = float(ring.findtext("{*}ThetaBounds/{*}LowerTheta") or bounds[-1])
            if lower != bounds[-1]:
                text = f"a ring begins at {lower:g} degrees, but the one before it ends at {bounds[-1]:g}"
                raise FileFormatError(f"{path}: field LowerTheta of angle basis {name!r}: {text}")
            bounds.append(float(ring.findtext("{*}ThetaBounds/{*}UpperTheta") or "nan"))
            counts.append(int(ring.findtext("{*}nPhis") or "0"))
    except FileFormatError:
        raise
    except ValueError as error:
        raise FileFormatError(f"{path}: angle basis {name!r}: {error}") from None
    rising = all(low < high for low, high in itertools.pairwise(bounds)) and bounds[-1] == 90.0
    if not (rising and all(count > 0 for count in counts) and len(counts) <= _MOST_RINGS):
        raise FileFormatError(
            f"{path}: field AngleBasis: angle basis {name!r} has no rings of patches up to 90 degrees"
        )
    if sum(counts) > _MOST_PATCHES:
        raise FileFormatError(f"{path}: angle basis {name!r} has {sum(counts)} patches, more than {_MOST_PATCHES}")
    return Basis(name, tuple(bounds), tuple(counts))


FLIPPED = np.array([-1.0, -1.0, 1.0])


def light(basis: Basis, patch: Index, place: Floats) -> Floats:
    """Return unit vectors towards the light: its patches are those that it would mirror to."""
    return np.asarray(basis.vectors(patch, place) * FLIPPED)


def averages(evaluate: Evaluate, basis: Basis, channels: int, *, isotropic: bool) -> Floats:
    """Return averages [1/sr] of f_r over pairs of patches (viewers, lights, C), weighted with projected solid angles.

    `evaluate` gives f_r [1/sr], shape (..., C), at unit vectors (..., 3) of light and viewer, which broadcast. If
    `isotropic`, f_r depends on the difference of the azimuths alone, whatever its sign.

    Two Gauss-Legendre nodes along each of the four axes of a pair. Where they differ, and where the patch of the viewer
    is that of the mirror direction or touches it, there are more nodes of the light, and for each of them cells of the
    viewer divide until their nodes are alike: column sums, which are albedos, are right then.
    """
    size = len(basis)
    viewer, incident = np.divmod(np.arange(size * size), size)
    alike, whose = _alike(basis, viewer, incident) if isotropic else (np.arange(size * size), np.arange(size * size))
    viewer, incident = viewer[alike], incident[alike]
    nodes, _ = _rule(2)
    pair = np.arange(len(viewer))
    mean, spread = np.zeros((2, len(viewer), channels))
    for start in range(0, len(viewer), _AT_ONCE):
        pairs = pair[start : start + _AT_ONCE, np.newaxis]
        wi, wr = light(basis, incident[pairs], nodes), basis.vectors(viewer[pairs], nodes)
        values = evaluate(wi[:, np.newaxis], wr[:, :, np.newaxis]).reshape(len(pairs), -1, channels)
        mean[pairs[:, 0]], spread[pairs[:, 0]] = values.mean(axis=1), np.ptp(values, axis=1)
    weight = basis.solid_angles[viewer][:, np.newaxis]
    columns = basis.solid_angles @ mean[whose].reshape(size, -1)
    negligible = _NEGLIGIBLE * float(columns.max())
    steep = np.any((spread > _STEEP * mean) & (spread * weight > negligible), axis=-1)
    # Two nodes around a whole ring are none
    steep |= _next_to_mirror(basis)[viewer, incident] | (viewer == 0) | (incident == 0)
    for ring in (True, False):  # the first patch is a whole ring
        pairs = np.flatnonzero(steep & ((incident == 0) == ring))
        nodes, weights = _rule(_LIGHTS[size], periodic=ring)
        refined = _refined(evaluate, basis, viewer[pairs], incident[pairs], nodes, channels, negligible)
        mean[pairs] = np.einsum("pnc,n->pc", refined, weights)
    return mean[whose].reshape(size, size, channels)


def _refined(
    evaluate: Evaluate, basis: Basis, viewer: Index, incident: Index, nodes: Floats, channels: int, negligible: float
) -> Floats:
    """Return averages over the patches of the viewer, shape (pairs, nodes, C), for lights at nodes of their patches."""
    count = len(nodes)
    result = np.zeros((len(viewer) * count, channels))
    item = np.arange(len(result))
    corner = np.zeros((len(item), 2))
    halves = (np.arange(4)[:, np.newaxis] >> np.arange(2)) & 1
    for depth in range(_DEEPEST + 1):
        length = 0.5**depth
        mean, spread = np.zeros((2, len(item), channels))
        lit = np.zeros(len(item), dtype=bool)
        for start in range(0, len(item), _AT_ONCE):
            cells = slice(start, start + _AT_ONCE)
            pair, node = np.divmod(item[cells], count)
            wi = light(basis, incident[pair], nodes[node])
            place = corner[cells, np.newaxis] + length * (0.5 + _NODE * (2.0 * halves - 1.0))
            wr = basis.vectors(viewer[pair, np.newaxis], place)
            values = np.ascontiguousarray(np.moveaxis(evaluate(wi[:, np.newaxis], wr), 1, 0))  # reduced faster
            mean[cells], spread[cells] = values.mean(axis=0), np.ptp(values, axis=0)
            if depth < _AT_LEAST:
                lit[cells] = _at_mirror(wi, wr)
        pair = item // count
        weight = length**2 * basis.solid_angles[viewer[pair]][:, np.newaxis]
        divided = np.any((spread > _STEEP * mean) & (spread * weight > negligible), axis=-1)
        divided |= lit
        divided |= (viewer[pair] == 0) & (depth < _AROUND)
        divided &= depth < _DEEPEST
        np.add.at(result, item[~divided], length**2 * mean[~divided])
        corner = (corner[divided][:, np.newaxis] + 0.5 * length * halves).reshape(-1, 2)
        item = np.repeat(item[divided], 4)
        if not item.size:
            break
    return result.reshape(-1, count, channels)


def _at_mirror(wi: Floats, wr: Floats) -> NDArray[np.bool_]:
    """Return whether the mirror directions of lights (N, 3) are in cells with nodes (N, 4, 3), or next to them."""
    middle = wr.mean(axis=1)
    radius = np.sqrt(3.0) * np.linalg.norm(wr - middle[:, np.newaxis], axis=-1).max(axis=-1)
    return np.asarray(np.linalg.norm(wi * FLIPPED - middle, axis=-1) < _NEXT * radius)


def _rule(count: int, *, periodic: bool = False) -> tuple[Floats, Floats]:
    """Return nodes (N, 2) in the unit square and their weights, of a Gauss-Legendre rule of `count` nodes an axis.

    Along the second axis of a patch that is a whole ring, `periodic`, they have equal distances.
    """
    from brdfdb.gauss import gauss_rule  # loads numba, which `export --help` does without

    x, w = gauss_rule(count)
    x, w = 0.5 + 0.5 * x, 0.5 * w
    around, share = ((np.arange(count) + 0.5) / count, np.full(count, 1.0 / count)) if periodic else (x, w)
    return np.stack(np.meshgrid(x, around, indexing="ij"), axis=-1).reshape(-1, 2), np.outer(w, share).reshape(-1)


def _alike(basis: Basis, viewer: Index, incident: Index) -> tuple[Index, Index]:
    """Return pairs of which no two are turned or mirrored into each other, and the number among them of each pair."""
    rings = basis.rings
    counts = np.array(basis.counts)
    whole = int(np.lcm.reduce(counts))
    azimuth = np.concatenate([np.arange(count) * (whole // count) for count in counts])
    apart = (azimuth[viewer] - azimuth[incident]) % whole
    key = (rings[viewer] * len(counts) + rings[incident]) * whole + np.minimum(apart, whole - apart)
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    return first, inverse


def _next_to_mirror(basis: Basis) -> NDArray[np.bool_]:
    """Return, by viewer and light, whether the patches are the same one or touch."""
    rings = basis.rings
    counts = np.array(basis.counts)
    middle = np.concatenate([np.arange(count) / count for count in counts])
    half = 0.5 / counts[rings]
    apart = np.abs((middle[:, np.newaxis] - middle + 0.5) % 1.0 - 0.5)
    touching = apart <= half[:, np.newaxis] + half + 1e-9
    return np.asarray((np.abs(rings[:, np.newaxis] - rings) <= 1) & touching)
