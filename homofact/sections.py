"""The sections of a configuration: frozen dataclasses whose fields declare the keys and the options, see `config`."""

import math
import typing
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from homofact.brdf.source_names import (
    CALIBRATIONS,
    CHANNELS,
    DEFAULT_CALIBRATE,
    DEFAULT_COUNT,
    DEFAULT_SCHEME,
    HELD_OUT,
    MOST_COUNT,
    SCHEMES,
)
from homofact.errors import BadInput
from homofact.methods.search import Search
from homofact.methods.table import METHODS, MODELS_BY_NAME, SHIPPED, made, made_each, unused_settings
from homofact.settings.options import check_options, none_twice, option

if TYPE_CHECKING:
    from homofact.brdf.source import Opening
    from homofact.methods.method import Method

SOURCE, FIT, OUTPUT = "The source", "The fit", "Output"
COMPARED = ("mccool", "cole", "search")
# What a chart varies, by the setting of a method, where nothing else is given.
CHARTED = {"textures": (1, 2, 3), "size": (8, 16, 32), "search": ("gradient",)}


def _expected_channels(value: str) -> str | None:
    if value in (*CHANNELS, "R", "G", "B") or value.endswith("nm"):
        return None
    return f"{', '.join(CHANNELS)}, or one channel such as G or 550nm"


def _expected_level(value: float | str) -> str | None:
    return "a number above 0, or found" if isinstance(value, str) and value != "found" else None


def _several(value: tuple[Any, ...]) -> str | None:
    return None if value and len(set(value)) == len(value) else "at least one, no repeats"


class _Checked:
    """A section whose values are checked by what its fields declare."""

    def __post_init__(self) -> None:
        """Refuse what cannot be meant. Raises BadInput."""
        check_options(self)


@dataclass(frozen=True)
class SourceSettings(_Checked):
    """What is read: a file's path or `material:NAME`, its channels, and how a model is sampled.

    `count` (pairs of directions) and `scheme` apply only to analytic models. If `subset` is above 0, it is the maximum
    number of samples for a fit, drawn by cells (`brdf.stratified`). `calibrate` and `clipped` repair a measurement
    (`brdf.quality.mending`); suspicions in `dismiss` were checked and are not raised again.
    """

    path: str | None = option(
        None, "A measurement file, or material:NAME", flag="source", argument=True, metavar="SOURCE"
    )
    channels: str = option(
        "rgb",
        "rgb, luminance, spectral, or one channel's name",
        expected_instead=_expected_channels,
        panel=SOURCE,
        everyday=True,
    )
    count: int = option(
        DEFAULT_COUNT,
        "Number of pairs of directions sampled from an analytic model",
        least=1,
        most=MOST_COUNT,
        panel=SOURCE,
    )
    scheme: str = option(
        DEFAULT_SCHEME,
        "Distribution of the pairs of directions sampled from an analytic model (lobe: half of them around the"
        " highlight, half as with discs; discs: uniform in the parabolic discs, as in Cole's thesis; cosine: by the"
        " cosines of both angles; grid: a regular grid in the discs)",
        choices=SCHEMES,
        panel=SOURCE,
    )
    calibrate: tuple[str, ...] = option(
        DEFAULT_CALIBRATE,
        "Faults of the instrument to correct (tilt: a tilt of the sample; rings: a gain per ring of angles; rows: a"
        " drift of the lamp; auto: a tilt, but only in complete tables and only if the evidence is clear)",
        choices=CALIBRATIONS, separators="+,", metavar="A+B",
        expected_instead=none_twice, panel=SOURCE, everyday=True,
    )  # fmt: skip
    clipped: float | str | None = option(
        None, "Clipping level in sr⁻¹: the true values may be larger than the values at or above it; the word found"
        " detects the level",
        above=0, metavar="LEVEL", none="no value is treated as clipped", expected_instead=_expected_level, panel=SOURCE,
    )  # fmt: skip
    dismiss: tuple[str, ...] = option(
        (), "Names of suspicions, as homofact info prints them, that you have checked and found wrong, or all. Verdicts"
        " then ignore them", separators="+,", metavar="A+B", expected_instead=none_twice, panel=SOURCE,
    )  # fmt: skip
    subset: int = option(
        0,
        "Maximum number of samples for the fit; 0 uses all. The selection keeps the highlight and grazing angles",
        least=0,
        panel=SOURCE,
    )

    def opening(self, seed: int, path: str | None = None) -> "Opening":
        """Return the `Opening` of the source, or of another `path`; `seed` draws the samples of a model."""
        from homofact.brdf.source import Opening

        text = str(self.path) if path is None else path
        return Opening(
            text, self.channels, self.count, self.scheme, seed, "", self.calibrate, self.clipped, self.dismiss
        )


@dataclass(frozen=True)
class EvaluateSettings(_Checked):
    """`held_out`: the held-out share of the samples, drawn with the seed; only `factorize` accepts 0."""

    held_out: float = option(
        HELD_OUT,
        "Share of the samples held out from the fit. Only factorize accepts 0",
        least=0,
        below=1,
        panel=SOURCE,
    )


@dataclass(frozen=True)
class CompareSettings(_Checked):
    """Settings of a comparison: fit `methods` to each of `sources`, or to the source in [source].

    A method is a name, `mccool:` and fixed projections joined with "+" (`mccool:theta_h-theta_d+wi`), `ggx:` and a
    number of lobes, or `svd:` and coordinates. `plot` is the file of the figure. `metrics` names the metrics: six, all,
    or single metrics. `csv` and `latex` are files for their means and standard deviations over sources and seeds; with
    `by_source`, the LaTeX table also has rows for each source. If `sources` are saved fits and `on` names a
    measurement, the fits are compared on it. If `chart` names a folder, each source is fitted with all combinations of
    methods, `textures`, `size` and `search` instead. `textures` does not apply to McCool's fixed projections, and
    `search` applies only to the method `search`.
    """

    sources: tuple[str, ...] = option(
        (),
        "Measurement files, material:NAME, or folders that homofact wrote",
        argument=True,
        metavar="SOURCE...",
        expected_instead=none_twice,
    )
    methods: tuple[str, ...] = option(
        COMPARED,
        f"Methods, separated by commas ({', '.join((*METHODS, *MODELS_BY_NAME))}); mccool:A+B uses the fixed"
        " projections A and B, ggx:2 fits two lobes, svd:half-diff uses half-diff coordinates",
        expected_instead=_several,
    )
    plot: str | None = option(None, "Draw the errors (.png, .pdf, .svg)", metavar="FILE")
    csv: str | None = option(
        None, "Write means and standard deviations over sources, seeds and splits (.csv)", metavar="FILE"
    )
    latex: str | None = option(
        None, "Write means and standard deviations as a LaTeX table for booktabs (.tex)", metavar="FILE"
    )
    by_source: bool = option(False, "In the LaTeX table, add rows for each single source")
    on: str | None = option(None, "Compare saved fits on this measurement instead of their own source", metavar="FILE")
    metrics: tuple[str, ...] = option(
        ("six",),
        "Metrics: six (those of Cole's thesis), all, or names separated by commas. An unknown name makes the command"
        " list all names",
    )
    chart: str | None = option(
        None,
        "Fit many sizes, and draw charts of error against bytes and of error against time into this folder",
        metavar="FOLDER",
    )
    textures: tuple[int, ...] | None = option(
        None, "Number of textures; for a chart several, separated by commas", expected_instead=_several,
        none="2; 1,2,3 for a chart", metavar="N[,N...]", panel=FIT, everyday=True,
    )  # fmt: skip
    size: tuple[int, ...] | None = option(
        None, "Texels per side; for a chart several, separated by commas", expected_instead=_several,
        none="16; 8,16,32 for a chart", metavar="N[,N...]", panel=FIT, everyday=True,
    )  # fmt: skip
    search: tuple[str, ...] | None = option(
        None,
        "Optimizer of the projections: gradient, powell, or nlopt-NAME such as nlopt-PRAXIS; for a chart several,"
        " separated by commas",
        expected_instead=_several, none="gradient", panel=FIT,
    )  # fmt: skip


@dataclass(frozen=True)
class OutputSettings(_Checked):
    """Where the result goes (`folder`), and whether a result already there is replaced (`force`)."""

    folder: str | None = option(
        None,
        "Folder for the result. Required, here or in the configuration file",
        flag="out",
        metavar="FOLDER",
        panel=OUTPUT,
    )
    force: bool = option(False, "Replace an existing result", panel=OUTPUT)


@dataclass(frozen=True)
class RenderSettings(_Checked):
    """How a sphere or a relit scene is drawn.

    `light` is a vector of any length towards a directional light; None means the light of the comparison pictures.
    `environment` is a lat-long .hdr or .exr file that replaces this light. `exposure` is a number of stops above the
    automatic exposure, `tonemap` the tone curve (`rendering.tonemap`), `size` the picture's height in pixels, and
    `file` the output file. `camera`, `eye` and `target` are for scenes.
    """

    light: tuple[float, float, float] | None = option(
        None, "Direction towards a directional light: x right, y up, z to the viewer", metavar="X,Y,Z"
    )
    environment: str | None = option(
        None,
        "Latitude-longitude environment map (.hdr or .exr), or a built-in sky: overcast, studio, uniform; instead of"
        " the directional light",
        metavar="FILE.hdr",
    )
    exposure: float = option(0.0, "Added to the automatic exposure", unit="stops", least=-20, most=20, metavar="STOPS")
    tonemap: str = option("filmic", "Tone curve of the picture", choices=("filmic", "srgb"))
    size: int | None = option(
        None,
        "Height of the picture; a sphere's picture is as wide. Default: 384 for a sphere, the camera's for a scene",
        least=16,
        most=8192,
        unit="pixels",
    )
    camera: str | None = option(None, "Name or number of a scene's camera. Default: the first", metavar="NAME")
    eye: tuple[float, float, float] | None = option(
        None, "Point from which to look at a scene, instead of the camera's", metavar="X,Y,Z"
    )
    target: tuple[float, float, float] | None = option(
        None, "Point of a scene to look at, instead of the camera's", metavar="X,Y,Z"
    )
    file: str | None = option(None, "File for the picture", flag="out", metavar="FILE.png")

    def __post_init__(self) -> None:
        """Refuse a light without direction and a picture too small to hold a sphere. Raises BadInput."""
        super().__post_init__()
        if self.light is not None and not 0 < math.hypot(*self.light) < math.inf:
            raise BadInput(where="light", found=self.light, expected="a direction x,y,z that is not zero")
        if self.light is not None and self.environment is not None:
            raise BadInput(where="light", found="beside an environment", expected="one of the two")


@dataclass(frozen=True)
class FitSection:
    """[fit]: the name of a method, with the settings from the file (`places` has their positions) or the options.

    `method_alone` makes the method object from it, and `methods` makes those of several labels. Both raise BadInput for
    an invalid setting, and for a setting that no such method has.
    """

    method: str = option(
        Search.name,
        f"Fitting method: {', '.join(SHIPPED)}. cole reproduces Cole's thesis; ggx is a model without textures",
        panel=FIT,
        everyday=True,
    )
    settings: Mapping[str, Any] = field(default_factory=dict)
    places: Mapping[str, str] = field(default_factory=dict)

    def method_alone(self) -> "Method":
        """Return the method with all of the settings. Raises BadInput also for a method without shaders."""
        # "npf" is a model as well as "ggx:2".
        if self.method.partition(":")[0] in MODELS_BY_NAME.keys() - SHIPPED.keys():
            expected = f"one of {', '.join(SHIPPED)}; other models are for homofact compare"
            raise BadInput(where=self.places.get("method", "method"), found=repr(self.method), expected=expected)
        return self._placed(lambda: made(self.method, self.settings))

    def methods(self, labels: Iterable[str]) -> "dict[str, Method]":
        """Return the methods of several labels, each with those of the settings that it has."""
        return self._placed(lambda: made_each(labels, self.settings))

    def unused(self, labels: Iterable[str]) -> dict[str, str]:
        """Return the settings that none of the methods of these labels has, each with a sentence about it."""
        return unused_settings(labels, self.settings)

    def with_settings(self, settings: Mapping[str, Any]) -> "FitSection":
        """Return the section with other settings, which replace or extend its own."""
        return FitSection(self.method, {**self.settings, **settings}, self.places)

    def without(self, *names: str) -> "FitSection":
        """Return the section without these settings."""
        kept = {name: value for name, value in self.settings.items() if name not in names}
        return FitSection(self.method, kept, self.places)

    def _placed(self, make: typing.Callable[[], Any]) -> Any:
        try:
            return make()
        except BadInput as error:
            if error.where in self.places:
                raise error.moved_to(self.places[error.where]) from error
            raise
