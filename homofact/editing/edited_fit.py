"""Turn the edited curves of a material into textures: change the textures of its fit, or fit it again.

If a material is a fit of homofact and its curves multiply all of it, the edits are applied to its textures
(`to_textures`). Any other material (a measurement, a model, a sum of terms or of products) is fitted by the default
method. The fit uses the pairs of directions at which the material was measured or sampled. Each sample is multiplied by
the ratio f(edited)/f(start), so that a measurement keeps its noise and is not interpolated.

In both cases the error is the relative RMS of the textures against the edited material.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import torch

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import NOISE_FREE_EPSILON, Source, open_source
from homofact.brdf.source_names import DEFAULT_COUNT, DEFAULT_SCHEME, HELD_OUT
from homofact.editing.build import EditMaterial
from homofact.editing.curves import Bands
from homofact.editing.material import Editable, Edited, Place
from homofact.editing.picture import Address
from homofact.editing.to_textures import AppliedEdit, apply_edit, edits_of
from homofact.errors import BadInput
from homofact.evaluation.compare import ComparisonRow, fit_and_measure
from homofact.exporting.as_source import Drawn
from homofact.factor.factorization import Factorization
from homofact.factor.fitted import Fitted
from homofact.factor.fixed_projections import EDITED, EDITED_NAME
from homofact.geometry.directions import draw_cosine_weighted
from homofact.methods.fitting import ProgressCallback
from homofact.methods.search import Search
from homofact.scene.materials import SOURCE

_PAIRS, _SEED, _COPIES = 10_000, 2, 8
_AZIMUTHAL = ("gamma_alpha", "gamma_beta")


@dataclass(frozen=True)
class EditedFit:
    """Textures of an edited material, their error `rms`, and the `applied` edits or the `row` of the new fit."""

    fit: Fitted
    edited: Edited
    rms: float
    applied: tuple[AppliedEdit, ...] = ()
    row: ComparisonRow | None = None

    def words(self) -> str:
        """Return one line for people."""
        if self.row is not None:
            return f"fitted again: the new fit has a relative RMS error of {self.rms:.2%} against the edited material"
        ways = " and ".join(dict.fromkeys(each.way for each in self.applied))
        rms = f"{self.rms:.2%} against the edited fit"
        if len(self.applied) == 1:
            rms = (
                f"{self.applied[0].rms:.2%} against the edit with a smooth curve, {self.rms:.2%} with a step at each"
                " band as in the edit's pictures"
            )
        return (
            f"changed in the textures of the fit ({ways}): relative RMS {rms}; the error of the fit before the edit"
            " comes on top"
        )


def chosen_material(
    materials: Sequence[EditMaterial], curves: Mapping[Address, Bands], name: str | None = None
) -> tuple[EditMaterial, dict[Place, Bands]]:
    """Return the edited material, or the material `name`, and its curves that differ from the start.

    Raises BadInput if no material is edited, if several are edited and `name` is None, and for an unknown name.
    """
    changed: dict[str, dict[Place, Bands]] = {}
    by_name = {own.material.name: own for own in materials}
    for (material, *place), curve in curves.items():
        start = by_name[material].material.banded_start()[place[0], place[1]]
        if not torch.equal(curve.values, start.values):
            changed.setdefault(material, {})[place[0], place[1]] = curve
    if name is not None and name not in by_name:
        raise BadInput(where="material", found=repr(name), expected=f"one of {', '.join(by_name)}")
    if not changed:
        raise BadInput("all are as the materials start", where="curves", expected="an edit")
    if name is None and len(changed) > 1:
        what = f"of {', '.join(changed)} are edited"
        raise BadInput(what, where="curves", expected="one material", hint="name the material")
    chosen = next(iter(changed)) if name is None else name
    if chosen not in changed:
        raise BadInput(f"no curve of {chosen!r} is edited", where="material", expected=f"one of {', '.join(changed)}")
    return by_name[chosen], changed[chosen]


def fit_edit(
    own: EditMaterial,
    curves: Mapping[Place, Bands],
    way: str | None = None,
    refine: int = 1,
    progress: ProgressCallback | None = None,
) -> EditedFit:
    """Fit textures to a material with these curves; `way` and `refine` as in `to_textures.apply_edit`.

    `way` and `refine` are valid only if the edits are applied to the textures of a fit; otherwise they raise BadInput.
    Also raises as `apply_edit` and the fit do.
    """
    edited = own.material.edited(curves)
    fit = own.opened.reflectance
    if isinstance(fit, Factorization) and len(own.material.terms) == 1:
        applied = []
        for edit in edits_of(own.material, curves):
            applied.append(apply_edit(fit, edit, way, refine))
            fit = applied[-1].fit
        fit = replace(fit, provenance=fit.provenance | {EDITED_NAME: own.material.name})
        return EditedFit(fit, edited, _rms(fit, edited), tuple(applied))
    for option, given in (("way", way is not None), ("refine", refine != 1)):
        if given:
            why = "is edited by terms" if len(own.material.terms) > 1 else "is no product of textures"
            raise BadInput(f"{own.material.name} {why} and is fitted anew", where=option, expected="none")
    source = _edited_source(own, edited)
    row = fit_and_measure(source, Search(), HELD_OUT, progress)
    return EditedFit(row.factorization, edited, _rms(row.factorization, edited), (), row)


def _rms(fit: Reflectance, edited: Edited) -> float:
    """Return the relative RMS error over cosine-weighted pairs."""
    wi, wo = draw_cosine_weighted(_PAIRS, torch.Generator().manual_seed(_SEED))
    wanted, found = edited.evaluate(wi, wo), torch.as_tensor(fit.evaluate(wi, wo))
    return float((found - wanted).square().mean().sqrt() / wanted.square().mean().sqrt())


def _edited_source(own: EditMaterial, edited: Edited) -> Source:
    """Return the material's samples with the edit applied, as a source."""
    begun = time.perf_counter()
    source = _own_source(own)
    samples = source.samples
    turns = any(own.material.slot(place).angle in _AZIMUTHAL for place in edited.curves)
    if turns and samples.isotropic and not samples.all_azimuths:
        # The edit makes it anisotropic: measured at one azimuth, it must be known at others.
        samples = samples.azimuth_copies(_COPIES, _SEED)
    start = own.material.edited({})
    now, before = edited.evaluate(samples.wi, samples.wo), start.evaluate(samples.wi, samples.wo)
    # Where nothing was, a sample of noise has no ratio: it takes the edited value itself.
    values = torch.where(before > 0, samples.values * now / before.clamp_min(1e-300), now)
    about = {EDITED: _curves_record(own.material, edited.curves), EDITED_NAME: own.material.name}
    samples = replace(
        samples, values=values, isotropic=samples.isotropic and not turns, provenance=samples.provenance | about
    )
    name = f"{own.material.name}, edited"
    seconds = source.seconds_read + time.perf_counter() - begun
    return replace(source, name=name, samples=samples, reflectance=edited, seconds_read=seconds, opening=None)


def _own_source(own: EditMaterial) -> Source:
    """Return the material as a source: the samples of its file, or drawn samples."""
    found = own.opened.reflectance
    if own.opened.kind == SOURCE:
        return open_source(own.opened.words)
    isotropic = bool(getattr(getattr(found, "evaluation", found), "isotropic", False))
    samples = sample_model(Drawn(found, isotropic), DEFAULT_COUNT, DEFAULT_SCHEME)
    return Source(own.material.name, "drawn", samples, found, NOISE_FREE_EPSILON, 0.0)


def _curves_record(material: Editable, curves: Mapping[Place, Any]) -> list[dict[str, Any]]:
    """Return the edited curves and their initial values as JSON for the provenance."""
    start = material.banded_start()
    return [
        {
            "term": place[0], "curve": place[1], "angle": material.slot(place).angle,
            "finer": material.slot(place).finer, "values": curve.values.tolist(), "start": start[place].values.tolist(),
        }
        for place, curve in curves.items()
    ]  # fmt: skip
