"""Mueller matrices in polarised variants of Mitsuba, from those of a facet that mirrors light to viewer.

Mitsuba's Stokes vectors have U and V of the opposite sign of `brdfdb.tables.stokes`: its second axis is k x s, ours is
p = s x k. The lower right block of a facet is the same in both. Matrices of `eval` and `sample` act on light that
travels along -wo and leaves along si.wi where radiance is carried, the other way round where importance is. They are
between `mitsuba.mueller.stokes_basis` of both directions of travel, in the frame of the surface.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

_LEAST = 1e-12  # square of the sine below which light and viewer are collinear: any plane through both serves


class Facet(NamedTuple):
    """Elements [1] of the Mueller matrix of a facet over its first one, between bases of the plane of light and viewer.

    The others are 0, but for m11 = 1, m10 = m01, m33 = m22 and m32 = -m23.
    """

    m01: Any
    m22: Any
    m23: Any


def matrix(ctx: Any, wi: Any, wo: Any, facet: Facet, polarised: Any, depolarised: Any) -> Any:
    """Return the matrix of a polarised value times a facet, and of a value that is depolarised.

    `wi` and `wo` are those of Mitsuba, `wi` towards the camera where radiance is carried.
    """
    nothing = mi.UnpolarizedSpectrum(0.0)
    m01, m22, m23 = polarised * facet.m01, polarised * facet.m22, polarised * facet.m23
    rows = (
        (polarised + depolarised, m01, nothing, nothing),
        (m01, polarised, nothing, nothing),
        (nothing, nothing, m22, m23),
        (nothing, nothing, -m23, m22),
    )
    light, viewer = (wo, wi) if ctx.mode == mi.TransportMode.Radiance else (wi, wo)
    normal = dr.cross(light, viewer)
    collinear = dr.squared_norm(normal) < _LEAST
    s_in = _across(light, normal, collinear)
    s_out = _across(viewer, normal, collinear)
    basis = mi.mueller.stokes_basis
    in_plane = mi.Spectrum(*(element for row in rows for element in row))
    return mi.mueller.rotate_mueller_basis(in_plane, -light, s_in, basis(-light), viewer, s_out, basis(viewer))


def _across(w: Any, normal: Any, collinear: Any) -> Any:
    """Return the normal of the plane, or where there is none a unit vector across `w`."""
    other = dr.cross(w, dr.select(dr.abs(w.z) < 0.9, mi.Vector3f(0.0, 0.0, 1.0), mi.Vector3f(1.0, 0.0, 0.0)))
    return dr.normalize(dr.select(collinear, other, normal))
