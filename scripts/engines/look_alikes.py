"""How near glTF's metallic-roughness material comes to materials: the table of docs/interchange.md.

python scripts/engines/look_alikes.py material:lafortune-blue-paint FILE.bsdf FILE.npz#NAME ...
"""

import argparse
import sys
from pathlib import Path

from homofact.brdf.source import open_source
from homofact.evaluation.appearance import appearance
from homofact.exporting.gltf_fit import fit_metallic_roughness

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import markdown

_FIGURES = ("albedo_worst", "energy_overall", "highlight", "psnr_light", "psnr_sky")


def main() -> None:
    """Print one row a source: the material's numbers, and the figures of its likeness."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sources", nargs="+", help="materials and files that are whole reflectances")
    rows = []
    for place in parser.parse_args().sources:
        source = open_source(place, count=100)
        look = fit_metallic_roughness(source.reflectance, source.samples.isotropic)
        likeness = appearance(look, source)
        assert likeness is not None, f"{place}: interpolated samples"
        shown = [f"{likeness.figures[name]:.3g}" for name in _FIGURES]
        more = (
            f"coat {look.clearcoat:.2f}"
            if look.clearcoat
            else f"along {look.anisotropy:.2f}"
            if look.anisotropy
            else ""
        )
        rows.append((source.name, f"{look.metallic:.2f}", f"{look.roughness:.2f}", more, *shown))
    head = ("source", "metallic", "roughness", "extension", "albedo, worst", "energy", "highlight", "lamp dB", "sky dB")
    print(markdown(head, rows))


if __name__ == "__main__":
    main()
