"""Time fragment shaders in a WebGL 2 page: two textures, McCool's, the NBRDF network and GGX.

    python scripts/speed/shader_throughput.py [SOURCE] [--page FILE.html] [--run] [--out FILE.md] [--short]

All ways are fitted here to the same samples and printed as GLSL ES by the export's own printer; textures are read as
the export stores them (`--formats`), by the machine's own sampler. The page (`shader_throughput.html` with its data)
asks for nothing from anywhere: open it in any browser with WebGL 2. There

- every fragment evaluates many pairs of directions, which it makes itself from a hash of the pair's number
  (`shader_ways.directions`), and writes the mean; the pairs are the same for all ways;
- a draw ends when a pixel has been read back; every round times each way once, in an order that turns, and the medians
  of the rounds count. What the empty shader of the same directions takes is subtracted round by round;
- EXT_disjoint_timer_query_webgl2 gives the GPU's own times where a browser has it;
- every shader's values are held against those that Python computed for the same directions, of single pairs and of
  the mean of a loop.

With `--run` a headless Chromium opens the page, and its table is printed as Markdown.
"""

import base64
import json
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from homofact.brdf.source import open_source
from homofact.errors import BadInput
from homofact.evaluation.machine import machine
from homofact.files.words import harmless
from homofact.methods.search import Search
from homofact.shading.cost import cost_of
from homofact.shading.encoding import Encoded
from homofact.shading.languages import GLSL, shader

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, markdown, parser_of, print_measured, write
from scripts.shared.headless import chromium, open_page
from scripts.speed.shader_ways import NAMED, STORED, Way, directions, ways_of

TEMPLATE = Path(__file__).resolve().with_suffix(".html")
# Fragments along a side and pairs a fragment of the comparisons with Python.
CHECKS = ((16, 1), (8, 32))


def record(way: Way) -> dict[str, Any]:
    """What the page needs of a way, JSON-able."""
    cost = cost_of(way.program, 0)
    expected = {}
    for side, pairs in CHECKS:
        wi, wo = directions(side * side * pairs)
        means = way.reflectance.evaluate(wi, wo).reshape(side * side, pairs, 3).mean(1)
        expected[str(pairs)] = [float(f"{value:.9g}") for value in means.flatten().tolist()]
    return {
        "key": way.key, "name": way.name, "code": shader(way.program, GLSL), "fetches": cost.fetches,
        "operations": cost.scalar, "bytes": way.nbytes, "error": way.error, "allowed": way.allowed,
        "textures": [texture_record(texture) for texture in way.textures], "expected": expected,
    }  # fmt: skip


def texture_record(texture: Encoded) -> dict[str, Any]:
    """A texture's texels as texImage2D takes them: four channels, little-endian, in base64."""
    rows, columns, channels = texture.stored.shape
    full = np.ones((rows, columns, 4), texture.stored.dtype.newbyteorder("<"))
    full[..., :channels] = texture.stored
    data = base64.b64encode(full.tobytes()).decode("ascii")
    return {"format": STORED[texture.storage], "rows": rows, "columns": columns, "data": data}


def page_of(ways: Sequence[Way], title: str, about: str, floor: float, side: int, rounds: int, least: float) -> str:
    """The page's text.

    `floor` (sr⁻¹) is added to the values by which differences are divided; a draw has side² fragments, and so many
    pairs each that the empty shader takes at least `least` milliseconds.
    """
    notes = [
        "Every fragment makes its pairs of directions from a hash, the same for all ways, and writes the mean of the"
        " values. The evaluation alone is less what the empty shader takes, round by round; ± is half the range of the"
        " middle half of the rounds.",
        f"Differences from Python: at {CHECKS[0][0] ** 2} pairs and at means of {CHECKS[1][1]} pairs in"
        f" {CHECKS[1][0] ** 2} fragments, relative to the value and {figure(floor)} sr⁻¹ more. Textures may differ by"
        " as much as a sampler does that divides the way from texel to texel into 256 steps.",
        "Bytes are those of the texels on the GPU or of the numbers as 32-bit floats. Operations count every component"
        " by itself; lookups are the sampler’s.",
    ]
    data = {
        "title": title,
        "about": about,
        "notes": notes,
        "floor": floor,
        "side": side,
        "rounds": rounds,
        "least": least,
        "pairs": 8,
        "checks": [{"side": n, "pairs": pairs} for n, pairs in CHECKS],
        "ways": [record(way) for way in ways],
    }
    text = json.dumps(data, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
    return TEMPLATE.read_text(encoding="utf-8").replace("{{data}}", text)


def shown(page: Path, seconds: float = 540) -> tuple[dict[str, Any], str]:
    """The page's results and the browser's name and version; a headless browser draws it in software.

    Raises BadInput where the page says that it could not, or is not done after so many seconds, and MissingDependency
    where there is no browser.
    """
    with tempfile.TemporaryDirectory() as folder, chromium(Path(folder) / "profile") as driver:
        open_page(driver, page)
        name = f"Chromium {driver.capabilities['browserVersion']}"
        began = time.perf_counter()
        while time.perf_counter() - began < seconds:
            found = driver.execute_script("return {results: homofact.results, trouble: homofact.trouble}")
            if found["trouble"]:
                raise BadInput(f"{page}: {found['trouble']}")
            if found["results"]:
                return found["results"], name
            time.sleep(0.2)
    raise BadInput(f"not done after {seconds:g} s", where=page, expected="it to be")


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit, write the page, and with --run open it and print its table; 2 where something is missing or wrong."""
    parser = parser_of(__doc__, "effort")
    parser.add_argument("source", nargs="?", default="material:lafortune-blue-paint", help="as homofact factorize")
    parser.add_argument("--page", type=Path, help="the page's file (shader_throughput.html here, or none with --run)")
    parser.add_argument("--formats", default="ktx2,png8", help=f"of {', '.join(NAMED)} (%(default)s)")
    parser.add_argument("--side", type=int, default=256, help="fragments along a side of the canvas (%(default)s)")
    parser.add_argument("--rounds", type=int, default=15, help="of which the medians count (%(default)s)")
    parser.add_argument("--run", action="store_true", help="open the page in a headless Chromium and print its table")
    return print_measured(parser, arguments, measured)


def measured(options: Any) -> str:
    """What there is to print. Raises BadInput for what cannot be meant, and where a browser is missing."""
    formats = list(dict.fromkeys(options.formats.split(",")))
    for name in formats:
        if name not in NAMED:
            raise BadInput(where="--formats", found=repr(name), expected=f"some of {', '.join(NAMED)}")
    for name, found, least, most in (("side", options.side, 16, 4096), ("rounds", options.rounds, 1, 1000)):
        if not least <= found <= most:
            raise BadInput(where=f"--{name}", found=found, expected=f"{least} to {most}")
    if options.out is not None and not options.run:
        raise BadInput("--out: there is no table without --run")
    count, steps, side, rounds, effort, least = (
        (2000, 200, 32, 3, 1.0, 1.0)
        if options.short
        else (45_000, 20_000, options.side, options.rounds, options.effort, 30.0)
    )
    source = open_source(options.source, count=count)
    settings = Search(effort=effort, epsilon=source.default_epsilon)
    ways, words = ways_of(source, formats, settings, steps)
    title = f"{source.name} in a fragment shader"
    floor = float(source.samples.values.mean()) * max(0.01, source.default_epsilon)
    text = page_of(ways, harmless(title), harmless(words), floor, side, rounds, least)
    if not options.run:
        page = options.page or Path("shader_throughput.html")
        write(page, text)
        return f"{page}: {len(text.encode()):,} bytes, {len(ways)} ways; open it in a browser with WebGL 2"
    with tempfile.TemporaryDirectory() as folder:
        page = options.page or Path(folder) / "shader_throughput.html"
        write(page, text)
        found, browser = shown(page)
    for row in found["rows"]:
        if not row["agrees"]:
            name, *_, difference = row["cells"]
            raise BadInput(
                where=name, found=f"values that differ from Python's by {difference}", expected="them to agree"
            )
    lines = [
        f"# {title}",
        "",
        f"- {words}",
        f"- {found['conditions']}",
        f"- {browser}, {found['renderer']}",
        f"- {machine()}; load average at the end {os.getloadavg()[0]:.1f}",
        "",
        markdown(found["header"], [row["cells"] for row in found["rows"]]),
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
