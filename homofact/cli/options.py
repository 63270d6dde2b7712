"""The options that commands share, each declared once.

Every default here is None, "not given", so that a configuration file can fill it in; the default that
`--help` shows is written out, because reading it off the dataclasses would import torch. A test compares.
"""

from pathlib import Path
from typing import Annotated, Any

import typer

from homofact.errors import BadInput

_SOURCE, _FIT, _OUTPUT = "The source", "The fit", "Output"
# `factor.kinds.KINDS`, written out like the defaults.
KINDS = (
    "wi", "wo", "h", "d", "theta_h-theta_d", "theta_d-phi_d", "theta_h-phi_d", "theta_i-theta_o",
    "theta_i-delta_phi", "theta_h", "theta_d", "theta_i", "in-out", "half-diff", "isotropic-half-diff",
    "isotropic-in-out",
)  # fmt: skip

Source = Annotated[
    str | None,
    typer.Argument(metavar="SOURCE", help="A measurement's file, or material:NAME.", show_default=False),
]
Result = Annotated[Path, typer.Argument(metavar="RESULT", help="A result's folder, or its factorization.npz.")]
MadeFrom = Annotated[
    str | None,
    typer.Option(
        metavar="SOURCE",
        help="What the fit was made from: a measurement's file, or material:NAME. Found by itself where it can be.",
        show_default=False,
    ),
]
Channels = Annotated[
    str | None,
    typer.Option(
        help="rgb, luminance, spectral, or one channel's name. Default: rgb.",
        show_default=False,
        rich_help_panel=_SOURCE,
    ),
]
Count = Annotated[
    int | None,
    typer.Option(
        help="Pairs drawn from an analytic model. Default: 45000.",
        show_default=False,
        rich_help_panel=_SOURCE,
    ),
]
Scheme = Annotated[
    str | None,
    typer.Option(
        help="How they are drawn: discs, cosine or grid. Default: discs.",
        show_default=False,
        rich_help_panel=_SOURCE,
    ),
]
Subset = Annotated[
    int | None,
    typer.Option(
        help="Most samples that a fit is given, drawn by cells; 0 is all. Default: 0.",
        show_default=False,
        rich_help_panel=_SOURCE,
    ),
]
HeldOut = Annotated[
    float | None,
    typer.Option(
        help="Part of the samples kept from the fit. Default: 0.2.",
        show_default=False,
        rich_help_panel=_SOURCE,
    ),
]


def _fit(help: str, default: str, *names: str) -> Any:
    return typer.Option(*names, help=f"{help} Default: {default}.", show_default=False, rich_help_panel=_FIT)


Method = Annotated[str | None, _fit("search, cole (the thesis), mccool, svd or nmf.", "search")]
Textures = Annotated[int | None, _fit("How many textures at most; terms of svd and nmf.", "2")]
Size = Annotated[int | None, _fit("Texels on a side of a texture.", "16")]
Parameterization = Annotated[
    str | None,
    _fit(
        "What textures are indexed by. For cole, svd and nmf half-diff or in-out. For search one kind for all, or"
        f" one each joined by +: {', '.join(KINDS)}.",
        "by method",
    ),
]
Reciprocal = Annotated[
    bool | None,
    _fit("Enforce f(wi, wo) = f(wo, wi).", "on", "--reciprocal/--no-reciprocal"),
]
Solver = Annotated[str | None, _fit("Of the inner problem: cholesky, qr, lsmr, cg or qmr.", "cholesky")]
Smoothing = Annotated[float | None, _fit("Weight of the Laplacian, in samples a texel.", "by method")]
Epsilon = Annotated[float | None, _fit("Of the log transform, in units of the mean.", "by the source")]
Together = Annotated[int | None, _fit("How many of the last textures cole solves together; 0 is all.", "2")]
Restarts = Annotated[int | None, _fit("Random starts of the search for each texture.", "6")]
Search = Annotated[
    str | None, _fit("How search refines: gradient, powell, or nlopt-NAME such as nlopt-PRAXIS.", "gradient")
]
Validation = Annotated[
    str | None, _fit("What search leaves out to judge by: rings of a goniometer, or samples at random.", "rings")
]
Budget = Annotated[float | None, _fit("Seconds that search may take.", "20.0")]
Refine = Annotated[str | None, _fit("looks: a last descent of search on the linear error; or none.", "none")]
SearchSize = Annotated[int | None, _fit("Texels on a side during the search; 0 is --size.", "by method")]
SearchSamples = Annotated[int | None, _fit("Samples during the search; 0 is all.", "8000")]
Copies = Annotated[int | None, _fit("Azimuth copies of an isotropic measurement.", "8")]
Mirrored = Annotated[bool | None, _fit("Mirrored copies beside them.", "on", "--mirrored/--no-mirrored")]
Robust = Annotated[
    bool | None, _fit("Give outliers little weight in the last solve (Huber).", "off", "--robust/--no-robust")
]
Confidence = Annotated[
    bool | None,
    _fit("Leave every texel's standard deviation beside the textures.", "off", "--confidence/--no-confidence"),
]
Quantize = Annotated[str | None, _fit("Texels that png8 or png16 hold exactly, fitted so; or none.", "none")]
Bound = Annotated[str | None, _fit("How a projection fills its texture: disc, or the thesis's cube.", "disc")]
Projections = Annotated[str | None, _fit("Fixed projections for mccool, by name, with commas.", "McCool's own")]
Map = Annotated[
    str | None, _fit("Of directions to textures, for svd and nmf: parabolic, orthographic or polar.", "parabolic")
]
Decomposition = Annotated[
    str | None, _fit("How svd finds its terms: eigen, svd, power, or normalized (one term).", "by symmetry")
]

Seed = Annotated[int | None, typer.Option(help="Of sampling, split and search. Default: 0.", show_default=False)]
Seeds = Annotated[
    int,
    typer.Option(
        "--seeds",
        min=1,
        help="How many seeds to fit by, from --seed on, on one split: means with their spread.",
        rich_help_panel=_FIT,
    ),
]
Strict = Annotated[bool, typer.Option("--strict", help="Refuse a fit that the verdict finds fault with: exit 2.")]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON object on stdout, all else on stderr.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no notes.")]
ConfigFile = Annotated[
    Path | None,
    typer.Option("--config", "-c", metavar="FILE.toml", help="Settings; options given here win over it."),
]
Out = Annotated[
    Path | None,
    typer.Option(metavar="FOLDER", help="Where the result goes.", rich_help_panel=_OUTPUT),
]
Force = Annotated[
    bool | None,
    typer.Option("--force/--no-force", help="Replace a result that is there.", rich_help_panel=_OUTPUT),
]


# Where an option of a command goes in the configuration, by the name of its parameter.
_KEYS = {
    "source": "source.path",
    "channels": "source.channels",
    "count": "source.count",
    "scheme": "source.scheme",
    "subset": "source.subset",
    "held_out": "evaluate.held_out",
    "sources": "chart.sources",
    "methods": "compare.methods",
    "chart_methods": "chart.methods",
    "texture_counts": "chart.textures",
    "sizes": "chart.sizes",
    "searches": "chart.searches",
    "metrics": "compare.metrics",
    "plot": "compare.plot",
    "out": "output.folder",
    "force": "output.force",
    "light": "render.light",
    "environment": "render.environment",
    "pixels": "render.size",
    "picture": "render.file",
    "seed": "seed",
} | {
    name: f"fit.{name}"
    for name in (
        "method",
        "textures",
        "size",
        "parameterization",
        "reciprocal",
        "solver",
        "smoothing",
        "epsilon",
        "together",
        "restarts",
        "search",
        "validation",
        "budget",
        "refine",
        "search_size",
        "search_samples",
        "copies",
        "mirrored",
        "robust",
        "confidence",
        "quantize",
        "bound",
        "projections",
        "map",
        "decomposition",
    )
}
_LISTS = ("methods", "metrics", "chart_methods", "searches", "projections")
_COUNTS = {"texture_counts": "textures", "sizes": "sizes"}


def given(context: typer.Context) -> dict[str, Any]:
    """The command line's options by their key in the configuration; None where one was not given."""
    values: dict[str, Any] = {}
    for name, key in _KEYS.items():
        value = context.params.get(name)
        if name in _LISTS and value is not None:
            value = tuple(part.strip() for part in value.split(",") if part.strip())
        elif name in _COUNTS and value is not None:
            value = _whole_numbers(_COUNTS[name], value)
        elif name == "sources":
            value = tuple(value) if value else None
        elif name == "parameterization" and value is not None:
            value = "+".join(part.strip() for part in value.split("+"))
        elif name == "light" and value is not None:
            value = _direction(value)
        values[key] = str(value) if isinstance(value, Path) else value
    return values


def _whole_numbers(option: str, text: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in text.split(",") if part.strip())
    except ValueError as error:
        raise BadInput(f"{option}: found {text!r}, expected whole numbers with commas") from error


def _direction(text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError as error:
        raise BadInput(f"light: found {text!r}, expected three numbers x,y,z") from error
    return x, y, z
