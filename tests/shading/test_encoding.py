"""Storage: what files hold decodes to the textures, within each storage's own bound, and whole numbers exactly."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from shading_cases import CASES

import homofact
from homofact.containers.formats import FORMATS
from homofact.errors import BadInput
from homofact.factor.factorization import Term
from homofact.factor.fitted import QuantizationGrid
from homofact.factor.projection import fixed_projection
from homofact.shading.encoding import LEVELS, STORAGES, encode, encode_texture

pytestmark = pytest.mark.usefixtures("unseen")


def lobe(side: int = 32, channels: int = 3) -> tuple[torch.Tensor, torch.Tensor]:
    """A log texture like a fit's: a peak of 6 above a slope of 4, coloured; its mask is a disc."""
    y, x = torch.meshgrid(*[torch.linspace(-1, 1, side, dtype=torch.float64)] * 2, indexing="ij")
    grey = 6 * torch.exp(-8 * (x * x + y * y)) - 2 * (x + 1) - 3 * y * y
    tints = torch.tensor([1.0, 0.92, 0.85])[:channels].to(grey)
    return grey[..., None] * tints + 0.3 * torch.arange(channels).to(grey), x * x + y * y <= 1.1


def rms(found: torch.Tensor, texture: torch.Tensor | np.ndarray, mask: torch.Tensor | np.ndarray) -> float:
    off = (np.asarray(found) - np.asarray(texture))[np.asarray(mask)]
    return float(np.sqrt((off**2).mean()))


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("channels", [1, 3])
def test_what_a_file_holds_is_what_the_encoding_says(name: str, channels: int, tmp_path: Path) -> None:
    """The errors that are reported are those of the file: written, read as a sampler reads, decoded."""
    form = FORMATS[name]
    texture, mask = lobe(channels=channels)
    encoded = encode(texture, mask, form.storage)
    form.write(tmp_path / f"t{form.suffix}", encoded.stored)
    found = form.read(tmp_path / f"t{form.suffix}", channels)
    np.testing.assert_array_equal(found, encoded.sampled)
    logs = torch.from_numpy(found.astype(np.float64) / LEVELS.get(form.storage, 1) * encoded.scale + encoded.bias)
    assert torch.equal(logs, encoded.decoded())


@pytest.mark.parametrize(("storage", "least", "most"), [
    ("float32", 0, 2e-8), ("float16", 1e-5, 1 / 4096), ("unorm16", 1e-6, 0.29 / 65535), ("unorm8", 1e-3, 0.29 / 255),
    ("bc6h", 2e-3, 5e-3),
])  # fmt: skip
def test_errors_beside_the_range(storage: str, least: float, most: float) -> None:
    """Rounding to steps of d has a root mean square of d/√12; a half's is at most 2⁻¹² of half the range."""
    texture, mask = lobe()
    inside = texture[mask]
    span = float((inside.amax(0) - inside.amin(0)).max())
    assert least <= rms(encode(texture, mask, storage).decoded(), texture, mask) / span <= most


def test_every_storage_of_a_format_is_known() -> None:
    assert {form.storage for form in FORMATS.values()} == set(STORAGES)


def test_texels_outside_the_mask_do_not_widen_the_steps() -> None:
    texture, mask = lobe()
    wild = torch.where(mask[..., None], texture, torch.tensor(1e3, dtype=torch.float64))
    for storage in STORAGES[1:]:
        found = encode(wild, mask, storage).decoded()
        assert rms(found, texture, mask) < 0.03 * 9, storage
        assert float(found.max()) < float(texture[mask].max()) + 0.2
    # float32 has no steps to widen, and keeps all.
    assert float(encode(wild, mask, "float32").decoded().max()) == 1e3


def test_bc6h_stays_on_one_side_of_zero_and_picks_the_better_one() -> None:
    """Through zero the same texture loses twice as much; mirrored, it is stored mirrored and loses the same."""
    texture, mask = lobe()
    chosen = encode(texture, mask, "bc6h")
    assert chosen.stored.min() >= 0 or chosen.stored.max() <= 0
    centred = replace(chosen, stored=(chosen.stored - np.sign(chosen.stored.mean()) / 2).astype(np.float16))
    offset = torch.from_numpy((chosen.stored - centred.stored).astype(np.float64) * chosen.scale)
    least = rms(chosen.decoded(), texture, mask)
    assert rms(centred.decoded() + offset, texture, mask) > 1.5 * least
    mirrored = encode(-texture, mask, "bc6h")
    assert mirrored.stored.mean() * chosen.stored.mean() < 0
    assert rms(mirrored.decoded(), -texture, mask) == pytest.approx(least, rel=0.05)


def test_only_texels_inside_the_mask_choose_the_side() -> None:
    """A third is the mirror image of the rest: each by itself asks for the other side of zero."""
    left = lobe(16)[0]
    texture = torch.cat((left, *[left.amin() + left.amax() - left] * 2), 1)
    mask = torch.zeros(16, 48, dtype=torch.bool)
    mask[:, :16] = True
    sides = [np.sign(encode(texture, each, "bc6h").stored.mean()) for each in (mask, ~mask)]
    assert sides[0] == -sides[1] != 0


def test_a_shift_of_the_logarithms_changes_the_bias_alone() -> None:
    texture, mask = lobe()
    for storage in ("float16", "unorm8", "unorm16", "bc6h"):
        one, other = (encode(texture + shift, mask, storage) for shift in (0.0, 64.0))
        np.testing.assert_array_equal(one.stored, other.stored)
        np.testing.assert_allclose(other.bias - one.bias, 64)


@pytest.mark.parametrize("storage", STORAGES)
def test_a_texture_of_one_value_and_an_empty_mask(storage: str) -> None:
    texture = torch.full((8, 8, 3), -3.25, dtype=torch.float64)
    for mask in (torch.ones(8, 8, dtype=torch.bool), torch.zeros(8, 8, dtype=torch.bool)):
        assert torch.allclose(encode(texture, mask, storage).decoded(), texture, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("storage", "levels"), LEVELS.items())
def test_texels_fitted_to_whole_numbers_lose_nothing(storage: str, levels: int) -> None:
    generator = torch.Generator().manual_seed(1)
    low = torch.tensor([-2.0, 0.5, 1.0], dtype=torch.float64)
    step = torch.tensor([0.01, 0.02, 0.005], dtype=torch.float64)
    # Neither end of the range is taken: a range read off the texels would be another.
    numbers = torch.randint(5, levels - 5, (8, 8, 3), generator=generator)
    term = Term(fixed_projection("h", True), low + step * numbers, torch.ones(8, 8, dtype=torch.bool))
    (texture,) = replace(CASES["fixed h"], terms=(term,)).textures
    with_grid = encode_texture(replace(texture, grid=QuantizationGrid(low, step, levels)), storage)
    np.testing.assert_array_equal(with_grid.stored, numbers.numpy())
    assert np.allclose(with_grid.decoded(), term.texture, rtol=0, atol=1e-9)
    assert not np.array_equal(encode_texture(texture, storage).stored, numbers.numpy())


def test_what_bc6h_cannot_hold() -> None:
    texture = torch.zeros(8, 8, 4, dtype=torch.float64)
    mask = torch.ones(8, 8, dtype=torch.bool)
    with pytest.raises(BadInput, match="bc6h: found 4 channels, expected 1 or 3"):
        encode(texture, mask, "bc6h")
    with pytest.raises(BadInput, match="bc6h: 8 x 6 texels, expected sides that are multiples of 4"):
        encode(texture[:6, :, :3], mask[:6], "bc6h")


def test_unknown_storages_are_refused() -> None:
    with pytest.raises(BadInput, match=r"storage: found 'float8', expected one of float32, .*, bc6h$"):
        encode_texture(CASES["fixed h"].textures[0], "float8")


@pytest.mark.slow
def test_a_measured_paint_in_every_storage(real_data: Path) -> None:
    """Red garnet by McCool's two textures: what each storage loses beside the range of the logarithms."""
    source = homofact.read(str(real_data / "cornell" / "garnet_red.brdf"))
    fitted = homofact.fit(source, homofact.McCool(size=16, smoothing=0.1, grid="plain")).factorization
    for texture in fitted.textures:
        inside = texture.texels[texture.mask]
        span = float((inside.max(0) - inside.min(0)).max())
        lost = {
            each: rms(encode_texture(texture, each).decoded(), texture.texels, texture.mask) / span for each in STORAGES
        }
        assert lost["float32"] < lost["unorm16"] < lost["float16"] < lost["unorm8"] < lost["bc6h"], texture.name
        assert lost["float16"] < 1e-4
        assert lost["unorm8"] < 0.29 / 255
        # A block of 4 x 4 is a quarter of such a texture's side, and its noise lies on no line in colour space.
        assert lost["bc6h"] < 0.014


def test_halves_are_counted_from_the_middle_of_the_range() -> None:
    """A range of 8 far from zero: numbers of at most 4, of which a half float holds steps of 2⁻⁹ below 4."""
    texture = torch.rand(16, 16, 1, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * 8 + 100
    texture[0, 0], texture[0, 1] = 100, 108
    found = encode(texture, torch.ones(16, 16, dtype=torch.bool), "float16")
    assert float((found.decoded() - texture).abs().max()) <= 2**-10
    assert float(np.abs(found.stored).max()) == pytest.approx(4)
