"""The BSDF that all models share: components, their sampler, their density and Mueller matrices, around a formula.

Mitsuba's Stokes vectors have U and V of the opposite sign of `brdfdb.tables.stokes`: its second axis is k x s, ours is
p = s x k. The lower right block of a facet is the same in both. Matrices of `eval` and `sample` act on light that
travels along -wo and leaves along si.wi where radiance is carried, the other way round where importance is. They are
between `mitsuba.mueller.stokes_basis` of both directions of travel, in the frame of the surface.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import drjit as dr
import mitsuba as mi

from brdfdb.mitsuba._parameters import PluginParameters

Values = dict[str, Any]

GLOSSY = "glossy"
DIFFUSE = "diffuse"
SPECULAR = "specular"

_COLLINEAR = 1e-12  # square of the sine below which light and viewer are collinear: any plane through both serves


class Facet(NamedTuple):
    """Elements [1] of the Mueller matrix of a facet over its first one, between bases of the plane of light and viewer.

    The others are 0, but for m11 = 1, m10 = m01, m33 = m22 and m32 = -m23.
    """

    m01: Any
    m22: Any
    m23: Any


class SampledLobe(Protocol):
    """Directions around the mirror direction that a sampler prefers."""

    @property
    def share(self) -> Any:
        """The share [1] of samples that follow the lobe."""

    @property
    def alone(self) -> float:
        """The share [1] if the glossy part is alone."""

    def draw(self, wi: Any, choice: Any, sample: Any) -> Any:
        """Return directions for a random number and a point in the unit square."""

    def density(self, wi: Any, wo: Any) -> Any:
        """Return the density [1/sr] of these directions."""


class Formula:
    """A model in Dr.Jit. Its parameters are read from the properties of the plugin.

    `components` are the parts of the BSDF in the order in which Mitsuba numbers them.
    """

    components: tuple[str, ...]
    anisotropic = False
    parameters: PluginParameters

    def at(self, interaction: Any, active: Any) -> Values:
        """Return the parameters where a ray meets the surface."""
        return self.parameters.at(interaction, active)

    def traverse(self, callback: Any) -> None:
        """Show the parameters to the scene."""
        self.parameters.traverse(callback)

    def parameters_changed(self) -> None:
        """Take what the scene has changed. Textures need nothing."""

    @property
    def description(self) -> list[str]:
        """The lines of a text about the plugin."""
        return [f"{name} = {texture}" for name, texture in self.parameters.textures.items()]

    def parts(self, values: Values, wi: Any, wo: Any) -> dict[str, Any]:
        """Return f_r [1/sr] of each part but the specular one, no cosine, for directions above the horizon.

        A part may be negative in linear sRGB. Where the sum of the parts is, 0 takes its place.
        """
        raise NotImplementedError

    def facet(self, values: Values, wi: Any, wo: Any) -> Facet | None:  # noqa: ARG002  # of a model without polarisation
        """Return what the glossy and the specular part do to polarised light; None if they depolarise it.

        The diffuse part always does.
        """
        return None

    def depolarised(self, values: Values) -> Any:  # noqa: ARG002  # of models whose glossy part is all polarised
        """Return the depolarised part of the glossy f_r [1/sr]."""
        return 0.0

    def lobe(self, values: Values, wi: Any) -> SampledLobe | None:  # noqa: ARG002  # of a model that is diffuse
        """Return the lobe of the glossy part; None if there is no such part."""
        return None

    def specular(self, values: Values, wi: Any) -> Any:  # noqa: ARG002  # of a model without a specular part
        """Return the specular reflectance [1]."""
        return 0.0

    def specular_share(self, values: Values, wi: Any) -> Any:  # noqa: ARG002  # of a model without a specular part
        """Return the share [1] of samples in the mirror direction."""
        return 0.0


class _SampleShares(NamedTuple):
    """Probabilities [1] of the three ways to draw a direction. Their sum is 1, or 0 where nothing is drawn."""

    specular: Any
    lobe: Any
    cosine: Any


class _Methods:
    """The methods of a BSDF that is black from below, around a formula."""

    m_components: list[Any]
    m_flags: Any

    def __init__(self, props: Any, formula: Formula) -> None:
        mi.BSDF.__init__(self, props)
        self._formula = formula
        of_axes = mi.BSDFFlags.Anisotropic if formula.anisotropic else mi.BSDFFlags.Empty
        self.m_components = [_flag(part) | mi.BSDFFlags.FrontSide | of_axes for part in formula.components]
        combined = mi.BSDFFlags.FrontSide | of_axes
        for part in formula.components:
            combined |= _flag(part)
        self.m_flags = combined

    def traverse(self, callback: Any) -> None:
        self._formula.traverse(callback)

    def parameters_changed(self, keys: Any = ()) -> None:  # noqa: ARG002  # all are taken
        self._formula.parameters_changed()

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        above = active & _finite(si.wi) & _finite(wo) & (si.wi.z > 0.0) & (wo.z > 0.0)
        values = self._formula.at(si, above)
        known = _finite(si.wi) & _finite(wo) & _without_nan(values)
        light, viewer = _or_normal(above, si.wi), _or_normal(above, wo)
        lobe = self._formula.lobe(values, light)
        pdf = _density(self._shares(ctx, values, lobe, light), lobe, light, viewer)
        factor = dr.select(above, viewer.z, 0.0)
        value = self._reflected(ctx, values, light, viewer, factor)
        return _or_nan(known, active, value), _or_nan(known, active, dr.select(above, pdf, 0.0))

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
        above = active & _finite(si.wi) & (si.wi.z > 0.0)
        values = self._formula.at(si, above)
        known = _finite(si.wi) & dr.isfinite(sample1) & _finite(sample2) & _without_nan(values)
        light = _or_normal(above, si.wi)
        lobe = self._formula.lobe(values, light)
        shares = self._shares(ctx, values, lobe, light)
        is_specular, in_lobe = sample1 < shares.specular, sample1 < shares.specular + shares.lobe
        wo = mi.warp.square_to_cosine_hemisphere(sample2)
        if lobe is not None:
            choice = (sample1 - shares.specular) / dr.maximum(shares.lobe, 1e-6)  # in [0, 1] where it counts
            wo = dr.select(in_lobe, lobe.draw(light, choice, sample2), wo)
        if SPECULAR in self._formula.components:
            wo = dr.select(is_specular, mi.reflect(light), wo)
        above &= wo.z > 0.0
        viewer = _or_normal(above, wo)
        pdf = _density(shares, lobe, light, viewer)
        above &= pdf > 0.0
        pdf = dr.select(above, pdf, 1.0)
        factor = dr.select(above, viewer.z / pdf, 0.0)
        specular: Any = None
        if SPECULAR in self._formula.components:
            probability = dr.select(is_specular, shares.specular, 1.0)
            pdf = dr.select(is_specular, probability, pdf)
            above |= is_specular & active & (si.wi.z > 0.0)
            specular = dr.select(is_specular & above, self._formula.specular(values, light) / probability, 0.0)
            factor = dr.select(is_specular, 0.0, factor)
            viewer = dr.select(is_specular, wo, viewer)
        record = dr.zeros(mi.BSDFSample3f)
        record.wo, record.pdf = (_or_nan(known, active, x) for x in (wo, dr.select(above, pdf, 0.0)))
        record.eta = 1.0
        self._set_component(record, ctx, is_specular, in_lobe)
        return record, _or_nan(known, active, self._reflected(ctx, values, light, viewer, factor, specular))

    def eval_diffuse_reflectance(self, si: Any, active: Any = True) -> Any:
        straight = mi.Vector3f(0.0, 0.0, 1.0)
        values = self._formula.at(si, active)
        parts = self._formula.parts(values, straight, straight)
        return parts.get(DIFFUSE, parts.get(GLOSSY)) * dr.pi

    def to_string(self) -> str:
        lines = (f"  {line}," for line in self._formula.description)
        return "\n".join((f"{type(self._formula).__name__}[", *lines, "]"))

    def _reflected(self, ctx: Any, values: Values, wi: Any, wo: Any, factor: Any, specular: Any = None) -> Any:
        """Return f_r times a factor and the specular part, as a matrix in polarised variants."""
        zero = mi.UnpolarizedSpectrum(0.0)
        parts = self._formula.parts(values, wi, wo)
        of_each = {part: zero + value * self._enabled(ctx, part) for part, value in parts.items()}
        glossy, diffuse = of_each.get(GLOSSY, zero), of_each.get(DIFFUSE, zero)
        facet = self._formula.facet(values, wi, wo) if mi.is_polarized else None
        if facet is None:
            # Parts of a colour outside sRGB may be negative, their sum is not
            value = dr.maximum(glossy + diffuse, 0.0) * factor
            return mi.depolarizer(value if specular is None else value + specular)
        hidden = dr.minimum(glossy, self._formula.depolarised(values))
        mirrored = (glossy - hidden) * factor
        mirrored = mirrored if specular is None else mirrored + specular
        return _matrix(ctx, wi, wo, facet, mirrored, (diffuse + hidden) * factor)

    def _enabled(self, ctx: Any, part: str) -> float:
        """Return 1 if the context asks for a component, else 0."""
        components = self._formula.components
        return float(part in components and ctx.is_enabled(_flag(part), components.index(part)))

    def _shares(self, ctx: Any, values: Values, lobe: SampledLobe | None, wi: Any) -> _SampleShares:
        glossy, diffuse = self._enabled(ctx, GLOSSY), self._enabled(ctx, DIFFUSE)
        in_lobe: Any = 0.0
        if lobe is not None and glossy:
            in_lobe = lobe.share if diffuse else lobe.alone
        specular: Any = 0.0
        if self._enabled(ctx, SPECULAR):
            specular = dr.detach(self._formula.specular_share(values, wi)) if glossy or diffuse else 1.0
        rest = (1.0 - specular) * max(glossy, diffuse)
        return _SampleShares(specular, rest * in_lobe, rest * (1.0 - in_lobe))

    def _set_component(self, record: Any, ctx: Any, is_specular: Any, in_lobe: Any) -> None:
        """Set type and number of the drawn component in a record. The cosine draws the diffuse one, if there is one."""
        components = self._formula.components
        record.sampled_type = record.sampled_component = mi.UInt32(0)
        for part, chosen in ((GLOSSY, True), (DIFFUSE, True), (GLOSSY, in_lobe), (SPECULAR, is_specular)):
            if self._enabled(ctx, part):
                kind = mi.UInt32(int(_flag(part)))
                number = mi.UInt32(components.index(part))
                record.sampled_type = dr.select(chosen, kind, record.sampled_type)
                record.sampled_component = dr.select(chosen, number, record.sampled_component)


def surface_class() -> Any:
    """Return the class of BSDFs for the variant of Mitsuba that is set. It takes properties and a formula.

    Each variant has a base class of its own, which allows no second one.
    """
    methods = {name: method for name, method in vars(_Methods).items() if callable(method)}
    return type(mi.BSDF)("Surface", (mi.BSDF,), methods)


def _flag(part: str) -> Any:
    """Return the flag of a component."""
    flags = mi.BSDFFlags
    return {GLOSSY: flags.GlossyReflection, DIFFUSE: flags.DiffuseReflection, SPECULAR: flags.DeltaReflection}[part]


def _or_normal(above: Any, w: Any) -> Any:
    """Return `w`, and the normal where it lies below the horizon, so that derivatives there are 0 and not nan."""
    return dr.select(above, w, mi.Vector3f(0.0, 0.0, 1.0))


def _finite(vector: Any) -> Any:
    return dr.all(dr.isfinite(vector))


def _without_nan(values: Values) -> Any:
    """Return whether no parameter is nan, nor a wavelength."""
    known: Any = True
    for value in values.values():
        for leaf in value if isinstance(value, list | tuple) else (value,):
            number = dr.isnan(leaf)
            known &= dr.none(number) if dr.depth_v(leaf) > dr.depth_v(mi.Float) else number ^ True
    return known


def _or_nan(known: Any, active: Any, value: Any) -> Any:
    """Return a value where all that it depends on is known; elsewhere nan, and 0 where a ray is masked out."""
    unknown = dr.select(active, dr.nan, 0.0)
    if dr.is_matrix_v(value):
        return dr.select(known, value, mi.Spectrum(*[mi.UnpolarizedSpectrum(unknown)] * 16))
    return dr.select(known, value, unknown)


def _density(shares: _SampleShares, lobe: SampledLobe | None, wi: Any, wo: Any) -> Any:
    cosine = shares.cosine * dr.maximum(wo.z, 0.0) * dr.inv_pi
    return cosine if lobe is None else cosine + shares.lobe * lobe.density(wi, wo)


def _matrix(ctx: Any, wi: Any, wo: Any, facet: Facet, polarised: Any, depolarised: Any) -> Any:
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
    collinear = dr.squared_norm(normal) < _COLLINEAR
    s_in = _across(light, normal, collinear)
    s_out = _across(viewer, normal, collinear)
    basis = mi.mueller.stokes_basis
    in_plane = mi.Spectrum(*(element for row in rows for element in row))
    return mi.mueller.rotate_mueller_basis(in_plane, -light, s_in, basis(-light), viewer, s_out, basis(viewer))


def _across(w: Any, normal: Any, collinear: Any) -> Any:
    """Return the normal of the plane, or a unit vector across `w` where light and viewer are collinear."""
    other = dr.cross(w, dr.select(dr.abs(w.z) < 0.9, mi.Vector3f(0.0, 0.0, 1.0), mi.Vector3f(1.0, 0.0, 0.0)))
    return dr.normalize(dr.select(collinear, other, normal))
