"""Fits of samples on a GPU, where there is one; what works on the processor alone gets a copy of them there."""

from dataclasses import replace

import pytest
import torch

import homofact
from homofact import Cole, Gaussians, McCool, Nmf, Samples, Search, Svd
from homofact.brdf.materials import material
from homofact.brdf.sampling import sample_model
from homofact.linear import threads
from homofact.methods.method import Method

METHODS = {
    "mccool": McCool(size=8, epsilon=1e-5),
    "mccool, robust, with deviations": McCool(size=6, epsilon="floor", robust=True, confidence=True),
    "mccool, whole texels": McCool(size=6, epsilon=1e-5, quantize="png8"),
    "cole": Cole(textures=1, size=4, restarts=1, search_samples=100, epsilon=1e-5),
    "search": Search(textures=2, size=8, effort="quick", epsilon=1e-5),
    "search of the logs": Search(textures=1, size=8, effort=1, objective="log", epsilon=1e-5),
    "svd": Svd(size=6, epsilon=1e-5),
    "nmf": Nmf(size=6, epsilon=1e-5),
    "gaussians": Gaussians(epsilon=1e-5),
}
gpu = pytest.mark.skipif(not torch.cuda.is_available(), reason="torch finds no GPU")


def drawn(count: int = 2000) -> Samples:
    return sample_model(material("phong-10").model, count, "discs", 0)


@gpu
@pytest.mark.parametrize("name", METHODS)
def test_samples_on_a_gpu_are_fitted_as_well(name: str) -> None:
    here, method = drawn(), METHODS[name]
    there = here.to("cuda")
    ours, theirs = homofact.fit(here, method), homofact.fit(there, method)
    # A search may turn elsewhere at the last bit; what needs no search is equal.
    tolerance = 0.5 if "search" in name or name == "cole" else 1e-6
    assert theirs.report is not None
    assert ours.report is not None
    assert theirs.report.residual == pytest.approx(ours.report.residual, rel=tolerance)
    assert theirs.verdict is not None
    values = theirs.evaluate(there.wi, there.wo)
    assert values.device.type == "cuda"
    assert torch.allclose(values.cpu(), theirs.evaluate(here.wi, here.wo), rtol=1e-9)


@gpu
def test_clipped_samples_on_a_gpu() -> None:
    here = drawn()
    bounds = here.values > here.values.quantile(0.9)
    here = replace(here, clipped=bounds)
    ours, theirs = (McCool(size=6, epsilon=1e-5).fit(samples) for samples in (here, here.to("cuda")))
    assert torch.allclose(ours.evaluate(here.wi, here.wo), theirs.evaluate(here.wi, here.wo), rtol=1e-6)


def test_samples_that_are_there_already_are_not_copied() -> None:
    samples = drawn(10)
    assert samples.to("cpu") is samples


class _Elsewhere(Samples):
    """Samples that note where they are asked to go, and count as on another device until then."""

    asked: list[str]

    def to(self, device: object) -> Samples:
        self.asked.append(str(device))
        return Samples(self.wi, self.wo, self.values)


@pytest.mark.parametrize(
    ("method", "asked"), [(Svd(size=4, epsilon=1e-5), ["cpu"]), (McCool(size=4, epsilon=1e-5), [])]
)
def test_methods_of_the_processor_take_a_copy_there(method: Method, asked: list[str]) -> None:
    given = drawn(500)
    samples = _Elsewhere(given.wi, given.wo, given.values)
    object.__setattr__(samples, "asked", [])
    method.fit(samples)
    assert samples.asked == asked


def test_a_verdict_is_of_samples_on_the_processor() -> None:
    given = drawn(500)
    samples = _Elsewhere(given.wi, given.wo, given.values)
    object.__setattr__(samples, "asked", [])
    assert homofact.fit(samples, McCool(size=4, epsilon=1e-5)).verdict is not None
    assert samples.asked == ["cpu"]


def test_solvers_of_a_gpu_are_loaded_before_threads_use_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Torch refuses to load them from two threads at once."""
    told: list[str] = []
    monkeypatch.setattr(torch.cuda, "is_initialized", lambda: True)
    monkeypatch.setattr(threads, "_load_linear_algebra", lambda: told.append("loaded"))
    threads.one_thread(lambda: told.append("worked"))()
    assert told == ["loaded", "worked"]
