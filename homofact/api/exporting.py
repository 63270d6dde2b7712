"""Exporting: a fit's textures in an engine's format, with the shaders that read them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.progress import Progress, ProgressSteps
from homofact.api.subjects import Place, given_fit, given_source, reopened_or_why
from homofact.containers.format_names import FORMAT_NAMES
from homofact.errors import BadInput
from homofact.files.kinds import ENGINE_MARK
from homofact.files.lock import claimed

if TYPE_CHECKING:
    from homofact.brdf.samples import Samples
    from homofact.containers.formats import Format
    from homofact.evaluation.reopening import Reopened
    from homofact.exporting.engine_light import UnderSkies
    from homofact.exporting.engines.base import Added, Engine
    from homofact.exporting.exported import Exported
    from homofact.exporting.look_alike import Likeness
    from homofact.exporting.prefiltered import PrefilteredExport
    from homofact.factor.fitted import Fitted
    from homofact.shading.cost import EvaluationCost

QUANTIZED = ("png8", "png16")
SEEN = "the fit has, or may have, seen the samples that its errors are on"
AGAINST_UNEDITED = "the fit is edited and the samples are of the unedited material: its errors include the edit"
SKY_SIDE = 256  # as `rendering.sky_chain.SIDE`, which help must not load


@dataclass(frozen=True)
class ExportResult:
    """What an export wrote.

    Attributes
    ----------
    result : str
        The path of the fit; "fit" for a fit in memory.
    folder : Path
        Where the export is.
    format : str
        The textures' format.
    files : tuple of str
        The names of all files in the folder.
    errors : dict
        Errors of the fit and of the stored texels by label: `log_difference` to the fit, and metrics by part of the
        samples.
    part : str
        The name of the part that was tested, "held_out" or "source".
    caution : str
        The reason why there are no errors on samples, or a warning that the fit may have seen the samples; otherwise
        empty.
    source_found : bool
        Whether there are errors on samples.
    cost : EvaluationCost
        Fetches, operations and bytes of one evaluation.
    noise : tuple of dict
        The noise of importance sampling for each angle of the viewer: the relative variance of an estimate from one
        direction that `homofact_sample` draws.
    engine : str
        The engine that the export is for; empty for an export without an engine.
    looks : dict
        The errors of the engine's look-alike materials against the source, or against the fit, by label.
    prefiltered : PrefilteredExport or None
        The prefiltered environment map.
    light : UnderSkies or None
        How the engine lights the fit with its own sky, and the error of this; None if it does not.
    likeness : Likeness or None
        The error of the glTF look-alike material against the fit; None for exports without one.
    verdict : dict or None
        The fit's verdict as "trusted" and "summary"; None for a fit without a verdict.
    shipped : tuple of str
        The files that the engine needs, if it does not need all files; otherwise empty.
    """

    result: str
    folder: Path
    format: str
    files: tuple[str, ...]
    errors: dict[str, Any] = field(repr=False)
    part: str
    caution: str
    source_found: bool
    cost: "EvaluationCost"
    noise: tuple[Mapping[str, float], ...] = field(repr=False)
    engine: str = ""
    looks: Mapping[str, Any] | None = field(default=None, repr=False)
    prefiltered: "PrefilteredExport | None" = field(default=None, repr=False)
    light: "UnderSkies | None" = field(default=None, repr=False)
    likeness: "Likeness | None" = field(default=None, repr=False)
    verdict: Mapping[str, Any] | None = field(default=None, repr=False)
    shipped: tuple[str, ...] = ()

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        record = {
            "result": self.result,
            "out": str(self.folder),
            "errors": self.errors,
            "cost": self.cost.record(),
            "format": self.format,
            "verdict": None if self.verdict is None else dict(self.verdict),
            **({"shipped": list(self.shipped)} if self.shipped else {}),
        }
        for name, part in (("prefiltered", self.prefiltered), ("light", self.light), ("likeness", self.likeness)):
            if part is not None:
                record[name] = part.record()
        return record | ({"engine": self.engine, "looks": dict(self.looks or {})} if self.engine else {})


def export(
    fit: Any,
    to: Place,
    *,
    format: str | None = None,
    quantize: str | None = None,
    engine: str | None = None,
    prefilter: Place | None = None,
    prefilter_side: int | None = None,
    source: Any = None,
    force: bool = False,
    progress: Progress | None = None,
) -> ExportResult:
    """Write a fit's textures and the shaders that read them: GLSL, HLSL, WGSL and C.

    Parameters
    ----------
    fit : Fit or path
        A fit, a result's folder, or a saved .npz file.
    to : path
        The output folder. If the export fails, nothing is written.
    format : str, optional
        The textures' format, such as "exr", "png8" or "ktx2". Default: the value of `quantize`. Without `quantize`, a
        fit that is an 8-bit or 16-bit export (such as `plan` writes) keeps its format and texels. Any other fit is
        written as "exr", or as "exr16" for the engines "three" and "godot".
    quantize : {"png8", "png16"}, optional
        Solve for the best texels of 8 or 16 bits, instead of rounding each by itself.
    engine : str, optional
        Add what an engine loads: "three", "gltf", "materialx", "godot", "blender" or "pbrt".
    prefilter : path, optional
        A lat-long environment map (.hdr or .exr) to prefilter for the material.
    prefilter_side : int, optional
        Texels per side of the filtered sky's faces, a power of two. Default: 256.
    source : path or source, optional
        The source of the fit. By default, homofact tries to find it.
    force : bool, optional
        Replace an export that is there.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    ExportResult
        The folder, its files, and the errors of the stored texels.

    Raises
    ------
    BadInput
        For a fit or source that cannot be read, a format that cannot store the fit, and a folder that already contains
        files.

    Examples
    --------
    >>> fit = homofact.fit("material:phong-30", homofact.McCool(size=8))
    >>> exported = homofact.export(fit, "engine", format="png16")
    >>> exported.format, "brdf.glsl" in exported.files
    ('png16', True)
    """
    asked = _format_of(format, quantize)
    if prefilter_side is not None and prefilter is None:
        raise BadInput(where="prefilter-side", found="it without a sky", expected="prefilter, the sky to filter")
    given = given_fit(fit)
    source = None if source is None else given_source(source)

    from homofact.containers.formats import format_named
    from homofact.exporting.exported_reader import whole_format
    from homofact.files.folder import check_new_folder
    from homofact.files.kinds import EXPORT
    from homofact.rendering.environment import read_environment
    from homofact.rendering.sky_chain import check_side

    kept = None if asked is not None or given.place is None else whole_format(given.place)
    name, of_engine = asked or kept or "exr", None
    if engine is not None:
        from homofact.exporting.engines.table import engine_named

        of_engine, name = engine_named(engine, asked)
        if kept is not None and kept in of_engine.formats:
            name = kept
    folder = Path(to)
    check_new_folder(folder, EXPORT, force)
    side = SKY_SIDE if prefilter_side is None else prefilter_side
    check_side(side)
    light = None if prefilter is None else read_environment(prefilter)
    steps = ProgressSteps(progress)
    with claimed(folder):
        steps.stage("reading")
        fitted = given.open()
        work = _Work(fitted, reopened_or_why(fitted, source, given.near), format_named(name), steps)
        made, rows = work.stored(quantize)
        steps.stage("fitting the table of importance sampling")
        made = replace(work.drawable(made), verdict=given.verdict)
        if light is not None:
            from homofact.exporting.prefiltered import prefiltered_export

            steps.stage("filtering the environment")
            made = replace(made, prefiltered=prefiltered_export(made.stored, light, made.format, side))
        written = work.write(given.words, folder, made, rows, of_engine, force)
    return replace(written, verdict=given.verdict)


def _format_of(form: str | None, quantize: str | None) -> str | None:
    """Return the requested format, None for the default. Raises BadInput if it is unknown or contradictory."""
    name = form or quantize
    if quantize is not None and quantize not in QUANTIZED:
        raise BadInput(where="quantize", found=repr(quantize), expected="png8 or png16")
    if quantize is not None and quantize != name:
        raise BadInput(where="format", found=f"{name!r} beside quantize {quantize}", expected=quantize)
    if name is not None and name not in FORMAT_NAMES:
        raise BadInput(where="format", found=repr(name), expected=f"one of {', '.join(FORMAT_NAMES)}")
    return name


@dataclass(frozen=True)
class _Work:
    """An export in progress: the fit, its reopened source or the reason why there is none, and the textures' format."""

    fitted: "Fitted"
    source: "Reopened | str"
    format: "Format"
    steps: ProgressSteps

    def stored(self, quantize: str | None) -> "tuple[Exported, dict[str, Exported | Fitted]]":
        """Return the fit as it will be stored, and other versions of it for comparing errors, by label."""
        from homofact.exporting.exported import exported
        from homofact.factor.quantize import is_solved

        made = exported(self.fitted, self.format)
        if not self.fitted.textures:
            if quantize is not None:
                raise BadInput(where="quantize", found=f"{quantize} for a model without texels", expected="none")
            return made, {"as fitted": self.fitted}
        if quantize is None:
            return made, {"as fitted": self.fitted, f"stored as {self.format.name}": made}
        self.steps.stage("solving for whole texels")
        best = exported(self._quantized(quantize), self.format)
        rows: dict[str, Exported | Fitted] = {"as fitted": self.fitted, "each texel rounded": made}
        return best, rows | ({f"solved for {self.format.name}": best} if is_solved(self.fitted) else {})

    def _quantized(self, storage: str) -> "Fitted":
        """Return the fit with integer texels; for a product, they are solved for on its own samples.

        The samples of an edited fit belong to the material before the edit, so its texels are solved for on its own
        values.
        """
        from homofact.evaluation.reopening import settings_of
        from homofact.exporting.as_source import as_source
        from homofact.factor.edited import edits_in_words
        from homofact.factor.quantize import is_solved, rounded
        from homofact.methods.common import quantized

        if not is_solved(self.fitted):
            return rounded(self.fitted, storage)
        if edits_in_words(self.fitted.provenance):
            own = as_source(self.fitted, "the fit").samples
            return quantized(self.fitted, own, settings_of(self.fitted), storage)
        if isinstance(self.source, str):
            raise BadInput(self.source, where="quantize", expected="the samples to solve on: name their source")
        return quantized(self.fitted, self.source.training, settings_of(self.fitted), storage)

    def drawable(self, made: "Exported") -> "Exported":
        """Return the export with the mixture from which its shaders sample directions."""
        from homofact.shading.mixture_fit import fitted_mixture

        return replace(made, sampling=fitted_mixture(made.stored))

    def write(
        self,
        words: str,
        folder: Path,
        made: "Exported",
        rows: "Mapping[str, Exported | Fitted]",
        engine: "Engine | None",
        force: bool,
    ) -> ExportResult:
        """Measure errors and write the export."""
        from homofact.exporting.exported import write_exported
        from homofact.exporting.look_alike import AddedLookAlike
        from homofact.factor.fixed_projections import EDITS

        self.steps.stage("measuring and writing")
        samples = None if isinstance(self.source, str) else self.source.parts
        errors = {label: self._errors(row, samples) for label, row in rows.items()}
        more: dict[str, str | bytes] = {}
        looks: dict[str, Any] = {}
        likeness = light = None
        shipped: tuple[str, ...] = ()
        if engine is not None:
            self.steps.stage(engine.work)
            added = engine.add(made)
            more, light, shipped = dict(added.files), added.light, added.shipped
            likeness = added.likeness if isinstance(added, AddedLookAlike) else None
            looks = self._looks(made, added, likeness)
        of_looks = {label: look["errors"] for label, look in looks.items() if label != "fit"}
        name = "" if engine is None else engine.name
        description = write_exported(folder, made, errors | of_looks, force, name, more)
        filtered = [] if made.prefiltered is None else made.prefiltered.files
        beside = [*more, ENGINE_MARK] if more else []
        found = self.source
        seen = "" if isinstance(found, str) or found.held_out else SEEN
        if EDITS in self.fitted.provenance:
            seen = AGAINST_UNEDITED
        return ExportResult(
            result=words,
            folder=folder,
            format=self.format.name,
            files=(
                *made.names,
                *description["code"]["files"],
                description["code"]["check"],
                *filtered,
                "manifest.json",
                *beside,
            ),
            errors=errors,
            part="held_out" if isinstance(found, str) else found.part,
            caution=found if isinstance(found, str) else seen,
            source_found=not isinstance(found, str),
            cost=made.cost,
            noise=tuple(description["sampling"]["measured"]),
            engine=name,
            looks=looks,
            prefiltered=made.prefiltered,
            likeness=likeness,
            light=light,
            shipped=shipped,
        )

    def _errors(self, row: "Exported | Fitted", samples: "dict[str, Samples] | None") -> dict[str, Any]:
        """Return a version's errors against the samples, if any, and its difference from the original fit."""
        from homofact.evaluation.metrics import measure
        from homofact.exporting.exported import Exported, log_difference

        values = row.stored if isinstance(row, Exported) else row
        parts = (samples or {}).items()
        measured = {part: measure(values, own, self.fitted.transform).record() for part, own in parts}
        return {"log_difference": log_difference(self.fitted, values)} | measured

    def _looks(self, made: "Exported", added: "Added", likeness: "Likeness | None") -> dict[str, Any]:
        """Compare each look-alike of an engine, and the fit, with the source, or with the fit if there is none.

        `likeness` is the measured likeness of the only look-alike to the fit.
        """
        from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
        from homofact.brdf.scattered import made_of_samples
        from homofact.evaluation.appearance import appearance
        from homofact.evaluation.metrics import measure
        from homofact.exporting.as_source import as_source
        from homofact.exporting.engines.gltf import said
        from homofact.exporting.exported import log_difference

        looks = added.looks
        if not looks:
            return {}
        found = self.source
        whole = None if isinstance(found, str) or made_of_samples(found.source.reflectance) else found.source
        against = whole or as_source(made.stored, "the fit")
        compared = dict(looks) if whole is None else {"fit": made.stored, **looks}
        answer = {}
        for label, look in compared.items():
            figures = likeness.appearance if likeness and whole is None else appearance(look, against)
            six = measure(look, against.samples, made.stored.transform).record()
            numbers = f"{said(look)}; " if isinstance(look, MetallicRoughness) else ""
            answer[label] = {
                "against": against.name,
                "appearance": None if figures is None else figures.record(),
                "errors": six | {"log_difference": log_difference(made.stored, look)},
                "said": "" if label == "fit" else f"{label}: {numbers}log_mse {six['log_mse']:.3g}",
            }
        return answer
