"""Samples of a measurement: directions, wavelengths, f_r, its standard uncertainty, and the instrument."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.arrays import check_rows, plain
from brdfdb.errors import ParameterError, counted
from brdfdb.geometry import check_phi, degrees, radians, unit_vector
from brdfdb.measurements.conventions import ANGLES, NM_PER, PER_SR, QUANTITIES
from brdfdb.measurements.instrument import Instrument
from brdfdb.parameters import Floats, check_nanometres

if TYPE_CHECKING:
    import xarray as xr

_OPTIONAL = ("uncertainty", "wavelength_nm", "bandwidth_nm")
_HORIZON = 0.5 * np.pi * (1.0 + 1e-9)  # largest polar angle [rad], with rounding
_SAME_DEG = 1e-4  # directions closer than this are the same
_READ_DEG = 0.25  # cells of directions that encoders read
_SPREAD_DEG = 1.0  # width of the readings of one direction of the light, at most
_REGULAR = 8  # viewers of an incidence, and more, make a scan
_HELD = {name: words for name, words in QUANTITIES.items() if name != "f_r"} | {
    "f_r_cos": "values with the cosine of the viewer",
    "f_r_cos_i": "values with the cosine of the light",
}
_AZIMUTHS = {
    "forward": "Azimuths count from the forward direction, as was stated: 180 degrees were added.",
    "mirror": "Azimuths of viewers count from the mirror direction, as was stated: 180 degrees were added.",
    "light": "Azimuths of viewers count from the light, as was stated.",
    "absolute": "Azimuths of viewers count from a direction of the surface, as was stated.",
}


@dataclass(frozen=True, eq=False)
class Samples:
    """f_r at some directions, as an instrument measured it or as a file lists it.

    ParameterError if shapes do not fit, an angle is outside its range, a value is infinite, or an uncertainty is
    negative or infinite.
    """

    name: str  #: name of the material, or of the file
    #: theta_i, phi_i, theta_r, phi_r: directions of light and viewer. Polar angles are in [0, pi/2], (N,) [rad]
    theta_i: Floats = field(repr=False)
    phi_i: Floats = field(repr=False)
    theta_r: Floats = field(repr=False)
    phi_r: Floats = field(repr=False)
    #: names of the columns of `values`: ("R", "G", "B"), ("X", "Y", "Z"), ("grey",), or wavelengths as "550nm"
    channels: tuple[str, ...]
    #: wavelengths of the channels; None of colours and of grey samples, (C,) [nm]
    wavelength_nm: NDArray[np.float64] | None
    #: f_r without the cosine. A hole is nan. Noise may make values negative, (N, C) [1/sr]
    values: Floats = field(repr=False)
    #: standard uncertainty of each value, nan where it is not known; None, also of nan alone, if none is known, (N, C)
    #: [1/sr]
    uncertainty: Floats | None = field(default=None, repr=False)
    #: full width of each band at half of its height; None if it is not known, (C,) [nm]
    bandwidth_nm: NDArray[np.float64] | None = None
    instrument: Instrument = field(default_factory=Instrument)  #: the instrument
    provenance: str = ""  #: where the samples come from, in words
    #: Mueller matrices over their first element, between bases of the surface as in `brdfdb.tables.stokes`; elements
    #: that are not measured are nan. None if the polarisation is not measured, (N, C, 4, 4) [1]
    mueller: Floats | None = field(default=None, repr=False)
    #: what the file says beside its values: its header, or the record of an export
    record: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        check_rows({name: getattr(self, name) for name in (*ANGLES, "values", "uncertainty")})
        for name in (*ANGLES, "values", "uncertainty", "wavelength_nm", "bandwidth_nm"):
            object.__setattr__(self, name, _floats(name, getattr(self, name), optional=name in _OPTIONAL))
        count = self.theta_i.size
        expected = {**dict.fromkeys(ANGLES, (count,)), "values": (count, len(self.channels))}
        expected |= {"uncertainty": expected["values"], "wavelength_nm": (len(self.channels),)}
        expected |= {"bandwidth_nm": expected["wavelength_nm"], "mueller": (*expected["values"], 4, 4)}
        for name, shape in expected.items():
            array = getattr(self, name)
            if array is not None and array.shape != shape:
                raise ParameterError(name, f"shape {array.shape} is not {shape}", array.shape, shape)
        for name in ANGLES:
            angle = getattr(self, name)
            if not np.all(np.isfinite(check_phi(name, angle))):
                raise ParameterError(name, "nan is not an angle", np.nan)
            beyond = angle[(angle < 0.0) | (angle > _HORIZON)] if name.startswith("theta") else angle[:0]
            if beyond.size:
                where = "is below the horizon" if beyond[0] > 0.0 else "is no polar angle"
                text = f"{degrees(beyond[0]):.6g} degrees {where}; allowed are 0 to 90 degrees"
                raise ParameterError(name, text, float(beyond[0]), (0.0, _HORIZON))
        if self.wavelength_nm is not None:
            check_nanometres("wavelength_nm", self.wavelength_nm)
        if np.any(np.isinf(self.values)):
            raise ParameterError("values", "a value is infinite; a hole must be nan", np.inf)
        if self.uncertainty is not None and np.any(self.uncertainty < 0.0):
            raise ParameterError("uncertainty", f"{np.nanmin(self.uncertainty):g} is below 0", None, (0.0, np.inf))
        if self.uncertainty is not None and np.any(np.isinf(self.uncertainty)):
            raise ParameterError("uncertainty", "a value is infinite; an unknown value must be nan", np.inf)
        if self.uncertainty is not None and np.all(np.isnan(self.uncertainty)):
            object.__setattr__(self, "uncertainty", None)

    def __len__(self) -> int:
        return len(self.theta_i)

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """True where there is a value, shape (N, C): False in holes."""
        return np.isfinite(self.values)

    @cached_property
    def w_i(self) -> Floats:
        """Unit vectors of the light, shape (N, 3)."""
        return unit_vector(self.theta_i, self.phi_i)

    @cached_property
    def w_r(self) -> Floats:
        """Unit vectors of the viewer, shape (N, 3)."""
        return unit_vector(self.theta_r, self.phi_r)

    @cached_property
    def incidence(self) -> NDArray[np.int64]:
        """Number of the incidence of each sample, shape (N,): the same number, the same direction of the light.

        Encoders read one direction as several that differ by hundredths of a degree. Lights are one incidence if cells
        of a quarter of a degree that touch join them, and all lie within a degree. Lights that are joined over more
        than that are scattered, or a fine series: each is an incidence of its own.
        """
        from scipy.ndimage import find_objects, label

        at = _flat(self.theta_i, self.phi_i)
        cells = np.rint(at / _READ_DEG).astype(np.int64)
        cells -= cells.min(axis=0, initial=0)
        read = np.zeros(cells.max(axis=0, initial=0) + 1, dtype=bool)
        read[tuple(cells.T)] = True
        groups, _ = label(read, structure=np.ones((3, 3)))
        widest = [max(side.stop - side.start for side in box) * _READ_DEG for box in find_objects(groups)]
        group = groups[tuple(cells.T)]
        exact = np.rint(at / _SAME_DEG).astype(np.int64)
        exact[(np.array([0.0, *widest]) <= _SPREAD_DEG)[group]] = 0
        return _numbered(np.column_stack([group, exact]))

    @cached_property
    def pair(self) -> NDArray[np.int64]:
        """Number of the pair of incidence and viewer of each sample, shape (N,): repeats have the same number."""
        viewer = np.rint(_flat(self.theta_r, self.phi_r) / (2.0 * _READ_DEG)).astype(np.int64)
        return _numbered(np.column_stack([self.incidence, viewer]))

    @cached_property
    def scanned(self) -> bool:
        """True if the typical incidence has eight viewers or more, repeats not counted."""
        first = np.unique(self.pair, return_index=True)[1]
        return bool(np.median(np.bincount(self.incidence[first])) >= _REGULAR)

    @cached_property
    def turned(self) -> bool:
        """True if the light comes from more than one azimuth, so that anisotropy can be seen.

        Azimuths are one if all lights are within a quarter of a degree of those of the azimuth of the lowest light.
        """
        if not len(self):
            return False
        turn = 0.5 * (self.phi_i - self.phi_i[np.argmax(self.theta_i)])
        beside = 2.0 * np.sin(self.theta_i) * np.abs(np.sin(turn))
        return bool(np.any(degrees(beside) > _READ_DEG))

    def selected(self, rows: NDArray[Any]) -> Samples:
        """Return some of the samples: those of a mask (N,), or of indices."""
        parts = {name: getattr(self, name)[rows] for name in (*ANGLES, "values")}
        uncertainty = None if self.uncertainty is None else self.uncertainty[rows]
        mueller = None if self.mueller is None else self.mueller[rows]
        return replace(self, **parts, uncertainty=uncertainty, mueller=mueller)

    def to_xarray(self) -> xr.Dataset:
        """Return the samples as a Dataset over ``sample`` and ``channel``, with angles in degrees.

        Its variables are brdf and uncertainty [1/sr]. All else stands in its attributes, the record as JSON.
        """
        import xarray as xr

        angles = {name: ("sample", degrees(getattr(self, name)), {"units": "degree"}) for name in ANGLES}
        of_channels: dict[str, Any] = {"channel": ("channel", list(self.channels))}
        for name, of in (("wavelength", self.wavelength_nm), ("bandwidth", self.bandwidth_nm)):
            if of is not None:
                of_channels[name] = ("channel", of, {"units": "nm"})
        values = {"brdf": self.values, "uncertainty": self.uncertainty}
        known: dict[str, Any] = {
            name: (("sample", "channel"), v, {"units": "sr-1"}) for name, v in values.items() if v is not None
        }
        if self.mueller is not None:
            known["mueller"] = (("sample", "channel", "row", "column"), self.mueller, {"units": "1"})
        instrument = {
            f"instrument_{part.name}": getattr(self.instrument, part.name)
            for part in fields(Instrument)
            if getattr(self.instrument, part.name) not in (None, "")
        }
        attributes = {"name": self.name, "provenance": self.provenance, **instrument}
        attributes["record"] = json.dumps(dict(self.record), ensure_ascii=False, default=str)
        return xr.Dataset(known, coords=angles | of_channels, attrs=attributes)

    @classmethod
    def from_xarray(cls, dataset: xr.Dataset) -> Samples:
        """Return the samples of a Dataset as `to_xarray` gives it.

        Only the angles theta_i, theta_r and phi_r in degrees or radians (attribute ``units``) and brdf are required.
        Wavelengths and bandwidths are in nm, um or m, by default nm; brdf and uncertainty are in 1/sr. ParameterError
        if a variable is missing or has other units, or the samples are not allowed.
        """
        brdf = dataset.get("brdf")
        if brdf is None or not {"theta_i", "theta_r", "phi_r"} <= set(dataset.variables):
            missing = [name for name in ("brdf", "theta_i", "theta_r", "phi_r") if name not in dataset.variables]
            raise ParameterError("dataset", f"it has no {', '.join(missing)}", missing)
        count = dataset["theta_i"].size
        values = np.asarray(brdf.transpose("sample", ...), dtype=np.float64).reshape(count, -1)
        for name in ("brdf", "uncertainty"):
            if name in dataset.variables and (units := _units(dataset, name)) not in PER_SR:
                raise ParameterError(name, f"its units are {units!r}; allowed is sr-1", units, PER_SR)
        wavelength = _length_nm(dataset, "wavelength")
        if "channel" in dataset.variables:
            channels = tuple(str(name) for name in np.atleast_1d(dataset["channel"].values))
        else:
            channels = ("grey",) if wavelength is None else tuple(f"{at:g}nm" for at in wavelength)
        uncertainty = None
        if "uncertainty" in dataset.variables:
            uncertainty = np.asarray(dataset["uncertainty"].transpose("sample", ...)).reshape(values.shape)
        mueller = None
        if "mueller" in dataset.variables:
            mueller = np.asarray(dataset["mueller"].transpose("sample", "channel", "row", "column"))
        attributes = dataset.attrs
        instrument = {
            part.name: attributes[f"instrument_{part.name}"]
            for part in fields(Instrument)
            if f"instrument_{part.name}" in attributes
        }
        return cls(
            name=str(attributes.get("name", "samples")),
            **{name: _angle(dataset, name, count) for name in ANGLES},
            channels=channels,
            wavelength_nm=wavelength,
            values=values,
            uncertainty=uncertainty,
            mueller=mueller,
            bandwidth_nm=_length_nm(dataset, "bandwidth"),
            instrument=Instrument(**instrument),
            provenance=str(attributes.get("provenance", "")),
            record=json.loads(attributes.get("record", "{}")),
        )


def _floats(name: str, array: Any, *, optional: bool) -> Floats | None:
    """Return numbers as an array of floats; ParameterError if they are missing, or none."""
    if array is None:
        if optional:
            return None
        raise ParameterError(name, "it is missing; an array of numbers is needed", None)
    array = plain(name, array)
    try:
        return np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParameterError(name, f"{type(array).__name__} is no array of numbers", type(array).__name__) from None


def _units(dataset: xr.Dataset, name: str) -> str:
    """Return the units that a variable of a Dataset states, without blanks at the ends; "" if it states none."""
    return str(dataset[name].attrs.get("units", "")).strip()


def _length_nm(dataset: xr.Dataset, name: str) -> NDArray[np.float64] | None:
    """Return wavelengths or bandwidths [nm] of a Dataset, shape (C,), from nm, um or m; None if it has none."""
    if name not in dataset.variables:
        return None
    units = _units(dataset, name)
    if units not in NM_PER:
        raise ParameterError(name, f"its units are {units!r}; allowed are nm, um and m", units, tuple(NM_PER))
    lengths = np.asarray(dataset[name], dtype=np.float64).reshape(-1)
    scale = NM_PER[units]
    return lengths if scale == 1.0 else np.round(lengths * scale, 9)


def _flat(theta: Floats, phi: Floats) -> Floats:
    """Return directions as theta (cos phi, sin phi) [degree], shape (N, 2)."""
    return np.stack([degrees(theta) * np.cos(phi), degrees(theta) * np.sin(phi)], axis=1)


def _numbered(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return a number for each row (N, K) of keys: the same number, the same row. Numbers are in the order of rows."""
    order = np.lexsort(keys.T[::-1])
    new = np.any(np.diff(keys[order], axis=0, prepend=keys[order[:1]]), axis=1)
    numbers = np.empty(len(keys), dtype=np.int64)
    numbers[order] = np.cumsum(new)
    return numbers


def _angle(dataset: xr.Dataset, name: str, count: int) -> Floats:
    """Return an angle [rad] of a Dataset; an azimuth of the light that is missing is 0."""
    if name not in dataset.variables:
        return np.zeros(count)
    units = str(dataset[name].attrs.get("units", "missing"))
    angle = np.asarray(dataset[name].values, dtype=np.float64)
    if units.startswith("deg"):
        return radians(angle)
    if units.startswith("rad"):
        return angle
    raise ParameterError(name, f"its units are {units!r}; degree and radian are allowed", units, ("degree", "radian"))


def percent(share: float) -> str:
    """Return a share as text in percent: a plain number, with two digits below 10 %."""
    return f"{100.0 * share:.0f} %" if not abs(share) < 0.0995 else f"{100.0 * share:.2g} %"


def notes_of(record: Mapping[str, Any]) -> tuple[str, ...]:
    """Return what a reader noted in a record, in sentences."""
    notes = [str(note) for note in record.get("notes", ())]
    if "plane" in record:
        notes += _plane(record)
    if text := _HELD.get(record.get("quantity", "")):
        notes.append(f"The file holds {text}: f_r was made of them.")
    if text := record.get("angles_stated"):
        notes.append(f"Angles were read as stated: {text}.")
    if k := record.get("coverage_factor"):
        notes.append(f"Uncertainties were divided by the coverage factor {k:g}, as was stated.")
    if text := _AZIMUTHS.get(record.get("azimuth", "")):
        notes.append(text)
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


def _plane(record: Mapping[str, Any]) -> list[str]:
    """Return on which side of the plane of incidence a reader took viewers to be, and whether the lobe agrees."""
    lobe = record.get("lobe")
    forward = record.get("azimuth") == "forward"
    other = "light" if forward else "forward"
    sides = ("side of the light", "mirror side") if forward else ("mirror side", "side of the light")
    if record["plane"] == "signs":
        text = f"those of the sign of theta_i on the {sides[1]}"
    elif record["plane"] == "one side":
        text = f"all on the {sides[0]} (delta_phi {0 if forward else 180}), as no theta_r is negative"
    else:
        text = f"positive theta_r on the {sides[0]}"
    if forward and lobe in ("mirror", "light"):  # lobes were looked for before the sides were exchanged
        lobe = "light" if lobe == "mirror" else "mirror"
    if record["plane"] == "one azimuth":
        return (
            ["The azimuth is the same in all rows: negative theta_r is on its other side."] if lobe == "light" else []
        )
    text += "; the lobe is on the mirror side, too" if lobe == "mirror" else ""
    start = "No column is an azimuth: viewers were taken to be in the plane of incidence"
    notes = [f"{start}, {text}. --azimuth {other} exchanges the sides."]
    if lobe == "normal":
        text = "if theta_r counts from the specular direction, --column from_specular=NAME reads it"
        notes.append(f"Specular? The lobe stays at theta_r 0 at all incidences: {text}.")
    return notes
