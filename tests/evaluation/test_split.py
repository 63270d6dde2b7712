"""A split: the same samples again, what it says of itself, what it notices."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch

import homofact
from homofact.brdf.samples import Samples
from homofact.brdf.source import Source, open_source
from homofact.errors import BadInput
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.split import Split, samples_digest
from homofact.factor.factorization import Factorization
from homofact.methods.mccool import McCool

PAINT = Path(__file__).resolve().parents[2] / "data_synthetic" / "synthetic_cornell.brdf"
SMALL = McCool(size=6, seed=5)


@pytest.fixture(scope="module")
def source() -> Source:
    return open_source("material:blinn-phong-50", count=300, seed=2)


def rows_of(samples: Samples) -> set[tuple[float, ...]]:
    return {tuple(row) for row in torch.cat((samples.wi, samples.wo, samples.values), 1).tolist()}


@pytest.mark.parametrize("held_out", [0.1, 0.2, 0.75])
def test_the_parts_are_all_of_the_source_and_share_nothing(source: Source, held_out: float) -> None:
    train, held = Split.of(source, held_out, 4).parts(source)
    assert held is not None
    assert len(held) == round(held_out * 300)
    assert rows_of(train).isdisjoint(rows_of(held))
    assert rows_of(train) | rows_of(held) == rows_of(source.samples)


def test_nothing_held_out_is_all_samples(source: Source) -> None:
    split = Split.of(source, 0.0, 4)
    train, held = split.parts(source)
    assert held is None
    assert torch.equal(train.values, source.samples.values)
    assert len(split.test_samples(source)) == 300


def test_a_subset_leaves_the_held_out_samples(source: Source) -> None:
    whole, some = (Split.of(source, 0.2, 4, subset).parts(source) for subset in (0, 100))
    assert len(some[0]) == 100
    assert rows_of(some[0]) < rows_of(whole[0])
    assert whole[1] is not None
    assert some[1] is not None
    assert torch.equal(whole[1].values, some[1].values)


def test_a_split_that_names_no_calibration_is_of_the_measurement_as_it_was(source: Source) -> None:
    record = Split.of(source, 0.2, 0).record()
    assert Split._read(record).opening == source.opening
    del record["opening"]["calibrate"]
    older = Split._read(record).opening
    assert older is not None
    assert older.calibrate == ()


def test_what_a_fit_saved_gives_the_same_samples(source: Source, tmp_path: Path) -> None:
    row = fit_and_measure(source, SMALL, 0.3, subset=120)
    row.factorization.save(tmp_path / "a.npz")
    split = Split.saved_with(Factorization.load(tmp_path / "a.npz"))
    assert split is not None
    assert split == row.split == Split(source.opening, 300, samples_digest(source.samples), 0.3, 5, 120)
    assert json.loads(json.dumps(row.record()))["split"] == split.record()
    again = split.parts(split.open())
    for mine, theirs in zip(again, row.split.parts(source), strict=True):
        assert mine is not None
        assert theirs is not None
        assert all(
            torch.equal(getattr(mine, each), getattr(theirs, each)) for each in ("wi", "wo", "values", "weights")
        )


@pytest.mark.slow
def test_the_split_s_seed_may_be_another_than_the_fit_s(source: Source) -> None:
    rows = [fit_and_measure(source, replace(SMALL, seed=seed), split_seed=1) for seed in (0, 1)]
    assert rows[0].split == rows[1].split
    assert [row.settings.seed for row in rows] == [0, 1]
    assert fit_and_measure(source, SMALL).split.seed == 5


@pytest.mark.slow
def test_a_fit_from_python_says_that_nothing_was_held_out(source: Source) -> None:
    fitted = homofact.fit(source, McCool(size=6, seed=3)).factorization
    assert Split.saved_with(fitted) == Split.of(source, 0.0, 3)
    assert Split.saved_with(homofact.fit(source.samples, McCool(size=6)).factorization) is None


def test_the_digest_sees_every_sample(source: Source) -> None:
    samples = source.samples
    values = samples.values.clone()
    values[-1, -1] *= 1 + 1e-6
    others = [
        replace(samples, values=values),
        replace(samples, weights=samples.weights * 2),
        replace(samples, wi=samples.wo, wo=samples.wi),
        replace(samples, channels=("A", "B", "C")),
        replace(samples, isotropic=not samples.isotropic),
        replace(samples, all_azimuths=not samples.all_azimuths),
    ]
    digests = {samples_digest(each) for each in (samples, *others)}
    assert len(digests) == 1 + len(others)
    assert samples_digest(samples) == samples_digest(replace(samples, provenance={}))


def test_the_digest_leaves_the_last_bits(source: Source) -> None:
    samples = source.samples
    nudged = replace(samples, values=samples.values * (1 + 2**-52), wi=samples.wi + 1e-17)
    assert not torch.equal(nudged.values, samples.values)
    assert samples_digest(nudged) == samples_digest(samples)


def test_one_that_cannot_be_opened_says_why(source: Source, tmp_path: Path) -> None:
    path = tmp_path / "paint.brdf"
    shutil.copy(PAINT, path)
    split = Split.of(open_source(str(path)), 0.2, 0)
    assert len(split.open().samples) == split.samples
    path.write_text("".join(PAINT.read_text().splitlines(keepends=True)[:-1]))
    with pytest.raises(BadInput, match=r"^its source, paint.brdf, has changed: its samples are not those of the fit$"):
        split.open()
    path.write_bytes(b"\0")
    with pytest.raises(BadInput, match=r"^its source, paint\.brdf, cannot be read as what it was$"):
        split.open()
    path.unlink()
    with pytest.raises(BadInput, match=r"^its source, paint.brdf, is neither where it was nor in the working folder"):
        split.open()
    with pytest.raises(BadInput, match="put together by hand"):
        Split.of(replace(source, opening=None), 0.2, 0).open()
    other = replace(Split.of(source, 0.2, 0), digest="0" * 16)
    with pytest.raises(BadInput, match=r"material:blinn-phong-50, gives other samples in this version"):
        other.open()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"held_out": 1.0}, "held_out: found 1.0, expected a part of at least 0 and below 1"),
        ({"seed": "x"}, 'seed: found "x", expected a whole number'),
        ({"samples": 0}, "samples: found 0, expected a whole number"),
        ({"opening": {"path": 3}}, "opening.path: found 3, expected a text"),
        ({"opening": "file"}, 'opening: found "file", expected an object'),
        ({"digest": None}, "digest: found null, expected a text"),
    ],
)
def test_a_damaged_one_is_refused_by_name(source: Source, change: dict, message: str) -> None:
    fitted = homofact.fit(source, McCool(size=6)).factorization
    fitted.provenance["source"]["split"] |= change
    with pytest.raises(BadInput) as error:
        Split.saved_with(fitted)
    assert str(error.value).startswith(f"the fit's split: {message}")
