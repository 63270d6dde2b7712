"""Make the fits of the site's gallery, each with its sphere, textures, verdict and viewer: `make gallery`.

    python scripts/pictures/site_gallery.py [--data FOLDER] [--only NAME ...] [--out build/gallery]

A brushed metal and a paint come from named materials, the RGL and Cornell paints and some surrogates of MERL materials
from FOLDER or HOMOFACT_DATA; those that are not there are named and left out. Each is the default fit of three 32²
textures, as `homofact factorize` makes it, in a folder of its own; what is there and was made with this version from
this source is kept. `make docs` shows whatever it finds in build/gallery.
"""

import contextlib
import io
import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from homofact.cli.main import main as homofact
from homofact.version import __version__

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, data_folder, parser_of

NAMED = (
    ("ward-brushed", "Named materials", "lightly brushed aluminium (Ward 1992)"),
    ("lafortune-blue-paint", "Named materials", "a blue paint (Lafortune et al. 1997)"),
)
RGL = ("aurora_white", "vch_golden_yellow", "chm_light_blue", "irid_flake_paint1")
CORNELL = ("garnet_red", "krylon_blue", "cayman")
SURROGATES = ("chrome", "gold-metallic-paint", "pink-plastic")
RECORD = "gallery.json"


def materials(folder: Path) -> Iterator[tuple[str, str, str, str]]:
    """(name, group, what it is, source) of what is there; the others are named on stderr."""
    for name, group, what in NAMED:
        yield name, group, what, f"material:{name}"
    networks = folder / "nbrdf" / "merl_nbrdf_weights.npz"
    measured, sampled = "a measured paint (Dupuy and Jakob 2018)", "an automotive paint, known at its samples alone"
    surrogate = "a network fitted to a MERL material (Sztrajman et al. 2021)"
    places = [
        *((name, "RGL paints", measured, folder / "rgl" / f"{name}_rgb.bsdf", "") for name in RGL),
        *((name, "Cornell paints", sampled, folder / "cornell" / f"{name}.brdf", "") for name in CORNELL),
        *((name, "Surrogates of MERL", surrogate, networks, f"#{name}") for name in SURROGATES),
    ]
    for name, group, what, file, member in places:
        if file.is_file():
            yield name, group, what, f"{file}{member}"
        else:
            print(f"skipped {name}: no {file} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)


def main() -> int:
    """Fit what is not there yet, and return 1 where a fit was refused."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these materials alone")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "gallery", help="folder of the fits")
    parser.add_argument("--effort", default="normal", help="how much is searched (normal)")
    asked = parser.parse_args()
    failed = 0
    for number, (name, group, what, source) in enumerate(materials(data_folder(asked.data))):
        if asked.only and name not in asked.only:
            continue
        place = asked.out / name
        made = {"version": __version__, "source": Path(source).name, "effort": asked.effort}
        record = place / RECORD
        if record.is_file() and json.loads(record.read_text(encoding="utf-8"))["made"] == made:
            print(f"{name}: there", flush=True)
            continue
        if place.exists():
            shutil.rmtree(place)
        report = fitted(place, source, asked.effort)
        if report is None:
            failed += 1
            continue
        record.write_text(
            json.dumps({"made": made, "order": number, "name": name, "group": group, "what": what, "report": report}),
            encoding="utf-8",
        )
        print(f"{name}: {report['verdict']['summary']}", flush=True)
    return 1 if failed else 0


def fitted(place: Path, source: str, effort: str) -> dict[str, Any] | None:
    """The fit's report, its folder with sphere and viewer at `place`; None where a command refuses it."""
    commands = (
        ["factorize", source, "--textures", "3", "--size", "32", "--effort", effort, "--out", str(place), "--json"],
        ["render", str(place), "--environment", str(ROOT / "data_synthetic" / "sky.hdr"), "--size", "256",
         "--out", str(place / "sphere.png"), "--json"],
        ["view", str(place), "--source", source, "--json"],
    )  # fmt: skip
    answers = []
    for command in commands:
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            code = homofact(command)
        if code != 0:
            return None
        answers.append(json.loads(out.getvalue()))
    return answers[0]


if __name__ == "__main__":
    sys.exit(main())
