"""Plots of a table with matplotlib, as `table.plot.lobe()`: lobe, cuts, albedo and slices."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.errors import ParameterError, import_extra
from brdfdb.geometry import check_azimuth_deg, radians, unit_vector
from brdfdb.integrals.quadrature import reflected_share
from brdfdb.lobes import around_mirror, narrowest
from brdfdb.materials import FunctionRecord, Material
from brdfdb.measurements.glints import Glints
from brdfdb.parameters import Array, Floats
from brdfdb.tables.shared_axes import (
    COLOURS,
    DASHES,
    GRID,
    INK,
    MUTED,
    Drawn,
    DrawnCurve,
    add,
    axes_for,
    drawn_on,
    only,
    polar_grid,
    remember,
    without_only,
)
from brdfdb.tables.slices import Slice, Sliced, half_difference_slice, in_plane_slice

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SHOWN_NM = 550.0  # wavelength of a plot by default
_UNIT = "$f_r$ [1/sr]"
# Colours [sRGB] of wavelengths: violet, blue, green, orange, red, all dark enough for labels
_SPECTRUM_NM = (400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 750.0)
_SPECTRUM = (
    (0.35, 0.10, 0.55),
    (0.04, 0.37, 0.75),
    (0.00, 0.50, 0.55),
    (0.15, 0.52, 0.12),
    (0.72, 0.46, 0.00),
    (0.80, 0.20, 0.10),
    (0.45, 0.05, 0.10),
)

# Angles of a cut [degree]: even ones up to where poles at the horizon begin, and more around the mirror direction
_EVEN_DEG = np.linspace(-89.0, 89.0, 357)
_AROUND_DEG = np.linspace(-8.0, 8.0, 161)
ALBEDO_DEG = np.array([*range(0, 85, 5), 82.5, 85.0, 87.5, 89.0], dtype=np.float64)
_TOLERANCE = 1e-3  # of an albedo; a line is as wide as 0.005
_MOST_PANELS = 300

_SLICES: dict[str, Callable[[Sliced], Slice]] = {"in_plane": in_plane_slice, "half_difference": half_difference_slice}


class Plotted(Sliced, Protocol):
    """The properties of a table that plots need."""

    @property
    def name(self) -> str: ...

    @property
    def anisotropic(self) -> bool: ...

    @property
    def source(self) -> Material | FunctionRecord | None: ...

    def lookup_vectors(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats: ...

    def specular_reflectance(self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats: ...

    def smooth_vectors(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats: ...

    def glint_power(self, wi: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats: ...

    @property
    def glints(self) -> Glints | None: ...


@dataclass(frozen=True)
class Plot:
    """Plots of one table. Each draws on `ax`, or on new axes, and returns the axes.

    Axes that show a plot of the same kind are extended: all plots have one scale, each has a colour, its curves differ
    by their dashes, and the legend names them. Axes with a plot of another kind, and images, are refused.

    matplotlib is imported by the first call. MissingExtraError names the command that installs it.
    """

    table: Plotted

    def lobe(
        self,
        theta_i_deg: float | Sequence[float] = (0.0, 30.0, 60.0),
        phi_i_deg: float | Sequence[float] | None = None,
        wavelength_nm: float | Sequence[float] | None = None,
        *,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw f_r [1/sr] in the plane of incidence as a polar plot, with the light on the left.

        The radius is f_r, and the angle to the vertical is theta_r: on the right around the mirror direction, on the
        left back towards the light. ParameterError if an angle or a wavelength is out of range.

        Parameters
        ----------
        theta_i_deg : float or sequence [degree]
            Polar angles of the light, 0 to 90.
        phi_i_deg : float or sequence [degree], optional
            Azimuths of the light. The default is 0, and of anisotropic tables also 90 degrees.
        wavelength_nm : float or sequence [nm], optional
            Wavelengths of a spectral table. The default is the one of its range that is closest to 550 nm.
        ax : matplotlib Axes, optional
            Axes to draw on.
        """
        wavelengths = self._wavelengths(wavelength_nm)
        curves = self._curves(theta_i_deg, phi_i_deg, wavelengths)
        axes = axes_for("lobe", ax, (6.4, 3.9))
        turned = []
        for curve in curves:
            theta = radians(curve.x)
            turned.append(replace(curve, x=curve.y * np.sin(theta), y=curve.y * np.cos(theta)))
        edge = polar_grid(axes, turned)
        add(axes, "lobe", self._name(wavelengths), turned)
        axes.set(
            xlim=(-1.13 * edge, 1.13 * edge), ylim=(-0.1 * edge, 1.13 * edge), aspect="equal", xticks=[], yticks=[]
        )
        axes.spines[:].set_visible(False)
        axes.set_xlabel(f"← towards the light    {_UNIT} over $\\theta_r$    mirror side →", color=MUTED)
        return axes

    def cuts(
        self,
        theta_i_deg: float | Sequence[float] | None = None,
        phi_i_deg: float | Sequence[float] | None = 0.0,
        wavelength_nm: float | Sequence[float] | None = None,
        *,
        log: bool | None = None,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw f_r [1/sr] in the plane of incidence over theta_r, which is positive on the mirror side.

        Parameters and errors are those of `lobe`; lights are 0, 20, 40 and 60 degrees by default, and that of the
        strongest glint. `log` chooses a logarithmic axis. The default is one where the largest value is more than 50
        times the median.
        """
        wavelengths = self._wavelengths(wavelength_nm)
        if theta_i_deg is None:
            lit = [] if self.table.glints is None else [self.table.glints.strongest.theta_i_deg]
            theta_i_deg = sorted({0.0, 20.0, 40.0, 60.0, *lit})
        curves = self._curves(theta_i_deg, phi_i_deg, wavelengths)
        axes = axes_for("cuts", ax, (6.4, 3.9))
        was_log = bool(drawn_on(axes)) and axes.get_yscale() == "log"
        add(axes, "cuts", self._name(wavelengths), curves)
        values = np.concatenate([np.asarray(line.get_ydata(), dtype=np.float64) for line in axes.lines])
        largest = float(np.nanmax(values))
        if log is None:
            log = was_log or largest > 50.0 * max(float(np.nanmedian(values)), 1e-30)
        axes.set_yscale("log" if log else "linear")
        positive = values[values > 0.0]
        if log and positive.size:
            axes.set_ylim(max(float(positive.min()) / 1.5, 2e-7 * largest), 2.0 * largest)
        elif not log:
            axes.set_ylim(0.0, 1.12 * largest or 1.0)
        axes.set(xlim=(-90.0, 90.0), xticks=range(-90, 91, 30))
        axes.set_xlabel("$\\theta_r$ [°]: negative towards the light, positive on the mirror side", color=MUTED)
        axes.set_ylabel(_UNIT, color=MUTED)
        axes.grid(color=GRID, lw=0.7)
        return axes

    def albedo(self, phi_i_deg: float = 0.0, wavelength_nm: float | None = None, *, ax: Axes | None = None) -> Axes:
        """Draw the directional albedo [1] over theta_i: shares of uniform part, lobe, specular part and glints, and 1.

        The shares are stacked. The uniform part is shown where the source of the table names it. The azimuth of the
        light matters for anisotropic tables only; `wavelength_nm`, `ax` and errors are those of `lobe`.
        """
        wavelength = self._wavelength(wavelength_nm)
        check_azimuth_deg("phi_i_deg", phi_i_deg)
        axes = axes_for("albedo", ax, (6.4, 3.9))
        shares = albedo_shares(self.table, float(radians(phi_i_deg)), wavelength)
        shown = {label: share for label, share in shares.items() if np.max(share) > 0.0} or {"reflected": np.zeros(21)}
        tops = np.cumsum(list(shown.values()), axis=0)
        colours = [COLOURS[list(shares).index(label) % len(COLOURS)] for label in shown]
        labels = [*itertools.islice(itertools.accumulate(shown, "{} + {}".format), len(shown) - 1), ""]
        curves = [DrawnCurve(labels[at], ALBEDO_DEG, tops[at], colours[at], "-") for at in reversed(range(len(shown)))]
        without_only(axes)
        if not drawn_on(axes):
            axes.axhline(1.0, color=INK, lw=1.2)
            axes.text(1.0, 1.01, "1: everything is reflected", color=INK, va="bottom", fontsize="small")
        azimuth = f", $\\phi_i$ = {phi_i_deg:g}°" if self.table.anisotropic else ""
        plots = add(axes, "albedo", f"{self.table.name}{_at(wavelength)}{azimuth}", curves, legend=False)
        if len(plots) == 1:
            _stack(axes, shown, colours)
        highest = max(float(curve.y.max()) for plot in plots for curve in plot.curves)
        axes.set(xlim=(0.0, 90.0), ylim=(0.0, max(1.1, 1.05 * highest)), xticks=range(0, 91, 15))
        axes.set_xlabel("$\\theta_i$ [°]", color=MUTED)
        axes.set_ylabel("directional albedo [1]", color=MUTED)
        return axes

    def slices(
        self,
        kind: Literal["in_plane", "half_difference"] = "in_plane",
        wavelength_nm: float | None = None,
        *,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw f_r [1/sr] as an image on a logarithmic scale, with a colour bar on axes of its own.

        `kind` is "in_plane": theta_i over theta_r in the plane of incidence, as `brdfdb.tables.slices.in_plane_slice`;
        or "half_difference": theta_d over theta_h, as `brdfdb.tables.slices.half_difference_slice`. The wavelength of
        the table that is closest to `wavelength_nm` is shown, by default to 550 nm. Errors are those of `lobe`, also
        for another kind.
        """
        if kind not in _SLICES:
            raise ParameterError("kind", f"{kind!r} is not one of {', '.join(_SLICES)}", kind, tuple(_SLICES))
        wanted = self._wavelength(wavelength_nm)
        axes = axes_for("slices", ax, (6.4, 3.6))
        picture = _SLICES[kind](self.table)
        values = picture.values
        stored = self.table.wavelength_nm
        at = None
        if stored is not None:
            index = int(np.argmin(np.abs(stored - (_SHOWN_NM if wanted is None else wanted))))
            values = values[..., index]
            at = float(stored[index])
        positive = values[values > 0.0]
        high = float(positive.max()) if positive.size else 1.0
        low = max(float(positive.min()) if positive.size else 0.1, 1e-6 * high)
        colours = import_extra("matplotlib.colors")
        norm = colours.LogNorm(low, high if high > 1.001 * low else 1.1 * low, clip=True)
        extent = (picture.x.first - 0.5, picture.x.last + 0.5, picture.y.first - 0.5, picture.y.last + 0.5)
        look: dict[str, Any] = {"norm": norm, "cmap": "viridis", "aspect": "auto", "interpolation": "nearest"}
        image = axes.imshow(np.maximum(values, low), extent=extent, **look)
        name = f"{self.table.name}{_at(at)}"
        remember(axes, Drawn("slices", name, (), (image,)))
        bar = axes.figure.colorbar(image, ax=axes, pad=0.02)
        bar.set_label(_UNIT, color=MUTED)
        bar.outline.set_visible(False)
        labels = {
            "in_plane": ("$\\theta_r$ [°]: negative towards the light", "$\\theta_i$ [°]"),
            "half_difference": ("$\\theta_h$ [°]", "$\\theta_d$ [°]"),
        }
        axes.set_xlabel(labels[kind][0], color=MUTED)
        axes.set_ylabel(labels[kind][1], color=MUTED)
        axes.set(xticks=range(-90 if kind == "in_plane" else 0, 91, 30), yticks=range(0, 91, 30))
        axes.set_title(name, loc="left")
        return axes

    def _curves(
        self,
        theta_i_deg: float | Sequence[float],
        phi_i_deg: float | Sequence[float] | None,
        wavelengths: list[float | None],
    ) -> list[DrawnCurve]:
        """Return cuts in the plane of incidence, f_r over theta_r [degree], which is negative towards the light.

        There is one for each light, azimuth and wavelength [nm].
        """
        if phi_i_deg is None:
            phi_i_deg = (0.0, 90.0) if self.table.anisotropic else 0.0
        lights = _numbers("theta_i_deg", theta_i_deg)
        azimuths = _numbers("phi_i_deg", phi_i_deg)
        check_azimuth_deg("phi_i_deg", azimuths)
        for theta in lights:
            if not 0.0 <= theta <= 90.0:
                raise ParameterError("theta_i_deg", f"{theta:g} is outside [0, 90] degrees", theta, (0.0, 90.0))
        curves = []
        for (number, theta), (row, phi), wavelength in itertools.product(
            enumerate(lights), enumerate(azimuths), wavelengths
        ):
            around = _AROUND_DEG + theta  # more viewers around the mirror direction, most in a narrow lobe
            signed = np.union1d(_EVEN_DEG, around[np.abs(around) <= 89.0])
            at = None if wavelength is None else np.array([wavelength])
            if (
                self.table.source is not None
                and (lobe := self.table.source.lobe(np.cos(radians(theta)), at)) is not None
            ):
                signed = np.union1d(signed, around_mirror(theta, lobe))
            if self.table.glints is not None:
                signed = np.union1d(signed, self.table.glints.viewers_deg(theta, phi))
            phi_r = phi + np.where(signed > 0.0, 180.0, 0.0)
            light = radians(theta), radians(phi)
            brdf = np.asarray(
                self.table.lookup(*light, radians(np.abs(signed)), radians(phi_r), wavelength), np.float64
            )
            parts = [f"$\\theta_i$ = {theta:g}°"]
            parts += [f"$\\phi_i$ = {phi:g}°"] if len(azimuths) > 1 else []
            parts += [f"{wavelength:g} nm"] if len(wavelengths) > 1 else []
            colour: str | tuple[float, ...]
            if wavelength is None or len(wavelengths) == 1:
                colour = COLOURS[number % len(COLOURS)]
                dashes = DASHES[row % len(DASHES)]
            else:
                channels = zip(*_SPECTRUM, strict=True)
                colour = tuple(float(np.interp(wavelength, _SPECTRUM_NM, channel)) for channel in channels)
                dashes = DASHES[number % len(DASHES)]
            curves.append(DrawnCurve(", ".join(parts), signed, brdf, colour, dashes))
        return curves

    def _name(self, wavelengths: list[float | None]) -> str:
        """Return the name of the table, with its wavelength if there is a single one."""
        return self.table.name + (_at(wavelengths[0]) if len(wavelengths) == 1 else "")

    def _wavelengths(self, wavelength_nm: float | Sequence[float] | None) -> list[float | None]:
        stored = self.table.wavelength_nm
        wanted = [] if wavelength_nm is None else _numbers("wavelength_nm", wavelength_nm)
        if wanted:
            self.table.lookup(0.0, 0.0, 0.0, 0.0, wanted)  # refuses what lookups refuse, also of a grey table
        if stored is None:
            return [None]
        return list(wanted) or [float(np.clip(_SHOWN_NM, stored[0], stored[-1]))]

    def _wavelength(self, wavelength_nm: float | None) -> float | None:
        wavelengths = self._wavelengths(wavelength_nm)
        if len(wavelengths) > 1:
            raise ParameterError("wavelength_nm", f"{len(wavelengths)} numbers; one is shown at a time", wavelength_nm)
        return wavelengths[0]


def albedo_shares(table: Plotted, phi_i: float, wavelength_nm: float | None) -> dict[str, Array]:
    """Return shares [1] of reflected light at `ALBEDO_DEG`: uniform part, rest of f_r, glints, specular part.

    Lookups are integrated to 1e-3, for lights at the azimuth `phi_i` [rad]; `wavelength_nm` is None for a grey table.
    Power of glints that is an upper bound counts up to an albedo of 1.
    """
    source = table.source
    theta_i = radians(ALBEDO_DEG)

    def brdf(wi: Floats, wr: Floats) -> Floats:
        return np.asarray(table.smooth_vectors(wi, wr, wavelength_nm))[..., np.newaxis]

    at = None if wavelength_nm is None else np.array([wavelength_nm])
    total = reflected_share(
        brdf,
        theta_i,
        phi_i,
        narrowest(None if source is None else source.lobe(np.cos(theta_i)[:, np.newaxis], at)),
        tolerance=_TOLERANCE,
        most_panels=_MOST_PANELS,
        mirrored=not table.anisotropic,
    ).albedo[:, 0]
    known = source.uniform_at(at) if isinstance(source, Material) else None
    uniform = np.minimum(np.full(theta_i.size, 0.0 if known is None else np.pi * float(known[0])), total)
    rest = "lobe" if isinstance(source, Material) and source.has_lobe else "reflected"
    specular = np.asarray(table.specular_reflectance(theta_i, wavelength_nm), dtype=np.float64)
    wi = unit_vector(theta_i, phi_i)
    power = table.glint_power(wi, wavelength_nm)
    guessed = np.zeros(theta_i.size)
    if table.glints is not None:
        every = table.glints.power(wi).sum(axis=1)
        guessed = power * np.divide(
            table.glints.power(wi, guessed=True).sum(axis=1), every, out=guessed, where=every > 0.0
        )
    most = np.clip(1.0 - (total + specular + power - guessed), 0.0, guessed)
    label = "glints, at most" if guessed.any() else "glints"
    return {"uniform part": uniform, rest: total - uniform, "specular part": specular, label: power - guessed + most}


def _numbers(name: str, given: float | Sequence[float]) -> list[float]:
    """Return an argument as numbers, at least one; ParameterError if it is none."""
    try:
        numbers = np.asarray(given, dtype=np.float64).reshape(-1).tolist()
    except (TypeError, ValueError):
        raise ParameterError(name, f"{given!r} is neither a number nor a list of numbers", given) from None
    if not numbers:
        raise ParameterError(name, "is an empty list; at least one number is needed", given)
    return [float(number) for number in numbers]


def _at(wavelength_nm: float | None) -> str:
    return "" if wavelength_nm is None else f" at {wavelength_nm:g} nm"


def _stack(axes: Axes, shares: Mapping[str, Array], colours: Sequence[str]) -> None:
    """Fill the shares of the only albedo on the axes, one above the other, and name them."""
    only(*axes.stackplot(ALBEDO_DEG, *shares.values(), colors=colours, alpha=0.85, lw=0))
    below = np.zeros(ALBEDO_DEG.size)
    for label, share in shares.items():
        at = int(np.argmax(share[:-3]))
        thick = share[at] > 0.07
        x = float(np.clip(ALBEDO_DEG[at], 12.0, 66.0))
        y = below[at] + (share[at] / 2.0 if thick else share[at] + 0.015)
        colour, va = ("white", "center") if thick else (INK, "bottom")
        only(axes.text(x, y, label, ha="center", va=va, color=colour))
        below = below + share
