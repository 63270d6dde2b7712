"""Measure the page of a relit scene in a software renderer: size, time to the first picture, speed of turning.

    python scripts/relighting/relight_page_numbers.py SCENE.toml [--sky FILE.hdr ...] [--page FILE.html] [--out FILE.md]
    python scripts/relighting/relight_page_numbers.py FILE.html

A scene is precomputed as `homofact relight` does it, in clusters where its file asks for them, and written as a page
with the reference of its first camera: the sum over all texels, at every vertex that the camera sees. The light of the
scene is the first sky. A page that is there already is measured as it is.

A headless Chromium draws with SwiftShader. Frames are counted as the page makes them while the camera is turned by 2° a
frame: it lowers the resolution to keep up, and the part of the pixels' width that it settles at is said. Beside that
stand single frames at full resolution. Seconds are of the clock; on a machine that does other work they are too long,
so the processors' own seconds per frame (browser and drawing, all threads) stand beside them, and the machine's load.
A second table has the bytes of the file by what they are for.
"""

import json
import os
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from homofact.errors import BadInput
from homofact.evaluation.machine import machine
from homofact.relighting.build import open_relight_scene, relit_objects
from homofact.relighting.errors import dense_colours
from homofact.relighting.page.build import PageReference, page_objects, write_page
from homofact.relighting.page.skies import page_sky
from homofact.relighting.scene_file import read_relight_scene
from homofact.rendering.environment import read_environment

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, markdown, parser_of, print_measured
from scripts.shared.headless import chromium, first_frame, open_page, processor_seconds, settled

LARGEST, LATEST, SLOWEST = 20_000_000, 5.0, 20.0
PICTURE = (900, 700)
FRAMES = 40
# Turns the camera frame by frame and tells when each was done, and at which part of the width.
TURN = """
const [count, step, done] = arguments, v = homofact.view, times = [], scales = [];
(function next() {
  times.push(performance.now());
  scales.push(v.stage.canvas.width / v.stage.canvas.clientWidth);
  if (times.length > count) return done([times, scales]);
  const before = homofact.frames;
  v.orbit.turn(step, 0);
  v.changed("moving");
  (function wait() { homofact.frames > before ? next() : requestAnimationFrame(wait); })();
})();
"""
WHOLE = """
const [count, smooth] = arguments, v = homofact.view, times = [];
v.fit(1);
for (let k = 0; k <= count; k++) {
  const began = performance.now();
  v.orbit.turn(2, 0);
  v.stage.draw(v, smooth);
  v.stage.finish();
  times.push(performance.now() - began);
}
return times.slice(1);
"""
LIGHT = """
const v = homofact.view, times = [];
for (let k = 1; k <= 12; k++) {
  const began = performance.now();
  v.relit.relight(v.sky.coefficients(10 * k));
  v.bring();
  times.push(performance.now() - began);
}
return times.slice(2);
"""


def made(file: Path, skies: list[Path], target: Path) -> None:
    """Precompute the scene and write its page."""
    scene = read_relight_scene(file)
    ready = open_relight_scene(scene)
    objects = relit_objects(ready)
    size = scene.settings.cube
    lights = [page_sky(scene.light.name, scene.light, size)]
    lights += [page_sky(each.stem, read_environment(each), size) for each in skies]
    numbers = {
        f"{each.mesh.name}, {each.material}": {
            "vertices": len(each.mesh.positions),
            "terms K": each.transport.factors.terms,
            "bytes": each.nbytes,
        }
        for each in objects
    }
    reference = PageReference(dense_colours(ready, lights[0].cube))
    write_page(target, page_objects(objects), lights, numbers, reference, title=scene.name, camera=scene.cameras[0])


def measured(page: Path, frames: int) -> dict[str, Any]:
    """What one browser says of the page."""
    with tempfile.TemporaryDirectory() as folder, chromium(Path(folder) / "profile") as driver:
        open_page(driver, page)
        trouble = driver.execute_script("return document.getElementById('trouble')?.innerText ?? ''")
        if trouble:
            raise BadInput(f"{page}: {trouble.splitlines()[0]}")
        found: dict[str, Any] = {"first": first_frame(driver) / 1000}
        driver.execute_script(
            "const p = document.getElementById('picture'); p.style.width = arguments[0] + 'px';"
            "p.style.height = arguments[1] + 'px'; homofact.changed('picture')",
            *PICTURE,
        )
        settled(driver)
        driver.execute_async_script(TURN, 12, 2)
        began = processor_seconds(driver)
        times, scales = driver.execute_async_script(TURN, frames, 2)
        found["processor"] = (processor_seconds(driver) - began) / frames
        found["frames"] = np.diff(times).tolist()
        found["scale"] = float(median(scales))
        settled(driver)
        found["plain"] = driver.execute_script(WHOLE, 8, False)
        found["smooth"] = driver.execute_script(WHOLE, 8, True)
        found["light"] = driver.execute_script(LIGHT)
        driver.execute_script("if (homofact.view.reference) homofact.view.goToReference()")
        settled(driver)
        found["statistics"] = driver.execute_script("return homofact.view.statistics()")
        found["browser"] = f"Chromium {driver.capabilities['browserVersion']}"
        found["vertices"] = driver.execute_script("return homofact.view.objects.map(o => o.vertices)")
        found["said"] = [entry["message"] for entry in driver.get_log("browser")]
    return found


def text_of(page: Path, found: dict[str, Any]) -> str:
    """The figures with their conditions."""
    size, rate = page.stat().st_size, 1000 / median(found["frames"])
    share = f"{found['scale']:.2f} of the width"
    milliseconds = {name: f"{median(found[name]):.0f}" for name in ("plain", "smooth", "light")}
    error = found["statistics"]["error"]
    rows = [
        ("file, bytes", f"{size:,}", f"≤ {LARGEST:,}", held(size <= LARGEST)),
        ("first picture, s", figure(found["first"]), f"≤ {LATEST:g}", held(found["first"] <= LATEST)),
        (f"turning the camera, frames per second, at {share}", figure(rate), f"≥ {SLOWEST:g}", held(rate >= SLOWEST)),
        ("the same, processors' seconds per frame", figure(found["processor"]), "", ""),
        ("one frame at full resolution, ms", milliseconds["plain"], "", ""),
        ("the same with smooth edges, ms", milliseconds["smooth"], "", ""),
        ("light turned, from nothing, ms", milliseconds["light"], "", ""),
        ("relative RMS against the reference", "–" if error is None else f"{error:.2%}", "", ""),
        ("light below zero", f"{found['statistics']['below']:.3%}", "", ""),
    ]
    sizes = bytes_by_part(page)
    vertices = " + ".join(f"{count:,}" for count in found["vertices"])
    lines = [
        f"# The page {page.name}",
        "",
        f"- {vertices} vertices, a picture of {PICTURE[0]} × {PICTURE[1]} pixels, {found['browser']}, WebGL 2 by"
        f" SwiftShader. {machine()}",
        f"- load of the machine meanwhile {os.getloadavg()[0]:.1f} (mean number of programs that want a core)",
        "",
        markdown(("figure", "measured", "wanted", "verdict"), rows),
        "",
        markdown(("bytes for", "kB"), [(what, f"{size / 1e3:,.0f}") for what, size in sizes.most_common()], 1),
        "",
    ]
    return "\n".join(lines)


# What arrays of the page are for, by the first word of their names that is here.
PARTS = {
    "basis": "transport", "mix": "transport", "sight": "visibility bits", "tables": "tables of lobes and suns",
    "lobe": "tables of lobes and suns", "sunlight": "visible parts of suns", "skies": "skies", "map": "view maps",
    "tint": "textures", "reference": "reference", "objects": "meshes",
}  # fmt: skip


def bytes_by_part(page: Path) -> Counter[str]:
    """How many bytes of the file are for what; scripts, styles and numbers are the rest."""
    text = page.read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)
    data = json.loads(found[1]) if found else {}
    sizes: Counter[str] = Counter()
    repeated = data.pop("repeated", [])
    for names, packed in arrays_of(data):
        if "repeated" in packed:
            place = packed["repeated"]
            packed, repeated[place] = repeated[place], None
        if packed is not None:
            sizes[next(word for name, word in PARTS.items() if name in names)] += len(packed["data"])
    sizes["scripts, styles and numbers"] = page.stat().st_size - sizes.total()
    return sizes


def arrays_of(node: Any, names: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], dict[str, Any]]]:
    """The packed arrays of a page's data, with the names that lead to them."""
    if isinstance(node, dict) and ("repeated" in node or "data" in node):
        yield names, node
    elif isinstance(node, dict):
        for name, each in node.items():
            yield from arrays_of(each, (*names, name))
    elif isinstance(node, list):
        for each in node:
            yield from arrays_of(each, names)


def held(good: bool) -> str:
    """The verdict in words."""
    return "held" if good else "NOT held"


def main(arguments: list[str] | None = None) -> int:
    """Make or take the page, measure and print; 2 where something is missing or the page complains."""
    parser = parser_of(__doc__)
    parser.add_argument("source", type=Path, help="SCENE.toml, or a page that is there already")
    parser.add_argument("--sky", type=Path, action="append", default=[], help="another sky of the page (.hdr, .exr)")
    parser.add_argument("--page", type=Path, help="keep the page in this file")
    return print_measured(parser, arguments, asked)


def asked(chosen: Any) -> str:
    """The text of what was asked for. Raises BadInput for what is wrong with it, or missing."""
    with tempfile.TemporaryDirectory() as folder:
        page = chosen.source
        if not re.fullmatch(r"\.html?", page.suffix):
            page = chosen.page or Path(folder) / f"{page.stem}.html"
            made(chosen.source, chosen.sky, page)
        found = measured(page, 4 if chosen.short else FRAMES)
        if found["said"]:
            raise BadInput(f"the page complained ({found['said'][0]})", where=page, expected="it silent")
        return text_of(page, found)


if __name__ == "__main__":
    sys.exit(main())
