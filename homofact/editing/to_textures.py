"""Apply an edit to the textures of a fit: f becomes r(γ) f, which adds log r in the log domain.

There are three ways; the error of each is measured:

* "texels": if γ is a function of a texture's coordinates (`texel_angles`), log r is added to its texels and nothing
  else changes. A reciprocal texture is read at two places. If swapping the directions does not change γ, the texture
  gets half of log r. Over θi it gets all of log r if the edit is r(θi) r(θo); other edits over θi are not possible. The
  error is the bilinear interpolation of log r between texels; `refine` puts this many steps between two texels and
  changes nothing else.
* "solve": the solver of all fits (`factor.textures`) adds a correction to all textures, whose sum best approximates log
  r over pairs of directions. The error is the part of log r that the projections cannot represent.
* "texture": adds a texture over γ, which costs one fetch; the only error is interpolation.

Textures store log(f/A + ε), so adding log r gives r f + (r − 1) ε A, cut at zero, instead of r f. No choice of texels
over γ avoids this error, so it is reported separately (`by_epsilon`). Values of r below `LEAST` are set to it.

The fit's provenance, and so its file and manifest, records each edit with all that `undo_edit` needs to revert it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.editing.angles import angle, check_angle
from homofact.editing.curves import Bands, band_place
from homofact.editing.material import Editable, Place
from homofact.editing.pairs import pairs_of
from homofact.editing.texel_angles import angles_of_texels
from homofact.errors import BadInput
from homofact.factor.edited import LETTERS
from homofact.factor.factorization import Factorization, Term
from homofact.factor.fixed_projections import EDITED_NAME, EDITS
from homofact.factor.projection import fixed_projection
from homofact.factor.textures import LogSamples, solve_terms
from homofact.geometry.directions import draw_cosine_weighted
from homofact.linear.layout import Axis

WAYS = ("texels", "solve", "texture")
LEAST = 1e-6
PROVENANCE = EDITS
PAIRS, HELD_OUT, SEED = 20_000, 10_000, 0
_SMOOTHING = 1e-3
_SAME_SWAPPED = ("theta_h", "theta_d", "gamma_alpha", "gamma_beta", "theta_r", "theta_x", "theta_y")
# The projection of a texture over one angle alone.
_OVER = {
    "theta_h": "theta_h", "theta_d": "theta_d", "theta_i": "theta_i", "theta_o": "theta_i-theta_o",
    "gamma_alpha": "theta_h-phi_h", "gamma_beta": "theta_h-phi_h", "theta_x": "theta_h-phi_h",
    "theta_y": "theta_h-phi_h",
}  # fmt: skip


@dataclass(frozen=True)
class Edit:
    """f times r(γ), `ratio`, over the angle of that name; `also_outgoing`: over θi, times r(θo) too."""

    angle: str
    ratio: Bands
    also_outgoing: bool = False

    def __post_init__(self) -> None:
        """Reject an unknown angle, and `also_outgoing` for an angle other than θi."""
        check_angle(self.angle)
        if self.also_outgoing and self.angle != "theta_i":
            found = f"a ratio over {LETTERS[self.angle]} at both ends"
            raise BadInput(where="edit", found=found, expected="one over θi")

    def log_at(self, gamma: Tensor) -> Tensor:
        """log r (N, C): straight lines from the middle of a band to the next, constant beyond the first and last.

        The middle of bands that are finer near 0 is that of their edges' roots.
        """
        logs = torch.log(self.ratio.values.clamp_min(LEAST)).to(gamma)
        place = (band_place(gamma, self.ratio.count, self.ratio.finer) - 0.5).clamp(0, self.ratio.count - 1)
        number = place.floor().to(torch.int64).clamp_max(self.ratio.count - 2)
        return torch.lerp(logs[number], logs[number + 1], (place - number)[..., None])

    def log_of_pairs(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return the change (N, C) of the logarithm of f at pairs (N, 3)."""
        found = self.log_at(angle(self.angle, wi, wo))
        return found + self.log_at(angle("theta_o", wi, wo)) if self.also_outgoing else found

    def record(self) -> dict[str, Any]:
        """Return the edit, JSON-able."""
        kind = {"finer": True} if self.ratio.finer else {}
        return {"angle": self.angle, "also_outgoing": self.also_outgoing, "ratio": self.ratio.values.tolist()} | kind

    @classmethod
    def of_record(cls, record: dict[str, Any]) -> "Edit":
        """Return the edit of a record; those of earlier builds have equal bands."""
        ratio = torch.tensor(record["ratio"], dtype=torch.float64)
        return cls(record["angle"], Bands(ratio, bool(record.get("finer", False))), record["also_outgoing"])


@dataclass(frozen=True)
class AppliedEdit:
    """A fit with an edit in its textures, and the errors of the edit over held-out pairs.

    `log_rms` is the RMS error of the logarithm: Σ textures against Σ before + log r. `rms` is the relative,
    cosine-weighted RMS error of f against r f. `by_epsilon` is this error if log r were added exactly: the part that ε
    alone causes. Other errors can offset it. `clamped` is the share of pairs where f is cut at zero although r f is not
    zero.
    """

    fit: Factorization
    way: str
    log_rms: float
    rms: float
    by_epsilon: float
    clamped: float

    def words(self) -> str:
        """Return one line for people."""
        more = f" ({self.by_epsilon:.2%} from ε alone)" if self.by_epsilon > 1e-4 else ""
        cut = f"; {self.clamped:.2%} of the pairs are cut at zero" if self.clamped else ""
        return (
            f"{self.way}: relative RMS {self.rms:.2%} against the smooth curve{more}; logarithms off by"
            f" {self.log_rms:.2g}{cut}"
        )


def edits_of(material: Editable, curves: Mapping[Place, Bands]) -> tuple[Edit, ...]:
    """Return the edits that change a one-term material from its start curves to `curves`.

    Raises BadInput for a material of several terms, whose edits are no factor of f.
    """
    if len(material.terms) > 1:
        names = ", ".join(term.name for term in material.terms)
        wanted = "one: an edit of a part is no factor of all"
        raise BadInput(where=material.name, found=f"the terms {names}", expected=wanted)
    before, found = material.banded_start(), []
    for place, curve in curves.items():
        slot = material.slot(place)
        start = before[place].values
        # Where the start is nothing, no ratio brings light back.
        ratio = torch.where(start > 0, material.checked(place, curve).values / start.clamp_min(1e-300), 1.0)
        if bool((ratio != 1).any()):
            found.append(Edit(slot.angle, Bands(ratio, slot.finer), slot.also_outgoing))
    return tuple(found)


def apply_edit(fit: Factorization, edit: Edit, way: str | None = None, refine: int = 1) -> AppliedEdit:
    """Apply an edit to a fit's textures: by `way`, else by texels if a texture determines the angle, else "solve".

    `refine` is for "texels": it divides each step between two texels into `refine` steps, along the axes of that
    texture. Raises BadInput for another way, for a ratio of other channels, and for "texels" if no texture determines
    the angle.
    """
    if way is not None and way not in WAYS:
        raise BadInput(where="way", found=repr(way), expected=f"one of {', '.join(WAYS)}")
    if edit.ratio.channels != len(fit.channels):
        raise BadInput(where="edit", found=f"a ratio of {edit.ratio.channels} channels", expected=len(fit.channels))
    if not 1 <= refine <= 64:
        raise BadInput(where="refine", found=refine, expected="1 to 64")
    knowing = [k for k, term in enumerate(fit.terms) if _added(term, edit) is not None]
    chosen = way or ("texels" if knowing else "solve")
    if chosen == "texels":
        if not knowing:
            letter = LETTERS[edit.angle]
            what = f"no texture of the fit is indexed by {letter} so"
            raise BadInput(what, where="texels", expected="solve or texture")
        tried = [_judged(fit, edit, _by_texels(fit, edit, k, refine), "texels") for k in knowing]
        return min(tried, key=lambda each: each.rms)
    if chosen == "solve":
        return _judged(fit, edit, _by_solving(fit, edit, 1), "solve")
    if edit.angle not in _OVER:
        what = f"no projection is indexed by {LETTERS[edit.angle]} alone"
        raise BadInput(what, where="texture", expected="solve")
    return _judged(fit, edit, _by_a_texture(fit, edit), "texture")


def undo_edit(fit: Factorization) -> Factorization:
    """Return the fit without its last edit. Raises BadInput if it has no edit or its record is invalid."""
    records = fit.provenance.get(PROVENANCE, [])
    if not records:
        raise BadInput("the fit has no edit", where="undo", expected="one that was edited")
    *earlier, record = records
    try:
        edit = Edit.of_record(record)
        way, number, refine = record["way"], int(record.get("texture", 0)), int(record.get("refine", 1))
        term = fit.terms[number].tensors()
    except (KeyError, TypeError, ValueError, IndexError) as error:
        what = f"the fit's record of its last edit is damaged ({error})"
        raise BadInput(what, where="undo", expected="what an edit saved") from error
    if way == "texture":
        terms = tuple(each for k, each in enumerate(fit.terms) if k != number)
    elif way == "texels":
        added = _added(term, edit)
        if added is None:
            wanted = "the edited fit"
            raise BadInput(f"texture {number} does not know {LETTERS[edit.angle]}", where="undo", expected=wanted)
        back = replace(term, texture=term.texture - added)
        terms = tuple(_coarsened(back, refine) if k == number else each for k, each in enumerate(fit.terms))
    elif way == "solve":
        terms = _by_solving(fit, edit, -1).terms
    else:
        raise BadInput(where="undo", found=f"the way {way!r}", expected=f"one of {', '.join(WAYS)}")
    gone = (PROVENANCE,) if earlier else (PROVENANCE, EDITED_NAME)
    provenance = {name: value for name, value in fit.provenance.items() if name not in gone}
    return replace(fit, terms=terms, provenance=provenance | ({PROVENANCE: earlier} if earlier else {}))


def _added(term: Term[Any], edit: Edit) -> Tensor | None:
    """Return the summand (rows, columns, C) for a texture's texels; None if it cannot represent the edit."""
    known, twice = angles_of_texels(term), term.projection.lookups == 2
    if edit.angle not in known:
        return None
    added = edit.log_at(known[edit.angle])
    if edit.angle in _SAME_SWAPPED:
        return added / 2 if twice else added
    if twice:
        return added if edit.also_outgoing else None
    if not edit.also_outgoing:
        return added
    return added + edit.log_at(known["theta_o"]) if "theta_o" in known else None


def _by_texels(fit: Factorization, edit: Edit, number: int, refine: int) -> Factorization:
    term = _refined(fit.terms[number].tensors(), refine)
    added = _added(term, edit)
    assert added is not None
    changed = replace(term, texture=term.texture + added, grid=None)
    terms = tuple(changed if k == number else each for k, each in enumerate(fit.terms))
    return _recorded(replace(fit, terms=terms), edit, way="texels", texture=number, refine=refine)


def _refined(term: Term[Tensor], times: int) -> Term[Tensor]:
    """Refine a texture `times` times by interpolation, without changing its function."""
    for dimension, axis in enumerate(term.projection.axes):
        count = term.size[dimension]
        if count == 1 or times == 1:
            continue
        steps = torch.arange(times * count if axis is Axis.PERIODIC else times * (count - 1) + 1)
        lower, share = steps // times, (steps % times).double() / times
        upper = (lower + 1) % count if axis is Axis.PERIODIC else (lower + 1).clamp_max(count - 1)
        shape = [1, 1, 1]
        shape[dimension] = -1
        low, high = term.texture.index_select(dimension, lower), term.texture.index_select(dimension, upper)
        texture = torch.lerp(low, high, share.reshape(shape).to(low))
        reached = (share > 0).reshape(shape[:2]) & term.mask.index_select(dimension, upper)
        mask = term.mask.index_select(dimension, lower) | reached
        term = replace(term, texture=texture, mask=mask, deviation=None, grid=None)
    return term


def _coarsened(term: Term[Tensor], times: int) -> Term[Tensor]:
    """Return the inverse of `_refined`, without the deviation and the grid, which are lost."""
    for dimension, count in enumerate(term.size):
        if count > 1 and times > 1:
            steps = torch.arange(0, count, times)
            texture, mask = (each.index_select(dimension, steps) for each in (term.texture, term.mask))
            term = replace(term, texture=texture, mask=mask)
    return term


def _by_solving(fit: Factorization, edit: Edit, sign: int) -> Factorization:
    wi, wo = pairs_of(PAIRS, SEED)
    weights = torch.ones(len(wi), dtype=torch.float64)
    samples = LogSamples(wi, wo, sign * edit.log_of_pairs(wi, wo), weights)
    projections = tuple(term.projection for term in fit.terms)
    found = solve_terms(samples, projections, tuple(term.size for term in fit.terms), _SMOOTHING, "cholesky")
    pairs = zip(fit.terms, found.terms, strict=True)
    terms = tuple(replace(term, texture=term.texture + more.texture.numpy(), grid=None) for term, more in pairs)
    return _recorded(replace(fit, terms=terms), edit, way="solve")


def _by_a_texture(fit: Factorization, edit: Edit) -> Factorization:
    projection = fixed_projection(_OVER[edit.angle], edit.also_outgoing)
    count = edit.ratio.count
    rows = 1 if bool((projection.matrix[1] == 0).all()) else count
    empty = torch.zeros(rows, count, len(fit.channels), dtype=torch.float64)
    term = Term(projection, empty, torch.ones(rows, count, dtype=torch.bool))
    added = _added(term, edit)
    assert added is not None
    made = replace(fit, terms=(*fit.terms, replace(term, texture=added)))
    return _recorded(made, edit, way="texture", texture=len(fit.terms))


def _recorded(fit: Factorization, edit: Edit, **more: Any) -> Factorization:
    earlier = fit.provenance.get(PROVENANCE, [])
    return replace(fit, provenance=fit.provenance | {PROVENANCE: [*earlier, edit.record() | more]})


def _judged(before: Factorization, edit: Edit, after: Factorization, way: str) -> AppliedEdit:
    """Measure the remaining error at held-out pairs, and add it to the record."""
    wi, wo = pairs_of(HELD_OUT, SEED + 1)
    added = edit.log_of_pairs(wi, wo)
    wanted = before.evaluate_log(wi, wo) + added
    off = after.evaluate_log(wi, wo) - wanted
    rms, by_epsilon, clamped = relative_rms(before, edit, after)
    made = AppliedEdit(after, way, float(off.square().mean().sqrt()), rms, by_epsilon, clamped)
    figures = {"log_rms": made.log_rms, "rms": rms, "by_epsilon": by_epsilon, "clamped": clamped}
    *earlier, record = after.provenance[PROVENANCE]
    stated = after.provenance | {PROVENANCE: [*earlier, record | figures]}
    return replace(made, fit=replace(after, provenance=stated))


def relative_rms(before: Factorization, edit: Edit, after: Reflectance) -> tuple[float, float, float]:
    """Return (relative RMS of `after` against r f, RMS by ε alone, share of cut pairs), cosine-weighted."""
    wi, wo = draw_cosine_weighted(HELD_OUT, torch.Generator().manual_seed(SEED + 2))
    ratio = torch.exp(edit.log_of_pairs(wi, wo))
    wanted, found = ratio * before.evaluate(wi, wo), after.evaluate(wi, wo)
    moved = before.transform.inverse(before.evaluate_log(wi, wo) + torch.log(ratio))
    size = float(wanted.square().mean().sqrt()) or 1.0
    cut = float(((found <= 0) & (wanted > 0)).double().mean())
    return (
        float((found - wanted).square().mean().sqrt()) / size,
        float((moved - wanted).square().mean().sqrt()) / size,
        cut,
    )
