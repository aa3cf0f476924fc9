"""The tables of models and their parameters, from the registry."""

from __future__ import annotations

from pathlib import Path

from _site.markup import plain, table, write_page
from _site.papers import cited
from brdfdb.models import MODELS
from brdfdb.parameters import ModelSpec


def write(docs: Path, _: Path) -> None:
    """Write ``reference/generated/models.txt``, which ``reference/models.md`` includes."""
    specs = [spec for spec in MODELS.values() if spec.evaluate.__module__.startswith("brdfdb.")]
    rows = [(f"[`{s.name}`](#model-{slug(s)})", plain(s.title), plain(s.equation), cited(s.reference)) for s in specs]
    parts = [table(("function", "model", "equations", "paper"), rows), *map(_section, specs)]
    write_page(docs / "reference" / "generated" / "models.txt", "\n".join(parts))


def slug(spec: ModelSpec) -> str:
    """Return the name of a model as part of an address."""
    return spec.name.replace("_", "-")


def _section(spec: ModelSpec) -> str:
    rows = [
        (
            f"`{parameter.name}`",
            plain(parameter.symbol),
            f"{parameter.low:g} to {parameter.high:g}",
            parameter.unit,
            "required" if parameter.default is None else f"`{parameter.default}`",
            plain(parameter.meaning) + ("; may be a spectrum" if parameter.reflectance else ""),
        )
        for parameter in spec.parameters
    ]
    if spec.spectral:
        rows.append(("`wavelength_nm`", "λ", "more than 0", "nm", "required", "wavelength"))
        rows.append(("`n`, `k`", "n, k", "", "1", "required", "refractive index, n + ik"))
    traits = ["spectral" if spec.spectral else "grey", "anisotropic" if spec.lobe_axes else "isotropic"]
    traits += ["with a specular part"] if spec.specular else []
    excess = f"It may reflect more than it receives. {plain(spec.excess)}.\n" if spec.excess else ""
    return "\n".join(
        [
            f"(model-{slug(spec)})=",
            f"## {plain(spec.title)}\n",
            f"{{py:func}}`~brdfdb.models.{spec.name}`, {plain(spec.equation)}, of {cited(spec.reference)}: "
            f"{', '.join(traits)}.\n",
            table(("parameter", "symbol", "range", "unit", "default", "meaning"), rows),
            excess,
        ]
    )
