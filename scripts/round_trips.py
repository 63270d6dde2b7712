"""Two tables of one material: half/difference against in-out, at random directions, at rising resolution.

    python scripts/round_trips.py [--material lafortune-clay] [--short]

The half/difference table is written as a MERL file and read back; the in-out one is an `AngleTable` over θi, θo and
|Δφ|. Errors are relative to the model, and of the tables to each other, at 20,000 pairs uniform on both hemispheres up
to 84° from the normal. Where both are interpolations of the same thing their difference is at most the sum of both
errors, and falls with the spacing of the nodes.
"""

import math
import sys
import tempfile
from pathlib import Path

import torch
from conditions import figure, markdown, parser_of

from homofact.brdf.formats import merl
from homofact.brdf.formats import merl as writer
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.table import AngleTable, Axis
from homofact.evaluate.machine import machine
from homofact.geometry.directions import draw_uniform, from_spherical

NODES = (15, 30, 60, 90)


def in_out_table(model: Reflectance, count: int) -> AngleTable:
    """The model at count × count × count nodes of θi, θo and |Δφ|."""
    theta = torch.linspace(0, math.pi / 2, count, dtype=torch.float64)
    turn = torch.linspace(0, math.pi, count, dtype=torch.float64)
    i, o, d = torch.meshgrid(theta, theta, turn, indexing="ij")
    wi, wo = from_spherical(i.reshape(-1), torch.zeros(count**3).double()), from_spherical(o.reshape(-1), d.reshape(-1))
    values = model.evaluate(wi, wo).reshape(count, count, count, -1)
    return AngleTable((Axis(theta), Axis(theta), Axis(turn)), values, tuple(model.channels))


def main(arguments: list[str] | None = None) -> int:
    """Print a row a resolution."""
    parser = parser_of(__doc__)
    parser.add_argument("--material", default="lafortune-clay")
    options = parser.parse_args(arguments)
    model = material(options.material).model
    wi, wo = draw_uniform(20_000, torch.Generator().manual_seed(0))
    keep = (wi[:, 2] > 0.1) & (wo[:, 2] > 0.1)
    wi, wo = wi[keep], wo[keep]
    exact = model.evaluate(wi, wo)
    print(f"{options.material}, {len(wi)} pairs; {machine()}")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for count in NODES[:2] if options.short else NODES:
            path = Path(folder) / "table.binary"
            writer.write(path, model, (count, count, 2 * count))
            half, angles = (table.evaluate(wi, wo) for table in (merl.load(path), in_out_table(model, count)))
            errors = [(one / other - 1).abs() for one, other in ((half, exact), (angles, exact), (half, angles))]
            rows.append([count, *(figure(float(e.quantile(q))) for e in errors for q in (0.5, 0.99))])
    names = ("half/difference", "in-out", "one against the other")
    header = ["nodes", *(f"{name}, {part}" for name in names for part in ("median", "99%"))]
    print(markdown(header, rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
