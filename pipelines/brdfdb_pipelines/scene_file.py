"""Scene files: TOML by path, or by name one of those that come with the program; one sentence for what is wrong."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from pydantic import ValidationError

from brdfdb.errors import ParameterError
from brdfdb.parameters import closest
from brdfdb.scenes.scene import Scene
from brdfdb_pipelines import toml_file

_SHIPPED = resources.files("brdfdb_pipelines") / "scenes"


class SceneError(ParameterError):
    """A scene that cannot be rendered; `parameter` is the field that is at fault, and may be "".

    Parameters
    ----------
    scene : str
        Name or path of the scene, as it was given.
    parameter, sentence : str
        As of `ParameterError`.
    """

    def __init__(self, scene: str, parameter: str, sentence: str) -> None:
        super().__init__(parameter, sentence)
        self.args = (scene, parameter, sentence)
        self.scene = scene

    def __str__(self) -> str:
        return ": ".join(part for part in (self.scene, self.parameter, self.sentence) if part)


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
        sentence = f"is no scene{closest(name, shipped())}; give a path that ends in .toml or one of "
        raise SceneError(name, "", sentence + ", ".join(shipped()))
    path = Path(name)
    source = path if name.endswith(".toml") else _SHIPPED / f"{name}.toml"
    try:
        scene = Scene.model_validate(toml_file.read(source))
    except OSError as error:
        raise SceneError(name, "", error.strerror or str(error)) from None
    except ValidationError as error:
        raise SceneError(name, *_field_and_sentence(error)) from None
    except toml_file.TomlError as error:
        raise SceneError(name, "", str(error)) from None
    return scene.resolved(path.parent)


def _field_and_sentence(error: ValidationError) -> tuple[str, str]:
    """Return the first field that pydantic finds fault with, and why; a mistyped key before what is then missing."""
    errors = error.errors(include_url=False)
    first = next((each for each in errors if each["type"] == "extra_forbidden"), errors[0])
    # after the key of a shape comes its kind, which is no key
    loc = [str(part) for before, part in zip((None, *first["loc"]), first["loc"], strict=False) if before != "shape"]
    match first["type"]:
        case "value_error":
            cause = first["ctx"]["error"]
            if not isinstance(cause, ParameterError):
                said = str(cause)
            else:
                if loc and cause.parameter.startswith(loc[-1]):
                    loc.pop()
                loc.append(cause.parameter)
                said = cause.sentence
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
    return ".".join(loc), said
