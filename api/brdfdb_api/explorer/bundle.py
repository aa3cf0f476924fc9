"""The files of the explorer, and its modules as one script."""

from __future__ import annotations

import functools
import gzip
import hashlib
import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import PurePath

SCRIPT = "text/javascript; charset=utf-8"
_COMMENT = re.compile(r"^[ \t]*(?:/\*\*(?:[^*]|\*(?!/))*\*/|//.*)\n", re.MULTILINE)
_IMPORT = re.compile(r"""^import ([^;]+) from "\./(.+)";$""", re.MULTILINE)
_TYPES = {".html": "text/html; charset=utf-8", ".css": "text/css; charset=utf-8", ".js": SCRIPT}
_VIEWS, _BUNDLE = "views.js", "explorer.js"  # all modules in one answer: a slow connection waits 0.4 s for each six
FOLDER = files("brdfdb_api").joinpath("explorer")
# Media types of all files of the explorer: those of the folder, the list of its views, and all modules as one
MEDIA = {
    **{file.name: _TYPES[kind] for file in FOLDER.iterdir() if (kind := PurePath(file.name).suffix) in _TYPES},
    **dict.fromkeys((_VIEWS, _BUNDLE), SCRIPT),
}


@functools.cache
def content_of(name: str, *, packed: bool) -> tuple[bytes, str]:
    """Return a file of the explorer, compressed if it is to be `packed`, and the digest of these bytes."""
    content = _text(name).encode()
    content = gzip.compress(content, 9, mtime=0) if packed else content
    return content, hashlib.sha256(content).hexdigest()[:16]


def _text(name: str) -> str:
    if name == _BUNDLE:
        return "const modules = {};\n" + "".join(_modules("main.js", set()))
    return _views() if name == _VIEWS else FOLDER.joinpath(name).read_text(encoding="utf-8")


def _modules(name: str, before: set[str]) -> Iterator[str]:
    """Yield a module as a function that is called once, after those that it imports and are not `before`.

    Imports are lines of their own, and exports declare a constant, a function or a class, or are a default.
    """
    before.add(name)
    text = re.sub(r"^ +", "", _COMMENT.sub("", _text(name)), flags=re.MULTILINE)
    for _, other in _IMPORT.findall(text):
        if other not in before:
            yield from _modules(other, before)
    text = _IMPORT.sub(lambda line: f"const {_bound(line[1])} = modules[{line[2]!r}];", text)
    names = re.findall(r"^export (?:async )?(?:const|function\*?|class) (\w+)", text, re.MULTILINE)
    text = re.sub("^export default ", "const exported = ", text, flags=re.MULTILINE)
    exports = ", ".join([*names, *(["default: exported"] if "\nconst exported = " in text else [])])
    text = re.sub("^export ", "", text, flags=re.MULTILINE)
    yield f"modules[{name!r}] = (() => {{\n{text}return {{ {exports} }};\n}})();\n"


def _bound(names: str) -> str:
    """Return the pattern that takes the names of an import from the exports of a module."""
    if names.startswith("*"):
        return names.removeprefix("* as ")
    return names.replace(" as ", ": ") if names.startswith("{") else f"{{ default: {names} }}"


def _views() -> str:
    """Return a script that exports VIEWS: the views of all modules ``view_*.js`` by name, in their order."""
    modules = sorted(name for name in MEDIA if name.startswith("view_"))
    lines = [f'import view{number} from "./{name}";' for number, name in enumerate(modules)]
    views = ", ".join(f"view{number}" for number in range(len(modules)))
    lines.append("const by = (a, b) => a.order - b.order;")
    lines.append(f"export const VIEWS = Object.fromEntries([{views}].sort(by).map((view) => [view.name, view]));")
    return "\n".join(lines) + "\n"
