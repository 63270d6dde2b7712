"""Measure the page of a prepared scene in a software renderer: size, time to the first picture, time of a drag.

    python scripts/editing/editing_page_numbers.py FOLDER [--window 1400x900] [--out FILE.md] [--short]
    python scripts/editing/editing_page_numbers.py FILE.html

FOLDER is what `homofact edit` wrote; a page that is there already is measured as it is.

A headless Chromium shows the page in a window of 1400 × 900 pixels unless --window says otherwise; WebGL, which the
preview alone uses, is SwiftShader's. A curve of each material is dragged by its brush for some frames. "Frames a
second" are of the clock, from a drag's first frame to its last; on a machine that does other work they are too few,
so that beside them stand the milliseconds that the page's own work takes in a frame (`draw`, on the page's thread),
the processors' seconds a frame of all the browser's processes (the compositor's drawing of the window included), and
the machine's load. "All columns" is a frame in which the whole change comes in at once; what is "not put on the
canvas" is computed and not shown. Products a second are those of the sums; for comparison the same sums by a WebGL 2
fragment shader that reads the coefficients from a texture, at the same number of pixels and columns.
"""

import os
import re
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from homofact.errors import BadInput
from homofact.evaluation.machine import machine

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, markdown, parser_of, print_measured
from scripts.shared.headless import chromium, first_frame, open_page, processor_seconds, settled

RATE = 30.0
FRAMES = 45
# What is done before a drag, by what is added to its name.
WAYS = {
    "": "",
    ", all columns": "homofact.page.budget = 1e6",
    ", not put on the canvas": "homofact.page.paint = () => {}",
}
# Drags the curve of a material by the brush, frame by frame, and tells when each was done and how long it worked.
DRAG = """
const [material, count, done] = arguments, p = homofact.page, times = [], work = [], { bell, pulled } = homofact.shapes;
const own = p.curvesOf(material), summed = own.filter((c) => c.summed);
p.controls.edit(material, (summed.find((c) => c.angle === "theta_h") ?? summed[0]).index);
const curve = p.curve, from = p.values, band = curve.bands >> 4, draw = p.draw.bind(p);
p.draw = () => { const began = performance.now(); draw(); work.push(performance.now() - began); };
p.beginStep();
(function next() {
  times.push(performance.now());
  if (times.length > count) {
    delete p.draw;
    p.endStep();
    const ranks = p.view.parts.filter((part) => part.thing === material).map((part) => part.rank);
    return done({ times, work, name: `${curve.materialName}: ${curve.name}`, rank: Math.max(0, ...ranks) });
  }
  const before = homofact.frames, level = from[band * curve.channels] * (1 + 0.6 * Math.sin(times.length / 5));
  p.setValues(pulled(from, curve.channels, null, band, level, bell(curve.bands, band, curve.bands / 15), false));
  (function wait() { homofact.frames > before ? next() : requestAnimationFrame(wait); })();
})();
"""
# The sums of the largest part: by the processor, and by a shader that reads as many numbers.
PRODUCTS = """
const p = homofact.page, part = p.view.parts.toSorted((a, b) => b.numbers.length - a.numbers.length)[0];
const twin = part.twin(), times = [];
for (let k = 0; k < 4; k++) {
  twin.asked = null;
  for (const each of twin.shown) each.fill(0);
  twin.ask(p.history.state);
  const began = performance.now();
  twin.advance();
  times.push(performance.now() - began);
}
const pixels = part.size / part.channels, quads = Math.ceil(part.rank / 4) * part.channels, width = 2048;
const canvas = document.createElement("canvas"), gl = canvas.getContext("webgl2");
gl.getExtension("EXT_color_buffer_float");
const rows = Math.ceil(pixels / width), depth = Math.min(quads, 96), program = gl.createProgram();
const texts = ["#version 300 es\\nin vec2 a; void main() { gl_Position = vec4(a, 0.0, 1.0); }",
  `#version 300 es\\nprecision highp float; precision highp sampler2DArray; uniform sampler2DArray u;
  uniform vec4 h[${depth}];
  out vec4 colour;
  void main() {
    float sum = 0.0;
    for (int k = 0; k < ${depth}; k++) sum += dot(h[k], texelFetch(u, ivec3(gl_FragCoord.xy, k), 0));
    colour = vec4(sum);
  }`];
[gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((kind, k) => {
  const shader = gl.createShader(kind);
  gl.shaderSource(shader, texts[k]);
  gl.compileShader(shader);
  gl.attachShader(program, shader);
});
gl.linkProgram(program);
gl.useProgram(program);
gl.bindTexture(gl.TEXTURE_2D_ARRAY, gl.createTexture());
gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA16F, width, rows, depth);
gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.STATIC_DRAW);
gl.enableVertexAttribArray(0);
gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
const target = gl.createTexture();
gl.bindTexture(gl.TEXTURE_2D, target);
gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, width, rows);
gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
gl.viewport(0, 0, width, rows);
const card = [];
for (let k = 0; k < 4; k++) {
  const began = performance.now();
  gl.drawArrays(gl.TRIANGLES, 0, 3);
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.FLOAT, new Float32Array(4));
  card.push(performance.now() - began);
}
const least = (list) => Math.min(...list.slice(1));
const share = (quads * pixels) / (depth * width * rows);
return { products: part.numbers.length, processor: least(times), card: least(card) * share, pixels, rank: part.rank };
"""


def made(folder: Path, target: Path) -> None:
    """Write the page of a prepared scene."""
    from homofact.editing.page.edit_page import write_saved_page
    from homofact.editing.result import open_edit

    write_saved_page(target, open_edit(folder))


def measured(page: Path, frames: int, window: tuple[int, int] = (1400, 900)) -> dict[str, Any]:
    """What one browser says of the page in a window of so many pixels."""
    with tempfile.TemporaryDirectory() as folder, chromium(Path(folder) / "profile", size=window) as driver:
        open_page(driver, page)
        trouble = driver.execute_script("return document.getElementById('trouble')?.innerText ?? ''")
        if trouble:
            raise BadInput(f"{page}: {trouble.splitlines()[0]}")
        settled(driver)
        found: dict[str, Any] = {"first": first_frame(driver) / 1000, "drags": []}
        for number in range(driver.execute_script("return homofact.page.data.materials.length")):
            for way, script in WAYS.items():
                driver.execute_script(script)
                driver.execute_async_script(DRAG, number, 6)
                settled(driver)
                began = processor_seconds(driver)
                drag = driver.execute_async_script(DRAG, number, frames)
                drag["processor"] = 1000 * (processor_seconds(driver) - began) / frames
                settled(driver)
                drag["way"] = way
                found["drags"].append(drag)
            driver.execute_script("const p = homofact.page; p.budget = 16; delete p.paint; p.resetAll()")
        found["products"] = driver.execute_script(PRODUCTS)
        found["pixels"] = driver.execute_script("return homofact.page.views.map((v) => v.count)")
        found["window"] = window
        found["browser"] = f"Chromium {driver.capabilities['browserVersion']}"
        found["said"] = [entry["message"] for entry in driver.get_log("browser")]
    return found


def text_of(page: Path, found: dict[str, Any]) -> str:
    """The figures with their conditions."""
    rows = []
    for drag in found["drags"]:
        steps = np.diff(drag["times"])
        rows.append(
            (drag["name"] + drag["way"], str(drag["rank"]),
             figure(1000 / median(steps)), figure(median(drag["work"])), figure(drag["processor"]))
        )  # fmt: skip
    products = found["products"]
    rate = products["products"] / products["processor"] / 1e6
    wide, high = found["window"]
    lines = [
        f"# The page {page.name}",
        "",
        f"- {page.stat().st_size:,} bytes, {' + '.join(map(str, found['pixels']))} covered pixels; first picture after"
        f" {figure(found['first'])} s. {found['browser']}, WebGL 2 by SwiftShader, a window of {wide} × {high}."
        f" {machine()}",
        f"- load of the machine meanwhile {os.getloadavg()[0]:.1f} (mean number of programs that want a core)",
        f"- wanted: {RATE:g} frames per second, {figure(1000 / RATE)} ms a frame",
        "",
        markdown(("dragged", "rank", "frames per second", "page's work, ms", "all processes, ms"), rows),
        "",
        f"The sums of the largest part ({products['pixels']} pixels, rank {products['rank']}): {figure(rate)} thousand"
        f" million products a second, {figure(products['processor'])} ms in all; by a fragment shader"
        f" {figure(products['card'])} ms.",
        "",
    ]
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Make or take the page, measure and print; 2 where something is missing or the page complains."""
    parser = parser_of(__doc__)
    parser.add_argument("source", type=Path, help="a folder that homofact edit wrote, or a page that is there already")
    parser.add_argument("--window", default="1400x900", metavar="WxH", help="pixels of the window (%(default)s)")
    return print_measured(parser, arguments, asked)


def asked(chosen: Any) -> str:
    """The text of what was asked for. Raises BadInput for what is wrong with it, or missing."""
    window = re.fullmatch(r"(\d+)x(\d+)", chosen.window)
    if window is None:
        raise BadInput(where="--window", found=repr(chosen.window), expected="its width and height as 1400x900")
    with tempfile.TemporaryDirectory() as folder:
        page = chosen.source
        if not re.fullmatch(r"\.html?", page.suffix):
            page = Path(folder) / f"{page.name}.html"
            made(chosen.source, page)
        found = measured(page, 6 if chosen.short else FRAMES, (int(window[1]), int(window[2])))
        if found["said"]:
            raise BadInput(f"the page complained ({found['said'][0]})", where=page, expected="it silent")
        return text_of(page, found)


if __name__ == "__main__":
    sys.exit(main())
