"""Scenes of one object for the tests of scenes: materials, cameras and the shape that most of them see."""

from __future__ import annotations

from typing import Any

from brdfdb.scenes.scene import Scene

COARSE = [float(wavelength) for wavelength in range(400, 701, 20)]
WHITE = {"title": "white", "model": "lambert", "source": "a test", "parameters": {"rho": 1.0}}
MIRROR = {
    "title": "smooth copper",
    "model": "he_torrance",
    "source": "a test",
    "refractive_index": "main/Cu/Johnson",
    "parameters": {"sigma_0_um": 0.0, "tau_um": 1.0},
}
SPHERE = {"kind": "sphere", "radius": 1.0}
FAR = {"position": [0.0, -5.0, 0.0], "height": 2.0, "aspect": 1.0}
ABOVE = {"position": [0.0, 0.0, 5.0], "up": [0.0, 1.0, 0.0], "height": 2.0, "aspect": 1.0}
TILTED = {"position": [0.0, -0.6, 0.8], "height": 1.0, "aspect": 1.0}  # 36.87 degrees from the normal of the ground


def scene(
    material: str,
    shape: dict[str, Any] | None = None,
    *,
    grain_deg: float = 0.0,
    more: list[dict[str, Any]] | None = None,
    **fields: Any,
) -> Scene:
    """Return a scene of `thing`, a sphere or another shape, with more objects and other fields of the scene."""
    thing = {"name": "thing", "material": material, "shape": shape or SPHERE, "grain_deg": grain_deg}
    given = {"camera": FAR, "wavelengths_nm": COARSE, "define": {"white": WHITE, "mirror": MIRROR}, **fields}
    return Scene.model_validate({"objects": [thing, *(more or [])], **given})
