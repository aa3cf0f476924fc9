"""He et al. 1991 with polarised light, section 3.1 and appendix A.1: the Mueller matrix of rough surfaces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brdfdb.figure import Curve, Figure, Map, Panel, Statement, curve_of, listed, rows
from brdfdb.gallery._he_torrance_cuts import Surface, parameters_text, surface_of
from brdfdb.geometry import degrees, radians
from brdfdb.models import he_torrance, he_torrance_jones, he_torrance_mueller
from brdfdb.parameters import Floats

LIGHT_DEG = 60.0
VIEWERS_DEG = np.arange(-88.0, 88.5, 2.0)
AZIMUTHS_DEG = np.arange(0.0, 181.0, 5.0)
ELEMENTS = ((0, 1), (0, 2), (1, 1), (1, 2), (2, 3), (3, 3))  # The other elements are close to one of these, or to 0
ROUNDING = 1e-9  # relative difference of two programs of one formula
MIRROR = {"n": 1.0, "k": 1e4}  # An index that reflects 0.9996 of the light, s and p alike


def _surfaces() -> tuple[Surface, Surface]:
    """Return the aluminum of Fig. 8, and the plastic of the table top of Fig. 14 without its uniform part."""
    return surface_of("roughened-aluminum-500nm"), {**surface_of("scene-plastic-table", 550.0), "a": 0.0}


def _in_plane(surface: Surface, viewers_deg: Floats = VIEWERS_DEG) -> Floats:
    """Return Mueller matrices [1/sr] for viewers in the plane of incidence; angles are positive on the mirror side."""
    phi_r = np.where(viewers_deg < 0.0, 0.0, np.pi)
    return he_torrance_mueller(radians(LIGHT_DEG), 0.0, radians(np.abs(viewers_deg)), phi_r, **surface)


def _around(surface: Surface) -> Floats:
    """Return Mueller matrices [1/sr] for viewers around the normal, at the polar angle of the light."""
    return he_torrance_mueller(radians(LIGHT_DEG), 0.0, radians(LIGHT_DEG), radians(AZIMUTHS_DEG), **surface)


def _relative(M: Floats, row: int, column: int) -> Floats:
    """Return an element of Mueller matrices over m_00 [1]."""
    return M[..., row, column] / M[..., 0, 0]


def _turned(n: float, k: float, theta_r: Floats | float, phi_r: Floats) -> Floats:
    """Return the share [1] of s-polarised light from LIGHT_DEG that leaves p-polarised."""
    J = he_torrance_jones(radians(LIGHT_DEG), 0.0, theta_r, phi_r, n=n, k=k)
    ss, ps = np.abs(J[..., 0, 0]) ** 2, np.abs(J[..., 1, 0]) ** 2
    return np.asarray(ps / (ss + ps))


def in_plane() -> Figure:
    """Draw the change of polarisation in the plane of incidence."""
    aluminum, plastic = _surfaces()
    table = {**plastic, "a": 0.28}
    metal = _in_plane(aluminum)

    def polarised(label: str, surface: Surface) -> Curve:
        """Return the curve of m_01 over m_00."""
        return curve_of(label, VIEWERS_DEG, _relative(_in_plane(surface), 0, 1))

    return Figure(
        key="he-torrance-1991-polarisation",
        paper="he1991",
        title="Polarised light in the plane of incidence",
        caption=f"θ_i = {LIGHT_DEG:.0f}°. Aluminum of Fig. 8: {parameters_text(aluminum)}; plastic of the table top of "
        f"Fig. 14: {parameters_text(table)}. Stokes vectors (I, Q, U, V); positive Q is s-polarised. The paper gives "
        "the equations and no figure.",
        panels=[
            Panel(
                title="Unpolarised light becomes polarised, m_01",
                x_label="θ_r [degree], above 0 on the mirror side",
                y_label="Q / I of the reflected light",
                curves=[
                    polarised("plastic, first surface", plastic),
                    polarised("plastic with its uniform part", table),
                    polarised("aluminum", aluminum),
                ],
            ),
            Panel(
                title="Aluminum: linear and circular light",
                x_label="θ_r [degree], above 0 on the mirror side",
                y_label="element over m_00",
                curves=[
                    curve_of(f"m_{row}{column}", VIEWERS_DEG, _relative(metal, row, column))
                    for row, column in ((1, 1), (2, 3), (3, 3))
                ],
            ),
        ],
        statements=[
            _brewster(plastic),
            _favours_s(aluminum, plastic),
            _elliptical(aluminum, plastic),
            _reduces(aluminum, plastic),
        ],
    )


def _brewster(plastic: Surface) -> Statement:
    viewers_deg = np.arange(30.0, 80.0, 0.05)
    polarisation = _relative(_in_plane(plastic, viewers_deg), 0, 1)
    most = int(np.argmax(polarisation))
    expected = 2.0 * float(degrees(np.arctan(plastic["n"]))) - LIGHT_DEG
    return Statement(
        says="the vector form allows a complete treatment of polarization and directional Fresnel effects",
        where="section 3.1; Brewster's law for the facet that mirrors light to viewer",
        seen=f"Light from plastic is s-polarised to {polarisation[most]:.6f} at θ_r = {viewers_deg[most]:.2f}°, where "
        f"the light meets the facet at Brewster's angle: 2 arctan(n) - θ_i is {expected:.2f}°.",
        threshold_from="a closed form: Brewster's angle, to the step of the search",
        holds=bool(abs(viewers_deg[most] - expected) < 0.06 and polarisation[most] > 1.0 - 1e-5),
    )


def _fresnel(cosine: float, n: float, k: float) -> tuple[complex, complex]:
    """Return F_s and F_p [1] by the textbook's formulas."""
    index = complex(n, k)
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / index**2)
    F_s = (cosine - index * inside) / (cosine + index * inside)
    F_p = (index * cosine - inside) / (index * cosine + inside)
    return complex(F_s), complex(F_p)


def _favours_s(aluminum: Surface, plastic: Surface) -> Statement:
    # Half of the angle between light and viewer
    facet = np.cos(radians(np.abs(LIGHT_DEG + VIEWERS_DEG) / 2.0))
    off, least = [], []
    for surface in (aluminum, plastic):
        polarisation = _relative(_in_plane(surface), 0, 1)
        squares = np.abs([_fresnel(float(cosine), surface["n"], surface["k"]) for cosine in facet]) ** 2
        expected = (squares[:, 0] - squares[:, 1]) / squares.sum(axis=1)
        off.append(float(np.abs(polarisation - expected).max()))
        least.append(float(polarisation.min()))
    return Statement(
        says="reflection by facets makes s the stronger polarization, as Fresnel's coefficients at the bisecting angle "
        "do",
        where="eqs 59 to 65 in the plane of incidence; Fresnel's reflectances of the facet",
        seen=f"m_01 over m_00 is {min(least):.0e} at least, and within {max(off):.0e} of (|F_s|² - |F_p|²) / (|F_s|² + "
        "|F_p|²), for aluminum and plastic.",
        threshold_from="a closed form: Fresnel's amplitudes, to rounding",
        holds=max(off) < ROUNDING and min(least) > -ROUNDING,
    )


def _elliptical(aluminum: Surface, plastic: Surface) -> Statement:
    shares, expected = [], []
    for surface in (aluminum, plastic):
        shares.append(float(_relative(_in_plane(surface, np.array([LIGHT_DEG])), 2, 3)[0]))
        F_s, F_p = _fresnel(float(np.cos(radians(LIGHT_DEG))), surface["n"], surface["k"])
        expected.append(abs(2.0 * (F_s * F_p.conjugate()).imag) / (abs(F_s) ** 2 + abs(F_p) ** 2))
    return Statement(
        says="the model permits arbitrary incident polarization states (e.g., plane, circular, unpolarized, partially "
        "polarized)",
        where="section 3.1; Fresnel's amplitudes of a mirror",
        seen=f"In the mirror direction aluminum turns {abs(shares[0]):.4f} of circular light into light that is linear "
        f"at 45°, plastic {abs(shares[1]):.4f}; F_s and F_p of smooth mirrors give {listed(expected, '.4f')}.",
        threshold_from="a closed form: Fresnel's amplitudes of a mirror",
        holds=bool(np.allclose(np.abs(shares), expected, atol=1e-6) and abs(shares[0]) > 0.1),
    )


def _pairs(theta_deg: Floats, delta_phi_deg: Floats) -> list[Floats]:
    """Return theta_i, theta_r and phi_r - phi_i [rad] of all pairs of directions on a grid of angles [degree]."""
    return list(np.meshgrid(radians(theta_deg), radians(theta_deg), radians(delta_phi_deg), indexing="ij"))


def _reduces(aluminum: Surface, plastic: Surface) -> Statement:
    angles = _pairs(np.arange(5.0, 90.0, 10.0), np.arange(0.0, 181.0, 20.0))
    off = 0.0
    for surface in (aluminum, plastic):
        M = he_torrance_mueller(angles[0], 0.0, angles[1], angles[2], **surface)[..., 0, 0]
        f_r = he_torrance(angles[0], 0.0, angles[1], angles[2], **surface)
        lit = f_r > 1e-100
        off = max(off, float(np.abs(M[lit] / f_r[lit] - 1.0).max()))
    return Statement(
        says="the total reflected intensity is the sum of the s and p polarized intensities, and for unpolarized "
        "incident light the model reduces to the form of appendix B",
        where="eqs 32 and 68; conclusion 1",
        seen=f"Half of the sum over s and p of eqs 59 and 60 differs from eq. 71 by {off:.0e} of it at most, at 891 "
        "pairs of directions of aluminum and of plastic.",
        threshold_from="an independent evaluation: Jones matrices and eq. 71, to rounding",
        holds=off < ROUNDING,
    )


def out_of_plane() -> Figure:
    """Draw the Mueller matrix around the normal, and the share of s-polarised light that leaves p-polarised."""
    aluminum, plastic = _surfaces()
    axis = np.linspace(-0.98, 0.98, 41)
    x, y = np.meshgrid(axis, axis)
    sine = np.hypot(x, y)
    inside = sine < 0.99
    share = _turned(aluminum["n"], aluminum["k"], np.arcsin(np.where(inside, sine, 0.0)), np.arctan2(y, x))
    return Figure(
        key="he-torrance-1991-mueller",
        paper="he1991",
        title="The Mueller matrix outside the plane of incidence",
        caption=f"θ_i = {LIGHT_DEG:.0f}°; surfaces as in the figure before, without uniform parts. The first panels "
        "have elements over m_00 at θ_r = θ_i. The map has the share of s-polarised light that leaves aluminum "
        "p-polarised, over the projection of the viewers on the surface. The light comes from x > 0.",
        panels=[
            *(
                Panel(
                    title=name,
                    x_label="φ_r - φ_i [degree], 180 is the mirror direction",
                    y_label="element over m_00",
                    curves=[
                        curve_of(f"m_{row}{column}", AZIMUTHS_DEG, _relative(M, row, column))
                        for row, column in ELEMENTS
                    ],
                )
                for name, M in (("Aluminum", _around(aluminum)), ("Plastic", _around(plastic)))
            ),
            Map(
                title="From s to p, aluminum",
                x_label="sin(θ_r) cos(φ_r)",
                y_label="sin(θ_r) sin(φ_r)",
                value_label="share that leaves as p",
                x=np.round(axis, 4).tolist(),
                y=np.round(axis, 4).tolist(),
                values=rows(np.where(inside, share, np.nan), 3),
                low=0.0,
                high=1.0,
            ),
        ],
        statements=[
            _crossed(aluminum, plastic),
            _kept(aluminum, plastic),
            _depolarised(aluminum, plastic),
            _mirror(),
            _reciprocal(aluminum),
        ],
    )


def _crossed(aluminum: Surface, plastic: Surface) -> Statement:
    angles_deg = [0.0, 45.0, 90.0, 135.0, 180.0]
    shares = [
        _turned(surface["n"], surface["k"], radians(LIGHT_DEG), radians(angles_deg)) for surface in (aluminum, plastic)
    ]
    return Statement(
        says="the model includes effects like cross-polarization",
        where="section 3.1, eqs 62 and 64",
        seen=f"Aluminum reflects {listed(shares[0], '.3f')} of s-polarised light as p, plastic "
        f"{listed(shares[1], '.3f')}, for φ_r - φ_i of {listed(angles_deg, '.0f')}° and θ_r = θ_i.",
        threshold_from="the paper's words: cross-polarization, read as a largest share of more than half",
        holds=all(bool(share[0] < 1e-9 and share[-1] < 1e-9 and share[1:-1].max() > 0.5) for share in shares),
    )


def _kept(aluminum: Surface, plastic: Surface) -> Statement:
    theta = radians(1.0)
    expected = np.sin(radians(AZIMUTHS_DEG)) ** 2
    off = []
    for surface in (aluminum, plastic):
        J = he_torrance_jones(theta, 0.0, theta, radians(AZIMUTHS_DEG), n=surface["n"], k=surface["k"])
        square = np.abs(J[..., 0]) ** 2
        off.append(float(np.abs(square[..., 1] / square.sum(axis=-1) - expected).max()))
    return Statement(
        says="close to the normal a field keeps its direction in space: s turns to p as sin² of the azimuth between "
        "light and viewer",
        where="property of the form: eqs 61 to 64 for θ_i = θ_r → 0, where F_s = -F_p",
        seen=f"At θ_i = θ_r = 1° the share that leaves as p is within {max(off):.0e} of sin²(φ_r - φ_i).",
        threshold_from="a limit: second order in the angle of 1°",
        holds=max(off) < 1e-3,
    )


def _polarisation(M: Floats, stokes: NDArray[np.float64]) -> Floats:
    """Return the degree of polarisation [1] of light that Mueller matrices reflect, from a Stokes vector."""
    reflected = M @ stokes
    return np.asarray(np.linalg.norm(reflected[..., 1:], axis=-1) / reflected[..., 0])


def _depolarised(aluminum: Surface, plastic: Surface) -> Statement:
    states = [np.array([1.0, *state]) for state in ((1.0, 0.0, 0.0), (0.0, 0.6, 0.8), (-0.6, 0.8, 0.0))]
    matrices = [_around(surface) for surface in (aluminum, plastic)]
    least = min(float(_polarisation(M, state).min()) for M in matrices for state in states)
    table = min(float(_polarisation(_around({**plastic, "a": 0.28}), state).min()) for state in states)
    return Statement(
        says="the model includes effects like depolarization",
        where="section 3.1",
        seen="The first surface reflects like the one facet that mirrors light to viewer (eq. 50): fully polarised "
        f"light leaves it with a degree of polarisation of {least:.6f} at least. Only the uniform part depolarises, if "
        f"it is unpolarised, which the paper does not state: to {table:.2f} for the table top.",
        threshold_from="the paper's words: depolarization, read as a hundredth or more",
        holds=least < 0.99,
    )


def _mirror() -> Statement:
    angles = _pairs(np.arange(5.0, 85.0, 10.0), np.arange(0.0, 181.0, 10.0))
    J = he_torrance_jones(angles[0], 0.0, angles[1], angles[2], **MIRROR)
    values = np.linalg.svd(J, compute_uv=False) ** 2
    return Statement(
        says="a mirror that absorbs nothing reflects every state of polarization completely",
        where="property of the form: energy, with |F_s| = |F_p| = 1 in eqs 61 to 64",
        seen=f"With n + ik = 1 + 10000i the squared singular values of the Jones matrix are {values.min():.4f} to "
        f"{values.max():.4f} at {angles[0].size} pairs of directions.",
        threshold_from="conservation: all light of any state, within 1 %",
        holds=bool(np.abs(values - 1.0).max() < 0.01),
    )


def _reciprocal(aluminum: Surface) -> Statement:
    angles = _pairs(np.arange(5.0, 90.0, 10.0), np.arange(20.0, 180.0, 20.0))
    forth = he_torrance_mueller(angles[0], 0.0, angles[1], angles[2], **aluminum)
    back = he_torrance_mueller(angles[1], angles[2], angles[0], 0.0, **aluminum)
    # p = s x k: light that travels back has the opposite p
    sign = np.diag([1.0, 1.0, -1.0, 1.0])
    off = np.abs(back - sign @ np.swapaxes(forth, -1, -2) @ sign).max(axis=(-1, -2)) / forth[..., 0, 0]
    return Statement(
        says="with light and viewer exchanged, the Mueller matrix is its own transpose, except for the sign of U",
        where="property of the form: reciprocity of polarised light",
        seen=f"The two differ by {off.max():.0e} of m_00 at most, at {off.size} pairs of directions of aluminum.",
        threshold_from="a closed form: reciprocity, to rounding",
        holds=bool(off.max() < ROUNDING),
    )


FIGURES: dict[str, Callable[[], Figure]] = {
    "he-torrance-1991-polarisation": in_plane,
    "he-torrance-1991-mueller": out_of_plane,
}
