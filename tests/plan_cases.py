"""Materials, benches and stages for the tests of the planner."""

from functools import lru_cache

from homofact.brdf.analytic import CookTorrance
from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.sampling import Drawable, sample_model
from homofact.brdf.source import Source
from homofact.scene.lighting import named_lighting
from homofact.scene.plan.bench import Bench
from homofact.scene.plan.ladder import FitOptions
from homofact.scene.plan.stage import Stage

QUICK = FitOptions(effort=10, count=800)
WHITE = Lambert((0.6, 0.3, 0.1))
PAINT = CookTorrance((0.4, 0.2, 0.1), (1.0, 1.0, 1.0), roughness=0.15, reflectance=0.1)


def bench_of(model: Drawable, name: str = "own") -> Bench:
    """A bench whose source is a model that has no name of its own."""
    bench = Bench(name, QUICK)
    samples = sample_model(model, QUICK.count)
    bench.__dict__["source"] = Source(name, "material", samples, model, 1e-5, 0.0)
    return bench


@lru_cache
def stage_of(light: str) -> Stage:
    """The stage of a named lighting, made once."""
    return Stage.of(named_lighting(light))
