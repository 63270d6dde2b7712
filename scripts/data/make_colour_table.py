"""Make the table that turns spectra into linear sRGB under D65, from colour-science: homofact/brdf/d65.json.

    python scripts/data/make_colour_table.py [--out FILE.json]

colour-science takes about a second to load, which a command that reads a spectral file would wait for. The table holds
what `brdf.spectral.illuminated` computes from it for D65, number for number; a test compares both.
"""

import json
import sys
from pathlib import Path

from homofact.brdf.spectral import ILLUMINANT, computed
from homofact.files.atomic import write_text

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, parser_of


def main(arguments: list[str] | None = None) -> int:
    """Compute and write."""
    parser = parser_of(__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "homofact" / "brdf" / "d65.json")
    options = parser.parse_args(arguments)
    found = computed(ILLUMINANT)
    record = {name: getattr(found, name).tolist() for name in found._fields}
    write_text(options.out, json.dumps(record) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
