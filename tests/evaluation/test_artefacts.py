"""Artefacts planted on models: found and named where they are, and nothing found where there is none."""

import json
from dataclasses import replace

import pytest
import torch
from judged import MODEL, TRAIN, Altered, seen, verdict
from torch import Tensor

from homofact.brdf.analytic import Lambert, Ward
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.scattered import Scattered
from homofact.brdf.source import Source
from homofact.evaluation.artefacts.artefact import Artefact, Kind
from homofact.evaluation.artefacts.look import Look, look_for_artefacts
from homofact.evaluation.artefacts.structure import SourceRange
from homofact.evaluation.artefacts.views import views
from homofact.evaluation.verdict.finding import About
from scripts.verdict.planted_artefacts import PlantedArtefact

PLASTIC = material("cook-torrance-plastic").model
PLANTED = {
    Kind.NEEDLE: PlantedArtefact(PLASTIC, "needle", 0.6, 15, 1.0),
    Kind.RING: PlantedArtefact(PLASTIC, "ring", -0.3, 25, 1.5),
    Kind.RIM: PlantedArtefact(PLASTIC, "rim", 1.0, 72, 1.5),
    Kind.SPOT: PlantedArtefact(PLASTIC, "spot", 0.6, 25, 4.0),
    Kind.HOLE: PlantedArtefact(PLASTIC, "hole", -0.4, 25, 4.0),
}


def source(model: Reflectance) -> Source:
    return Source("model", "material", sample_model(PLASTIC, 200), model, 1e-5, 0.0)


def measured(samples: Samples) -> Source:
    return Source("measured", "measurement", samples, Scattered(samples), 1e-2, 0.0)


def look(fit: Reflectance, of: Source | Samples) -> Look:
    found = look_for_artefacts(fit, of)
    assert found is not None
    return found


def test_a_fit_that_is_its_source_has_none() -> None:
    assert look(PLASTIC, source(PLASTIC)) == Look((), 0.0)


@pytest.mark.parametrize("width", [0.095, 0.105])
def test_a_highlight_that_is_a_little_wider_or_narrower_is_no_artefact(width: float) -> None:
    models = [Ward((0.2, 0.1, 0.05), (0.1,) * 3, each, each) for each in (0.1, width)]
    assert look(models[1], source(models[0])).artefacts == ()


@pytest.mark.parametrize("kind", list(Kind))
def test_an_artefact_is_named(kind: Kind) -> None:
    planted = PLANTED[kind]
    found = {each.kind: each for each in look(planted, source(PLASTIC)).artefacts}
    assert kind in found
    assert found[kind].bright == (planted.strength > 0)
    assert 0.03 < found[kind].size < 1
    assert 0 < found[kind].area < 1


def test_the_place_is_where_it_was_planted() -> None:
    found = {each.kind: each for each in look(PLANTED[Kind.RING], source(PLASTIC)).artefacts}
    degrees = float(found[Kind.RING].where.split(", ")[1].split("°")[0])
    # The mirrored view turns twice as fast as the normal.
    assert degrees == pytest.approx(2 * 25, abs=5)


@pytest.mark.parametrize("kind", list(Kind))
def test_structure_that_the_source_has_is_none(kind: Kind) -> None:
    assert look(PLANTED[kind], source(PLANTED[kind])).artefacts == ()
    # A fit that lacks it is wrong, but shows nothing that is not there; without a bright rim the sphere's edge is dark.
    lacks = {(each.kind, each.bright) for each in look(PLASTIC, source(PLANTED[kind])).artefacts}
    assert lacks == ({(Kind.RIM, False)} if kind is Kind.RIM else set())


@pytest.fixture(scope="module")
def noisy() -> Samples:
    samples = sample_model(PLASTIC, 6000)
    noise = torch.randn(samples.values.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    return replace(samples, values=samples.values * torch.exp(0.05 * noise), provenance={})


@pytest.mark.slow
def test_noise_of_samples_is_no_artefact(noisy: Samples) -> None:
    found = look(PLASTIC, measured(noisy))
    assert found.artefacts == ()
    assert found.left_out < 0.1
    assert look(PLASTIC, noisy).artefacts == ()


def test_a_ring_stands_out_of_the_noise(noisy: Samples) -> None:
    ring = PlantedArtefact(PLASTIC, "ring", 1.0, 25, 2.0)
    assert Kind.RING in {each.kind for each in look(ring, measured(noisy)).artefacts}


def test_what_no_sample_is_near_to_is_left_out() -> None:
    samples = sample_model(PLASTIC, 6000)
    steep = samples.select((samples.wi[:, 2] > 0.7) & (samples.wo[:, 2] > 0.7))
    rim = PlantedArtefact(PLASTIC, "rim", 1.0, 75, 1.5)
    found = look(rim, measured(replace(steep, provenance={})))
    assert found.left_out > 0.2
    assert found.artefacts == ()


def test_channels_without_a_picture_and_few_samples_are_not_looked_at() -> None:
    two = sample_model(Lambert((0.2, 0.3), channels=("a", "b")), 300)
    assert look_for_artefacts(Lambert((0.2, 0.3), channels=("a", "b")), two) is None
    assert look_for_artefacts(PLASTIC, sample_model(PLASTIC, 50)) is None


def test_a_black_source_has_a_picture() -> None:
    black = Lambert((0.0, 0.0, 0.0))
    assert look(black, source(black)).artefacts == ()


def test_the_same_twice() -> None:
    one, two = (look(PLANTED[Kind.RING], source(PLASTIC)) for _ in range(2))
    assert one == two


def test_every_pair_has_light_and_every_pixel_its_normal() -> None:
    for view in views():
        assert len(view.normal) == view.inside.sum()
        assert float(view.wi[:, 2].min()) > 0
        assert float(view.wo[:, 2].min()) >= 0
        flat = view.radiance(torch.ones(len(view.wi), 1, dtype=torch.float64))
        assert float(flat[~torch.from_numpy(view.inside)].sum()) == 0


def test_a_range_holds_all_its_readings() -> None:
    view = views()[0]
    generator = torch.Generator().manual_seed(0)
    readings = [torch.rand(96, 96, 3, generator=generator, dtype=torch.float64).numpy() for _ in range(2)]
    bounds = SourceRange.of(readings, view.inside)
    assert all(abs(bounds.excess(each)).max() == 0 for each in readings)
    assert abs(bounds.excess(3 * readings[0])).max() > 0


def test_a_fit_with_an_artefact_is_not_called_right() -> None:
    clean = verdict(seen=seen(), look=Look((), 0.0))
    ring = Artefact(Kind.RING, True, "around the highlight, 12° off the mirror direction", 0.07, 0.02, "lamp")
    found = verdict(seen=seen(), look=Look((ring,), 0.0))
    assert clean.trusted
    assert "visible artefacts" not in clean.summary
    assert not found.trusted
    assert "visible artefacts: ring" in found.summary
    [finding] = [each for each in found.about(About.FIT) if each.name == "artefact"]
    assert ring.where in finding.line()
    record = json.loads(json.dumps(found.record(), allow_nan=False))
    assert record["look"]["artefacts"][0]["kind"] == "ring"
    assert record["look"]["left_out"] == 0


def test_a_planted_ring_reaches_the_verdict() -> None:
    def ringed(values: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        bump = PlantedArtefact(MODEL, "ring", 1.0, 20, 1.5).bump(wi, wo)
        return values * (1 + bump[:, None])

    of = Source("model", "material", TRAIN, MODEL, 1e-5, 0.0)
    found = verdict(Altered(ringed), seen=seen(), look=look_for_artefacts(Altered(ringed), of))
    assert "artefact" in {each.name for each in found.findings}
