"""The material of the tests of scenes that has a specular part and nothing else."""

MIRROR = {
    "title": "smooth copper",
    "model": "he_torrance",
    "source": "a test",
    "refractive_index": "main/Cu/Johnson",
    "parameters": {"sigma_0_um": 0.0, "tau_um": 1.0},
}
