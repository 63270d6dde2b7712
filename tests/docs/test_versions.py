"""Versions of the site side by side: their list, and the choice that a page offers."""

import functools
import http.server
import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import browser

from sitemaker.versions import write_versions

SCRIPT = Path(__file__).parents[2] / "docs" / "static" / "versions.js"
PAGE = """<!doctype html><html data-content_root="{root}"><head><script>{script}</script></head>
<body><a class="sidebar-brand" href="#">homofact</a><p>{name}</p></body></html>"""


def put(folder: Path, name: str, *pages: str) -> None:
    for page in pages:
        path = folder / name / page
        path.parent.mkdir(parents=True, exist_ok=True)
        root = "../" * page.count("/") or "./"
        path.write_text(PAGE.format(root=root, script=SCRIPT.read_text(encoding="utf-8"), name=f"{name} {page}"))
    (folder / name / "objects.inv").write_bytes(b"")


def test_the_newest_version_is_first_and_only_sites_are_listed(tmp_path: Path) -> None:
    for name in ("0.9.1", "0.10.0", "latest", "v0.2"):
        put(tmp_path, name, "index.html")
    (tmp_path / "pictures").mkdir()
    assert write_versions(tmp_path) == ["0.10.0", "0.9.1", "v0.2", "latest"]
    assert json.loads((tmp_path / "versions.json").read_text()) == ["0.10.0", "0.9.1", "v0.2", "latest"]


@pytest.fixture(scope="module")
def sites(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, str]]:
    """A folder that is served, and its address."""
    folder = tmp_path_factory.mktemp("sites")
    quiet = type("Quiet", (http.server.SimpleHTTPRequestHandler,), {"log_message": lambda *_: None})
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(quiet, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield folder, f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    server.server_close()


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with browser(webgl=False) as started:
        yield started


CHOICES = "return [...document.querySelectorAll('.site-versions option')].map((each) => each.value)"
CHOOSE = """const choice = document.querySelector(".site-versions");
choice.value = arguments[0]; choice.dispatchEvent(new Event("change"));"""


@pytest.mark.slow
def test_a_page_leads_to_the_same_page_of_another_version(sites: tuple[Path, str], driver: Any) -> None:
    from selenium.webdriver.support.ui import WebDriverWait

    folder, address = sites
    put(folder, "0.2.0", "index.html", "a/b.html", "a/old.html")
    put(folder, "0.3.0", "index.html", "a/b.html")
    wait = WebDriverWait(driver, 20)
    driver.get(f"{address}/0.2.0/a/b.html")
    # Without a list there is no choice.
    assert driver.execute_script(CHOICES) == []
    write_versions(folder)
    for page, leads in (("a/b.html", "0.3.0 a/b.html"), ("a/old.html", "0.3.0 index.html")):
        driver.get(f"{address}/0.2.0/{page}")
        wait.until(lambda page: page.execute_script(CHOICES) == ["0.3.0", "0.2.0"])
        assert driver.execute_script("return document.querySelector('.site-versions').value") == "0.2.0"
        driver.execute_script(CHOOSE, "0.3.0")
        wait.until(
            lambda page, leads=leads: page.execute_script("return document.querySelector('p')?.textContent") == leads
        )
