"""The type of a fit for users, which `homofact.fit`, `homofact.load` and sweeps return.

fit = homofact.fit("paint.brdf", textures=2)
values = fit.evaluate(wi, wo)  # tensors, arrays or lists (..., 3), answered in kind
fit.export("out/paint", engine="three")
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from homofact.brdf.in_kind import Pairs
from homofact.errors import BadInput, Report, Status
from homofact.evaluation.bar.error_bar import ErrorBar, ErrorBars
from homofact.evaluation.verdict.finding import Finding
from homofact.evaluation.wording import trust_in_words
from homofact.factor.evaluation import Evaluation
from homofact.factor.spectral_fit import SpectralFit
from homofact.files.archive import add_record
from homofact.files.atomic import replace_file
from homofact.files.plain import plain as plain_json
from homofact.shading.encoded import plain
from homofact.shading.on_arrays import ModelOnArrays, OnArrays, TexturesOnArrays
from homofact.shading.program import Program, program_of

if TYPE_CHECKING:
    from homofact.api.module import FitModule
    from homofact.brdf.log_transform import LogTransform
    from homofact.factor.fitted import Fitted, QuantizationGrid, Texture


class Judgement(Protocol):
    """The verdict on a fit: a `homofact.evaluation.verdict.verdict.Verdict`, or a verdict read from a report."""

    @property
    def trusted(self) -> bool:
        """Whether the verdict does not warn, no picture shows a visible artefact, and no error bar is too wide."""
        ...

    @property
    def bars(self) -> "ErrorBars | None":
        """The error bars; None if a report of an early version does not contain them."""
        ...

    @property
    def findings(self) -> Sequence[Finding]:
        """The findings of the verdict."""
        ...

    @property
    def summary(self) -> str:
        """The verdict in one line."""
        ...


@dataclass(frozen=True, repr=False, eq=False)
class Fit:
    """A fitted BRDF: textures and the projections that index them, or a model without textures.

    Attributes
    ----------
    factorization : what is evaluated and saved: a `Factorization`, a `SpectralFit`, a `Separable` or a
        `ModelFit`.
    report : the report of the fit: how it ended and what it cost; None if there is none.
    verdict : the verdict on the fit (`bars`, `trusted`, `findings`, `summary`); None if the fit was not judged.
    """

    factorization: "Fitted"
    report: Report | None = None
    verdict: Judgement | None = None

    def __repr__(self) -> str:
        """Describe in a line or two the fit, how its search ended, and the verdict."""
        ended = "" if self.report is None else f", {self.report.status.value}"
        judged = "" if self.verdict is None else f": {self.verdict.summary}"
        return f"<Fit of {self.factorization!r}{ended}{judged}>"

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the C channels."""
        return tuple(self.factorization.channels)

    @property
    def nbytes(self) -> int:
        """Bytes of all texels (or of a model's numbers) as float32."""
        return self.factorization.nbytes

    @property
    def fetches(self) -> int:
        """Texture lookups of one evaluation."""
        return self.factorization.fetches

    @property
    def provenance(self) -> dict[str, Any]:
        """How the fit was made (source, method, seed, settings, version), JSON-able."""
        return self.factorization.provenance

    @property
    def textures(self) -> "tuple[Texture, ...]":
        """All textures, in the order in which lookups number them; empty for a model without textures."""
        return self.factorization.textures

    @property
    def projections(self) -> tuple[dict[str, Any], ...]:
        """The projection of each term, JSON-able: name, coordinates, matrix, reciprocity, warp, rotation.

        For a term of a sum of products, this is its direction map and the coordinates of its two sides. A model has
        none.
        """
        described = self.factorization.describe()
        terms = described.get("terms", [])
        if described["kind"] == "product":
            return tuple(term["projection"] for term in terms)
        return tuple({"map": described["map"], "sides": described["parameterization"]} for _ in terms)

    @property
    def evaluation(self) -> Evaluation | None:
        """How to compute values from the textures, as plain data; None for a model without textures."""
        return self.factorization.evaluation

    @property
    def terms(self) -> Sequence[Any]:
        """The terms of the product or of the sum."""
        return self.factorization.terms

    @property
    def transform(self) -> "LogTransform":
        """The fit's ε and A, by which its error in log space is measured."""
        return self.factorization.transform

    @property
    def isotropic(self) -> bool:
        """Whether the fit is isotropic because of its coordinates; True for a model without textures."""
        return self.evaluation is None or self.evaluation.isotropic

    @cached_property
    def program(self) -> Program | None:
        """The shading program that shaders, compiled code and `evaluate` on arrays share; None for a model.

        Raises BadInput for more than the four channels of a texture.
        """
        if self.evaluation is None:
            return None
        return program_of(self.factorization, [plain(texels) for texels in self._texels])

    @cached_property
    def on_arrays(self) -> OnArrays:
        """The evaluator for NumPy arrays."""
        if self.evaluation is None:
            model: Any = self.factorization
            return ModelOnArrays(self.channels, model.model)
        own = self.factorization
        own = own.expanded if isinstance(own, SpectralFit) else own
        texels = tuple(texture.texels for texture in own.textures)
        return TexturesOnArrays(self.channels, texels, self.evaluation, self.provenance)

    @property
    def _texels(self) -> tuple[np.ndarray, ...]:
        return tuple(texture.texels for texture in self.textures)

    def evaluate(self, wi: Any, wo: Any) -> Any:
        """Return BRDF values in sr⁻¹, without the cosine.

        Parameters
        ----------
        wi, wo : unit vectors (..., 3) to the light and to the viewer, of shapes that broadcast, in the surface frame
            (z the normal, x the tangent): NumPy arrays, torch tensors of any floating type and device, or nested lists.

        Returns
        -------
        Values (..., C) of the kind, type and device of the directions; 0 where a direction is below the horizon.

        Raises
        ------
        BadInput : for other shapes, directions that are not real numbers, and tensors on two devices.

        Examples
        --------
        >>> import homofact
        >>> fit = homofact.fit("material:phong-10", homofact.McCool(size=4))
        >>> len(fit.evaluate([0, 0, 1], [0.6, 0, 0.8]))
        3
        """
        pairs = Pairs.of(wi, wo)
        if pairs.kind == "tensor":
            return pairs.answer(self.factorization.evaluate(pairs.wi, pairs.wo))
        return pairs.answer(self.on_arrays.evaluate(pairs.wi, pairs.wo))

    def interval(self, quantity: str = "albedo", theta: float | None = None) -> "ErrorBar":
        """Return how far the fit may be off in a quantity.

        Parameters
        ----------
        quantity : "albedo" (total reflected light in the worst channel), "highlight" (light in the brightest 1%), "sky"
            (a sphere's picture under a sky); also "lamp" (its picture under a lamp) if the source can be evaluated.
        theta : an angle of incidence in degrees, for the error of the albedo at this angle only.

        Returns
        -------
        The error bar. `error` is the bound as a share; it is None if homofact can give no bound, and `reason` explains
        why. `low` and `high` bound the value of the source divided by the fit's value. `rate` is the share of fits for
        which the bound holds, `degrees` the range of angles for which it holds, and `kind` the evidence on which it is
        based.

        Raises
        ------
        BadInput : for a fit without a verdict, an unknown quantity, an angle together with a quantity other than the
            albedo, and an angle outside [0, 90].

        Examples
        --------
        >>> import homofact
        >>> fit = homofact.fit("material:phong-10", homofact.McCool(size=8))
        >>> bar = fit.interval("albedo", 45)
        >>> bar.kind.value, bar.low < 1 < bar.high
        ('measured', True)
        """
        bars = None if self.verdict is None else self.verdict.bars
        if bars is None:
            raise BadInput(where="interval", found="a fit without a verdict", expected="one that fit or load made")
        return bars.interval(quantity, theta)

    def with_textures(
        self,
        texels: Sequence[Any],
        grids: "Sequence[QuantizationGrid | None] | None" = None,
        facts: Mapping[str, Any] | None = None,
    ) -> "Fit":
        """Return the fit with other texels of the same sizes; it has no report and no verdict.

        `grids` are the values that quantized texels can have. `facts` are added to the provenance. Raises BadInput for
        a model without textures.
        """
        return Fit(self.factorization.with_textures(texels, grids, facts))

    def module(self, device: Any = None, dtype: Any = None) -> "FitModule":
        """Return the fit as a `torch.nn.Module` with texels and projections as parameters.

        Parameters
        ----------
        device, dtype : the device and the floating-point type of the parameters; by default the CPU and float64.

        Returns
        -------
        A module that maps directions (..., 3) to values (..., C), differentiable in directions and parameters;
        `module.to_fit()` turns it back into a fit.

        Raises
        ------
        BadInput : for a model without textures.

        Examples
        --------
        >>> import homofact, torch
        >>> module = homofact.fit("material:phong-10", homofact.McCool(size=4)).module()
        >>> up = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
        >>> module(up, up).sum().backward()
        >>> module.textures[0].grad.shape
        torch.Size([4, 4, 3])
        """
        from homofact.api.module import module_of

        return module_of(self, device, dtype)

    def describe(self) -> dict[str, Any]:
        """Return the description of the fit for a manifest, without texels and transform, JSON-able."""
        return self.factorization.describe()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the one .npz file that `homofact.load` reads back, with the verdict and how the search ended.

        The time of the search is not saved, so that equal fits give equal files. Raises BadInput for an unwritable
        place.
        """
        record = _record(self)

        def write(place: Path) -> None:
            self.factorization.save(place)
            if record:
                add_record(place, record)

        replace_file(path, write)

    def export(self, to: str | os.PathLike[str], **settings: Any) -> Any:
        """Write textures, shaders and manifest for an engine to a folder: `homofact.export` of this fit."""
        from homofact.api.exporting import export

        return export(self, to, **settings)

    def view(self, to: str | os.PathLike[str], **settings: Any) -> Any:
        """Write a page that shows the fit in a browser: `homofact.view` of this fit."""
        from homofact.api.viewing import view

        return view(self, to, **settings)

    def render(self, **settings: Any) -> Any:
        """Draw a sphere of the fit: `homofact.render` of this fit."""
        from homofact.api.rendering import render

        return render(self, **settings)


@dataclass(frozen=True)
class RecordedVerdict:
    """A verdict read from a result's report.json."""

    trusted: bool
    summary: str
    findings: tuple[Finding, ...]
    facts: Mapping[str, Any]
    bars: "ErrorBars | None" = None

    def record(self) -> dict[str, Any]:
        """Return the verdict's record from the report, JSON-able."""
        return dict(self.facts)

    @classmethod
    def of(cls, record: Any) -> "RecordedVerdict | None":
        """Return the verdict of a record; None if the record is invalid, as in a report of an early version."""
        if not isinstance(record, Mapping) or not isinstance(record.get("trusted"), bool):
            return None
        findings = record.get("findings")
        kept = [Finding.of_record(each) for each in findings] if isinstance(findings, list) else []
        summary = record.get("summary")
        words = trust_in_words(record["trusted"], summary if isinstance(summary, str) else "")
        bars = ErrorBars.of_record(record["bars"]) if "bars" in record else None
        return cls(record["trusted"], words, tuple(each for each in kept if each is not None), record, bars)


def with_record(fit: Fit, record: Mapping[str, Any]) -> Fit:
    """Return the fit with the report and the verdict from its folder's report.json; missing ones are None."""
    return replace(fit, report=_report(record), verdict=RecordedVerdict.of(record.get("verdict")))


def _record(fit: Fit) -> dict[str, Any]:
    """Return the record for `with_record`: a fit's status, evaluations, seed and verdict, if available."""
    found: dict[str, Any] = {}
    if fit.report is not None:
        report = fit.report
        found |= {"status": report.status.value, "evaluations": report.evaluations, "seed": report.seed}
    record = getattr(fit.verdict, "record", None)
    return plain_json(found if record is None else found | {"verdict": record()})


def _report(record: Mapping[str, Any]) -> Report | None:
    seconds = record.get("seconds")
    try:
        status, evaluations, seed = Status(record["status"]), int(record["evaluations"]), int(record["seed"])
        took = float(seconds["fit"]) if isinstance(seconds, Mapping) else float("nan")
    except (KeyError, TypeError, ValueError):
        return None
    # The record keeps no count of iterations and no objective.
    return Report(status, evaluations, evaluations, took, float("nan"), seed, details=dict(record))
