"""Chromium without a window, driven over a pipe by its DevTools protocol, and what tests read of the explorer in it."""

from __future__ import annotations

import base64
import fcntl
import io
import json
import os
import select
import signal
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from matplotlib.image import imread

from tests.api.connections import WAIT_S

FLAGS = [
    *("--headless", "--no-sandbox", "--no-first-run", "--hide-scrollbars", "--remote-debugging-pipe"),
    *("--disable-gpu", "--force-color-profile=srgb"),  # no page has WebGL, and pictures are cheaper without OpenGL
    *(f"--disable-{each}" for each in ("quic", "background-networking", "component-update", "sync", "dev-shm-usage")),
]
KEYS = {"Tab": 9, "Enter": 13, "Home": 36, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40}  # codes


class Chromium:
    """A process of the program `binary` with one page; `profile` is a new directory."""

    def __init__(self, binary: str, profile: Path) -> None:
        # the protocol wants descriptors 3 and 4: ends from 10 on never are in the way of those
        (to_read, self._write), (self._read, to_write) = os.pipe(), os.pipe()
        high = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in (to_read, to_write)]
        actions: list[tuple[Any, ...]] = [(os.POSIX_SPAWN_DUP2, high[0], 3), (os.POSIX_SPAWN_DUP2, high[1], 4)]
        actions += [(os.POSIX_SPAWN_OPEN, each, os.devnull, os.O_RDWR, 0) for each in (0, 1, 2)]
        arguments = [binary, *FLAGS, f"--user-data-dir={profile}", "about:blank"]
        self._pid = os.posix_spawn(binary, arguments, os.environ, file_actions=actions, setpgroup=0)
        for end in (to_read, to_write, *high):
            os.close(end)
        self._buffer, self._count, self._session = b"", 0, ""
        self.errors: list[str] = []
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Runtime", "Log", "Page"):
            self.send(f"{domain}.enable")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, at: TracebackType | None) -> None:
        os.killpg(self._pid, signal.SIGKILL)
        os.waitpid(self._pid, 0)
        os.close(self._write)
        os.close(self._read)

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Ask for something, and wait for the answer; errors of the page on the way are kept in `errors`."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next(method)
            if answer.get("id") == self._count:
                assert "error" not in answer, f"{method}: {answer['error']}"
                found: dict[str, Any] = answer["result"]
                return found
            self._note(answer)

    def open(
        self, address: str, width: int = 1280, height: int = 900, scheme: str = "light", touch: bool = False
    ) -> None:
        """Load an address in a window of some width, or on a phone that is touched; `errors` begins anew."""
        self.send("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=touch)
        self.send("Emulation.setTouchEmulationEnabled", enabled=touch)
        self.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.send("Page.navigate", url="about:blank")  # a link to another view of the same page would not load it
        self.errors.clear()
        self.send("Page.navigate", url=address)

    def evaluate(self, script: str) -> Any:
        """The value of an expression, or what its promise resolves to."""
        answer = self.send("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def until(self, script: str) -> Any:
        """The value of an expression as soon as it is one that counts as true."""
        deadline = time.monotonic() + WAIT_S
        while not (found := self.evaluate(script)):
            assert time.monotonic() < deadline, f"never true: {script}; {self.errors}"
            time.sleep(0.02)
        return found

    def texts(self, selector: str) -> list[str]:
        """The texts of all elements of a selector."""
        elements = f"[...document.querySelectorAll({json.dumps(selector)})]"
        return [str(each) for each in self.evaluate(f"{elements}.map(each => each.textContent)")]

    def click(self, selector: str, number: int = 0) -> None:
        """Click one of the elements of a selector; a negative number counts from the end."""
        self.evaluate(f"[...document.querySelectorAll({json.dumps(selector)})].at({number}).click()")

    def go(self, link: str) -> None:
        """Change the link of the page."""
        self.evaluate(f"location.hash = {json.dumps(link)}")

    def choose(self, name: str, value: float | str) -> None:
        """Set a control of the form, as a hand does."""
        control = f"controls.elements.{name}"
        event = "new Event('input', { bubbles: true })"
        self.evaluate(f"{control}.value = {json.dumps(value)}; {control}.dispatchEvent({event})")

    def drag(self, x: float, y: float, by: float = 0.0) -> None:
        """Press the mouse at a point [pixel], move it to the right and release it."""
        for kind, at in (("mousePressed", x), ("mouseMoved", x + by), ("mouseReleased", x + by)):
            self.send("Input.dispatchMouseEvent", type=kind, x=at, y=y, button="left", buttons=1, clickCount=1)

    def press(self, *keys: str) -> None:
        """Press keys, one after the other."""
        for key in keys:
            for kind in ("rawKeyDown", "keyUp"):
                self.send("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=KEYS[key])

    def type(self, text: str) -> None:
        """Type into what has the focus."""
        self.send("Input.insertText", text=text)

    def swipe(self, x: float, y: float, by: float) -> None:
        """Move a finger up from a point by some pixels."""
        for step in range(11):
            at = [{"x": x, "y": y - by * step / 10}]
            self.send("Input.dispatchTouchEvent", type="touchMove" if step else "touchStart", touchPoints=at)
        self.send("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def picture(self) -> np.ndarray:
        """The luminance of what is shown, 0 to 1."""
        shot = base64.b64decode(self.send("Page.captureScreenshot", format="png")["data"])
        return np.asarray(imread(io.BytesIO(shot)))[..., :3].mean(axis=-1)

    def _next(self, waiting_for: str) -> dict[str, Any]:
        deadline = time.monotonic() + WAIT_S
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._read], [], [], max(0.0, deadline - time.monotonic()))
            assert ready, f"the browser does not answer {waiting_for}"
            piece = os.read(self._read, 1 << 20)
            assert piece, "the browser ended"
            self._buffer += piece
        message, _, self._buffer = self._buffer.partition(b"\0")
        found: dict[str, Any] = json.loads(message)
        return found

    def _note(self, event: dict[str, Any]) -> None:
        kind, of = event.get("method"), event.get("params", {})
        if kind == "Runtime.exceptionThrown":
            self.errors.append(str(of["exceptionDetails"]))
        elif kind == "Runtime.consoleAPICalled" and of["type"] in ("error", "assert"):
            self.errors.append(str(of["args"]))
        elif kind == "Log.entryAdded" and of["entry"]["level"] == "error":
            self.errors.append(of["entry"]["text"])


def shown(browser: Chromium, *parts: str) -> None:
    """Wait for a picture of the state whose link has these parts."""
    of = "(document.querySelector('#picture')?.dataset.shown ?? '')"
    browser.until(" && ".join([f"{of} !== ''", *(f"{of}.includes('{part}')" for part in parts)]))


def visit(browser: Chromium, link: str, *parts: str) -> None:
    """Open a link, and wait for a picture of the state whose link has these parts."""
    browser.open(link)
    shown(browser, *parts)


def chosen(browser: Chromium) -> str:
    return str(browser.evaluate("document.querySelector('[aria-selected=true]').dataset.name"))


def milliseconds(browser: Chromium) -> float:
    """From what asked for a picture, a hand or the page, to the picture."""
    # there is none for a moment while a picture is drawn again, finely
    return float(browser.until("performance.getEntriesByName('picture')[0]?.duration"))


def curve(browser: Chromium, kind: str | int, view: str = "cut") -> np.ndarray:
    """The points of a curve [pixel], by its number, or of a line of another kind."""
    of = f"path.{kind}" if isinstance(kind, str) else "path.curve"
    number = 0 if isinstance(kind, str) else kind
    path = browser.evaluate(f"document.querySelectorAll('#{view} > svg {of}')[{number}].getAttribute('d')")
    return np.array([point.split() for point in path[1:].split("L")], dtype=float)


def idle(browser: Chromium, *conditions: str) -> Any:
    """Wait until no picture is being drawn, and for further conditions; return the value of the last one."""
    return browser.until(" && ".join(["picture.ariaBusy === 'false'", *conditions]))


def labels(browser: Chromium) -> list[str]:
    """Labels of the curves of the cut."""
    found = browser.evaluate("[...document.querySelectorAll('#cut > svg path.curve')].map(each => each.dataset.label)")
    return [str(each) for each in found]


def frame(browser: Chromium, view: str = "cut") -> list[float]:
    """Left, top, width and height of a chart [pixel], and the ends of its scale, which may be decades."""
    places = "['x', 'y', 'width', 'height'].map(each => Number(chart.querySelector('.frame').getAttribute(each)))"
    script = f"(chart => [...{places}, ...chart.dataset.range.split(' ').map(Number)])"
    return [float(each) for each in browser.evaluate(f"{script}(document.querySelector('#{view} > svg'))")]


def box(browser: Chromium, of: str) -> list[float]:
    """Left, top, width and height of an element in the window [pixel]."""
    script = "(({ left, top, width, height }) => [left, top, width, height])"
    return [
        float(each) for each in browser.evaluate(f"{script}(document.querySelector('{of}').getBoundingClientRect())")
    ]


def image(browser: Chromium, of: str) -> np.ndarray:
    """The bytes of a canvas (rows, columns, 4), rows from the top."""
    width, height, data = browser.evaluate(
        "(({ width, height }, context) => [width, height, [...context.getImageData(0, 0, width, height).data]])"
        f"(...[document.querySelector('{of}')].flatMap(each => [each, each.getContext('2d')]))"
    )
    return np.reshape(np.array(data, np.uint8), (height, width, 4))


def copied(browser: Chromium, kind: str) -> str:
    browser.click(f"[data-copy={kind}]")
    browser.until("/Copied|Selected/.test(document.querySelector('#message').textContent)")
    return str(browser.evaluate("document.querySelector('#copied textarea').value"))
