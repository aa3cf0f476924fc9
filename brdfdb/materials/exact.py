"""The exact twin of a material: the model of the registry that the model of the material approximates."""

from __future__ import annotations

from brdfdb.materials.material import Material


def exact_material(material: Material) -> Material:
    """Return the material with the exact model that its own approximates, or itself if the registry has none.

    Statements about parameters that the exact model lacks are left out, and so is a known excess: it belongs to the
    other model.
    """
    exact = None if material.spec.exact_model is None else material.spec.exact_model(material.parameters)
    if exact is None:
        return material
    model, parameters = exact
    stated = {
        "sources": {name: source for name, source in material.sources.items() if name in parameters},
        "assumed": {name: assumption for name, assumption in material.assumed.items() if name in parameters},
        "known_excess": None,
    }
    return material.model_copy(update={"model": model, "parameters": parameters, **stated})
