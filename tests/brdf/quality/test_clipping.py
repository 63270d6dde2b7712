"""Clipped values are marked at a level, and marks go wherever samples go."""

import torch
from refusals import refused

from homofact.brdf.materials import MATERIALS
from homofact.brdf.quality.clipping import marked
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model


def clipped(quantile: float = 0.95) -> tuple[Samples, torch.Tensor]:
    """Samples of which R is cut, and where."""
    samples = sample_model(MATERIALS["phong-30"].model, 500, "discs", 0)
    level = samples.values[:, 0].quantile(quantile)
    over = samples.values[:, 0] >= level
    samples.values[:, 0] = samples.values[:, 0].clamp_max(level)
    return samples, over


def test_the_level_is_found_channel_by_channel() -> None:
    samples, over = clipped()
    found = marked(samples, "found")
    assert found.clipped is not None
    assert torch.equal(found.clipped[:, 0], over)
    assert not bool(found.clipped[:, 1:].any())
    assert found.provenance["clipped"] == {
        "R": {"level": float(samples.values[:, 0].max()), "samples": int(over.sum())}
    }


def test_a_given_level_is_of_all_channels() -> None:
    samples, _ = clipped()
    level = float(samples.values.quantile(0.9))
    found = marked(samples, level)
    assert found.clipped is not None
    assert torch.equal(found.clipped, samples.values >= level * (1 - 1e-6))


def test_marks_go_with_their_samples() -> None:
    samples, over = clipped()
    found = marked(samples, "found")
    train, held = found.split(0.2, 0)
    for part in (train, held, found.azimuth_copies(2, 0), found.rotated_at_random(1), found.channel("R")):
        assert part.clipped is not None
        assert torch.equal(part.clipped[:, 0], part.values[:, 0] == samples.values[:, 0].max())
    index = torch.tensor([5, 3])
    assert found.select(index).clipped[:, 0].tolist() == over[index].tolist()  # type: ignore[index]
    assert found.channel("G").clipped.shape == (500, 1)  # type: ignore[union-attr]


def test_marks_of_another_shape_are_refused() -> None:
    samples, _ = clipped()
    with refused(where="samples"):
        Samples(samples.wi, samples.wo, samples.values, samples.weights, samples.channels, True,
                clipped=torch.zeros(500, dtype=torch.bool))  # fmt: skip


def test_levels_that_nothing_or_everything_reaches_are_refused() -> None:
    samples = sample_model(MATERIALS["phong-30"].model, 500, "discs", 0)
    with refused(where="clipped"):
        marked(samples, "found")
    with refused(where="clipped"):
        marked(samples, 1e6)
    with refused(where="clipped"):
        marked(samples, 1e-12)
