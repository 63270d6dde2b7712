"""Compare relit vertices with the sum over all texels and with Mitsuba: relative RMS by material and sky.

    python scripts/relighting/relight_truth.py [--data FOLDER] [--mesh FILE] [--vertices 300] [--rules share,light]

A mesh is lit by a sky and seen from one eye; errors are over vertices drawn among those that the eye sees, all
channels together, √(Σ|found − truth|²/Σ|truth|²).

(a) is the sum over all texels of the cube map with the reflectance itself, no term and no coefficient left out
(`transport.ledger`); (b) is Mitsuba's direct illumination at the same vertices by the full environment map
(`transport.reference`), whose noise is the relative RMS of its standard error. "Beyond the noise" is
√(error² − noise²), 0 where the noise is all; so are the columns of (a) against (b), of which the fine one is of a cube
map of --fine texels along a face: the difference is what the cube map's resolution costs.

How many terms there are is decided by each of --rules: `share`, as many as hold --share of f's energy (Mahajan et al.
2008); `light`, as many as leave an expected error of --error under this sky's powers; `terms`, so many as --terms. Of
each vertex's transport the coefficients stay that leave out at most --tolerance.

Mitsuba's `measured` takes the viewer for the file's ωi, and measurements are not quite reciprocal: the RGL paint is
relit with both exchanged, so that (b) is of the same numbers.
"""

import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from homofact.brdf.formats.rgl import load
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Exchanged, Reflectance
from homofact.brdf.source import open_source
from homofact.errors import HomofactError
from homofact.evaluation.machine import machine
from homofact.meshes.mesh import Mesh, read_mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.shapes import torus_knot
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import relative
from homofact.relighting.factoring import factor
from homofact.relighting.precompute import TransportSettings, transport
from homofact.relighting.reference import Estimate, Geometry, Material, vertex_radiance
from homofact.relighting.relight import Relit
from homofact.relighting.seen import seen_vertices
from homofact.rendering.environment import read_environment
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.mitsuba_bsdf import VARIANT, open_mitsuba
from homofact.scene.lighting import named_lighting

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, figure, finish, markdown, parser_of, progress

NAMED = ("ashikhmin-shirley-wang", "lafortune-clay", "lafortune-skin")
SURROGATE = ("nbrdf/merl_nbrdf_weights.npz", "gold-metallic-paint")
PAINT = "rgl/vch_golden_yellow_rgb.bsdf"
SKIES = ("grace_probe_latlong.hdr", "stpeters_probe_latlong.hdr", "studio_small_03_1k.hdr")
EYE = (0.6, 0.5, 3.0)
HEADER = (
    "material", "sky", "rule", "terms", "expected", "coefficients", "relit against (a)", "noise of (b)",
    "(a) against (b)",
    "fine (a) against (b)", "relit against (b)", "the same, beyond the noise", "light below 0",
)  # fmt: skip


class ExchangedPaint(Exchanged):
    """A measured paint as Mitsuba takes it."""

    @property
    def isotropic(self) -> bool:
        """As the paint."""
        return bool(getattr(self.base, "isotropic", False))


def materials(folder: Path, short: bool) -> tuple[dict[str, tuple[Reflectance, Material]], list[str]]:
    """(by name what is relit and what Mitsuba is given, a message for each that is not there)."""
    found: dict[str, tuple[Reflectance, Material]] = {}
    missing = []
    for name in NAMED[1:2] if short else NAMED:
        model = material(name).model
        found[name] = (model, model)
    if short:
        return found, missing
    weights, paint = folder / SURROGATE[0], folder / PAINT
    for path in (weights, paint):
        if not path.is_file():
            missing.append(f"skipped: no {path} (--data FOLDER or HOMOFACT_DATA names the real measurements)")
    if weights.is_file():
        network = open_source(f"{weights}#{SURROGATE[1]}").reflectance
        assert network is not None
        found[f"surrogate of MERL {SURROGATE[1]}"] = (network, network)
    if paint.is_file():
        found[f"RGL {paint.stem.removesuffix('_rgb')}"] = (ExchangedPaint(load(paint)), paint)
    return found, missing


def skies(folder: Path, short: bool) -> dict[str, EnvironmentMap]:
    """The environment maps that are there; our own studio in a short run."""
    paths = [] if short else [folder / "envmaps" / name for name in SKIES]
    found = {path.stem.split("_")[0]: read_environment(path) for path in paths if path.is_file()}
    if found:
        return found
    (own,) = named_lighting("studio").lights
    assert isinstance(own, EnvironmentMap)
    return {"our studio": own}


def beyond(error: float, noise: float) -> float:
    """What of a relative RMS is not noise."""
    return math.sqrt(max(error**2 - noise**2, 0.0))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table and write it."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--mesh", type=Path, help="a mesh (the bunny of the data, else a torus knot)")
    parser.add_argument("--vertices", type=int, default=300, help="vertices drawn (%(default)s)")
    parser.add_argument("--spp", type=int, default=1024, help="Mitsuba's samples a vertex and run (%(default)s)")
    parser.add_argument("--repeats", type=int, default=4, help="Mitsuba's runs (%(default)s)")
    parser.add_argument("--cube", type=int, default=64, help="texels along a cube map's face (%(default)s)")
    parser.add_argument("--share", type=float, default=0.99, help="of a material's energy in its terms (%(default)s)")
    parser.add_argument("--fine", type=int, help="a cube map's texels along a face for (a) once more, 256 say; slow")
    parser.add_argument("--rules", default="share,light", help="of share, light, terms (%(default)s)")
    parser.add_argument("--error", type=float, default=0.01, help="expected of the rule light (%(default)s)")
    parser.add_argument("--terms", type=int, default=4, help="of each material by the rule terms (%(default)s)")
    parser.add_argument("--map-size", type=int, default=64, help="texels across a light or view map (%(default)s)")
    parser.add_argument("--tolerance", type=float, default=0.005, help="of a vertex's transport (%(default)s)")
    parser.add_argument("--only", help="materials whose name has this in it")
    parser.add_argument("--sky", help="skies whose name has this in it")
    parser.add_argument("--out", type=Path, default=Path("out/relight_truth"), help="folder (%(default)s)")
    chosen = parser.parse_args(arguments)
    if chosen.short:
        chosen.vertices, chosen.spp, chosen.repeats, chosen.cube, chosen.fine = 12, 16, 2, 16, 32
    rules = {"share": {"share": chosen.share}, "light": {"error": chosen.error}, "terms": {"terms": chosen.terms}}
    unknown = [each for each in chosen.rules.split(",") if each not in rules]
    if unknown:
        parser.error(f"--rules: found {unknown[0]!r}, expected some of {', '.join(rules)}")
    folder = data_folder(chosen.data)
    bunny = folder / "meshes" / "bunny.ply"
    path = chosen.mesh or (None if chosen.short or not bunny.is_file() else bunny)
    mesh = torus_knot(96, 12) if path is None else read_mesh(path)
    version = open_mitsuba().__version__
    found, missing = materials(folder, chosen.short)
    lights = {name: sky for name, sky in skies(folder, chosen.short).items() if (chosen.sky or "") in name}
    occluder = Occluder(mesh.positions, mesh.triangles)
    began, rows = time.perf_counter(), []
    for name, (reflectance, shown) in found.items():
        if chosen.only and chosen.only not in name:
            continue
        seen = seen_vertices(mesh, reflectance, occluder, EYE, chosen.vertices)
        which = seen.which
        part = Mesh(mesh.positions[which], mesh.normals[which], mesh.triangles[:0], mesh.name)
        settings = TransportSettings(cube=chosen.cube, tolerance=chosen.tolerance)
        for sky, light in lights.items():
            radiance = environment_cube(light, chosen.cube)
            dense = np.broadcast_to(seen.dense(radiance, chosen.cube), (len(which), 3))
            truth = at_vertices(mesh, which, shown, light, chosen.spp, chosen.repeats)
            # Two ray tracers may disagree about a vertex at a silhouette.
            exact, sampled = dense[truth.seen], truth.radiance[truth.seen]
            fine = "–"
            if chosen.fine:
                much = seen.dense(environment_cube(light, chosen.fine), chosen.fine)[truth.seen]
                fine = f"{beyond(relative(much, sampled), truth.noise):.2%}"
            for rule in chosen.rules.split(","):
                factors = factor(reflectance, map_size=chosen.map_size, light=light, **rules[rule])
                relit = Relit(transport(part, factors, settings, occluder))
                relit.relight(radiance)
                colours = relit.shade(np.asarray(EYE)).astype(np.float64)[truth.seen]
                against = relative(colours, sampled)
                rows.append([
                    name, sky, rule, factors.terms, f"{factors.expected_error:.2%}",
                    f"{relit.transport.mean_kept:.0f}", f"{relative(colours, exact):.2%}", f"{truth.noise:.2%}",
                    f"{beyond(relative(exact, sampled), truth.noise):.2%}", fine, f"{against:.2%}",
                    f"{beyond(against, truth.noise):.2%}",
                    f"{float(np.maximum(-colours, 0).sum() / np.abs(colours).sum()):.3%}",
                ])  # fmt: skip
            progress(f"{time.perf_counter() - began:.0f} s: {name}, {sky}")
    lines = [
        "# Relit vertices against the truth",
        "",
        f"- {mesh.name}, {len(mesh.positions)} vertices, {len(mesh.triangles)} triangles, {chosen.vertices} of the"
        f" vertices that {EYE} sees; cube maps of 6 × {chosen.cube}², maps of {chosen.map_size}², tolerance"
        f" {chosen.tolerance:g}",
        f"- Mitsuba {version}, {VARIANT}, {chosen.repeats} runs of {chosen.spp} samples a vertex",
        f"- {machine()}; {figure(time.perf_counter() - began)} s",
        *(f"- {each}" for each in missing),
        "",
        markdown(HEADER, rows, 2),
        "",
    ]
    return finish("\n".join(lines), chosen, chosen.out / "relight_truth.md")


def at_vertices(
    mesh: Mesh, which: np.ndarray, shown: Material, light: EnvironmentMap, samples: int, repeats: int
) -> Estimate:
    """Mitsuba's radiance of vertices of a mesh that the eye sees, in their order."""
    geometry = Geometry(mesh.positions, mesh.normals, mesh.triangles)
    found = vertex_radiance(geometry, shown, light, EYE, samples, repeats, which=which)
    if found.seen.mean() < 0.99:
        raise HomofactError(f"{mesh.name}: Mitsuba sees {found.seen.sum()} of {len(which)} vertices, expected all")
    return found


if __name__ == "__main__":
    sys.exit(main())
