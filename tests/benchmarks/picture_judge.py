"""A judge of choices by pictures of its own, which shares no code with `choose`.

Rays, frames, shadows, mirrors, forms at limbs and at few wavelengths, colours and differences are written down again
here. A scene is rendered at some widths, with its pixels moved by some offsets, by the exact forms and by the choice.
Where an object shows more pixels than a limit, that many are drawn, and as many of its limbs.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import colour
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from brdfdb.forms import catalogue
from brdfdb.integrals.quadrature import spectral_albedo
from brdfdb.materials import Material, presets

Array = NDArray[np.float64]
WIDTHS = (100, 128, 200, 512)
LIMB, GRAZING, LAST = np.cos(np.radians([85.0, 89.99, 89.5]))
WAVELENGTHS = np.arange(380.0, 781.0, 10.0)
STEPS = 200  # along a ray through a surface of revolution
FAR = 1e-6  # how far off a surface other rays begin


class Count(NamedTuple):
    """Pixels of a material: how many, how many of them are beyond the tolerance, and the largest error."""

    pixels: int
    beyond: int
    most: float


class Light(NamedTuple):
    """Directions over a disc, irradiance by each, its centre, its radiance, and the cosine from there to its edge."""

    towards: Array
    each: float
    centre: Array
    radiance: float
    edge: float


def normalised(v: Array) -> Array:
    return np.asarray(v / np.sqrt((v * v).sum(axis=-1, keepdims=True)))


class Body:
    """A sphere, cylinder, plane, box or surface of revolution, in its own axes."""

    def __init__(self, item: dict[str, Any]) -> None:
        self.name, self.material, shape = item["name"], item["material"], item["shape"]
        self.shape, self.kind = shape, shape["kind"]
        self.at = np.array(shape.get("position", (0, 0, 0)), dtype=np.float64)
        z = normalised(np.array(shape.get("axis", (0, 0, 1)), dtype=np.float64))
        x = np.array([1.0, 0, 0]) if abs(z[0]) < 0.9 else np.array([0, 1.0, 0])
        x = normalised(x - x @ z * z)
        turn = np.radians(shape.get("turn_deg", 0.0))
        self.axes = np.stack(
            [np.cos(turn) * x + np.sin(turn) * np.cross(z, x), np.cos(turn) * np.cross(z, x) - np.sin(turn) * x, z]
        )
        if self.kind == "revolution":
            radius, height = np.array(shape["profile"]).T
            self.profile, self.ends = PchipInterpolator(height, radius), (height[0], height[-1])
        grain = np.radians(item.get("grain_deg", 0.0))
        self.grain = np.array([np.cos(grain), np.sin(grain)])

    def meets(self, o: Array, d: Array) -> Array:
        o, d = (o - self.at) @ self.axes.T, d @ self.axes.T
        with np.errstate(all="ignore"):
            t = np.stack(list(getattr(self, f"_{self.kind}")(o, d)))
        return np.asarray(np.min(np.where(t > 0.0, t, np.inf), axis=0))

    def _sphere(self, o: Array, d: Array) -> tuple[Array, ...]:
        b, c = (o * d).sum(axis=1), (o * o).sum(axis=1) - self.shape["radius"] ** 2
        root = np.sqrt(b * b - c)
        return -b - root, -b + root

    def _plane(self, o: Array, d: Array) -> tuple[Array, ...]:
        t = -o[:, 2] / d[:, 2]
        half = np.array(self.shape.get("size", (np.inf, np.inf))) / 2.0
        return (np.where((np.abs((o + t[:, None] * d)[:, :2]) <= half).all(axis=1), t, np.inf),)

    def _box(self, o: Array, d: Array) -> tuple[Array, ...]:
        size = np.array(self.shape["size"])
        low, high = np.array([-size[0], -size[1], 0.0]) / [2, 2, 1], size / [2, 2, 1]
        one, other = (low - o) / d, (high - o) / d
        near, far = np.fmax.reduce(np.minimum(one, other), axis=1), np.fmin.reduce(np.maximum(one, other), axis=1)
        return np.where(near <= far, near, np.inf), np.where(near <= far, far, np.inf)

    def _caps(self, o: Array, d: Array, caps: list[tuple[float, float]]) -> list[Array]:
        found = []
        for radius, height in caps:
            t = (height - o[:, 2]) / d[:, 2]
            p = o + t[:, None] * d
            found.append(np.where(np.hypot(p[:, 0], p[:, 1]) <= radius, t, np.inf))
        return found

    def _cylinder(self, o: Array, d: Array) -> tuple[Array, ...]:
        r, h = self.shape["radius"], self.shape["height"]
        a, b = d[:, 0] ** 2 + d[:, 1] ** 2, o[:, 0] * d[:, 0] + o[:, 1] * d[:, 1]
        root = np.sqrt(b * b - a * (o[:, 0] ** 2 + o[:, 1] ** 2 - r * r))
        sides = []
        for t in ((-b - root) / a, (-b + root) / a):
            z = o[:, 2] + t * d[:, 2]
            sides.append(np.where((z >= 0.0) & (z <= h), t, np.inf))
        return (*sides, *self._caps(o, d, [(r, 0.0), (r, h)]))

    def _revolution(self, o: Array, d: Array) -> tuple[Array, ...]:
        """March through the cylinder around the surface, then halve the step in which a ray enters it."""
        low, high = self.ends
        widest = float(max(radius for radius, _ in self.shape["profile"])) * 1.001
        a, b = d[:, 0] ** 2 + d[:, 1] ** 2, o[:, 0] * d[:, 0] + o[:, 1] * d[:, 1]
        root = np.sqrt(np.maximum(b * b - a * (o[:, 0] ** 2 + o[:, 1] ** 2 - widest**2), 0.0))
        enter, leave = (-b - root) / a, (-b + root) / a
        slab = np.sort(np.stack([(low - o[:, 2]) / d[:, 2], (high - o[:, 2]) / d[:, 2]]), axis=0)
        level = np.abs(d[:, 2]) < 1e-12
        start = np.maximum(np.where(level, enter, np.maximum(enter, slab[0])), 0.0)
        stop = np.where(level, leave, np.minimum(leave, slab[1]))

        near = np.flatnonzero(start < stop)
        o_near, d_near, start, stop = o[near], d[near], start[near], stop[near]

        def inside(t: Array) -> NDArray[np.bool_]:
            p = o_near + t[:, None] * d_near
            off = np.hypot(p[:, 0], p[:, 1]) < self.profile(np.clip(p[:, 2], low, high))
            return np.asarray(off & (p[:, 2] >= low) & (p[:, 2] <= high))

        one, other, met = start.copy(), stop.copy(), np.zeros(len(near), dtype=bool)
        for step in range(1, STEPS + 1):
            after = start + (stop - start) * step / STEPS
            new = inside(after) & ~met
            other = np.where(new, after, other)
            one = np.where(met | new, one, after)
            met |= new
        for _ in range(50):
            middle = (one + other) / 2.0
            within = inside(middle)
            one, other = np.where(within, one, middle), np.where(within, middle, other)
        found = np.full(len(o), np.inf)
        found[near[met]] = other[met]
        return found, *self._caps(o, d, [(float(self.profile(end)), end) for end in self.ends])

    def frames(self, points: Array) -> Array:
        """Return x along the grain, y and the normal as rows, (N, 3, 3)."""
        p = (points - self.at) @ self.axes.T
        flat = np.zeros(len(p), dtype=bool)
        out = np.stack([p[:, 0], p[:, 1], 0.0 * p[:, 0]], axis=1)
        if self.kind == "sphere":
            n = normalised(p)
        elif self.kind == "plane":
            n, flat = np.tile([0.0, 0.0, 1.0], (len(p), 1)), ~flat
        elif self.kind == "box":
            size = np.array(self.shape["size"])
            scaled = (p - [0, 0, size[2] / 2.0]) / size
            n = np.where(np.arange(3) == np.abs(scaled).argmax(axis=1)[:, None], np.sign(scaled), 0.0)
            out, flat = n, n[:, 2] != 0.0
        else:
            ends = (0.0, self.shape["height"]) if self.kind == "cylinder" else self.ends
            off = np.abs(p[:, 2:] - np.array(ends))
            flat = off.min(axis=1) < 1e-7
            slope = 0.0 if self.kind == "cylinder" else self.profile.derivative()(np.clip(p[:, 2], *ends))
            n = normalised(
                normalised(out + 1e-300) - np.stack([0.0 * p[:, 0], 0.0 * p[:, 0], slope + 0.0 * p[:, 0]], axis=1)
            )
            n[flat] = np.where(off.argmin(axis=1) == 0, -1.0, 1.0)[flat, None] * [0.0, 0.0, 1.0]
        x = np.where(flat[:, None], [1.0, 0.0, 0.0], np.stack([-out[:, 1], out[:, 0], 0.0 * out[:, 0]], axis=1))
        x = normalised(x)
        y = np.cross(n, x)
        x = self.grain[0] * x + self.grain[1] * y
        return np.asarray(np.stack([x, np.cross(n, x), n], axis=1) @ self.axes)


class Form:
    """A form of choice.json, built from the forms of its material; and the truth of that."""

    def __init__(self, material: Material, option: dict[str, Any]) -> None:
        match = re.fullmatch(r"(.+?)(-\d+-wavelengths)?", option["key"])
        assert match is not None
        key = match[1]
        self.own = None if option["wavelengths_nm"] is None else np.array(option["wavelengths_nm"])
        planned = re.search(r"planned for ([0-9.]+) %", option["title"])
        tolerances = [float(planned[1]) / 100.0] if planned else [0.1] if option["kind"] == "table" else []
        forms = {each.key: each for each in catalogue.forms(material, self.own, tolerances)}
        self.form, self.truth = forms[key.removesuffix("-true-limbs")], next(iter(forms.values()))
        self.limbs = key.endswith("-true-limbs")

    def __call__(self, wi: Array, wr: Array) -> Array:
        values = np.array(self.form.evaluate(wi.astype(self.form.dtype), wr.astype(self.form.dtype)), dtype=np.float64)
        limb = (wi[:, 2] < LIMB) | (wr[:, 2] < LIMB)
        if self.limbs and limb.any():
            values[limb] = self.truth.evaluate(wi[limb], wr[limb])
        if self.own is None or len(self.own) == len(WAVELENGTHS):
            return values
        return np.stack([np.interp(WAVELENGTHS, self.own, row) for row in values])


class Judge:
    """A scene file and what was chosen for it."""

    def __init__(self, scene: dict[str, Any], choice: dict[str, Any], seed: int = 0) -> None:
        self.scene, self.choice, self.rng = scene, choice, np.random.default_rng(seed)
        self.bodies = [Body(item) for item in scene["objects"]]
        known = dict(presets())
        for name, table in scene.get("define", {}).items():
            known[name] = Material.from_table(name, table)
        self.materials = {body.material: known[body.material] for body in self.bodies}
        options = {each["material"]: each for each in choice["materials"]}
        self.truths = {name: Form(each, options[name]["truth"]) for name, each in self.materials.items()}
        self.forms = {name: Form(each, options[name]["choice"]) for name, each in self.materials.items()}
        self.tolerance = scene["tolerance"]["ciede2000"]
        self.exposure, self.ambient = scene.get("exposure", 1.0), scene.get("ambient", 0.0)
        self.lights = [self._light(light) for light in scene.get("lights", [])]
        self.albedos = {name: self._albedos(name) for name in self.materials} if self.ambient else {}
        shape = colour.SPECTRAL_SHAPE_ASTME308
        spread = np.stack([np.interp(shape.wavelengths, WAVELENGTHS, one) for one in np.eye(len(WAVELENGTHS))])
        cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
        weights = spread @ (cmfs * colour.SDS_ILLUMINANTS["D65"].copy().align(shape).values[:, None])
        self.weights = weights / weights[:, 1].sum()

    def _light(self, light: dict[str, Any]) -> Light:
        z = normalised(np.array(light["direction"], dtype=np.float64))
        solid, strength = light.get("solid_angle_sr", 0.0), light.get("strength", 1.0)
        if not solid:
            return Light(z[None], np.pi * strength, z, 0.0, 2.0)
        count = light.get("samples", 16)
        edge = 1.0 - solid / (2.0 * np.pi)
        cos = 1.0 - (1.0 - edge) * (np.arange(count) + self.rng.random(count)) / count
        phi = 2.0 * np.pi * (np.arange(count) * 0.618034 + self.rng.random())
        x = normalised(np.cross(z, [0.3, 0.5, 0.8]))
        towards = cos[:, None] * z + np.sqrt(1.0 - cos**2)[:, None] * (
            np.cos(phi)[:, None] * x + np.sin(phi)[:, None] * np.cross(z, x)
        )
        whole = np.pi * strength / ((1.0 + edge) / 2.0)
        return Light(towards, whole / count, z, whole / solid, edge)

    def _albedos(self, name: str) -> tuple[Array, Array]:
        """Return angles and the albedo of the material there; of a grain, in light at 45 degrees to it."""
        material = self.materials[name]
        arguments = material.arguments(self.truths[name].own)
        theta = np.radians([0.0, 20, 40, 55, 65, 72, 78, 82, 85, 87, 88.5, 89.5])
        turned = np.pi / 4.0 if material.anisotropic else 0.0
        values = [
            spectral_albedo(
                material.spec, float(t), turned, arguments, tolerance=1e-3, mirrored=not material.anisotropic
            )
            for t in theta
        ]
        return theta, np.stack([np.broadcast_to(each.albedo, len(WAVELENGTHS)) for each in values])

    def rays(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return rays through places in halves of the picture's height."""
        camera = self.scene["camera"]
        eye = np.array(camera["position"], dtype=np.float64)
        ahead = normalised(np.array(camera.get("target", (0, 0, 0))) - eye)
        right = normalised(np.cross(ahead, camera.get("up", (0, 0, 1))))
        plane = x[:, None] * right + y[:, None] * np.cross(right, ahead)
        if "height" in camera:
            return eye + camera["height"] / 2.0 * plane, np.tile(ahead, (len(x), 1))
        return np.tile(eye, (len(x), 1)), normalised(ahead + np.tan(np.radians(camera["fov_deg"] / 2.0)) * plane)

    def nearest(self, o: Array, d: Array) -> tuple[Array, NDArray[np.int64]]:
        t = np.stack([body.meets(o, d) for body in self.bodies])
        return t.min(axis=0), np.where(np.isfinite(t.min(axis=0)), t.argmin(axis=0), -1)

    def shade(
        self, body: Body, p: Array, frame: Array, viewer: Array, form: Callable[[Array, Array], Array], mirrors: Any
    ) -> Array:
        """Return radiance (N, L): lights with shadows, ambient light, and what the mirror shows."""
        n = frame[:, 2]
        lifted = p + FAR * n
        wr = normalised(np.einsum("nij,nj->ni", frame, viewer))
        total = np.zeros((len(p), len(WAVELENGTHS)))
        for light in self.lights:
            for direction in light.towards:
                wi = normalised(frame @ direction)
                lit = np.flatnonzero((wi[:, 2] > 0.0) & (wr[:, 2] > 0.0))
                if self.scene.get("shadows", True) and lit.size:
                    lit = lit[self.nearest(lifted[lit], np.tile(direction, (lit.size, 1)))[1] < 0]
                if lit.size:
                    total[lit] += light.each * wi[lit, 2:] * form(wi[lit], wr[lit])
        cos = np.clip(wr[:, 2], 0.0, 1.0)
        if self.ambient:
            theta, albedo = self.albedos[body.material]
            at = np.arccos(np.maximum(cos, LAST))
            total += self.ambient * np.stack([np.interp(at, theta, row) for row in albedo.T], axis=1)
        material = self.materials[body.material]
        if material.spec.specular is not None and mirrors is not None:
            own = self.truths[body.material].own
            reflected = np.reshape(material.specular_reflectance(np.arccos(cos), own), (len(p), -1))
            total += reflected * mirrors(lifted, 2.0 * (n * viewer).sum(axis=1)[:, None] * n - viewer)
        return total

    def look(self, o: Array, d: Array, forms: dict[str, Form], depth: int = 0) -> Array:
        """Return radiance (N, L) along rays."""
        t, which = self.nearest(o, d)
        total = np.full((len(o), len(WAVELENGTHS)), self.ambient)
        if depth:
            for light in self.lights:
                total += np.where(d @ light.centre >= light.edge, light.radiance, 0.0)[:, None]
        for number, body in enumerate(self.bodies):
            at = np.flatnonzero(which == number)
            if at.size:
                p = o[at] + t[at, None] * d[at]
                again = (lambda a, b: self.look(a, b, forms, depth + 1)) if depth == 0 else None
                total[at] = self.shade(body, p, body.frames(p), -d[at], forms[body.material], again)
        return total

    def lab(self, radiance: Array) -> Array:
        white = colour.XYZ_to_xy(self.weights.sum(axis=0))
        return np.asarray(colour.XYZ_to_Lab(np.maximum(self.exposure * radiance @ self.weights, 0.0), white))

    def judged(self, widths: tuple[int, ...], offsets: int, most: int) -> dict[str, Count]:
        """Return what pictures at some widths and offsets show of each material."""
        counts = {name: Count(0, 0, 0.0) for name in self.materials}
        for width in widths:
            height = max(1, round(width / self.scene["camera"].get("aspect", 4.0 / 3.0)))
            column, row = (each.ravel() for each in np.meshgrid(np.arange(width), np.arange(height)))
            for offset in range(offsets):
                u, v = (offset % 4 + self.rng.random()) / 4.0, (offset // 4 + self.rng.random()) / max(1, offsets // 4)
                o, d = self.rays((2.0 * (column + u) - width) / height, 1.0 - 2.0 * (row + v) / height)
                t, which = self.nearest(o, d)
                for number, body in enumerate(self.bodies):
                    counts[body.material] = self._count(counts[body.material], body, o, d, t, which == number, most)
        return counts

    def _count(self, count: Count, body: Body, o: Array, d: Array, t: Array, here: Array, most: int) -> Count:
        at = np.flatnonzero(here)
        p = o[at] + t[at, None] * d[at]
        cos = -(body.frames(p)[:, 2] * d[at]).sum(axis=1)
        at, cos = at[(cos > GRAZING) | (cos <= 0.0)], cos[(cos > GRAZING) | (cos <= 0.0)]
        limb = at[(cos < LIMB)]
        chosen = [self.rng.permutation(each)[:most] for each in (at, limb)]
        drawn = np.unique(np.concatenate(chosen)) if len(at) > most else at
        if not drawn.size:
            return count
        truth, choice = (self.lab(self.look(o[drawn], d[drawn], forms)) for forms in (self.truths, self.forms))
        off = colour.delta_E(truth, choice, method="CIE 2000")
        beyond = int((off > self.tolerance).sum())
        return Count(count.pixels + len(drawn), count.beyond + beyond, max(count.most, float(off.max())))


def judge(
    scene: Path, choice: Path, *, widths: tuple[int, ...] = WIDTHS, offsets: int = 16, most: int | None = None
) -> dict[str, Count]:
    """Return what pictures of a scene show of each material, at widths and offsets."""
    told = tomllib.loads(scene.read_text(encoding="utf-8"))
    one = Judge(told, json.loads(choice.read_text(encoding="utf-8")))
    rays = sum(len(light.towards) for light in one.lights)
    return one.judged(widths, offsets, most or max(200, 20_000 // rays**2))
