"""A browser without a window, driven by its developer tools over a pipe."""

from __future__ import annotations

import base64
import http.server
import json
import os
import select
import shutil
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

# WebGL 2 is drawn by the processor; as root there is no sandbox.
OPTIONS = (
    *("--headless=new", "--no-sandbox", "--disable-gpu-sandbox", "--use-gl=angle"),
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--remote-debugging-pipe"),
    *("--no-first-run", "--disable-extensions", "--disable-background-networking"),
    *("--force-color-profile=srgb", "--hide-scrollbars", "--disable-dev-shm-usage"),
)
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")


def chromium() -> str | None:
    """The browser: the variable CHROMIUM, or what is found."""
    return os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)


class Browser:
    """Chromium with one page. All waiting ends after `patience` seconds."""

    def __init__(self, path: str, profile: Path, *options: str, patience: float = 90) -> None:
        self._patience = patience
        in_read, self._out = os.pipe()
        self._in, out_write = os.pipe()
        command = f'exec "$@" 3<&{in_read} 4>&{out_write}'
        self._process = subprocess.Popen(
            [
                *("bash", "-c", command, "browser", path, f"--user-data-dir={profile}"),
                *(*OPTIONS, *options, "about:blank"),
            ],
            pass_fds=(in_read, out_write),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(in_read)
        os.close(out_write)
        self._number, self._rest, self.events = 0, b"", list[dict[str, Any]]()
        self._session = ""
        targets = self.call("Target.getTargets")["targetInfos"]
        page = next(t["targetId"] for t in targets if t["type"] == "page")
        found = self.call("Target.attachToTarget", targetId=page, flatten=True)
        self._session = found["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Accessibility", "Network"):
            self.call(f"{domain}.enable")

    def close(self) -> None:
        try:
            self._session = ""
            self.call("Browser.close")
            self._process.wait(20)
        except (OSError, RuntimeError, subprocess.TimeoutExpired):
            self._process.kill()
        self._process.wait()
        os.close(self._out)
        os.close(self._in)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Ask for something; returns the answer. What happens meanwhile is in `events`."""
        self._number += 1
        asked = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            asked["sessionId"] = self._session
        os.write(self._out, json.dumps(asked).encode() + b"\0")
        end = time.monotonic() + self._patience
        while True:
            message = self._next(end)
            if message.get("id") == self._number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return message["result"]
            self.events.append(message)

    def _next(self, end: float) -> dict[str, Any]:
        while b"\0" not in self._rest:
            ready, _, _ = select.select([self._in], [], [], max(0, end - time.monotonic()))
            if not ready:
                raise RuntimeError("the browser does not answer")
            more = os.read(self._in, 1 << 20)
            if not more:
                raise RuntimeError("the browser has ended")
            self._rest += more
        text, _, self._rest = self._rest.partition(b"\0")
        return json.loads(text)

    def run(self, script: str) -> Any:
        """The value of an expression; a promise is waited for."""
        found = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in found:
            raise RuntimeError(str(found["exceptionDetails"]))
        return found["result"].get("value")

    def size(self, width: int, height: int, phone: bool = False) -> None:
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height,
                  deviceScaleFactor=1, mobile=phone)  # fmt: skip
        self.call("Emulation.setTouchEmulationEnabled", enabled=phone)

    def open(self, address: str) -> str:
        """Open a page of ARTO, and wait until it is ready -> whether it "turns" or is "still"."""
        self.events.clear()
        self.call("Page.navigate", url=address)
        end = time.monotonic() + self._patience
        while time.monotonic() < end:
            if ready := self.run("document.documentElement?.dataset.ready || ''"):
                return str(ready)
            time.sleep(0.1)
        raise RuntimeError("the page is not ready")

    def settled(self) -> None:
        """Wait until the page has drawn what it was asked for."""
        self.run("new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))")

    def picture(self, path: Path) -> None:
        """Save what is seen as a PNG file."""
        data = self.call("Page.captureScreenshot", format="png")["data"]
        path.write_bytes(base64.b64decode(data))

    def key(self, key: str, shift: bool = False) -> None:
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, modifiers=8 * shift)

    def drag(self, x0: float, y0: float, x1: float, y1: float, touch: bool = False) -> None:
        """Drag over the page in five steps."""
        steps = [(x0 + (x1 - x0) * i / 5, y0 + (y1 - y0) * i / 5) for i in range(6)]
        for i, (x, y) in enumerate(steps):
            if touch:
                kind = "touchMove" if i else "touchStart"
                self.call("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y}])
            else:
                kind = "mouseMoved" if i else "mousePressed"
                self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left",
                          buttons=1, clickCount=1)  # fmt: skip
        if touch:
            self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
        else:
            self.call("Input.dispatchMouseEvent", type="mouseReleased", x=x1, y=y1, button="left")

    def names(self) -> list[tuple[str, str, str]]:
        """What a screen reader is told: role, name and value of everything, in order."""
        nodes = self.call("Accessibility.getFullAXTree")["nodes"]
        return [
            (n["role"]["value"], n.get("name", {}).get("value", ""),
             str(n.get("value", {}).get("value", "")))
            for n in nodes if not n.get("ignored")
        ]  # fmt: skip

    def complaints(self) -> list[str]:
        """Errors and warnings of the console, failed requests and what was thrown."""
        out = []
        for e in self.events:
            about = e.get("params", {})
            if e.get("method") == "Runtime.exceptionThrown":
                out.append(str(about["exceptionDetails"]))
            elif e.get("method") == "Log.entryAdded" and about["entry"]["level"] != "verbose":
                out.append(about["entry"]["text"])
            elif e.get("method") == "Runtime.consoleAPICalled" and about["type"] != "log":
                out.append(str(about["args"]))
        return out

    def addresses(self) -> list[str]:
        """All that the page has asked for."""
        sent = [e for e in self.events if e.get("method") == "Network.requestWillBeSent"]
        return [e["params"]["request"]["url"] for e in sent]


@contextmanager
def browsing(*options: str) -> Iterator[Browser]:
    path = chromium()
    assert path
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(path, Path(profile), *options)
        try:
            yield browser
        finally:
            browser.close()


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_: Any) -> None: ...


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """A file server for a folder -> its address."""
    handler = partial(_Quiet, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()
