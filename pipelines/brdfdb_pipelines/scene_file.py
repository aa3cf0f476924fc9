"""Scene files: TOML by path, or by the name of a scene that comes with the program."""

from __future__ import annotations

from importlib import resources

from pydantic import ValidationError

from brdfdb.errors import ParameterError, sentence_of
from brdfdb.parameters import closest
from brdfdb.place import path_of
from brdfdb.scenes.scene import Scene
from brdfdb_pipelines import toml_file

_SHIPPED = resources.files("brdfdb_pipelines") / "scenes"


class SceneError(ParameterError):
    """A scene that cannot be rendered; `parameter` is the field that is at fault, and may be empty."""

    def __init__(self, scene: str, parameter: str, sentence: str) -> None:
        super().__init__(parameter, sentence)
        self.args = (scene, parameter, sentence)
        self.scene = scene

    def __str__(self) -> str:
        return ": ".join(part for part in (self.scene, self.parameter, self.sentence) if part)


def shipped() -> list[str]:
    """Return the names of the scenes that come with the program."""
    return sorted(file.name.removesuffix(".toml") for file in _SHIPPED.iterdir() if file.name.endswith(".toml"))


def load(name: str) -> Scene:
    """Return a scene from a path that ends in .toml, or the name of a packaged scene; SceneError if there is none.

    File names in a scene are relative to its directory.
    """
    if not name.endswith(".toml") and name not in shipped():
        sentence = f"is not a scene{closest(name, shipped())}; give a path that ends in .toml, or one of "
        raise SceneError(name, "", sentence + ", ".join(shipped()))
    path = path_of(name, "scene")
    source = path if name.endswith(".toml") else _SHIPPED / f"{name}.toml"
    try:
        scene = Scene.model_validate(toml_file.read(source))
    except OSError as error:
        raise SceneError(name, "", error.strerror or str(error)) from None
    except ValidationError as error:
        raise _refusal(name, error) from None
    except toml_file.TomlError as error:
        raise SceneError(name, "", str(error)) from None
    try:
        return scene.resolved(path.parent)
    except ParameterError as error:  # the scene names a file with a path that is not allowed
        raise SceneError(name, error.parameter, error.sentence) from None


def _refusal(name: str, error: ValidationError) -> SceneError:
    """Return the refusal of the first field that pydantic refuses; of an unknown key before a missing one."""
    errors = error.errors(include_url=False)
    first = next((item for item in errors if item["type"] == "extra_forbidden"), errors[0])
    # after the key of a shape comes its kind, which is no key
    loc = [str(part) for before, part in zip((None, *first["loc"]), first["loc"], strict=False) if before != "shape"]
    match first["type"]:
        case "value_error":
            cause = first["ctx"]["error"]
            sentence = str(cause)
            if isinstance(cause, ParameterError):
                if loc and cause.parameter.startswith(loc[-1]):
                    loc.pop()
                loc.append(cause.parameter)
                sentence = cause.sentence
        case "extra_forbidden":
            missing = [str(item["loc"][-1]) for item in errors if item["type"] == "missing"]
            sentence = f"unknown key{closest(loc[-1], missing)}"
        case "union_tag_invalid":
            loc.append("kind")
            sentence = f"{first['ctx']['tag']!r} is not one of {first['ctx']['expected_tags'].replace(chr(39), '')}"
        case "union_tag_not_found":
            loc.append("kind")
            sentence = "is missing"
        case _:
            sentence = sentence_of(first)
    return SceneError(name, ".".join(loc), sentence)
