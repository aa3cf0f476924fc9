"""The store that tests of the explorer look at: its recipe, and what an audit says of it."""

from __future__ import annotations

from tests.pipelines.recipes import anisotropic, isotropic

HEAD = """\
title = "one grey, one anisotropic, one spectral"
materials = ["foam", "rolled-brass", "scene-copper-sphere"]
wavelengths_nm = [{ start = 400, stop = 700, step = 20 }]
"""
THETA = "[{ start = 0, stop = 80, step = 10 }, 89.5]"
RECIPE = "".join(
    [
        HEAD,
        isotropic("[{ start = 0, stop = 80, step = 10 }, 85, 89.5]", "[{ start = 0, stop = 180, step = 15 }]"),
        isotropic(THETA, "[{ start = 0, stop = 180, step = 30 }]", kind="spectral"),
        anisotropic("[{ start = 0, stop = 80, step = 20 }, 89.5]", "[{ start = 0, stop = 360, step = 30 }]"),
    ]
)
ALBEDO = {"theta_i_deg": [0.0, 90.0], "wavelength_nm": None, "albedo": [[0.5], [1.2]]}
SENTENCES = [
    ("energy", "Energy", "violates", "reflects 1.2 at 90 degrees", ""),
    ("reciprocity", "Reciprocity", "passes", "asymmetry up to 0", ""),
    ("validity", "Validity", "at the edge", "of 1 limit 1 at the edge", ""),
    ("validity", "Alpha", "at the edge", "0.2 (at most 0.2)", "up to about 0.2"),
]
FOUND = {
    "material": "rolled-brass",
    "revision": "r000001",
    "model": "ward",
    "findings": {"energy": {"verdict": "violates", "model": ALBEDO, "table": ALBEDO}},
    "as_published": {"word": "passes", "text": "yes", "reason": "it keeps to its formulas"},
    "conserves_energy": {"word": "violates", "text": "no: albedo 1.2 at 90°", "reason": "reflects 1.2 at 90 degrees"},
    "sentences": [dict(zip(("finding", "title", "word", "text", "quote"), each, strict=True)) for each in SENTENCES],
    "verdict": "violates",
}
# Of three materials one is audited, one was at another revision
AUDIT = {
    "when": "2026-11-21T12:00:00Z",
    "materials": [FOUND, FOUND | {"material": "scene-copper-sphere", "revision": "r000009"}],
}
