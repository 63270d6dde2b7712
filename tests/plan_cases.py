"""Materials, their fits and stages for the tests of the planner."""

from functools import lru_cache

from homofact.brdf.analytic import CookTorrance
from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.sampling import Drawable, sample_model
from homofact.brdf.source import Source
from homofact.planning.ladder import FitOptions
from homofact.planning.material_fits import MaterialFits
from homofact.planning.stage import Stage
from homofact.scene.lighting import named_lighting

QUICK = FitOptions(effort=10, count=800)
WHITE = Lambert((0.6, 0.3, 0.1))
PAINT = CookTorrance((0.4, 0.2, 0.1), (1.0, 1.0, 1.0), roughness=0.15, reflectance=0.1)


def fits_of(model: Drawable, name: str = "own") -> MaterialFits:
    """The fits of a model that has no name of its own."""
    fits = MaterialFits(name, QUICK)
    samples = sample_model(model, QUICK.count)
    fits.__dict__["source"] = Source(name, "material", samples, model, 1e-5, 0.0)
    return fits


@lru_cache
def stage_of(light: str) -> Stage:
    """The stage of a named lighting, made once."""
    return Stage.of(named_lighting(light))
