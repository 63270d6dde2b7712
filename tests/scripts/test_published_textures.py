"""McCool's published textures: read as they were written, judged by their best constant."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
import torch
from PIL import Image

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.evaluation.metrics import six_errors
from homofact.geometry.directions import draw_in_discs, normalize
from homofact.geometry.parabolic import to_disc

FALLS = ((0.3, 0.5, 0.7), (5.0, 3.0, 2.0))


def published(folder: Path, generator: torch.Generator) -> None:
    """Radially symmetric factors of one made-up paint as 8-bit files, no texel 0."""
    (folder / "garnetred").mkdir(parents=True)
    across = torch.linspace(-1, 1, 33, dtype=torch.float64)
    radius = torch.sqrt(across[:, None] ** 2 + across**2)
    for number, falls in enumerate(FALLS):
        texture = torch.stack([torch.exp(-fall * radius) for fall in falls], 2)
        codes = (texture * 255).round().clamp(1, 255).to(torch.uint8).numpy()
        Image.fromarray(codes).save(folder / "garnetred" / f"garnetred64_{number}.png")
    (folder / "garnetred" / "garnetred64.txt").write_text("Made up\n0\n1 1 1\n26.0\n")


def test_published_textures_are_read_as_they_were_written(script: Callable[[str], ModuleType], tmp_path: Path) -> None:
    module = script("data.waterloo")
    generator = torch.Generator().manual_seed(0)
    published(tmp_path, generator)
    textures = module.read(tmp_path, "garnet_red")
    assert textures.span == 26.0
    assert textures.asymmetry == 0
    assert textures.zeros == 0
    wi, wo = draw_in_discs(600, generator, 0.98)
    radii = [to_disc(w).norm(dim=1, keepdim=True) for w in (wi, wo, normalize(wi + wo))]
    p, q = (torch.tensor(falls, dtype=torch.float64) for falls in FALLS)
    product = torch.exp(-p * (radii[0] + radii[1]) - q * radii[2])
    assert torch.allclose(textures.evaluate(wi, wo), product, rtol=0.03, atol=0.01)
    assert textures.nbytes == 2 * 33 * 33 * 3
    wanted = torch.tensor([0.2, 3.0, 40.0], dtype=torch.float64)
    for convention in (module.CONVENTIONS[0], module.Convention("gamma", "orthographic", "edge", True)):
        planted = module.PublishedTextures(textures.p, textures.q, 26.0, convention, constant=tuple(wanted.tolist()))
        samples = Samples(wi, wo, planted.evaluate(wi, wo), channels=("R", "G", "B"), isotropic=True)
        transform = LogTransform.of(samples, 1e-2)
        ranking = module.choose_convention([(textures, samples, transform)])
        assert len(ranking) == 24
        assert ranking[0][1] == convention
        assert ranking[0][0] < 1e-3 * ranking[1][0]
        found = module.PublishedTextures(textures.p, textures.q, 26.0, convention)
        fitted = module.calibrated(found, samples, transform)
        assert torch.tensor(fitted.constant, dtype=torch.float64) == pytest.approx(wanted, rel=2e-4)


def test_the_best_constant_is_the_best_and_scale_drops_out(script: Callable[[str], ModuleType], tmp_path: Path) -> None:
    module, cornell = script("data.waterloo"), script("accuracy.cornell_numbers")
    generator = torch.Generator().manual_seed(1)
    published(tmp_path, generator)
    textures = module.read(tmp_path, "garnet_red")
    halves = []
    for _ in range(2):
        wi, wo = draw_in_discs(500, generator, 0.98)
        noise = torch.exp(torch.randn(500, 3, dtype=torch.float64, generator=generator))
        values = textures.evaluate(wi, wo) * noise
        halves.append(Samples(wi, wo, values, channels=("R", "G", "B"), isotropic=True))
    train, test = halves
    transform = LogTransform.of(train, 1e-2)
    found = textures.evaluate(train.wi, train.wo)
    best = module.best_constant(found, train.values, transform)
    assert bool((best < 1.3).all())  # the ratio of the means is exp(½) = 1.65 here

    def error(constant: torch.Tensor) -> float:
        return six_errors(found * constant, train.values, transform).log_mse

    for channel in range(3):
        for factor in (1.02, 1 / 1.02):
            other = best.clone()
            other[channel] *= factor
            assert error(other) > error(best)
    data = cornell.Split(train, test, transform)
    free = cornell.scale_free(textures, data)
    assert free.log_mse == pytest.approx(1.0, rel=0.15)  # the noise's own
    scaled = module.PublishedTextures(textures.p, textures.q, 26.0, constant=(7.0, 0.1, 300.0))
    assert cornell.scale_free(scaled, data).log_mse == pytest.approx(free.log_mse, rel=1e-5)


def test_a_texel_of_zero_is_read_as_what_fits(script: Callable[[str], ModuleType], tmp_path: Path) -> None:
    module = script("data.waterloo")
    generator = torch.Generator().manual_seed(0)
    published(tmp_path, generator)
    textures = module.read(tmp_path, "garnet_red")
    dark = module.PublishedTextures(textures.p, torch.where(textures.q < 0.1, 0.0, textures.q), 26.0)
    assert dark.zeros == int((textures.q < 0.1).sum()) > 0
    wi, wo = draw_in_discs(600, generator, 0.98)
    for zero in (0.0, module.STEP / 2):
        planted = module.PublishedTextures(dark.p, dark.q, 26.0, zero=zero)
        samples = Samples(wi, wo, planted.evaluate(wi, wo), channels=("R", "G", "B"), isotropic=True)
        assert module.calibrated(dark, samples, LogTransform.of(samples, 1e-2)).zero == zero


@pytest.mark.parametrize(
    ("file", "content"), [("garnetred64_1.png", b"no picture"), ("garnetred64.txt", b"Garnet\n0\n")]
)
def test_damaged_published_files_are_named(
    script: Callable[[str], ModuleType], tmp_path: Path, file: str, content: bytes
) -> None:
    published(tmp_path, torch.Generator())
    (tmp_path / "garnetred" / file).write_bytes(content)
    with pytest.raises(BadInput, match=rf"{file}: cannot be read .*expected"):
        script("data.waterloo").read(tmp_path, "garnet_red")
