"""Measure how near glTF's metallic-roughness material comes to materials: the table of docs/interchange.md.

python scripts/engines/look_alikes.py material:lafortune-blue-paint FILE.bsdf FILE.npz#NAME ...
"""

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.source import open_source
from homofact.evaluation.appearance import appearance
from homofact.exporting.gltf_fit import fit_metallic_roughness

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import markdown

_FIGURES = ("albedo_worst", "highlight", "psnr_light", "psnr_sky")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print one row a source: the material's numbers, and the figures of its likeness."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sources", nargs="+", help="materials and files that are whole reflectances")
    rows = []
    for place in parser.parse_args(arguments).sources:
        source = open_source(place, count=100)
        look = fit_metallic_roughness(source.reflectance, source.samples.isotropic)
        likeness = appearance(look, source)
        if likeness is None:
            parser.error(f"{place} is known at its samples only: expected a material, or a file that is a reflectance")
        mean = max(likeness.energy.energy, key=lambda ratio: abs(math.log(ratio)))
        worst, *others = (f"{likeness.figures[name]:.3g}" for name in _FIGURES)
        numbers = (f"{look.metallic:.2f}", f"{look.roughness:.2f}", extensions(look))
        rows.append((source.name, *numbers, worst, f"{mean:.3g}", *others))
    head = ("source", "metallic", "roughness", "extensions", "albedo, worst", "albedo, mean", "highlight")
    print(markdown((*head, "lamp dB", "sky dB"), rows))


def extensions(look: MetallicRoughness) -> str:
    """The extensions of a material with their factors."""
    used = {
        "specular": look.specular if look.extended_specular else 0.0,
        "coat": look.clearcoat,
        "along": look.anisotropy,
    }
    return ", ".join(f"{name} {factor:.2f}" for name, factor in used.items() if factor)


if __name__ == "__main__":
    main()
