"""Compare Blender's pictures of exported fits with our renderer's: the table of docs/interchange.md.

HOMOFACT_BLENDER=/path/to/blender python scripts/engines/blender_numbers.py out/paint out/yellow ... --pictures DIR

Sphere of 96 pixels under two suns. Cycles (on the processor) and, with --eevee, EEVEE against `render_sphere` of the
stored fit: median and 99th percentile of the relative difference. The look-alike is the Principled BSDF, for the same
suns in Cycles, against the same.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from homofact.containers.formats import format_named
from homofact.exporting.engines.blender import BLENDER, NAME
from homofact.exporting.exported import Exported, exported
from homofact.exporting.result import open_result
from homofact.rendering.light import DEFAULT_LIGHT, DirectionalLight
from homofact.rendering.sphere import render_sphere

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.engines.with_blender import differences, drawn, sun
from scripts.shared.harness import markdown

LIGHTS = (DEFAULT_LIGHT, DirectionalLight((0.9, -0.1, 0.3), 1.5))
SIZE, RINGS = 96, 64


def pictures(made: Exported, eevee: bool, size: int = SIZE) -> dict[str, np.ndarray]:
    """(size, size, 3) linear radiance, of our own renderer first."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, content in BLENDER.add(made).files.items():
            (folder / file).write_text(str(content), encoding="utf-8")
        lamps = [sun(light) for light in LIGHTS]
        asked = {"script": str(folder / NAME), "size": size, "lamps": lamps, "rings": RINGS}
        ways = {"Cycles": asked, "look-alike": asked | {"lookalike": True, "samples": 256}}
        ways |= {"under a sky": asked | {"world": 0.5, "samples": 64}}
        ways |= {"EEVEE": asked | {"engine": "BLENDER_EEVEE", "samples": 8}} if eevee else {}
        found = drawn(folder, list(ways.values()))
    ours = render_sphere(made.stored, LIGHTS, size).radiance.numpy()
    ours = np.broadcast_to(ours, (size, size, 3))
    return {"homofact": ours} | {way: each[..., :3] for way, each in zip(ways, found, strict=True)}


def main() -> None:
    """Print the table; with --pictures, write a strip of pictures a fit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fits", nargs="+", type=Path, help="folders or files of fits")
    parser.add_argument("--eevee", action="store_true", help="draw with EEVEE too, which needs a GPU or its stand-in")
    parser.add_argument("--pictures", type=Path, help="a folder for strips of pictures")
    asked = parser.parse_args()
    rows, ways = [], ["Cycles", *["EEVEE"] * asked.eevee, "look-alike"]
    for place in asked.fits:
        made = exported(open_result(place), format_named("exr"))
        shown = pictures(made, asked.eevee)
        row = [place.name]
        for way in ways:
            off = differences(shown[way], shown["homofact"])
            row += [percent(float(each)) for each in (np.median(off), np.quantile(off, 0.99))]
        rows.append(row)
        if asked.pictures is not None:
            asked.pictures.mkdir(parents=True, exist_ok=True)
            strip(asked.pictures / f"{place.name}.png", shown)
    print(markdown(("fit", *(f"{way}, {which}" for way in ways for which in ("median", "99%"))), rows))


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
