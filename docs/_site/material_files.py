"""The files that the page of a material offers: its picture, the table as one zip, a slice, a recipe, its plot."""

from __future__ import annotations

import re
import tomllib
import zipfile
from collections.abc import Iterable
from functools import cache
from importlib import resources
from pathlib import Path

from matplotlib import pyplot, rc_context
from matplotlib.image import imsave

from _site.files import write_page
from brdfdb.formats import EXPORTERS
from brdfdb.materials import Material
from brdfdb.scenes.lit_sphere import lit_sphere
from brdfdb.store.reader import Store

SIZE = 192  # pixels across a picture
_KIND = "half_difference"  # of slices: the smallest of the three kinds


def write(folder: Path, store: Store, materials: Iterable[Material]) -> None:
    """Write the files of all materials; a file that is newer than its table stays."""
    folder.mkdir(parents=True, exist_ok=True)
    for material in materials:
        name = material.name
        group = store.path(name)
        write_page(folder / f"{name}.toml", recipe(name))
        built = (group / "zarr.json").stat().st_mtime
        archive, image, ball, plot = (folder / f"{name}{suffix}" for suffix in (".zarr.zip", ".exr", ".png", ".svg"))
        if not _newer(archive, built):
            _zip(group, archive)
        if not _newer(image, built):
            EXPORTERS["exr"].write(store[name], image, kind=_KIND)
        if not _newer(ball, built):
            imsave(ball, lit_sphere(store[name], SIZE), metadata={"Software": ""})
        if not _newer(plot, built):
            with rc_context({"svg.hashsalt": name, "svg.fonttype": "none"}):
                canvas = store[name].plot.lobe().get_figure()
                canvas.savefig(plot, metadata={"Date": None})
                pyplot.close(canvas)


def _newer(path: Path, built: float) -> bool:
    return path.exists() and path.stat().st_mtime > built


def links(name: str) -> str:
    """Return the list of files on the page of a material."""
    return "\n".join(
        [
            f"* {{download}}`The table <files/{name}.zarr.zip>` as one zip of a zarr group: "
            '`xarray.open_zarr(zarr.storage.ZipStore(path, mode="r"))`',
            f"* {{download}}`A slice <files/{name}.exr>` over half and difference angles as OpenEXR, a channel a "
            f"wavelength; `brdfdb export exr {name}` writes all slices",
            f"* {{download}}`The plot of the lobe <files/{name}.svg>`; `brdfdb plot {name}` draws others",
            f"* {{download}}`A recipe <files/{name}.toml>` that builds this material alone: "
            f"`brdfdb build {name}.toml --store my-store`",
            "",
        ]
    )


def pictures(name: str, title: str) -> str:
    """Return the sphere and the lobe of a material for its page."""
    sphere = f"{title}: a sphere under the same light as those of all pages"
    lobe = f"f_r of {title} in the plane of incidence, as a polar plot"
    return "\n".join([_image(f"{name}.png", sphere, "dark-light"), _image(f"{name}.svg", lobe, "lobe")])


def _image(file: str, text: str, kind: str) -> str:
    return f":::{{image}} files/{file}\n:alt: {text}\n:class: {kind}\n:::\n"


def recipe(name: str) -> str:
    """Return a recipe that builds one material as the default recipe does."""
    default = resources.files("brdfdb_pipelines").joinpath("recipes/default.toml").read_text(encoding="utf-8")
    fields = tomllib.loads(default)
    wavelengths = re.findall(r"^wavelengths_nm = .*$", default, flags=re.MULTILINE)
    lines = [f'title = "{name}, as the default recipe builds it"', f'materials = ["{name}"]', *wavelengths]
    return "\n".join([*lines, f"tolerance = {fields['tolerance']}", f'forms = "{fields["forms"]}"', ""])


@cache
def _definitions() -> dict[str, str]:
    """Return the text of every material in the files of the presets."""
    texts: dict[str, str] = {}
    for file in resources.files("brdfdb.materials").iterdir():
        if file.name.endswith(".toml"):
            for block in re.split(r"\n(?=\[[a-z0-9-]+\]\n)", file.read_text(encoding="utf-8"))[1:]:
                name = block[1 : block.index("]")]
                texts[name] = re.split(r"\n\n(?=#)", block)[0]
    return texts


def definition(name: str) -> str:
    """Return the definition of a material for a recipe, under a name of its own."""
    return re.sub(rf"^\[{name}", f"[define.my-{name}", _definitions()[name], flags=re.MULTILINE)


def _zip(group: Path, archive: Path) -> None:
    """Write the files of a table as one zip without compression: its chunks are compressed already."""
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_STORED) as whole:
        for path in sorted(path for path in group.rglob("*") if path.is_file()):
            entry = zipfile.ZipInfo(path.relative_to(group).as_posix(), (1980, 1, 1, 0, 0, 0))
            whole.writestr(entry, path.read_bytes())
