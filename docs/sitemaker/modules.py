"""The modules of the Python reference: which they are, their files, their pages, their syntax trees."""

import ast
from dataclasses import dataclass
from functools import cache

from sitemaker.navigation import ROOT

# The public modules, sorted by purpose. Only these have a page.
MODULES = {
    "The front door": (
        "homofact", "homofact.api.reading", "homofact.api.fitting", "homofact.api.result", "homofact.api.loading",
        "homofact.api.module", "homofact.api.comparing", "homofact.api.compared", "homofact.api.comparing_fits",
        "homofact.api.charting", "homofact.api.planning", "homofact.api.evaluating", "homofact.api.factorizing",
        "homofact.api.exporting", "homofact.api.viewing", "homofact.api.rendering", "homofact.api.converting",
        "homofact.api.sweeping", "homofact.api.measuring", "homofact.api.reporting", "homofact.api.describing",
        "homofact.api.terms", "homofact.api.progress", "homofact.errors",
    ),
    "Methods": (
        "homofact.methods.search", "homofact.methods.cole", "homofact.methods.mccool", "homofact.methods.svd",
        "homofact.methods.nmf", "homofact.methods.models", "homofact.methods.method", "homofact.methods.fitting",
        "homofact.methods.table", "homofact.methods.own",
    ),
    "Data": (
        "homofact.brdf.samples", "homofact.brdf.source", "homofact.brdf.reflectance", "homofact.brdf.materials",
        "homofact.brdf.sampling", "homofact.brdf.table", "homofact.brdf.scattered", "homofact.brdf.log_transform",
        "homofact.brdf.symmetry", "homofact.brdf.quality.noise_floor",
        "homofact.brdf.quality.outliers", "homofact.brdf.quality.gains",
        "homofact.brdf.quality.clipping", "homofact.brdf.quality.suspicion.suspects",
        "homofact.brdf.quality.suspicion.undo",
        "homofact.brdf.formats.csv", "homofact.brdf.formats.npz", "homofact.brdf.formats.merl",
        "homofact.brdf.formats.alta", "homofact.measuring.goniometer",
    ),
    "Fits": (
        "homofact.factor.fitted", "homofact.factor.factorization", "homofact.factor.evaluation",
        "homofact.factor.projection",
        "homofact.factor.gauge", "homofact.factor.quantize", "homofact.factor.confidence", "homofact.factor.layered",
        "homofact.separable.separable",
    ),
    "Quality of a fit": (
        "homofact.evaluation.compare", "homofact.evaluation.metric_table", "homofact.evaluation.metrics",
        "homofact.evaluation.brdf_metrics",
        "homofact.evaluation.image_metrics", "homofact.evaluation.appearance", "homofact.evaluation.energy",
        "homofact.evaluation.split", "homofact.evaluation.repeats", "homofact.evaluation.reopening",
        "homofact.evaluation.judging", "homofact.evaluation.verdict.verdict", "homofact.evaluation.verdict.finding",
        "homofact.evaluation.bar.error_bar", "homofact.evaluation.chart",
    ),
    "Pictures, pages, exports": (
        "homofact.rendering.sphere", "homofact.rendering.light",
        "homofact.rendering.environment", "homofact.rendering.tonemap",
        "homofact.rendering.mitsuba_bsdf", "homofact.exporting.exported", "homofact.exporting.exported_reader",
        "homofact.exporting.result", "homofact.web.page", "homofact.shading.program", "homofact.shading.languages",
    ),
    "Scenes": (
        "homofact.theory.terms", "homofact.scene.lighting", "homofact.theory.harmonics", "homofact.theory.reflection",
        "homofact.theory.light_field", "homofact.theory.sphere_field", "homofact.planning.scene",
        "homofact.planning.plan", "homofact.api.relighting", "homofact.api.editing", "homofact.scene.scene_file",
        "homofact.scene.objects", "homofact.relighting.scene_file", "homofact.relighting.build",
        "homofact.relighting.relight", "homofact.relighting.result", "homofact.relighting.relit_mesh",
        "homofact.relighting.lit_scene", "homofact.editing.scene_file",
        "homofact.editing.curves", "homofact.editing.session", "homofact.editing.to_textures",
        "homofact.editing.result",
    ),
    "Without torch": ("homofact.runtime", "homofact.shading.on_arrays"),
    "Whole databases": (
        "homofact.sweeps.sweep_file", "homofact.sweeps.run", "homofact.sweeps.ledger", "homofact.sweeps.svbrdf",
        "homofact.sweeps.shared_basis", "homofact.sweeps.report.site",
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Module:
    """A module of homofact: its dotted name, its file in the repository, its page."""

    name: str

    @property
    def path(self) -> str:
        """The file, from the repository's root."""
        stem = self.name.replace(".", "/")
        return f"{stem}/__init__.py" if (ROOT / stem).is_dir() else f"{stem}.py"

    @property
    def page(self) -> str:
        """The page's name."""
        return f"api/{self.name}"


def reference_modules() -> list[Module]:
    """Return the modules of the reference in their order."""
    return [Module(name) for names in MODULES.values() for name in names]


@cache
def module_pages() -> dict[str, str]:
    """Return the pages of the modules by their names."""
    return {each.name: each.page for each in reference_modules()}


@cache
def tree_of(module: str) -> ast.Module:
    """Return the syntax tree of a module; an empty one if homofact has no such module."""
    path = ROOT / Module(module).path
    return ast.parse(path.read_text(encoding="utf-8") if path.is_file() else "")
