"""What the tests of exports for engines share: exported fits, a web server of a folder, packages of npm."""

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from mitsuba_cases import factorization, random_texture

from homofact.containers.formats import format_named
from homofact.export.engines.table import ENGINES
from homofact.export.exported import Exported, exported, write_exported
from homofact.factor.factorization import Factorization
from homofact.factor.projection import Warp, fixed_projection

NODE = Path(__file__).parent / "containers" / "node"


def isotropic() -> Factorization:
    """A lobe with a colour of its own over a base, in two textures."""
    lobe = random_texture(1, 16, 1)[:1] * 0.2
    lobe[0, :, :] += 2.5 * (-(((lobe.new_tensor(range(16))[:, None]) / 3) ** 2)).exp()
    base = random_texture(1, 8, 2) * 0.1
    return factorization(
        (fixed_projection("theta_h", True, Warp(0.1)), lobe), (fixed_projection("theta_d", True), base)
    )


def brushed() -> Factorization:
    """A random product over h and the light, which knows azimuths."""
    return factorization(
        (fixed_projection("h", True, Warp(0.1)), random_texture(12, 9, 3)),
        (fixed_projection("wi", True), random_texture(8, 8, 4) * 0.3),
    )


def engine_folder(place: Path, fit: Factorization, engine: str, form: str | None = None) -> Exported:
    """An export with an engine's files at `place`."""
    made = exported(fit, format_named(form or ENGINES[engine].formats[0]))
    write_exported(place, made, {}, engine=engine, files=ENGINES[engine].add(made).files)
    return made


def npm_package(name: str) -> Path:
    """The folder of an installed package; skips where there is none."""
    place = NODE / "node_modules" / name
    if not place.is_dir():
        pytest.skip(f"npm's package {name} is missing: npm ci --prefix tests/containers/node")
    return place


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
