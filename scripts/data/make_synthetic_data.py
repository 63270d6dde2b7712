"""Make the synthetic data that the package contains.

    python scripts/data/make_synthetic_data.py [--check] [--out FOLDER]

blue_paint.npz and plastic.npz are samples of named materials, synthetic_cornell.brdf a made-up spectral
measurement in the Cornell format: a green pigment under a dielectric coat, with seeded noise that grows
towards short wavelengths and with weak readings lost to zero, as real ones have it. knot.ply and sky.hdr are a mesh
and an environment map for relighting: a torus knot, and a low sun in a clear sky over dry ground; labels.npy the label
map of a spatially varying material. manifest.json gives
generator, seed, counts and SHA-256 of each. --check remakes them elsewhere and compares the hashes.
"""

import argparse
import hashlib
import json
import math
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.analytic import CookTorrance
from homofact.brdf.formats import cornell, npz
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import RADIUS_SQUARED
from homofact.files.atomic import write_text
from homofact.geometry.directions import draw_in_discs, from_spherical, normalize
from homofact.meshes.shapes import torus_knot

FOLDER = Path(__file__).resolve().parents[2] / "data_synthetic"
MANIFEST = "manifest.json"
WAVELENGTHS = tuple(range(400, 701, 10))


def make_material(path: Path, name: str, count: int, seed: int) -> dict[str, Any]:
    """Samples of a named material, directions and values rounded to float32; returns the manifest's entry."""
    model = material(name).model
    wi, wo = draw_in_discs(count, torch.Generator().manual_seed(seed), RADIUS_SQUARED)
    # Values belong to the directions as they are stored; the rounding also hides the last bits, in which
    # the processors' sines differ.
    wi, wo = normalize(wi.float().double()), normalize(wo.float().double())
    samples = Samples(wi, wo, model.evaluate(wi, wo), channels=model.channels, isotropic=model.isotropic)
    header = {
        "name": name,
        "comments": [f"synthetic: {count} pairs of the analytic material {name}", material(name).source],
        "noise_free": True,
        "sampling": {"scheme": "discs", "seed": seed, "radius_squared": RADIUS_SQUARED},
    }
    npz.write(path, samples, header, dtype="float32")
    return {"generator": f"make_material({name!r})", "seed": seed, "samples": count, "channels": 3}


def make_cornell(path: Path, seed: int) -> dict[str, Any]:
    """The made-up measurement; returns the manifest's entry."""
    degrees = math.pi / 180
    incident = [10, 30, 50, 70]
    polar = [0, 8, 16, 26, 36, 46, 56, 66, 76]
    azimuth = [-150, -90, -45, 0, 30, 75, 120, 180]
    rows = [(i, 0, s, a) for i in incident for s in polar for a in azimuth if s > 0 or a == 0]
    # The highlight is dense in the plane of incidence.
    rows += [(i, 0, i + step, 180) for i in incident for step in (-5, -3, -1, 1, 3, 5)]
    angles = torch.tensor(rows, dtype=torch.float64) * degrees
    # What is written is what was "measured": six digits.
    angles = (angles * 1e6).round() / 1e6
    spectra = _coated_pigment(angles)
    generator = torch.Generator().manual_seed(seed)
    noise = torch.randn(spectra.shape, dtype=torch.float64, generator=generator)
    level = 2e-4 + 8e-4 * torch.exp(-(torch.tensor(WAVELENGTHS, dtype=torch.float64) - 400) / 30)
    measured = (spectra * (1 + 0.01 * noise) + level * noise).clamp_min(0)
    comments = [
        "Synthetic measurement, not of any real surface",
        "Green coated pigment (CookTorrance m .12, F0 .05, over a Gaussian diffuse spectrum)",
        # The folder of 0.1.0, kept so that the file keeps its bytes.
        f"made by scripts/make_synthetic_data.py, seed {seed}",
    ]
    cornell.write(path, angles, measured, WAVELENGTHS, comments)
    return {
        "generator": "make_cornell",
        "seed": seed,
        "samples": len(rows),
        "channels": len(WAVELENGTHS),
        "exact_zeros": int(((measured * 1e6).round() == 0).sum()),
    }


def _coated_pigment(angles: Tensor) -> Tensor:
    """Spectra (N, 31) in sr⁻¹: a diffuse hump at 540 nm, nearly black in the far blue, and a neutral coat."""
    wavelengths = torch.tensor(WAVELENGTHS, dtype=torch.float64)
    base = 0.002 + 0.08 * torch.sigmoid((wavelengths - 440) / 6)
    diffuse = base + 0.3 * torch.exp(-(((wavelengths - 540) / 45) ** 2))
    names = tuple(f"{w}nm" for w in WAVELENGTHS)
    model = CookTorrance(tuple(diffuse.tolist()), (1.0,) * len(names), 0.12, 0.05, channels=names)
    return model.evaluate(from_spherical(angles[:, 0], angles[:, 1]), from_spherical(angles[:, 2], angles[:, 3]))


def make_knot(path: Path, around: int = 128, across: int = 20) -> dict[str, Any]:
    """The torus knot as a binary PLY with normals in float32; returns the manifest's entry."""
    mesh = torus_knot(around, across)
    # Rounded to steps that float32 holds exactly: the processors' sines differ in the last bits.
    columns = np.concatenate((mesh.positions, mesh.normals), 1).round(5).astype("<f4")
    head = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    text = f"ply\nformat binary_little_endian 1.0\ncomment torus knot (2, 3)\nelement vertex {len(columns)}\n{head}"
    text += f"element face {len(mesh.triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    faces = np.empty(len(mesh.triangles), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.triangles
    path.write_bytes(text.encode() + columns.tobytes() + faces.tobytes())
    generator = f"make_knot(around={around}, across={across})"
    return {"generator": generator, "vertices": len(columns), "triangles": len(faces)}


def make_sky(path: Path, rows: int = 64) -> dict[str, Any]:
    """The sky as a Radiance .hdr of flat RGBE pixels; returns the manifest's entry."""
    polar = (np.arange(rows)[:, None] + 0.5) * (np.pi / rows)
    azimuth = ((np.arange(2 * rows)[None] + 0.5) / (2 * rows) - 0.5) * (2 * np.pi)
    x, y, z = np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth, -np.sin(polar) * np.cos(azimuth)
    sun = np.array((0.55, 0.5, 0.67))
    towards = (np.stack((x, y, z), -1) @ (sun / np.linalg.norm(sun)))[..., None]
    height = np.clip(y, 0, 1)[..., None]
    sky = np.array((0.35, 0.5, 0.8)) * (1 - height) + np.array((0.12, 0.25, 0.6)) * height
    sky = sky + np.array((0.9, 0.6, 0.3)) * np.clip(towards, 0, 1) ** 24
    sky = np.where(towards > np.cos(np.radians(6)), np.array((160.0, 140.0, 110.0)), sky)
    values = np.where(y[..., None] > 0, sky, np.array((0.22, 0.17, 0.12)))
    # Four digits: what is stored does not depend on the last bits of a processor's sines.
    values = np.float32(values).round(4)
    exponent = np.frexp(values.max(-1))[1]
    scaled = np.floor(values * np.exp2(8.0 - exponent)[..., None]).clip(0, 255)
    pixels = np.concatenate((scaled, exponent[..., None] + 128), -1).astype(np.uint8)
    head = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {rows} +X {2 * rows}\n"
    path.write_bytes(head.encode() + pixels.tobytes())
    return {"generator": f"make_sky(rows={rows})", "rows": rows, "columns": 2 * rows}


def make_labels(path: Path, clusters: int = 4, side: int = 32, seed: int = 4) -> dict[str, Any]:
    """A label map of patches: each texel has the label of the nearest of a few points; returns the manifest's entry."""
    points = np.random.Generator(np.random.PCG64(seed)).integers(0, side, (3 * clusters, 2))
    places = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), -1)[..., None, :]
    nearest = ((places - points) ** 2).sum(-1).argmin(-1)
    np.save(path, (nearest % clusters).astype(np.uint8))
    generator = f"make_labels(clusters={clusters}, side={side})"
    return {"generator": generator, "seed": seed, "rows": side, "columns": side}


def make(folder: Path) -> dict[str, Any]:
    """Write the files and the manifest into `folder`, which exists; returns the manifest."""
    entries = {
        "blue_paint.npz": make_material(folder / "blue_paint.npz", "lafortune-blue-paint", 4000, seed=1),
        "plastic.npz": make_material(folder / "plastic.npz", "cook-torrance-plastic", 1500, seed=2),
        "synthetic_cornell.brdf": make_cornell(folder / "synthetic_cornell.brdf", seed=3),
        "knot.ply": make_knot(folder / "knot.ply"),
        "sky.hdr": make_sky(folder / "sky.hdr"),
        "labels.npy": make_labels(folder / "labels.npy"),
    }
    manifest = {
        "remade_by": "python scripts/data/make_synthetic_data.py",
        "files": [
            {"file": name, **entry, "bytes": (folder / name).stat().st_size, "sha256": digest(folder / name)}
            for name, entry in entries.items()
        ],
    }
    write_text(folder / MANIFEST, json.dumps(manifest, indent=2) + "\n")
    return manifest


def digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def check(folder: Path) -> list[str]:
    """What differs between `folder`, its manifest and the data remade; empty where all agree."""
    faults = []
    stated = {entry["file"]: entry for entry in json.loads((folder / MANIFEST).read_text())["files"]}
    with tempfile.TemporaryDirectory() as place:
        remade = {entry["file"]: entry for entry in make(Path(place))["files"]}
    if sorted(stated) != sorted(remade):
        faults.append(f"{MANIFEST}: lists {sorted(stated)}, expected {sorted(remade)}")
    for name, entry in stated.items():
        if not (folder / name).is_file():
            faults.append(f"{name}: missing, expected it in {folder}")
        elif digest(folder / name) != entry["sha256"]:
            faults.append(f"{name}: SHA-256 differs from the manifest's")
        if name in remade and remade[name] != entry:
            faults.append(f"{name}: remaking gives another file than the manifest states")
    return faults


def main(arguments: list[str] | None = None) -> int:
    """Make, or with --check compare; returns the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    parser.add_argument("--out", type=Path, default=FOLDER, help="the folder (default: data_synthetic)")
    chosen = parser.parse_args(arguments)
    if chosen.check:
        faults = check(chosen.out)
        for fault in faults:
            print(fault, file=sys.stderr)
        print("differs" if faults else f"{chosen.out}: as the manifest states")
        return 1 if faults else 0
    chosen.out.mkdir(parents=True, exist_ok=True)
    for entry in make(chosen.out)["files"]:
        print(f"{entry['file']}: {entry['generator']}, {entry['bytes']} bytes, {entry['sha256'][:12]}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
