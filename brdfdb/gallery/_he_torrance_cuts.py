"""What the figures of He et al. 1991 are made of: surfaces, cuts through their f_r, reflectances."""

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

CONE_SR = np.pi / 1024.0  # of light and receiver, "in the experiments" of section 4
HALF_ANGLE_DEG = float(degrees(np.arcsin(np.sqrt(CONE_SR / np.pi))))  # of a cone
HIGHEST_DEG = 88.0  # beyond, a part of the cone of the receiver is below the horizon
TOLERANCE = 1e-5  # of reflectances, absolute

Surface = dict[str, Any]


class Cut(NamedTuple):
    """f_r [1/sr] in the plane of incidence, over the signed angle of the viewer: the mirror side is positive."""

    theta_i_deg: float
    x_deg: Floats
    f_r: Floats

    @property
    def label(self) -> str:
        return f"θ_i = {self.theta_i_deg:g}°"

    @property
    def mirror(self) -> float:
        """f_r in the mirror direction, the denominator of eq. (11)."""
        return float(np.interp(self.theta_i_deg, self.x_deg, self.f_r))

    @property
    def peak_deg(self) -> float:
        return float(self.x_deg[np.argmax(self.f_r)])

    @property
    def peak(self) -> float:
        """The largest f_r over that in the mirror direction [1]."""
        return float(self.f_r.max()) / self.mirror

    @property
    def width_deg(self) -> float:
        """The full width at half of the largest f_r, up to where the cut ends."""
        half = self.f_r.max() / 2.0
        first, last = np.flatnonzero(self.f_r >= half)[[0, -1]]
        rising = [max(first - 1, 0), first]
        falling = [min(last + 1, self.x_deg.size - 1), last]
        ends = [np.interp(half, self.f_r[pair], self.x_deg[pair]) for pair in (rising, falling)]
        return float(ends[1] - ends[0])

    def curve(self, over: float) -> Curve:
        """f_r over a number, labelled with the angle of incidence."""
        return curve_of(self.label, self.x_deg, self.f_r / over)


def surface_of(name: str, wavelength_nm: float | None = None) -> Surface:
    """Arguments of a preset at one wavelength, by default its own."""
    return {key: float(np.squeeze(value)) for key, value in presets()[name].arguments(wavelength_nm).items()}


def described(surface: Surface) -> str:
    """The parameters of a surface as captions write them."""
    return (
        f"σ_0 = {surface['sigma_0_um']:g} µm, τ = {surface['tau_um']:g} µm, a = {surface['a']:g}, "
        f"λ = {surface['wavelength_nm'] / 1000.0:g} µm"
    )


def viewers(theta_i_deg: float) -> Floats:
    """Angles [degree] of viewers in a plane, close to each other where a cone of light is mirrored."""
    near = np.arange(-4.0, 4.05, 0.1)
    x: Floats = np.unique(np.round(np.append(np.arange(-HIGHEST_DEG, HIGHEST_DEG + 0.5), theta_i_deg + near), 6))
    return x[abs(x) <= HIGHEST_DEG]


def cut_of(model: Callable[..., Floats], theta_i_deg: float, turn: float = 0.0, **arguments: Any) -> Cut:
    """A model in the plane of incidence, or in one turned away from it by that angle [rad]."""
    x = viewers(theta_i_deg)
    phi_r = np.where(x >= 0.0, np.pi, 0.0) + turn
    return Cut(theta_i_deg, x, model(radians(theta_i_deg), 0.0, radians(abs(x)), phi_r, **arguments))


def measured(surface: Surface, thetas_deg: Floats) -> list[Cut]:
    """What instruments of the paper's apertures see, all three parts, at some angles of incidence."""
    cones = {"incident_solid_angle_sr": CONE_SR, "received_solid_angle_sr": CONE_SR}
    return [cut_of(he_torrance_aperture, theta, **cones, **surface) for theta in thetas_deg.tolist()]


def specular(surface: Surface, theta_i_deg: float | Floats) -> Floats:
    """rho_s, eq. (73)."""
    return he_torrance_specular(radians(theta_i_deg), **{key: value for key, value in surface.items() if key != "a"})


def smooth(surface: Surface, theta_i_deg: float | Floats) -> Floats:
    """Return |F|^2 [1] of a surface, eq. (10)."""
    return he_torrance_smooth(radians(theta_i_deg), n=surface["n"], k=surface["k"])


def specular_of_peak(surface: Surface, cut: Cut) -> float:
    """The share of the specular part, eq. (70), in what is seen in the mirror direction."""
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
    """Curves over their value in the mirror direction, eq. (11)."""
    return Panel(
        kind="polar",
        x_label="θ_r [degree]",
        y_label="f_r over f_r in the mirror direction",
        curves=[cut.curve(cut.mirror) for cut in cuts],
    )
