"""Open the input of a command: a path or material:NAME gives samples and a reflectance."""

import math
import os
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from homofact.brdf.channels import LuminanceOf, OneChannel, as_channels, reading_of
from homofact.brdf.formats import open_file
from homofact.brdf.formats.reading import Drawing
from homofact.brdf.function import FunctionReflectance
from homofact.brdf.in_kind import Pairs
from homofact.brdf.materials import material
from homofact.brdf.quality.coverage import holes, spread
from homofact.brdf.quality.faults import evaluated_faults
from homofact.brdf.quality.mending import looked_at, mended, straightened, wanted
from homofact.brdf.quality.scatter import local_scatter
from homofact.brdf.reflectance import Derived, Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.scattered import Scattered, made_of_samples
from homofact.brdf.source_names import (
    AUTOMATIC,
    DEFAULT_CALIBRATE,
    DEFAULT_COUNT,
    DEFAULT_SCHEME,
    DISMISSED,
    GAINS,
    MATERIAL_PREFIX,
    as_names,
)
from homofact.brdf.symmetry import find_symmetry
from homofact.errors import BadInput
from homofact.geometry.directions import to_spherical
from homofact.linear.threads import one_thread

# ε of the log transform: noise-free values bear the thesis's, measured ones at least this (`measured_epsilon`).
NOISE_FREE_EPSILON = 1e-5
MEASURED_EPSILON = 1e-2


@dataclass(frozen=True)
class Opening:
    """The arguments of `open_source`, and the working folder of a relative path.

    Every source is opened through an `Opening` and stores it. The split of a fit also stores it, so that the same
    samples can be reproduced. `folder` is empty for a material, for an absolute path, and before the source is opened.
    """

    path: str
    channels: str = "rgb"
    count: int = DEFAULT_COUNT
    scheme: str = DEFAULT_SCHEME
    seed: int = 0
    folder: str = ""
    calibrate: tuple[str, ...] = DEFAULT_CALIBRATE
    clipped: float | str | None = None
    dismiss: tuple[str, ...] = ()

    @property
    def is_material(self) -> bool:
        """Whether the source is a named material rather than a file."""
        return self.path.startswith(MATERIAL_PREFIX)

    @one_thread
    def open(self, path: str | None = None) -> "Source":
        """Open the source, from another `path` if given. Raises as `open_source`."""
        text = self.path if path is None else path
        kind, single = reading_of(self.channels)
        source = _opened(text, kind, self.count, self.scheme, self.seed)
        source = _mended(source, text, self.calibrate, self.clipped, self.dismiss)
        if single:
            reflectance = OneChannel(source.reflectance, single)
            source = replace(source, samples=source.samples.channel(single), reflectance=reflectance)
        relative = not text.startswith(MATERIAL_PREFIX) and not os.path.isabs(text)
        return replace(source, opening=replace(self, path=text, folder=os.getcwd() if relative else ""))


@dataclass(frozen=True)
class Source:
    """A BRDF to work on.

    homofact fits `samples`, and renders and compares with `reflectance`, which is the model itself or the interpolated
    measurement. If `kind` is "material" or "drawn" (a reflectance that is defined everywhere), samples were drawn at
    all azimuths. If it is "measurement", they are at the measured directions. `default_epsilon` is the default ε of the
    log transform; `seconds_read` the wall time of reading or sampling. `opening` is how `open_source` opened it, None
    for a source put together by hand.
    """

    name: str
    kind: Literal["material", "measurement", "drawn"]
    samples: Samples
    reflectance: Reflectance
    default_epsilon: float
    seconds_read: float
    opening: Opening | None = None

    def __repr__(self) -> str:
        """In a line, without the values."""
        return f"<Source {self.name}, {self.kind}: {self.samples}>"

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the C channels."""
        return self.samples.channels

    def evaluate(self, wi: Any, wo: Any) -> Any:
        """BRDF values (..., C) in sr⁻¹ without the cosine, at directions (..., 3) of any kind (`brdf.in_kind`)."""
        evaluate: Any = self.reflectance.evaluate
        pairs = Pairs.of(wi, wo)
        return pairs.answer(evaluate(*pairs.tensors()))


def source_of(
    given: Any,
    *,
    channels: str = "rgb",
    count: int = DEFAULT_COUNT,
    scheme: str = DEFAULT_SCHEME,
    seed: int = 0,
    calibrate: Sequence[str] = DEFAULT_CALIBRATE,
    clipped: float | str | None = None,
    dismiss: Sequence[str] = (),
) -> Source:
    """Return the source that `given` is or names.

    A path or "material:NAME" is opened as `open_source` does. `Samples`, or a tuple (wi, wo, values) to create them
    from, are treated as a measurement. A `Reflectance`, or a function f(wi, wo) (`brdf.function`), is sampled at
    `count` pairs drawn by `scheme`. Raises BadInput for anything else, and as `open_source`.
    """
    if isinstance(given, str | os.PathLike):
        drawing = {"count": count, "scheme": scheme, "seed": seed}
        asked = {"calibrate": calibrate, "clipped": clipped, "dismiss": dismiss}
        return open_source(os.fspath(given), channels=channels, **asked, **drawing)
    if channels != "rgb":
        raise BadInput(
            where="channels", found=f"{channels!r} beside {_named(given)}", expected="them with a path or a material"
        )
    if isinstance(given, Source):
        # Whoever opened it decided about "auto".
        return _mended(given, given.name, wanted(calibrate), clipped, dismiss)
    samples = given if isinstance(given, Samples) else samples_of(given)
    if samples is not None:
        return _mended(_measured("samples", samples), "samples", calibrate, clipped, dismiss)
    if wanted(calibrate) or clipped is not None or dismiss:
        where = "calibrate, clipped, dismiss"
        raise BadInput(where=where, found=_named(given), expected="a measurement's samples with them")
    begun = time.perf_counter()
    reflectance = reflectance_of(given)
    name = getattr(given, "__name__", type(given).__name__)
    isotropic = getattr(reflectance, "isotropic", None)
    drawn: Any = reflectance if isotropic is not None else _Drawable(reflectance)
    samples = sample_model(drawn, count, scheme, seed)
    return Source(name, "drawn", samples, reflectance, NOISE_FREE_EPSILON, time.perf_counter() - begun)


def samples_of(given: Any) -> Samples | None:
    """Return the samples in a tuple (wi, wo, values) or (wi, wo, values, weights); None if not a tuple."""
    if not isinstance(given, tuple):
        return None
    if len(given) not in (3, 4):
        raise BadInput(
            where="source", found=f"a tuple of {len(given)}", expected="(wi, wo, values) or (wi, wo, values, weights)"
        )
    return Samples(*given)


def reflectance_of(given: Any) -> Reflectance:
    """Return a `Reflectance` as it is, or that of a function f(wi, wo). Raises BadInput for anything else."""
    if isinstance(given, type) or not (isinstance(given, Reflectance) or callable(given)):
        raise BadInput(
            where="source",
            found=_named(given),
            expected="a path, 'material:NAME', Samples, (wi, wo, values), a reflectance or a function f(wi, wo)",
        )
    return given if isinstance(given, Reflectance) else FunctionReflectance(given)


def _named(given: Any) -> str:
    """What a value is, in a word or two, for messages."""
    return f"the class {given.__name__}" if isinstance(given, type) else type(given).__name__


@dataclass(frozen=True)
class _Drawable(Derived):
    """A reflectance without a flag for isotropy, which is then tested by evaluation."""

    @property
    def isotropic(self) -> bool:
        """Whether values stay the same where both directions turn about the normal."""
        return find_symmetry(self.base).isotropic


def _measured(name: str, samples: Samples) -> Source:
    epsilon = measured_epsilon(samples)
    return Source(name, "measurement", samples, Scattered(samples, epsilon=epsilon), epsilon, 0.0)


def open_source(
    text: str,
    *,
    channels: str = "rgb",
    count: int = DEFAULT_COUNT,
    scheme: str = DEFAULT_SCHEME,
    seed: int = 0,
    calibrate: Sequence[str] = DEFAULT_CALIBRATE,
    clipped: float | str | None = None,
    dismiss: Sequence[str] = (),
) -> Source:
    """Return the source that `text` names: material:NAME, or the path of a file whose content is sniffed.

    `channels` are "rgb", "luminance", "spectral", or one channel's name ("G", "550nm"). `count`, `scheme` and `seed`
    set how a material, or a model in a file, is sampled; they have no effect on a measurement. FILE#NAME picks one
    material of a file that holds several. `calibrate` and `clipped` repair a measurement (`brdf.quality.mending`);
    `dismiss` names suspicions that you have checked and found wrong, so they are not raised again
    (`suspicion.dismissal`).

    Raises BadInput for an unknown material, faults of a file, channels that the source does not have, and repairs that
    this kind of source does not support.
    """
    repairs = as_names(calibrate)
    return Opening(text, channels, count, scheme, seed, "", repairs, clipped, as_names(dismiss)).open()


def _mended(
    source: Source, name: str, calibrate: Sequence[str], clipped: float | str | None, dismiss: Sequence[str]
) -> Source:
    """The source with what is known of its instrument undone; samples are interpolated anew where they change."""
    kinds = wanted(calibrate)
    reflectance, samples = straightened(name, source.reflectance, source.samples, calibrate)
    if dismiss:
        from homofact.brdf.quality.suspicion.dismissal import dismissed

        if source.kind == "material":
            raise BadInput(where="dismiss", found=f"it with {name}", expected="a measurement with it")
        samples = dismissed(samples, dismiss)
    source = replace(source, reflectance=reflectance, samples=samples)
    listed = made_of_samples(source.reflectance)
    gains = [kind for kind in kinds if kind in GAINS]
    if not listed and (gains or clipped is not None):
        option = "calibrate" if gains else "clipped"
        raise BadInput(f"{name} can be evaluated anywhere", where=option, expected="a measurement's samples with it")
    if not listed or (not kinds and clipped is None):
        return source
    samples = mended(source.samples, kinds, clipped)
    return replace(source, samples=samples, reflectance=Scattered(samples, epsilon=source.default_epsilon))


def with_tilt_looked_at(source: Source) -> Source:
    """Return a source of scattered samples with the tilt found in them recorded in their provenance.

    Others are returned as they are, and so is a source that was opened without "auto" in `calibrate`.
    """
    asked = source.opening is None or AUTOMATIC in source.opening.calibrate
    if not asked or source.kind != "measurement" or not made_of_samples(source.reflectance):
        return source
    return replace(source, samples=looked_at(source.samples))


def _opened(text: str, channels: str, count: int, scheme: str, seed: int) -> Source:
    """The source in the channels that a reader knows: "rgb", "luminance" or "spectral"."""
    begun = time.perf_counter()
    if text.startswith(MATERIAL_PREFIX):
        found = material(text.removeprefix(MATERIAL_PREFIX))
        if channels == "spectral":
            raise BadInput(
                where="channels", found=f"'spectral' for {text}, which is an RGB model", expected="rgb or luminance"
            )
        samples = sample_model(found.model, count, scheme, seed)
        facts = {
            "format": "analytic model",
            "material": found.name,
            "model": type(found.model).__name__,
            "parameters": _plain(asdict(found.model)),
            "comments": [found.source],
        }
        samples = as_channels(replace(samples, provenance=samples.provenance | facts), channels)
        reflectance = LuminanceOf(found.model) if channels == "luminance" else found.model
        seconds = time.perf_counter() - begun
        return Source(found.name, "material", samples, reflectance, NOISE_FREE_EPSILON, seconds)
    reading = open_file(text, channels, Drawing(count, scheme, seed))
    samples = replace(reading.samples, provenance=reading.samples.provenance | {"file": Path(text).name})
    epsilon = NOISE_FREE_EPSILON if samples.provenance.get("noise_free") is True else measured_epsilon(samples)
    seconds = time.perf_counter() - begun
    reflectance = Scattered(samples, epsilon=epsilon) if reading.reflectance is None else reading.reflectance
    drawn = reading.reflectance is not None and "sampling" in samples.provenance
    return Source(Path(text).name, "drawn" if drawn else "measurement", samples, reflectance, epsilon, seconds)


def measured_epsilon(samples: Samples) -> float:
    """ε for a measurement: 1e-2, or the scatter of its dark samples (`brdf.quality.scatter`) where that is over twice
    as much.

    The result is at most 0.2: a larger scatter is not a noise floor of dark samples.
    """
    scatter = local_scatter(samples)
    if scatter is None or scatter.floor <= 2 * MEASURED_EPSILON:
        return MEASURED_EPSILON
    return min(float(f"{scatter.floor:.1g}"), 0.2)


def describe(source: Source) -> dict[str, Any]:
    """Return what is in a source, JSON-able: format, units, comments, wavelengths, counts, angles, values, faults.

    `units` states the unit and the factors that were divided out. `spread_degrees` is `coverage.spread`. The faults are
    those found by the reader, those of the whole BRDF (`faults.evaluated_faults`), the holes (`coverage.holes`), and
    the scatter of neighbouring samples (`scatter.local_scatter`), an upper bound of the noise.
    """
    samples = source.samples
    facts = samples.provenance
    values = samples.values
    scattered = made_of_samples(source.reflectance)
    scatter = local_scatter(samples) if scattered else None
    ranges = {}
    for name, direction in (("theta_i", samples.wi), ("theta_o", samples.wo)):
        degrees = to_spherical(direction)[0] * (180 / math.pi)
        ranges[f"{name}_degrees"] = [round(float(degrees.min()), 4), round(float(degrees.max()), 4)]
    return {
        "source": source.name,
        "kind": source.kind,
        "format": facts.get("format", "unknown"),
        "units": facts.get("units", "1/sr, no cosine"),
        "comments": facts.get("comments", []),
        "wavelengths_nm": facts.get("wavelengths_nm"),
        "samples": len(samples),
        "channels": list(samples.channels),
        "isotropic": samples.isotropic,
        **ranges,
        "spread_degrees": spread(samples),
        "values_per_sr": {
            name: {
                "min": float(values[:, c].min()),
                "mean": float(values[:, c].mean()),
                "max": float(values[:, c].max()),
                "zeros": int((values[:, c] == 0).sum()),
            }
            for c, name in enumerate(samples.channels)
        },
        "faults": facts.get("faults", {})
        | evaluated_faults(samples, source.reflectance, own=not scattered)
        | {"holes": holes(samples)}
        | ({} if scatter is None else {"scatter": round(scatter.relative, 6)}),
        "colour": facts.get("colour"),
        "sampling": facts.get("sampling"),
        "gains": facts.get("gains"),
        "tilt": facts.get("tilt"),
        "clipped": facts.get("clipped"),
        DISMISSED: facts.get(DISMISSED),
        "material": {key: facts[key] for key in ("material", "model", "parameters") if key in facts} or None,
        "default_epsilon": source.default_epsilon,
        "seconds_read": source.seconds_read,
    }


def _plain(value: Any) -> Any:
    """Tuples as lists, so that the facts look the same before and after JSON."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value
