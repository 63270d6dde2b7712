"""Files of measurements in a scene: each is fitted once, and the fit replaces it.

Relighting and editing evaluate a material millions of times, and interpolating samples takes several times as long as a
fit. Tables are as fast as a fit, but are fitted too, since edits need the textures of a fit and fits can be exported.
The errors of a scene's light are measured against the fit; the error of the fit against the file is reported beside
them.
"""

import hashlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from homofact.brdf.scattered import made_of_samples
from homofact.brdf.source import open_source
from homofact.errors import BadInput
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.wording import shapes
from homofact.factor.fitted import Fitted
from homofact.files.reading import read_bytes, split_member
from homofact.methods.fitting import ProgressCallback
from homofact.methods.saved import open_saved
from homofact.methods.search import Search

METHOD = Search(textures=3, size=32, effort="quick")
# More texels than that follow the noise of a list of samples.
OF_SAMPLES = Search(textures=3, bytes=12288, effort="quick")
_FACTS = "stands_for"


@dataclass(frozen=True)
class FileFit:
    """A fit that replaces a file, saved as `name`.

    `errors` has "held_out", the mean absolute error of the logarithms on samples that were held out, and "sky", the
    relative error of a sphere's radiance under a sky (None for a file that has only samples).
    """

    name: str
    fit: Fitted

    @property
    def errors(self) -> dict[str, float | None]:
        """Return the errors of the fit against the file, as described above."""
        return self.fit.provenance[_FACTS]["errors"]

    @property
    def verdict(self) -> str | None:
        """Return the verdict on the fit in a sentence; None for a fit saved by an earlier version."""
        return self.fit.provenance[_FACTS].get("verdict")

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {"file": self.name, **self.errors, "verdict": self.verdict}

    def sentence(self, words: str) -> str:
        """Describe the fit, its errors and its verdict."""
        held_out, sky = self.errors["held_out"], self.errors["sky"]
        shown = "" if sky is None else f", a sphere under a sky off by {sky:.1%}"
        sizes = shapes([texture.size for texture in self.fit.textures])
        fit = f"{Path(words).name}: replaced by a fit (textures: {sizes} texels, {self.fit.nbytes} bytes)"
        verdict = "" if self.verdict is None else f". Verdict on the fit: {self.verdict}"
        return f"{fit}, mean absolute log error (log_mae) {held_out:.3f} on held-out samples{shown}{verdict}"


@dataclass
class FileFits:
    """The fits of a scene's files, read from `folder` if present, else made and, if `writes`, saved there.

    `progress` is called during a fit. `made` maps the name of each file to its fit.
    """

    folder: Path | None = None
    writes: bool = False
    progress: ProgressCallback | None = None
    made: dict[str, FileFit] = field(default_factory=dict)

    def of(self, words: str) -> FileFit:
        """Return the fit of a file. Raises BadInput for a file that cannot be read or fitted."""
        if words not in self.made:
            name = _name_of(words)
            self.made[words] = self._kept(name) or self._fitted(words, name)
        return self.made[words]

    def _kept(self, name: str) -> FileFit | None:
        if self.folder is None:
            return None
        place = self.folder / name
        if not place.is_file():
            return None
        fit = open_saved(place)
        if not {"held_out", "sky"} <= fit.provenance.get(_FACTS, {}).get("errors", {}).keys():
            raise BadInput(where=place, found="no errors in it", expected="a fit of a scene's file, or delete it")
        return FileFit(place.name, fit)

    def _fitted(self, words: str, name: str) -> FileFit:
        source = open_source(words)
        method = OF_SAMPLES if made_of_samples(source.reflectance) else METHOD
        row = fit_and_measure(source, method, progress=self.progress)
        sky = None if row.appearance is None else row.appearance.off_sky
        errors = {"held_out": row.held_out.log_mae, "sky": sky}
        facts = {"file": Path(words).name, "errors": errors, "verdict": row.verdict.summary}
        fit: Any = row.factorization
        fit = replace(fit, provenance=fit.provenance | {_FACTS: facts})
        found = FileFit(name, fit)
        if self.folder is not None and self.writes:
            self.folder.mkdir(parents=True, exist_ok=True)
            fit.save(self.folder / name)
        return found


def _name_of(words: str) -> str:
    """The name of the fit's file: the source's own, and a digest of its bytes and of how it is fitted."""
    place, member = split_member(words)
    digest = hashlib.sha256(repr((METHOD, OF_SAMPLES, member)).encode())
    digest.update(read_bytes(Path(place), "a measurement"))
    stem = Path(member or place).stem
    return f"fit_{stem}_{digest.hexdigest()[:16]}.npz"
