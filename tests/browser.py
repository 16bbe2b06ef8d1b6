"""Chromium through its driver, by the WebDriver protocol over plain HTTP."""

import json
import shutil
import socket
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

CONTROL, SHIFT, ENTER = "\ue009", "\ue008", "\ue007"
ESCAPE, DELETE = "\ue00c", "\ue017"
"""Keys as the protocol names them."""

_ARGUMENTS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage")
_PATIENCE = 60.0  # seconds


class Browser:
    """A window of Chromium.

    `folder` gets its downloads.
    """

    def __init__(self, port: int, folder: Path, width: int, height: int, *, touch: bool) -> None:
        self._address = f"http://127.0.0.1:{port}"
        self.folder = folder
        options: dict[str, Any] = {
            "args": [*_ARGUMENTS, f"--window-size={width},{height}"],
            "prefs": {"download.default_directory": str(folder)},
        }
        if touch:
            metrics = {"width": width, "height": height, "pixelRatio": 2, "touch": True}
            options["mobileEmulation"] = {"deviceMetrics": metrics}
        wanted = {"browserName": "chrome", "goog:chromeOptions": options}
        made = self._call("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})
        self._session = f"/session/{made['sessionId']}"

    def _call(self, method: str, path: str, values: Any = None) -> Any:
        data = None if values is None else json.dumps(values).encode()
        headers = {"Content-Type": "application/json"}
        request = urllib.request.Request(
            self._address + path, method=method, data=data, headers=headers
        )
        try:
            with urllib.request.urlopen(request, timeout=_PATIENCE) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            with error:
                raise AssertionError(error.read().decode()[:500]) from error

    def open(self, page: Path) -> None:
        """Open a page of `vdet draw` or a review, and wait until it is ready."""
        self.visit(page)
        self.wait("return document.body.dataset.ready === 'yes'")

    def visit(self, page: Path) -> None:
        """Open any page."""
        self._call("POST", f"{self._session}/url", {"url": page.resolve().as_uri()})

    def run(self, script: str, *values: Any) -> Any:
        """Return what a script returns."""
        data = {"script": script, "args": values}
        return self._call("POST", f"{self._session}/execute/sync", data)

    def wait(self, script: str) -> Any:
        """Return what a script returns as soon as that is true."""
        end = time.monotonic() + _PATIENCE
        while not (found := self.run(script)):
            assert time.monotonic() < end, script
            time.sleep(0.05)
        return found

    def text(self, selector: str) -> str:
        """Return the text of an element."""
        return str(self.run("return document.querySelector(arguments[0]).textContent", selector))

    def choose_file(self, selector: str, path: Path) -> None:
        """Choose a file as a user would."""
        found = self._call(
            "POST", f"{self._session}/element", {"using": "css selector", "value": selector}
        )
        [number] = found.values()
        text = {"text": str(path.resolve())}
        self._call("POST", f"{self._session}/element/{number}/value", text)

    def at(self, x: float, y: float) -> tuple[int, int]:
        """Return where a pixel of the frame is in the window."""
        box = self.run(
            "const box = document.getElementById('marks').getBoundingClientRect();"
            "const [width, height] = JSON.parse(document.getElementById('data').textContent).size;"
            "return [box.left, box.top, box.width / width, box.height / height]"
        )
        left, top, across, down = box
        return round(left + x * across), round(top + y * down)

    def click(self, *points: tuple[float, float]) -> None:
        """Click at pixels of the frame."""
        for point in points:
            self.drag(point)

    def drag(self, *points: tuple[float, float], kind: str = "mouse") -> None:
        """Press at the first of some pixels of the frame, move to the others, and let go."""
        first, *others = (
            {"type": "pointerMove", "x": x, "y": y, "duration": 30}
            for x, y in (self.at(*point) for point in points)
        )
        pressed, left = ({"type": item, "button": 0} for item in ("pointerDown", "pointerUp"))
        steps = [first, pressed, *others, left]
        parameters = {"pointerType": kind}
        self._act({"type": "pointer", "id": kind, "parameters": parameters, "actions": steps})

    def type(self, *keys: str) -> None:
        """Type keys; a text of several is pressed together where it begins with a modifier."""
        steps: list[dict[str, str]] = []
        for key in keys:
            for chord in [key] if key[0] in (CONTROL, SHIFT) else list(key):
                steps += [{"type": "keyDown", "value": item} for item in chord]
                steps += [{"type": "keyUp", "value": item} for item in reversed(chord)]
        self._act({"type": "key", "id": "keys", "actions": steps})

    def _act(self, *actions: dict[str, Any]) -> None:
        self._call("POST", f"{self._session}/actions", {"actions": actions})

    def close(self) -> None:
        """Close the window."""
        self._call("DELETE", self._session)


@contextmanager
def browser(
    folder: Path, width: int = 1400, height: int = 1000, *, touch: bool = False
) -> Iterator[Browser]:
    """Give a window of Chromium; skip where there is none."""
    driver = shutil.which("chromedriver")
    if not driver:
        pytest.skip("needs Chromium and its driver (Debian: chromium, chromium-driver)")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
    silent = subprocess.DEVNULL
    with subprocess.Popen([driver, f"--port={port}"], stdout=silent, stderr=silent) as process:
        try:
            _wait_for(port)
            window = Browser(port, folder, width, height, touch=touch)
            try:
                yield window
            finally:
                with suppress(AssertionError):
                    window.close()
        finally:
            process.terminate()


def _wait_for(port: int) -> None:
    end = time.monotonic() + _PATIENCE
    while time.monotonic() < end:
        with suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
            return
        time.sleep(0.05)


def downloaded(folder: Path, name: str) -> Path:
    """Wait for a download."""
    end = time.monotonic() + _PATIENCE
    while not (path := folder / name).exists():
        assert time.monotonic() < end, sorted(folder.iterdir())
        time.sleep(0.05)
    return path
