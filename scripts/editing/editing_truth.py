"""Compare edited pictures with Mitsuba: relative RMS by material, light and number of triangles.

    python scripts/editing/editing_truth.py [--size 24] [--spp 1024] [--repeats 4] [--out FILE.md] [--short]

A torus knot, which shadows itself, under an environment map. Its material is edited; pixels of a small picture are
rendered by Mitsuba's direct illumination at the same surface points (`transport.reference`), with the edited material
itself: an analytic model with its curves in bands, or a fit with the edit in its textures, through homofact's own
material of Mitsuba. Errors are √(Σ|found − truth|²/Σ|truth|²) over all pixels and channels; Mitsuba's noise, the
relative RMS of its standard error, is in them. "Points" asks the edited material at the centres of 10,000 triangles, a
point light each, as figure 4 of Ben-Artzi et al. (2006) has them.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from homofact.brdf.analytic import AshikhminShirley, CookTorrance
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import Reflectance
from homofact.editing import models
from homofact.editing.curves import Bands, band_centres
from homofact.editing.lights import triangle_lights
from homofact.editing.material import Editable, Place
from homofact.editing.pairs import pairs_of
from homofact.editing.precompute import prepare
from homofact.editing.reaching import visible_lights
from homofact.editing.scene import EditObject, EditScene
from homofact.editing.session import Session
from homofact.editing.to_textures import apply_edit, edits_of
from homofact.evaluation.machine import machine
from homofact.factor.factorization import Factorization
from homofact.factor.projection import fixed_projection
from homofact.factor.textures import LogSamples, solve_terms
from homofact.linear.threads import one_thread
from homofact.meshes.mesh import Mesh, read_mesh
from homofact.relighting.reference import Estimate, Geometry, Material, vertex_radiance
from homofact.rendering.environment import read_environment
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.mitsuba_bsdf import VARIANT, open_mitsuba
from homofact.scene.cameras import Camera
from homofact.scene.lighting import Lighting, named_lighting
from homofact.scene.meshes import MeshGroup
from homofact.scene.visibility import VisiblePixels, visible_pixels

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import finish, markdown, parser_of

EYE = (0.6, 0.9, 3.6)
TRIANGLES, POINTS = (400, 4000), 10_000
DATA = Path(__file__).resolve().parents[2] / "data_synthetic"
PAINT = CookTorrance((0.2, 0.1, 0.05), (0.5, 0.6, 0.7), 0.2, 0.05)
BRUSHED = AshikhminShirley((0.2, 0.1, 0.05), (0.3, 0.4, 0.5), 80, 20)


@dataclass(frozen=True)
class Case:
    """A material, its edit, and the edited material for Mitsuba and for point lights."""

    name: str
    material: Editable
    curves: dict[Place, Bands]
    shown: Material
    asked: Reflectance


def bumped(curve: Bands, at: float, width: float, height: float) -> Bands:
    """The curve raised about one angle."""
    gamma = band_centres(curve.count, curve.finer)
    return replace(curve, values=curve.values * (1 + height * torch.exp(-(((gamma - at) / width) ** 2))[:, None]))


def cases(folder: Path) -> list[Case]:
    """The edited materials; `folder` gets the edited fit."""
    paint = models.cook_torrance(PAINT, "CT")
    start = paint.banded_start()
    slot = paint.slot(("specular", "distribution"))
    assert slot.sliders is not None
    broad = {
        ("specular", "distribution"): slot.banded(slot.sliders.curve(sigma=0.3)),
        ("specular", "fresnel"): bumped(start["specular", "fresnel"], 0.9, 0.3, 2.0),
    }
    brushed = models.ashikhmin_shirley(BRUSHED, "AS")
    slot = brushed.slot(("specular", "alpha"))
    assert slot.sliders is not None
    turned = {
        ("specular", "alpha"): slot.banded(slot.sliders.curve(nu=15)),
        ("specular", "beta"): bumped(brushed.banded_start()["specular", "beta"], 0.3, 0.1, 0.5),
    }
    sharp = models.cook_torrance(replace(PAINT, roughness=0.05), "sharp")
    mirror = models.ashikhmin_shirley(replace(BRUSHED, nu=3000, nv=3000), "mirror")
    ringed = {("specular", "beta"): bumped(mirror.banded_start()["specular", "beta"], 0.02, 0.01, 0.5)}
    fit = fitted()
    whole = models.from_reflectance(fit, ("theta_h", "theta_d"), "fit")
    ring = {("whole", "theta_h"): bumped(whole.banded_start()["whole", "theta_h"], 0.5, 0.2, 2.0)}
    edited = fit
    for edit in edits_of(whole, ring):
        edited = apply_edit(edited, edit, refine=4).fit
    edited.save(folder / "edited.npz")
    made = [
        ("CT, sigma 0.2 to 0.3 and another Fresnel term", paint, broad),
        ("AS, nu 80 to 15 and a ring over beta", brushed, turned),
        ("CT, sigma 0.05 and another Fresnel term", sharp, {("specular", "fresnel"): broad["specular", "fresnel"]}),
        ("AS, nu and nv 3000 and a ring over beta", mirror, ringed),
    ]
    found = [Case(name, each, curves, each.edited(curves), each.edited(curves)) for name, each, curves in made]
    return [*found, Case("a fit, a ring over theta_h in its textures", whole, ring, folder / "edited.npz", edited)]


def fitted() -> Factorization:
    """A product of two textures of the paint."""
    wi, wo = pairs_of(20_000, 5)
    values = PAINT.evaluate(wi, wo)
    transform = LogTransform.of_values(values, 1e-5)
    samples = LogSamples(wi, wo, transform.forward(values), torch.ones(len(wi), dtype=torch.float64))
    projections = tuple(fixed_projection(name, True) for name in ("theta_h-theta_d", "theta_d-phi_d"))
    found = solve_terms(samples, projections, ((48, 24), (24, 24)), 1e-3, "cholesky")
    return Factorization(found.terms, transform, PAINT.channels)


def skies() -> dict[str, EnvironmentMap]:
    """A sky with a low sun, and soft boxes in a dark room."""
    (studio,) = named_lighting("studio").lights
    assert isinstance(studio, EnvironmentMap)
    return {"sky": read_environment(DATA / "sky.hdr"), "studio": studio}


def points_only(case: Case, mesh: Mesh, pixels: VisiblePixels, lighting: Lighting, number: int) -> np.ndarray:
    """R (P, C) by point lights at the triangles' centres."""
    lights = triangle_lights(lighting, number, 3)
    begins, numbers = visible_lights(pixels, lights, MeshGroup([mesh]))
    owner = np.repeat(np.arange(len(pixels)), np.diff(begins))
    wi = np.einsum("pij,pj->pi", pixels.frames[owner], lights.centres[numbers])
    values = case.asked.evaluate(torch.from_numpy(wi), torch.from_numpy(pixels.wo[owner]))
    lit = values * torch.from_numpy(wi[:, 2:] * (lights.solid_angles[:, None] * lights.radiance)[numbers])
    total = torch.zeros(len(pixels), 3, dtype=torch.float64)
    return total.index_add_(0, torch.from_numpy(owner), lit).numpy()


def truth(case: Case, mesh: Mesh, pixels: VisiblePixels, sky: EnvironmentMap, spp: int, repeats: int) -> Estimate:
    """Mitsuba's radiance of the pixels' surface points: vertices of the mesh that no triangle has."""
    positions = np.concatenate((mesh.positions, pixels.points))
    normals = np.concatenate((mesh.normals, pixels.frames[:, 2]))
    which = len(mesh.positions) + np.arange(len(pixels))
    geometry = Geometry(positions, normals, mesh.triangles)
    return vertex_radiance(geometry, case.shown, sky, EYE, spp, repeats, which=which)


def relative(found: np.ndarray, exact: np.ndarray) -> float:
    """Relative RMS."""
    return float(np.sqrt(((found - exact) ** 2).sum() / (exact**2).sum()))


@one_thread
def main(arguments: list[str] | None = None) -> int:
    """Measure and give the table."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--size", type=int, default=24, help="pixels along a side of the picture (%(default)s)")
    parser.add_argument("--spp", type=int, default=1024, help="Mitsuba's samples per pixel and run (%(default)s)")
    parser.add_argument("--repeats", type=int, default=4, help="Mitsuba's runs (%(default)s)")
    given = parser.parse_args(arguments)
    size, spp, repeats = (10, 16, 2) if given.short else (given.size, given.spp, given.repeats)
    counts, points = ((40, 100), 200) if given.short else (TRIANGLES, POINTS)
    mesh = read_mesh(DATA / "knot.ply")
    view = Camera(EYE, (0.0, 0.0, 0.0), 36, (size, size), "front")
    version = open_mitsuba().__version__
    rows, covered = [], 0
    with TemporaryDirectory() as folder:
        for case in cases(Path(folder)):
            for name, sky in skies().items():
                lighting = Lighting(name, (sky,))
                scene = EditScene((EditObject(mesh, replace(case.material, name="x")),), lighting, (view,))
                pixels = visible_pixels(MeshGroup([mesh]), view)
                exact = truth(case, mesh, pixels, sky, spp, repeats)
                seen, covered = exact.seen, len(pixels)
                errors = []
                for count in counts:
                    session = Session(prepare(scene, count))
                    session.set({("x", *place): curve for place, curve in case.curves.items()})
                    errors.append(relative(session.picture(0).numpy()[seen], exact.radiance[seen]))
                point = relative(points_only(case, mesh, pixels, lighting, points)[seen], exact.radiance[seen])
                rows.append(
                    [case.name, name, *(f"{each:.2%}" for each in errors), f"{point:.2%}", f"{exact.noise:.2%}"]
                )
    lines = [
        markdown(("edited material", "light", *(f"{count} triangles" for count in counts), f"{points} points",
                  "Mitsuba's noise"), rows, 2),
        "",
        f"{covered} pixels of a torus knot of {len(mesh.triangles)} triangles, low rank as by default. Mitsuba"
        f" {version}, {VARIANT}, {repeats} runs of {spp} samples per pixel. {machine()}.",
    ]  # fmt: skip
    return finish("\n".join(lines), given)


if __name__ == "__main__":
    sys.exit(main())
