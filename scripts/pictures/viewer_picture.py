"""Draw the picture of the viewer in docs/start.md: the page of a plastic in a headless browser.

    python scripts/pictures/viewer_picture.py [--out docs/pictures/viewer.png]

The page is that of `homofact view` for two searched textures; Debian's chromium and chromium-driver draw it.
"""

import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

from homofact.brdf.source import open_source
from homofact.brdf.source_names import HELD_OUT
from homofact.evaluation.compare import fit_and_measure
from homofact.methods.search import Search
from homofact.web.page import write_view

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, parser_of
from scripts.shared.headless import chromium, open_page

SIZE = (1440, 900)
PASSES = 48


def main(arguments: list[str] | None = None) -> int:
    """Fit, write the page, photograph it."""
    parser = parser_of(__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "pictures" / "viewer.png")
    options = parser.parse_args(arguments)
    source = open_source("material:cook-torrance-plastic")
    settings = Search(effort=1.0 if options.short else "normal")
    row = fit_and_measure(source, settings, HELD_OUT)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "view.html"
        write_view(row.factorization, page, source, report=row.record())
        with chromium(Path(folder) / "profile", size=SIZE) as driver:
            open_page(driver, page)
            # Light is gathered pass by pass; software takes its time.
            passes = 2 if options.short else PASSES
            while driver.execute_script("return window.homofact.passes") < passes:
                time.sleep(0.2)
            options.out.parent.mkdir(parents=True, exist_ok=True)
            driver.save_screenshot(str(Path(folder) / "shot.png"))
        # In all colours: 256 band the smooth spheres.
        Image.open(Path(folder) / "shot.png").convert("RGB").save(options.out, optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
