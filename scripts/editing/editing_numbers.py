"""Measure the cost and the error of editing: precomputation, edits, curve changes, storage, edited textures.

    python scripts/editing/editing_numbers.py [--size PIXELS] [--triangles N] [--terms R] [--out FILE.md] [--short]

The scene is made like the Teatray of Ben-Artzi et al. (2006), table 3, of what is built in: a tray (a floor of squares,
LV with a pattern and CT over θh with its Fresnel term held, 256 bands), an anisotropic body (a torus knot, LV and AS,
128 × 128) and a handle (a ball, HD, 256 × 32), under the lighting "studio". One thread; seconds are of the processor
(`time.process_time`), so that what else runs counts less, with those of the wall beside them. Published figures are of
another machine and another scene, and stand there for their order of magnitude.
"""

import math
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from homofact.brdf.analytic import AshikhminShirley, CookTorrance, Lambert
from homofact.brdf.log_transform import LogTransform
from homofact.editing import factored, models
from homofact.editing.basis import TOLERANCE
from homofact.editing.curves import Bands, band_centres, flat
from homofact.editing.lowrank import LowRank
from homofact.editing.material import Editable, EditableTerm
from homofact.editing.pairs import pairs_of
from homofact.editing.picture import starting_curves
from homofact.editing.precompute import prepare
from homofact.editing.scene import EditObject, EditScene, PreparedScene
from homofact.editing.session import Session, Stroke
from homofact.editing.to_textures import Edit, apply_edit, relative_rms
from homofact.evaluation.machine import machine
from homofact.factor.factorization import Factorization
from homofact.factor.projection import fixed_projection
from homofact.factor.textures import LogSamples, solve_terms
from homofact.linear.threads import one_thread
from homofact.meshes.mesh import Mesh
from homofact.meshes.shapes import ground, sphere, torus_knot
from homofact.scene.cameras import Camera
from homofact.scene.lighting import named_lighting

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, finish, markdown, parser_of

WOOD = CookTorrance((0.35, 0.2, 0.1), (0.4, 0.4, 0.4), 0.12, 0.05)
BODY = AshikhminShirley((0.25, 0.2, 0.15), (0.5, 0.45, 0.4), 400, 40)
NICKEL = CookTorrance((0.05, 0.05, 0.05), (0.6, 0.55, 0.5), 0.2, 0.5)
ROUNDS = 7
EDITED = (("tray", "specular", "distribution"), ("body", "specular", "alpha"), ("handle", "specular", "half"))


@dataclass(frozen=True)
class Timed:
    """Seconds of the processor and of the wall."""

    cpu: float
    wall: float

    def words(self, unit: float = 1.0) -> str:
        """In seconds, or in milliseconds with 1000."""
        return f"{figure(self.cpu * unit)} ({figure(self.wall * unit)})"


def timed(work: Callable[[], object], rounds: int = 1) -> Timed:
    """The median over rounds."""
    found = []
    for _ in range(rounds):
        cpu, wall = time.process_time(), time.perf_counter()
        work()
        found.append((time.process_time() - cpu, time.perf_counter() - wall))
    return Timed(*(float(np.median(each)) for each in zip(*found, strict=True)))


def tray_material() -> Editable:
    """LV and CT(H): the Fresnel term in the quotient."""
    made = models.cook_torrance(WOOD, "tray")
    specular = made.term("specular")
    slot = specular.slot("distribution")

    def held(wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        return specular.evaluate(wi, wo, {"distribution": flat(3)})

    return Editable("tray", made.channels, (made.term("diffuse"), EditableTerm("specular", held, (slot,))))


def placed(mesh: Mesh, size: float, place: tuple[float, float, float]) -> Mesh:
    """A mesh made smaller and moved."""
    return Mesh(mesh.positions * size + np.array(place), mesh.normals, mesh.triangles, mesh.name)


def planks(points: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """A pattern that multiplies the tray's diffuse term."""
    grain = 0.75 + 0.25 * np.sin(18 * points[:, 0] + 2 * np.sin(3 * points[:, 2]))
    return grain[:, None] * np.ones(3)


def scene_of(size: int) -> EditScene:
    """The scene at size × size pixels: a little over a quarter of them are covered, as in the paper's figure."""
    things = (
        EditObject(ground(1.15, -0.75, 16), tray_material(), {"diffuse": planks}),
        EditObject(placed(torus_knot(), 0.8, (0.1, 0.0, 0.0)), models.ashikhmin_shirley(BODY, "body")),
        EditObject(placed(sphere(48), 0.25, (-0.85, -0.45, 0.4)), factored.half_and_diffuse(NICKEL, "handle")),
    )
    view = Camera((0.0, 2.0, 4.6), (0.0, -0.25, 0.0), 36, (size, size), "front")
    return EditScene(things, named_lighting("studio"), (view,))


def bumped(curve: Bands, at: float) -> Bands:
    """A curve raised about one angle."""
    gamma = band_centres(curve.count, curve.finer)
    bump = 1 + 0.5 * torch.exp(-(((gamma - at) / 0.1) ** 2))
    return replace(curve, values=curve.values * bump[:, None])


def bands_of(prepared: PreparedScene) -> str:
    """Pixels, terms and ranks in words."""
    parts = []
    for part in prepared.parts:
        assert isinstance(part.transport, LowRank)
        name = prepared.scene.objects[part.object].material.name
        bands = "x".join(map(str, part.transport.bands))
        parts.append(f"{name} {part.term}: {len(part.rows)} pixels, {bands} bands, rank {part.transport.rank}")
    return "; ".join(parts)


def edits(session: Session) -> list[tuple[str, ...]]:
    """Edit to picture, curve switching, increments: a row for each of three curves."""
    rows = []
    for address in (
        ("tray", "specular", "distribution"),
        ("body", "specular", "alpha"),
        ("handle", "specular", "half"),
    ):
        session.picture(0)
        places = iter(np.linspace(0.05, 0.8, ROUNDS))

        def edit(address: tuple[str, str, str] = address, places: Iterator[float] = places) -> None:
            session.set({address: bumped(session.curves[address], float(next(places)))})
            session.picture(0)

        whole = timed(edit, ROUNDS)
        made: list[Stroke] = []
        switch = timed(lambda address=address, made=made: made.append(session.stroke(address)))
        stroke = made[0]
        stroke.set(bumped(stroke.curve, 0.3))
        frame = timed(stroke.update)
        frames = 1
        while stroke.update():
            frames += 1
        (part, increment), *_ = stroke.parts.items()
        table = session.prepared.parts[part].transport.frozen(0, held_curves(session, part)).double()
        exact = torch.einsum("pcj,jc->pc", table, stroke.curve.values)
        off = float((increment.shown - exact).square().mean().sqrt() / exact.square().mean().sqrt())
        transport = session.prepared.parts[part].transport
        assert isinstance(transport, LowRank)
        rank = transport.error([*held_curves(session, part)])
        rows.append(
            (": ".join(address), whole.words(1e3), switch.words(), frame.words(1e3), str(frames), f"{off:.1e}",
             f"{rank:.1e}")
        )  # fmt: skip
        session.recall("start")
    return rows


def held_curves(session: Session, number: int) -> list[torch.Tensor]:
    """The curves that count in a part's sum, as they are."""
    part = session.prepared.parts[number]
    material = session.prepared.scene.objects[part.object].material
    slots = material.term(part.term).summed
    return [session.curves[material.name, part.term, slot.name].values for slot in slots]


def textures_again() -> list[tuple[str, ...]]:
    """An edit of a fit over θh, its textures saved and read again: relative RMS of f on held-out pairs."""
    paint = CookTorrance((0.2, 0.1, 0.05), (0.5, 0.6, 0.7), 0.3, 0.05)
    rows = []
    for names, ways in (
        (("theta_h-theta_d", "theta_d-phi_d"), (("texels", 1), ("texels", 4))),
        (("wi", "d"), (("solve", 1), ("texture", 1))),
    ):
        wi, wo = pairs_of(20_000, 5)
        values = paint.evaluate(wi, wo)
        transform = LogTransform.of_values(values, 1e-5)
        samples = LogSamples(wi, wo, transform.forward(values), torch.ones(len(wi), dtype=torch.float64))
        projections = tuple(fixed_projection(name, True) for name in names)
        found = solve_terms(samples, projections, ((24, 24),) * len(names), 1e-3, "cholesky")
        fit = Factorization(found.terms, transform, paint.channels)
        bump = 1 + 3 * torch.exp(-(((band_centres(256) - 0.5) / 0.25) ** 2))
        edit = Edit("theta_h", Bands(bump[:, None].expand(-1, 3).contiguous()))
        for way, refine in ways:
            with TemporaryDirectory() as folder:
                apply_edit(fit, edit, way, refine).fit.save(Path(folder) / "edited.npz")
                again = Factorization.load(Path(folder) / "edited.npz")
            rms, by_epsilon, _ = relative_rms(fit, edit, again)
            name = f"{way}, refined {refine} times" if refine > 1 else way
            rows.append((f"{' + '.join(names)}: {name}", f"{rms:.2%}", f"{by_epsilon:.1e}",
                         f"{again.nbytes - fit.nbytes:+d}", f"{again.fetches - fit.fetches:+d}"))  # fmt: skip
    return rows


def fewer_lights(triangles: tuple[int, ...], dense: int) -> list[tuple[str, ...]]:
    """Relative RMS of each model in a small picture under some triangles, against many point lights."""
    view = Camera((0.0, 0.5, 4.0), (0.0, 0.0, 0.0), 40, (10, 10), "small")
    paint = CookTorrance((0.2, 0.1, 0.05), (0.5, 0.6, 0.7), 0.2, 0.05)
    brushed = AshikhminShirley((0.2, 0.1, 0.05), (0.3, 0.4, 0.5), 80, 20)
    rows = []
    grey = Lambert((0.5, 0.5, 0.5))
    for kind, made, model in (
        ("CT", models.cook_torrance(paint, "x"), paint),
        ("AS", models.ashikhmin_shirley(brushed, "x"), brushed),
        ("HF", factored.homomorphic(paint, "x"), paint),
        ("LV", models.light_view(grey, "x"), grey),
        ("HD", factored.half_and_diffuse(paint, "x"), paint),
    ):

        def picture(material: Editable, number: int, divided: int | None = None) -> torch.Tensor:
            scene = EditScene((EditObject(sphere(24), material),), named_lighting("studio"), (view,))
            return Session(prepare(scene, number, "full", divided=divided)).picture(0)

        points = models.from_reflectance(model, ("theta_i",), "x", (32,))
        exact = picture(points, dense, 0)
        size = float(exact.square().mean().sqrt())
        errors = [float((picture(made, n) - exact).square().mean().sqrt()) / size for n in triangles]
        plain = float((picture(points, triangles[-1], 0) - exact).square().mean().sqrt()) / size
        rows.append((kind, *(f"{error:.2%}" for error in errors), f"{plain:.2%}"))
    return rows


@one_thread
def main(arguments: list[str] | None = None) -> int:
    """Measure and print the page; returns the exit code."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--size", type=int, default=160, help="pixels along a side of the picture (%(default)s)")
    parser.add_argument("--triangles", type=int, default=4000, help="lights (%(default)s)")
    given = parser.parse_args(arguments)
    size, triangles, dense = (24, 120, 300) if given.short else (given.size, given.triangles, 12_000)
    scene = scene_of(size)
    # Compiled before anything is timed.
    prepare(scene_of(12), 20)
    made: list[PreparedScene] = []
    took = timed(lambda: made.append(prepare(scene, triangles)))
    prepared = made[0]
    fewer = timed(lambda: prepare(scene, max(triangles // 10, 8)))
    covered = len(prepared.pixels[0])
    session = Session(prepared)
    assert starting_curves(prepared).keys() == session.curves.keys()
    first = timed(lambda: session.picture(0))
    full = sum(4 * 3 * len(part.rows) * math.prod(part.transport.bands) for part in prepared.parts)
    lines = [
        f"{size} x {size} pixels, {covered} covered, {prepared.lights.count} triangles, low rank to {TOLERANCE:g}."
        f" {machine()}.",
        "",
        "Seconds or milliseconds of the processor, of the wall in brackets.",
        "",
        markdown(
            ("what", "paper", "here"),
            [
                ("precompute with visibility, s", "8.4 min", took.words()),
                ("the same with a tenth of the triangles, s", "2.1 min", fewer.words()),
                ("per covered pixel, ms", "7.5", figure(took.cpu / covered * 1e3)),
                ("first picture, all terms, ms", "", first.words(1e3)),
                ("stored, MB", "642", figure(prepared.nbytes / 1e6)),
                ("every band of every pixel, MB", "4147", figure(full / 1e6)),
            ],
            2,
        ),
        "",
        markdown(
            ("one curve", "edit to picture, ms", "curve switch, s", "frame of 30 wavelets, ms", "frames to settle",
             "settled against full sum", "low rank against all bands"),
            edits(session),
        ),
        "",
        bands_of(prepared) + ".",
        "",
        markdown(("a fit, and an edit over theta_h taken into it", "relative RMS", "by epsilon", "bytes", "fetches"),
                 textures_again()),
        "",
        markdown(("model", f"{triangles // 10} triangles", f"{triangles} triangles", f"{triangles} points"),
                 fewer_lights((triangles // 10, triangles), dense)),
        "",
        f"Relative RMS of a ball of 10 x 10 pixels against {dense} lights asked at their centres.",
    ]  # fmt: skip
    return finish("\n".join(lines), given)


if __name__ == "__main__":
    sys.exit(main())
