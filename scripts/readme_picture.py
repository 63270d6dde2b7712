"""The picture at the top of the README: blue paint, two searched textures, McCool's projections.

python scripts/readme_picture.py [--out docs/pictures/blue_paint.png]
"""

import argparse
from pathlib import Path

from homofact.brdf.source import open_source
from homofact.cli.factorize import caption
from homofact.evaluate.compare import fit_and_measure
from homofact.figures.compare_picture import compare_picture
from homofact.methods.mccool import McCool
from homofact.methods.search import Search

PLACE = Path(__file__).resolve().parent.parent / "docs" / "pictures" / "blue_paint.png"


def main(arguments: list[str] | None = None) -> None:
    """Fit and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=PLACE, help="where the picture goes")
    chosen = parser.parse_args(arguments)
    source = open_source("material:lafortune-blue-paint")
    panels = []
    for title, settings in (
        ("homofact: two searched textures", Search(textures=2)),
        ("McCool's projections", McCool()),
    ):
        row = fit_and_measure(source, settings)
        panels.append((title, row.factorization, caption(row.record())))
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    compare_picture(chosen.out, ("Lafortune's blue paint", source.reflectance), panels)


if __name__ == "__main__":
    main()
