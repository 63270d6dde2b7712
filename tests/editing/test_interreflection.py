"""Light between surfaces in edited scenes: form factors, energy, linearity in the sender's albedo, curves, the file."""

import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
import torch
from editing.scenes import PAINT, VIEW, checks, relative
from refusals import refused

from homofact.brdf.analytic import Lambert
from homofact.editing import errors, interreflection, models
from homofact.editing.build import open_edit_scene
from homofact.editing.curves import Bands
from homofact.editing.interreflection import LitSurfaces
from homofact.editing.lowrank import LowRank
from homofact.editing.picture import add_part, part_picture, radiance, starting_curves
from homofact.editing.precompute import prepare
from homofact.editing.quotient import LightPoints
from homofact.editing.scene import EditObject, EditScene, Pattern, PreparedScene
from homofact.editing.scene_file import read_edit_scene
from homofact.editing.sender_albedo import SenderAlbedo
from homofact.editing.session import Session
from homofact.editing.store import read_prepared, write_prepared
from homofact.editing.transport import FullTransport
from homofact.meshes.mesh import Mesh
from homofact.meshes.shapes import ground, sphere
from homofact.relighting.smooth_response import mean_albedo
from homofact.rendering.light import DirectionalLight
from homofact.scene.cameras import Camera
from homofact.scene.lighting import Lighting, named_lighting
from homofact.scene.meshes import MeshGroup

BALL = ("paint", "specular", "fresnel")
FLOOR = ("floor", "diffuse", "incident")
LIGHTS = 60


@pytest.fixture(autouse=True)
def few_lights(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interreflection, "LIGHTS", 100)


def scene(albedo: float = 0.5, bounces: int = 1, patterns: dict[str, Pattern] | None = None) -> EditScene:
    """A ball of paint on a matt floor."""
    things = (
        EditObject(sphere(12), models.cook_torrance(PAINT, "paint", (32, 32))),
        EditObject(ground(2.0, -1.0, 8), models.light_view(Lambert((albedo,) * 3), "floor"), patterns or {}),
    )
    view = replace(VIEW, pixels=(20, 20))
    return EditScene(things, named_lighting("overcast"), (view,), bounces=bounces)


@lru_cache(maxsize=4)
def prepared(form: str = "low-rank", bounces: int = 1) -> PreparedScene:
    return prepare(scene(bounces=bounces), LIGHTS, form)


def bounced(found: PreparedScene, curves=None) -> torch.Tensor:
    """The light from surfaces alone (P, C)."""
    total = torch.zeros(len(found.pixels[0]), 3, dtype=torch.float64)
    chosen = starting_curves(found) if curves is None else curves
    for part in found.parts:
        if part.senders is not None:
            add_part(total, found, part, part_picture(found, part, chosen), chosen)
    return total


def times(session: Session, address, factor) -> Bands:
    """A curve times numbers."""
    curve = session.curves[address]
    return replace(curve, values=curve.values * torch.as_tensor(factor, dtype=torch.float64))


@pytest.mark.slow
def test_direct_light_is_the_same_bits_with_a_bounce() -> None:
    without, whole = prepared(bounces=0), prepared()
    direct = [part for part in whole.parts if part.senders is None]
    assert len(direct) == len(without.parts) == len(whole.parts) / 2
    for one, other in zip(without.parts, direct, strict=True):
        assert isinstance(one.transport, LowRank)
        assert isinstance(other.transport, LowRank)
        assert np.array_equal(one.transport.coefficients.codes, other.transport.coefficients.codes)
    difference = Session(whole).picture(0) - Session(without).picture(0)
    assert relative(difference, bounced(whole)) < 1e-6
    assert 0.02 < float(difference.sum() / Session(whole).picture(0).sum()) < 0.4


def matt(albedo: float, bounces: int) -> EditScene:
    """The same shapes, matt, under even light."""
    meshes = [each.mesh for each in scene().objects]
    things = (EditObject(mesh, models.light_view(Lambert((albedo,) * 3), str(k))) for k, mesh in enumerate(meshes))
    return EditScene(tuple(things), named_lighting("uniform"), (replace(VIEW, pixels=(20, 20)),), bounces=bounces)


def test_black_surfaces_send_nothing() -> None:
    found = prepare(matt(0.0, 1), LIGHTS, "full")
    assert any(part.senders is not None for part in found.parts)
    assert not bounced(found).any()


def disc(radius: float, height: float, up: float) -> Mesh:
    """A level disc of 96 triangles that faces up or down."""
    angles = np.linspace(0, 2 * math.pi, 96, endpoint=False)
    rim = np.stack((radius * np.cos(angles), np.full(96, height), -radius * np.sin(angles)), 1)
    points = np.concatenate(([[0, height, 0]], rim))
    k = np.arange(96)
    triangles = np.stack((np.zeros(96, int), 1 + k, 1 + (k + 1) % 96), 1)
    normals = np.broadcast_to([0.0, up, 0.0], points.shape).copy()
    return Mesh(points, normals, triangles if up > 0 else triangles[:, ::-1].copy(), "disc")


@pytest.mark.parametrize("height", [0.5, 1.0])
def test_a_patch_over_a_disc_receives_its_form_factor(height: float) -> None:
    """A sun lights a disc of radius R; a small one h above it, from below, receives ρE R²/(h² + R²)."""
    upper, lower = Lambert((0.6, 0.5, 0.4)), Lambert((0.8, 0.4, 0.2))
    things = (
        EditObject(disc(0.02, height, -1), models.light_view(upper, "patch")),
        EditObject(disc(1.0, 0.0, 1), models.light_view(lower, "disc")),
    )
    sun = DirectionalLight((2.0, 1.0, 0.0), (3.0, 2.0, 1.0))
    view = Camera((0.02, 0.4 * height, 0.0), (0.0, height, 0.0), 3, (8, 8), "below")
    found = prepare(EditScene(things, Lighting("sun", (sun,)), (view,), bounces=1), 8, "full")
    assert len(found.pixels[0]) == 64
    expected = [
        a * b / math.pi * each * math.sin(math.atan2(1, 2)) / (height**2 + 1)
        for a, b, each in zip((0.6, 0.5, 0.4), (0.8, 0.4, 0.2), (3.0, 2.0, 1.0), strict=True)
    ]
    assert radiance(found, 0, starting_curves(found)).mean(0).tolist() == pytest.approx(expected, rel=0.035)


def test_white_in_even_light_reflects_no_more_than_arrives() -> None:
    """A furnace: with one bounce a white scene is nearer to 1 than without, and never above it."""
    direct, whole = (Session(prepare(matt(1.0, bounces), 400, "full")).picture(0) for bounces in (0, 1))
    assert float(whole.max()) < 1.03
    assert float((1 - whole).mean()) < 0.6 * float((1 - direct).mean())


def test_what_is_received_is_linear_in_the_sender_s_albedo_channel_by_channel() -> None:
    session = Session(prepared("full"))
    ball = torch.from_numpy(session.prepared.pixels[0].objects == 0)
    pictures = []
    for factor in (1.0, 0.5, 0.25):
        session.set({FLOOR: times(session, FLOOR, factor if factor == 1 else 0.5)})
        pictures.append(session.picture(0)[ball])
    one, two = pictures[0] - pictures[1], pictures[1] - pictures[2]
    assert float(one.max()) > 0.01
    assert relative(2 * two, one) < 1e-6
    before = session.picture(0)[ball]
    session.set({FLOOR: times(session, FLOOR, (2.0, 1.0, 1.0))})
    after = session.picture(0)[ball]
    assert float((after - before)[:, 0].max()) > 0.005
    assert torch.equal(before[:, 1:], after[:, 1:])


def test_undo_brings_back_the_same_bits() -> None:
    session = Session(prepared())
    start = session.picture(0)
    session.set({FLOOR: times(session, FLOOR, (0.2, 1.5, 1.0)), BALL: times(session, BALL, 2.0)})
    assert relative(session.picture(0), start) > 0.05
    assert torch.equal(session.picture(0), radiance(session.prepared, 0, session.curves))
    session.undo()
    assert torch.equal(session.picture(0), start)


@pytest.mark.parametrize("address", [FLOOR, BALL])
def test_a_stroke_settles_at_the_session_s_picture(address) -> None:
    session = Session(prepared())
    stroke = session.stroke(address)
    assert relative(stroke.picture(0), session.picture(0)) < 1e-6
    curve = session.curves[address]
    steps = torch.arange(curve.count)[:, None] > curve.count // 3
    stroke.set(replace(curve, values=curve.values * torch.where(steps, 1.7, 0.4)))
    while stroke.update(10):
        pass
    shown = stroke.picture(0)
    stroke.finish()
    assert relative(shown, session.picture(0)) < 1e-6


def test_a_receiver_responds_with_its_own_edited_curves() -> None:
    """Against the edited material itself, asked at four points of every triangle that a pixel receives light from."""
    found = prepared("full")
    session = Session(found)
    address = ("paint", "specular", "distribution")
    session.slide(address, sigma=0.5)
    session.set({BALL: times(session, BALL, 3.0)})
    own = np.flatnonzero(found.pixels[0].objects == 0)
    surfaces = LitSurfaces.of(found.scene, MeshGroup([each.mesh for each in found.scene.objects]), 1)
    rows, senders, light = surfaces.received(found.pixels[0].some(own))
    points, reaching = LightPoints.of(light.lights, 1), light.reaching()
    wi = np.einsum("pij,pnj->pni", light.pixels.frames[reaching.owner], points.points[reaching.numbers])
    weight = (
        points.shares[reaching.numbers] * np.maximum(wi[..., 2], 0) * light.lights.solid_angles[reaching.numbers, None]
    )
    wo = torch.from_numpy(light.pixels.wo[reaching.owner].repeat(4, 0))
    values = session.edited("paint").evaluate(torch.from_numpy(wi.reshape(-1, 3)), wo).numpy().reshape(*weight.shape, 3)
    each = (values * weight[..., None]).sum(1) * reaching.radiance
    albedos = np.stack([each.at(session.curves).numpy() for each in found.albedos])
    expected = np.zeros((len(own), 3))
    np.add.at(expected, rows[reaching.owner], each * albedos[senders[reaching.owner]])
    shown = bounced(found, session.curves)[torch.from_numpy(own)]
    assert relative(shown, torch.from_numpy(expected)) < 0.01


def test_low_rank_is_near_all_bands_and_says_how_near(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(errors, "BOUNCED_PIXELS", 24)
    monkeypatch.setattr(errors, "BOUNCED_LIGHTS", 60)
    kept, full = prepared(), prepared("full")
    found = errors.rank_errors(kept)
    assert [each.words for each in found if each.bounced] == [
        "diffuse, from surfaces", "specular, from surfaces", "diffuse, from surfaces",
    ]  # fmt: skip
    assert all(each.error < 0.01 for each in found if each.bounced)
    assert relative(Session(kept).picture(0), Session(full).picture(0)) < 0.003
    (off,) = errors.light_error(kept).values()
    assert off < 0.06


def test_threads_change_no_bit() -> None:
    one, three = (prepare(scene(), 20, "full", threads=count) for count in (1, 3))
    for part, other in zip(one.parts, three.parts, strict=True):
        assert isinstance(part.transport, FullTransport)
        assert isinstance(other.transport, FullTransport)
        assert np.array_equal(part.transport.table, other.transport.table)


def even(points: np.ndarray, uv: np.ndarray) -> np.ndarray:
    return np.full((len(points), 3), 0.5)


@pytest.mark.slow
def test_a_pattern_sends_what_is_left_of_it() -> None:
    """A floor of half the albedo everywhere sends half; squares lie between both."""
    patterns: list[dict[str, Pattern]] = [{}, {"diffuse": even}, {"diffuse": checks}]
    whole, half, squares = (prepare(scene(patterns=each), 20, "full") for each in patterns)
    ball = torch.from_numpy(whole.pixels[0].objects == 0)
    all_of_it, part, between = (bounced(each)[ball] for each in (whole, half, squares))
    assert relative(2 * part, all_of_it) < 1e-6
    assert 0.5 < float(between.sum() / all_of_it.sum()) < 0.95


def test_mean_albedos_are_those_of_uniform_light() -> None:
    floor, paint = scene(albedo=0.7).materials[1], scene().materials[0]
    for material, model, off in ((floor, Lambert((0.7,) * 3), 2e-3), (paint, PAINT, 0.02)):
        curves = {(material.name, *place): curve for place, curve in material.banded_start().items()}
        found = SenderAlbedo(material, [term.name for term in material.terms]).at(curves)
        assert found.tolist() == pytest.approx(mean_albedo(model).tolist(), rel=off)


def test_a_file_of_a_bounce_comes_back_and_belongs_to_it_alone(tmp_path: Path) -> None:
    place, found = tmp_path / "edit.npz", prepared()
    write_prepared(place, found, LIGHTS)
    again = read_prepared(place, scene())
    assert torch.equal(Session(again).picture(0), Session(found).picture(0))
    with refused("made of another scene", where="edit.npz"):
        read_prepared(place, scene(bounces=0))


TOML = """
[[object]]
mesh = "shape:sphere"
albedo = [0.6]
[ground]
albedo = [0.4]
steps = 8
[lighting]
named = "uniform"
[[camera]]
eye = [0, 1.5, 3]
[edit]
bounces = {}
"""


def test_the_scene_file_asks_for_a_bounce(tmp_path: Path) -> None:
    place = tmp_path / "scene.toml"
    place.write_text(TOML.format(1))
    file = read_edit_scene(place)
    assert open_edit_scene(file).bounces == 1
    assert file.record(tmp_path)["edit"]["bounces"] == 1
    place.write_text(TOML.replace("bounces = {}", ""))
    assert open_edit_scene(read_edit_scene(place)).bounces == 0


@pytest.mark.parametrize(
    ("given", "found"), [("2", "2"), ("-1", "-1"), ('"one"', "the string 'one'"), ("0.5", "0.5"), ("true", "true")]
)
def test_other_numbers_of_bounces_are_refused(given: str, found: str, tmp_path: Path) -> None:
    place = tmp_path / "scene.toml"
    place.write_text(TOML.format(given))
    with refused(where="scene.toml: edit.bounces", found=found):
        read_edit_scene(place)
