"""Measure CPU seconds of `homofact render` under an environment, for each kind of source and for fits.

A command is run twice, and the second run is told: the first may compile. Seconds are user and system time of all its
threads, the interpreter's start and its imports with them. The fits are quick ones: how textures were found does not
matter to how long they are drawn. Without the real measurements the synthetic ones are drawn alone.

    python scripts/speed/render_seconds.py [--size 384] [--environment FILE.hdr] [--data FOLDER] [--out FILE.md]
"""

import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from homofact.containers.exr import write_exr
from homofact.evaluation.machine import machine

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, data_folder, finish, markdown, parser_of, progress

ASKED = 10.0
SYNTHETIC = ROOT / "data_synthetic" / "synthetic_cornell.brdf"
MODELS = {"model, isotropic": "material:lafortune-blue-paint", "model, anisotropic": "material:ward-brushed"}
MEASURED = {
    "RGL tensor file": "rgl/chm_light_blue_rgb.bsdf",
    "scattered samples": "cornell/garnet_red.brdf",
    "scattered samples, many": "retro/retro-3M-jaune.dat",
    "table": "mdl/carpaint_red.mbsdf",
    "network": "nbrdf/merl_nbrdf_weights.npz#gold-metallic-paint",
}
FITS = {"fit, 2 textures of 16²": ("2", "16"), "fit, 3 textures of 32²": ("3", "32")}


def seconds_of(arguments: Sequence[str]) -> float:
    """Processor seconds of `homofact` with these arguments. Raises RuntimeError with its words where it fails."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-c", "import sys; from homofact.cli.entry import run; sys.exit(run())", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    if done.returncode:
        raise RuntimeError(f"{' '.join(arguments)}: exit {done.returncode}: {done.stderr.strip()}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def sky_file(folder: Path) -> Path:
    """A small environment of our own: a blue sky with a sun, for those who have none."""
    pixels = np.broadcast_to(np.linspace(1, 0.1, 32)[:, None, None], (32, 64, 3)).copy()
    pixels[8, 20] = 500.0
    target = folder / "sky.exr"
    write_exr(target, pixels, ("R", "G", "B"))
    return target


def main(arguments: list[str] | None = None) -> int:
    """Print (and with --out write) the table; returns the exit code."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--size", type=int, default=384, help="pixels a side (%(default)s)")
    parser.add_argument("--environment", type=Path, help="a lat-long .hdr (grace of the real data, else a plain sky)")
    chosen = parser.parse_args(arguments)
    data = data_folder(chosen.data)
    size = 32 if chosen.short else chosen.size
    sources = {} if chosen.short else dict(MODELS)
    sources["scattered samples, synthetic"] = str(SYNTHETIC)
    for kind, name in MEASURED.items():
        path = data / name
        if not Path(str(path).split("#")[0]).is_file():
            print(f"skipped {kind}: no {path} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)
        elif not chosen.short:
            sources[kind] = str(path)
    rows = []
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        grace = data / "envmaps" / "grace_probe_latlong.hdr"
        lit = chosen.environment or (grace if grace.is_file() and not chosen.short else sky_file(folder))
        for kind, (textures, side) in {} if chosen.short else FITS.items():
            result = folder / f"{textures}-{side}"
            settings = ["--effort", "20", "--count", "3000", "--textures", textures, "--size", side, "--quiet"]
            seconds_of(["factorize", MODELS["model, isotropic"], "--out", str(result), *settings])
            sources[kind] = str(result)
        for kind, drawn in sources.items():
            picture = folder / "sphere.png"
            command = [
                "render",
                drawn,
                "--environment",
                str(lit),
                "--size",
                str(size),
                "--out",
                str(picture),
                "--quiet",
            ]
            if not rows:
                seconds_of(command)
            took = seconds_of(command)
            rows.append((kind, f"{took:.1f}", "yes" if took <= ASKED else "no"))
            progress(*rows[-1])
    parts = [
        "# Seconds of a render under an environment",
        "Made by `python scripts/speed/render_seconds.py`. Processor seconds (user and system) of one `homofact"
        " render`,"
        f" {size} × {size} pixels, start and imports included. {machine()}",
        markdown(("source", "CPU s", f"within {ASKED:.0f}"), rows),
    ]
    return finish(parts, chosen)


if __name__ == "__main__":
    sys.exit(main())
