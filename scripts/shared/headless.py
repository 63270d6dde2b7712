"""Open a page in a headless Chromium that draws WebGL 2 in software.

Debian's packages chromium and chromium-driver, driven by selenium (an extra: pip install 'homofact[dev]'). Every
browser gets a profile of its own, and flags that keep it off the network.
"""

import os
import shutil
import subprocess
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib import import_module
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from homofact.errors import MissingDependency

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
DRIVERS = ("chromedriver", "chromium.chromedriver")
# SwiftShader draws WebGL 2 without a graphics card, with float textures, filtered, and float targets.
WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
QUIET = (
    "--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage", "--force-device-scale-factor=1",
    "--hide-scrollbars",
)  # fmt: skip


def found(names: Sequence[str]) -> str:
    """The first of these programs that is on the PATH. Raises MissingDependency that names it."""
    for name in names:
        place = shutil.which(name)
        if place is not None:
            return place
    raise MissingDependency(f"no {names[0]} on the PATH, expected Debian's chromium and chromium-driver, or the like")


def required() -> tuple[Any, Any, str, str]:
    """(selenium's webdriver, its Service, the browser, its driver); starts nothing.

    Raises MissingDependency where one of them is not there.
    """
    try:
        webdriver = import_module("selenium.webdriver")
        service = import_module("selenium.webdriver.chrome.service").Service
    except ImportError as error:
        raise MissingDependency("no selenium, expected it to drive a browser: pip install selenium") from error
    return webdriver, service, found(BROWSERS), found(DRIVERS)


@contextmanager
def chromium(profile: Path, *, webgl: bool = True, size: tuple[int, int] = (1440, 900)) -> Iterator[Any]:
    """A selenium driver with a window of `size` and a fresh `profile` folder; ends with the block.

    Without `webgl` pages find no WebGL at all. Raises MissingDependency where selenium, a browser or its driver is not
    there.
    """
    webdriver, service, binary, driver_of = required()
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    drawing = WEBGL if webgl else ("--disable-3d-apis",)
    for flag in (*QUIET, *drawing, f"--user-data-dir={profile}", f"--window-size={size[0]},{size[1]}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options, service(driver_of, log_output=subprocess.DEVNULL))
    try:
        resize(driver, size)
        driver.set_script_timeout(120)
        driver.set_page_load_timeout(120)
        yield driver
    finally:
        driver.quit()


def resize(driver: Any, size: tuple[int, int]) -> None:
    """Give pages exactly this many pixels, whatever the window keeps for itself."""
    shape = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", shape)


_LOADED = (
    "return document.readyState === 'complete' && decodeURIComponent(location.href).split('#')[0] === arguments[0]"
)


def open_page(driver: Any, page: Path, link: str = "") -> None:
    """Load a file, with a `link` (#…) to a place in it, and wait until it is ready, or shows its trouble."""
    address = page.resolve().as_uri()
    driver.get(address + link)
    # On a busy machine `get` may return when a new tab has loaded its empty page, or in the middle of the file.
    wait = import_module("selenium.webdriver.support.wait").WebDriverWait(driver, 120, poll_frequency=0.02)
    wait.until(lambda _: driver.execute_script(_LOADED, unquote(address)))
    driver.execute_async_script(
        "const done = arguments[0];"
        "(window.homofact?.ready ?? Promise.reject()).then(() => done(true), () => done(false));"
    )


def first_frame(driver: Any) -> float:
    """Milliseconds from the page's start to its first picture on the screen's own side, the GPU's work included."""
    return driver.execute_async_script(
        "const done = arguments[0];"
        "(function wait() { const t = window.homofact.firstFrameMs;"
        " t == null ? setTimeout(wait, 20) : done(t); })();"
    )


def settled(driver: Any) -> dict[str, Any]:
    """The page's state when it has nothing left to draw: when it says so itself, or draws no frame for a while."""
    return driver.execute_async_script(
        "const done = arguments[0]; let before = -1, still = 0;"
        "(function wait() { const { frames, idle } = window.homofact;"
        " still = frames === before && frames > 0 ? still + 1 : 0; before = frames;"
        " (idle === undefined ? still > 3 : idle && frames > 0) ? done(window.homofact.state)"
        " : setTimeout(wait, idle === undefined ? 60 : 15); })();"
    )


def processor_seconds(driver: Any) -> float:
    """Seconds that the browser's processes have taken so far, all threads; 0 where the system does not tell."""
    parents: dict[int, list[int]] = {}
    seconds: dict[int, float] = {}
    for place in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = place.read_text(encoding="utf-8").rpartition(")")[2].split()
        except OSError:
            continue
        parents.setdefault(int(fields[1]), []).append(int(place.parent.name))
        seconds[int(place.parent.name)] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    open_, total = [driver.service.process.pid], 0.0
    while open_:
        own = open_.pop()
        total += seconds.get(own, 0.0)
        open_ += parents.get(own, [])
    return total


class _Quiet(SimpleHTTPRequestHandler):
    headers_too: Mapping[str, str] = {}

    def end_headers(self) -> None:
        """The folder's own headers beside the usual ones."""
        for name, value in self.headers_too.items():
            self.send_header(name, value)
        super().end_headers()

    def log_message(self, format: str, *args: object) -> None:
        """Nothing."""


@contextmanager
def served(folder: Path, headers: Mapping[str, str] | None = None) -> Iterator[str]:
    """The address of a web server of a folder, on this machine alone; `headers` join its answers."""
    handler = type("Handler", (_Quiet,), {"headers_too": dict(headers or {})})
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(handler, directory=str(folder)))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
