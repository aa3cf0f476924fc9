"""Scene files: TOML by path, or by name one of those that come with the program; one sentence for what is wrong."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from pydantic import ValidationError

from brdfdb.errors import BrdfdbError
from brdfdb.parameters import closest
from brdfdb.scenes.scene import Scene
from brdfdb_pipelines import toml_file

_SHIPPED = resources.files("brdfdb_pipelines") / "scenes"


class SceneError(BrdfdbError, ValueError):
    """A scene that cannot be looked at; str() is one sentence that names the file and the field."""


def shipped() -> list[str]:
    """The names of the scenes that come with the program."""
    return sorted(file.name.removesuffix(".toml") for file in _SHIPPED.iterdir() if file.name.endswith(".toml"))


def load(name: str) -> Scene:
    """Read a scene: a path that ends in .toml, or the name of a scene that comes with the program.

    Files that the scene names lie beside it.

    Raises
    ------
    SceneError
        If there is none, it is not TOML, or is not a scene.
    """
    if not name.endswith(".toml") and name not in shipped():
        raise SceneError(
            f"{name}: is no scene{closest(name, shipped())}; give a path that ends in .toml or one of "
            f"{', '.join(shipped())}"
        )
    path = Path(name)
    source = path if name.endswith(".toml") else _SHIPPED / f"{name}.toml"
    try:
        scene = Scene.model_validate(toml_file.read(source))
    except OSError as error:
        raise SceneError(f"{name}: {error.strerror}") from None
    except ValidationError as error:
        raise SceneError(f"{name}: {_sentence(error)}") from None
    except ValueError as error:
        raise SceneError(f"{name}: {error}") from None
    return scene.resolved(path.parent)


def _sentence(error: ValidationError) -> str:
    """The first thing that pydantic finds fault with, and the field; a mistyped key before what is then missing."""
    errors = error.errors(include_url=False)
    first = next((each for each in errors if each["type"] == "extra_forbidden"), errors[0])
    # after the key of a shape comes its kind, which is no key
    loc = [str(part) for before, part in zip((None, *first["loc"]), first["loc"], strict=False) if before != "shape"]
    match first["type"]:
        case "value_error":
            said = str(first["ctx"]["error"])
            if loc and said.startswith(loc[-1]):
                loc.pop()
            return ".".join([*loc, said])
        case "extra_forbidden":
            missing = [str(each["loc"][-1]) for each in errors if each["type"] == "missing"]
            said = f"unknown key{closest(loc[-1], missing)}"
        case "union_tag_invalid":
            loc.append("kind")
            said = f"{first['ctx']['tag']!r} is not one of {first['ctx']['expected_tags'].replace(chr(39), '')}"
        case "union_tag_not_found":
            loc.append("kind")
            said = "Field required"
        case _:
            said = first["msg"]
    return f"{'.'.join(loc)}: {said}"
