"""Draw the picture of the editing page in docs/editing.md: a wider highlight beside the start.

    homofact edit configs/scenes/edit.toml --out out/edit
    python scripts/pictures/editing_picture.py out/edit [--out docs/pictures/edit.png]

Debian's chromium and chromium-driver draw the page of `homofact view`.
"""

import sys
import tempfile
from pathlib import Path

from PIL import Image

from homofact.editing.page.edit_page import write_saved_page
from homofact.editing.result import open_edit

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, parser_of
from scripts.shared.headless import chromium, open_page, settled

SIZE = (1440, 900)
EDIT = """
const p = homofact.page, { state } = p;
p.slide({ sigma: 0.3 });
Object.assign(state, { show: "split", split: 0.36 });
p.changed("all");
"""
SHOWN = """
const done = arguments[0], shown = () => !document.getElementById("settled").hidden;
(function wait() { shown() ? requestAnimationFrame(() => requestAnimationFrame(done)) : setTimeout(wait, 50); })();
"""


def main(arguments: list[str] | None = None) -> int:
    """Write the page, edit it, photograph it."""
    parser = parser_of(__doc__)
    parser.add_argument("scene", type=Path, help="a folder that homofact edit wrote")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "pictures" / "edit.png")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        page, shot = Path(folder) / "edit.html", Path(folder) / "shot.png"
        write_saved_page(page, open_edit(options.scene))
        with chromium(Path(folder) / "profile", size=SIZE) as driver:
            open_page(driver, page)
            settled(driver)
            driver.execute_script(EDIT)
            settled(driver)
            driver.execute_async_script(SHOWN)
            driver.save_screenshot(str(shot))
        Image.open(shot).convert("RGB").save(options.out, optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
