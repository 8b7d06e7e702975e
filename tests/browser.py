"""A real browser for tests: Debian's chromium and chromium-driver over the WebDriver protocol, plain HTTP and JSON.

A test that asks for one is skipped where they are not installed, and says so; `.ci/run` installs them.
"""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import time
import urllib.request
from typing import TYPE_CHECKING, Any, Self

import pytest

if TYPE_CHECKING:
    from pathlib import Path

ARGUMENTS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--disable-dev-shm-usage")


class Browser:
    """A window of a given width that keeps its profile in `folder`."""

    def __init__(self, folder: Path, width: int = 1280, height: int = 900) -> None:
        self.binary, driver = shutil.which("chromium"), shutil.which("chromedriver")
        if self.binary is None or driver is None:
            pytest.skip("NO BROWSER: apt-get install chromium chromium-driver, and this page is tested in one")
        self.log = (folder / "chromedriver.log").open("w+", encoding="utf-8")
        self.driver = subprocess.Popen([driver, "--port=0"], stdout=self.log, stderr=self.log)
        self.folder, self.width, self.height = folder, width, height

    def __enter__(self) -> Self:
        try:
            self._start()
        except BaseException:
            self._stop()
            raise
        return self

    def _start(self) -> None:
        self.address = f"http://127.0.0.1:{self._port()}"
        options = {"binary": self.binary, "args": [*ARGUMENTS, f"--user-data-dir={self.folder / 'profile'}"]}
        capabilities = {"alwaysMatch": {"browserName": "chrome", "goog:chromeOptions": options}}
        self.session = self._post("/session", {"capabilities": capabilities}, whole=True)["sessionId"]
        size = {"width": self.width, "height": self.height, "deviceScaleFactor": 1, "mobile": False}
        self.devtools("Emulation.setDeviceMetricsOverride", **size)

    def __exit__(self, *_: object) -> None:
        try:
            request = urllib.request.Request(f"{self.address}/session/{self.session}", method="DELETE")
            urllib.request.urlopen(request, timeout=30).close()
        finally:
            self._stop()

    def _stop(self) -> None:
        self.driver.terminate()
        self.driver.wait(30)
        self.log.close()

    def open(self, url: str) -> None:
        """Go to a page and wait until it is there."""
        self._post("/url", {"url": url})

    def run(self, expression: str) -> Any:
        """The value of a JavaScript expression on the page."""
        return self._post("/execute/sync", {"script": f"return {expression}", "args": []})

    def wait(self, expression: str, seconds: float = 60) -> Any:
        """Wait until an expression is true; its value."""
        end = time.monotonic() + seconds
        while not (value := self.run(expression)):
            assert time.monotonic() < end, f"waited for {expression}\n{self.run('document.body.innerText')}"
            time.sleep(0.1)
        return value

    def prefer(self, scheme: str) -> None:
        """Be on a machine set to `light` or `dark`."""
        self.devtools("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def screenshot(self, path: Path | None = None) -> bytes:
        """A picture (PNG) of the whole page."""
        found = self.devtools("Page.captureScreenshot", captureBeyondViewport=True)["data"]
        picture = base64.b64decode(found)
        if path is not None:
            path.write_bytes(picture)
        return picture

    def devtools(self, command: str, **parameters: Any) -> Any:
        """A command of the DevTools protocol."""
        return self._post("/goog/cdp/execute", {"cmd": command, "params": parameters})

    def _post(self, path: str, body: dict[str, Any], *, whole: bool = False) -> Any:
        place = path if whole else f"/session/{self.session}{path}"
        request = urllib.request.Request(self.address + place, json.dumps(body).encode(), method="POST")
        with urllib.request.urlopen(request, timeout=120) as answer:
            return json.load(answer)["value"]

    def _port(self) -> int:
        """The port that the driver says it listens on."""
        end = time.monotonic() + 60
        while time.monotonic() < end and self.driver.poll() is None:
            self.log.flush()
            found = re.search(r"on port (\d+)\.", (self.folder / "chromedriver.log").read_text())
            if found:
                return int(found[1])
            time.sleep(0.05)
        raise AssertionError((self.folder / "chromedriver.log").read_text())
