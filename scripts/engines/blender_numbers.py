"""Compare Blender's pictures of exported fits with our renderer's: the table of docs/interchange.md.

HOMOFACT_BLENDER=/path/to/blender python scripts/engines/blender_numbers.py out/paint out/yellow ... --pictures DIR

Sphere of 96 pixels under two suns. Cycles (on the processor) and, with --eevee, EEVEE against `render_sphere` of the
stored fit: median and 99th percentile of the relative difference. With --sky the sphere is under that lat-long map, by
the closures of the script, against the exact integration (`render_filtered`); the columns are then medians, 99th
percentiles and the relative RMS, all within .85 of the radius. With --lobes it prints the errors of sums of so many
lobes under three made skies, for which it needs no Blender.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from homofact.containers.formats import format_named
from homofact.exporting.engine_light import closure_light
from homofact.exporting.engines.blender import BLENDER, NAME
from homofact.exporting.exported import Exported, exported
from homofact.exporting.result import open_result
from homofact.rendering.environment import read_environment
from homofact.rendering.filtered import draw_sphere
from homofact.rendering.light import DEFAULT_LIGHT, DirectionalLight, EnvironmentMap
from homofact.rendering.made_skies import MADE_SKIES
from homofact.rendering.surface import RADIUS

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.engines.with_blender import blender_sphere, differences
from scripts.shared.harness import markdown

LIGHTS = (DEFAULT_LIGHT, DirectionalLight((0.9, -0.1, 0.3), 1.5))
SIZE, RINGS = 96, 64
BOUND = 0.85  # of the radius


def pictures(made: Exported, eevee: bool, sky: EnvironmentMap | None, size: int, samples: int) -> dict[str, np.ndarray]:
    """(size, size, 3) linear radiance, of our own renderer first."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, content in BLENDER.add(made).files.items():
            (folder / file).write_text(str(content), encoding="utf-8")
        lights = LIGHTS if sky is None else ()
        engines = {"Cycles": "CYCLES"} | ({"EEVEE": "BLENDER_EEVEE"} if eevee else {})
        found = {}
        for way, engine in engines.items():
            count = samples if engine == "CYCLES" else 8
            more = {"engine": engine, "rings": RINGS} | ({"samples": 8} if engine != "CYCLES" and sky is None else {})
            found[way] = blender_sphere(folder, folder / NAME, size, lights, sky, count, **more)
    ours = draw_sphere(made.stored, LIGHTS if sky is None else sky, size).radiance.numpy()
    return {"homofact": np.broadcast_to(ours, (size, size, 3))} | found


def relative_rms(found: np.ndarray, expected: np.ndarray) -> float:
    """√(Σ difference²/Σ expected²) within .85 of the radius."""
    y, x = np.mgrid[: len(found), : len(found)] + 0.5 - len(found) / 2
    inner = np.hypot(x, y) < BOUND * RADIUS * len(found) / 2
    return float(np.sqrt(((found - expected)[inner] ** 2).sum() / (expected[inner] ** 2).sum()))


def main() -> None:
    """Print the table; with --pictures, write a strip of pictures a fit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fits", nargs="+", type=Path, help="folders or files of fits")
    parser.add_argument("--eevee", action="store_true", help="draw with EEVEE too, which needs a GPU or its stand-in")
    parser.add_argument("--sky", type=Path, help="a lat-long map, .hdr or .exr, in place of the suns")
    parser.add_argument("--size", type=int, default=SIZE, help="pixels of a sphere's side")
    parser.add_argument("--samples", type=int, default=1024, help="of Cycles under a sky")
    parser.add_argument("--lobes", nargs="+", type=int, choices=(1, 2, 3), help="errors of sums of so many lobes")
    parser.add_argument("--pictures", type=Path, help="a folder for strips of pictures")
    asked = parser.parse_args()
    if asked.lobes:
        print(lobe_errors(asked.fits, asked.lobes))
        return
    sky = None if asked.sky is None else read_environment(asked.sky)
    rows, ways = [], ["Cycles", *["EEVEE"] * asked.eevee]
    columns = ("median", "99%") + (("RMS",) if sky else ())
    for place in asked.fits:
        made = exported(open_result(place), format_named("exr"))
        shown = pictures(made, asked.eevee, sky, asked.size, asked.samples)
        row = [place.name]
        for way in ways:
            off = differences(shown[way], shown["homofact"])
            figures = [np.median(off), np.quantile(off, 0.99)]
            figures += [relative_rms(shown[way], shown["homofact"])] if sky else []
            row += [percent(float(each)) for each in figures]
        rows.append(row)
        if asked.pictures is not None:
            asked.pictures.mkdir(parents=True, exist_ok=True)
            strip(asked.pictures / f"{place.name}.png", shown)
    print(markdown(("fit", *(f"{way}, {which}" for way in ways for which in columns)), rows))


def lobe_errors(places: list[Path], counts: list[int]) -> str:
    """The table of --lobes."""
    rows = []
    for place in places:
        made = exported(open_result(place), format_named("exr"))
        for count in counts:
            errors = closure_light(made.stored, count).errors
            rows.append([place.name, str(count), *(f"{error:.1%}" for error in errors.values())])
    return markdown(("fit", "lobes", *MADE_SKIES), rows)


def percent(share: float) -> str:
    """Two digits."""
    return f"{100 * share:.0f}%" if share >= 0.1 else f"{100 * share:.2g}%"


def strip(place: Path, shown: dict[str, np.ndarray]) -> None:
    """The pictures side by side, as a screen shows them."""
    from PIL import Image

    row = np.concatenate([np.clip(each, 0, 1) ** (1 / 2.2) for each in shown.values()], 1)
    Image.fromarray((row * 255).round().astype(np.uint8)).resize((3 * row.shape[1], 3 * row.shape[0]), 0).save(place)


if __name__ == "__main__":
    main()
