"""Building blocks of the figures of He et al. 1991: surfaces, cuts through their f_r, and reflectances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from brdfdb.figure import Curve, Panel, curve_of
from brdfdb.geometry import degrees, radians
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.materials import presets
from brdfdb.models import he_torrance, he_torrance_aperture, he_torrance_smooth, he_torrance_specular
from brdfdb.parameters import Floats

CONE_SR = np.pi / 1024.0  # solid angle of light and receiver, "in the experiments" of section 4
HALF_ANGLE_DEG = float(degrees(np.arcsin(np.sqrt(CONE_SR / np.pi))))  # half angle of a cone
HIGHEST_DEG = 88.0  # largest angle of a viewer: beyond it a part of the cone is below the horizon
TOLERANCE = 1e-5  # absolute tolerance of reflectances

Surface = dict[str, Any]


class Cut(NamedTuple):
    """f_r [1/sr] in the plane of incidence over the signed angle of the viewer, positive on the mirror side."""

    theta_i_deg: float
    x_deg: Floats
    f_r: Floats

    @property
    def label(self) -> str:
        return f"θ_i = {self.theta_i_deg:g}°"

    @property
    def mirror(self) -> float:
        """f_r [1/sr] in the mirror direction, the denominator of eq. 11."""
        return float(np.interp(self.theta_i_deg, self.x_deg, self.f_r))

    @property
    def peak_deg(self) -> float:
        return float(self.x_deg[np.argmax(self.f_r)])

    @property
    def peak(self) -> float:
        """The largest f_r over f_r in the mirror direction [1]."""
        return float(self.f_r.max()) / self.mirror

    @property
    def width_deg(self) -> float:
        """The full width [degree] at half of the largest f_r, limited by the ends of the cut."""
        half = self.f_r.max() / 2.0
        first, last = np.flatnonzero(self.f_r >= half)[[0, -1]]
        rising = [max(first - 1, 0), first]
        falling = [min(last + 1, self.x_deg.size - 1), last]
        ends = [np.interp(half, self.f_r[pair], self.x_deg[pair]) for pair in (rising, falling)]
        return float(ends[1] - ends[0])

    def curve(self, over: float) -> Curve:
        """Return the curve of f_r over a number, labelled with the angle of incidence."""
        return curve_of(self.label, self.x_deg, self.f_r / over)


def surface_of(name: str, wavelength_nm: float | None = None) -> Surface:
    """Return the arguments of a preset at one wavelength, by default its own."""
    return {key: float(np.squeeze(value)) for key, value in presets()[name].arguments(wavelength_nm).items()}


def parameters_text(surface: Surface) -> str:
    """Return the parameters of a surface as captions write them."""
    return (
        f"σ_0 = {surface['sigma_0_um']:g} µm, τ = {surface['tau_um']:g} µm, a = {surface['a']:g}, "
        f"λ = {surface['wavelength_nm'] / 1000.0:g} µm"
    )


def viewers(theta_i_deg: float) -> Floats:
    """Return angles [degree] of viewers in a plane, dense around the mirror direction."""
    near = np.arange(-4.0, 4.05, 0.1)
    x: Floats = np.unique(np.round(np.append(np.arange(-HIGHEST_DEG, HIGHEST_DEG + 0.5), theta_i_deg + near), 6))
    return x[abs(x) <= HIGHEST_DEG]


def cut_of(model: Callable[..., Floats], theta_i_deg: float, turn: float = 0.0, **arguments: Any) -> Cut:
    """Return the cut through a model in the plane of incidence, or in a plane turned from it by an angle [rad]."""
    x = viewers(theta_i_deg)
    phi_r = np.where(x >= 0.0, np.pi, 0.0) + turn
    return Cut(theta_i_deg, x, model(radians(theta_i_deg), 0.0, radians(abs(x)), phi_r, **arguments))


def measured_cuts(surface: Surface, thetas_deg: Floats) -> list[Cut]:
    """Return cuts of all three parts as seen through the paper's apertures, one per angle of incidence."""
    cones = {"incident_solid_angle_sr": CONE_SR, "received_solid_angle_sr": CONE_SR}
    return [cut_of(he_torrance_aperture, theta, **cones, **surface) for theta in thetas_deg.tolist()]


def specular(surface: Surface, theta_i_deg: float | Floats) -> Floats:
    """Return rho_s [1], eq. 73."""
    return he_torrance_specular(radians(theta_i_deg), **{key: value for key, value in surface.items() if key != "a"})


def smooth(surface: Surface, theta_i_deg: float | Floats) -> Floats:
    """Return |F|^2 [1] of a surface, eq. 10."""
    return he_torrance_smooth(radians(theta_i_deg), n=surface["n"], k=surface["k"])


def specular_of_peak(surface: Surface, cut: Cut) -> float:
    """Return the share [1] of the specular part, eq. 70, of f_r in the mirror direction."""
    cos_i = float(np.cos(radians(cut.theta_i_deg)))
    return float(specular(surface, cut.theta_i_deg)) / (cos_i * CONE_SR) / cut.mirror


def lobe_at(surface: Surface, theta_i_deg: float, x_deg: float) -> float:
    """Return f_r [1/sr] of the diffuse parts for one viewer in the plane of incidence."""
    phi_r = np.pi if x_deg >= 0.0 else 0.0
    return float(he_torrance(radians(theta_i_deg), 0.0, radians(abs(x_deg)), phi_r, **surface))


def reflected(
    surface: Surface, theta_i_deg: float | Floats, *, specular: bool = True, tolerance: float = TOLERANCE
) -> Floats:
    """Return rho_dh [1], with or without its specular part, within an absolute tolerance."""
    theta_i = radians(theta_i_deg)
    return directional_albedo("he_torrance", theta_i, tolerance=tolerance, specular=specular, **surface).albedo


def polar(cuts: Sequence[Cut]) -> Panel:
    """Return a polar panel of cuts over their values in the mirror direction, eq. 11."""
    return polar_panel([cut.curve(cut.mirror) for cut in cuts], "f_r over f_r in the mirror direction")


def polar_panel(curves: list[Curve], y_label: str, title: str = "") -> Panel:
    """Return a polar panel over the signed angle of the viewer."""
    return Panel(kind="polar", title=title, x_label="θ_r [degree]", y_label=y_label, curves=curves)
