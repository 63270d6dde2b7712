"""`homofact measure`: the directions to measure next, their order on a goniometer, and whether to stop."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from homofact.cli import options as o
from homofact.cli.screen import Screen
from homofact.cli.tables import facts_table
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.api.measuring import MeasureResult
    from homofact.config import Config

_GONIOMETER, _PLAN = "The goniometer", "What to choose"
_WIDE = 2.0  # factor of an interval from which a percentage says nothing


def _limits(name: str, text: str) -> tuple[float, float]:
    try:
        low, high = (float(word) for word in text.split(","))
    except ValueError:
        raise BadInput(where=name, found=repr(text), expected="two degrees such as 0,80") from None
    return low, high


def _option(help: str, panel: str | None, metavar: str | None = None, shown: bool = True) -> Any:
    return typer.Option(help=help, metavar=metavar, show_default=shown, rich_help_panel=panel)


_Samples = Annotated[
    list[str] | None,
    typer.Argument(metavar="SAMPLES...", help="Files of all samples so far; none for the first round."),
]
_Directions = Annotated[int | None, _option("Number of single directions to choose. Default: 5.", _PLAN, shown=False)]
_Incidences = Annotated[
    int | None,
    _option(
        "Number of incidence angles to choose, instead of single directions. The goniometer measures"
        " each of them at all view directions.",
        _PLAN,
        shown=False,
    ),
]
_Stop = Annotated[float, _option("Stop if three more rings would change the picture by less than this share.", _PLAN)]
_Channels = Annotated[
    str,
    _option(
        "Names of the value columns in the CSV, separated by commas. If you give SAMPLES, their columns are"
        " used instead.",
        None,
    ),
]
_Out = Annotated[
    Path | None, _option("File for the chosen directions; you fill in the measured values.", None, "FILE.csv", False)
]
_Complete = Annotated[
    Path | None,
    _option(
        "File for 12,000 samples of the whole material, predicted from your samples and the statistics. Use it as"
        " input of homofact factorize.",
        None,
        "FILE.csv",
        False,
    ),
]
_FAR = "Default: 0,80, or farther if the samples reach farther."
_ThetaI = Annotated[str | None, _option(f"Limits of the light's angle, in degrees. {_FAR}", _GONIOMETER, "A,B")]
_ThetaO = Annotated[str | None, _option(f"Limits of the detector's angle, in degrees. {_FAR}", _GONIOMETER, "A,B")]
_Phi = Annotated[
    str,
    _option(
        "Limits of the azimuth difference of light and detector, in degrees. At 180, the detector is on the side of"
        " the mirror direction.",
        _GONIOMETER,
        "A,B",
    ),
]
_Separation = Annotated[float, _option("Smallest possible angle between light and detector, in degrees.", _GONIOMETER)]
_Resolution = Annotated[
    float, _option("Angular resolution in degrees. All chosen angles are multiples of it.", _GONIOMETER)
]
_Rings = Annotated[
    float, _option("Step of the detector's polar angle at one incidence angle, in degrees.", _GONIOMETER)
]
_Azimuths = Annotated[float, _option("Step of the azimuth at one incidence angle, in degrees.", _GONIOMETER)]
_Speed = Annotated[float, _option("Speed of each axis, in degrees per second.", _GONIOMETER)]
_Settle = Annotated[float, _option("Settling time of an axis after each move, in seconds.", _GONIOMETER)]


@o.configured("output.force", "seed")
def measure(
    settings: "Config",
    samples: _Samples = None,
    directions: _Directions = None,
    incidences: _Incidences = None,
    stop: _Stop = 0.01,
    channels: _Channels = "R,G,B",
    out: _Out = None,
    complete: _Complete = None,
    theta_i: _ThetaI = None,
    theta_o: _ThetaO = None,
    phi: _Phi = "0,180",
    separation: _Separation = 5.0,
    resolution: _Resolution = 0.25,
    rings: _Rings = 10.0,
    azimuths: _Azimuths = 20.0,
    speed: _Speed = 10.0,
    settle: _Settle = 1.0,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Choose the directions that a goniometer should measure next.

    This command works for isotropic materials only. It combines your samples so far with statistics of 128
    materials, and chooses the directions that reduce the expected error of pictures, albedo and highlight most.
    It writes them to a CSV file (--out). Measure these directions, fill in the values, and run the command again
    with all files.
    """
    given = (("theta_i", theta_i), ("theta_o", theta_o), ("phi", phi))
    limits = {name: _limits(name, text) for name, text in given if text is not None}

    from homofact.api.measuring import measure

    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        goniometer = limits | {
            "separation": separation, "resolution": resolution, "rings": rings, "azimuths": azimuths, "speed": speed,
            "settle": settle,
        }  # fmt: skip
        found = measure(
            list(samples or []) or None, directions=directions, incidences=incidences, goniometer=goniometer, to=out,
            complete=complete, channels=tuple(name.strip() for name in channels.split(",")), stop=stop,
            seed=settings.seed, force=settings.output.force, progress=progress,
        )  # fmt: skip
    if found.misfit > 3:
        screen.note(
            f"homofact: the material is unlike the 128 known ones: errors are {found.misfit:.1f} times as wide as usual"
        )
    if not (quiet and found.files):
        screen.show(*_shown(found, stop))
    screen.show(*(f"{file}" for file in found.files))
    screen.answer(found.record())


def _shown(found: "MeasureResult", stop: float) -> list[Any]:
    count = 0 if found.samples is None else len(found.samples)
    told = found.foretold
    albedo, highlight = (
        [
            f"{_with_interval(*pair)} at {degrees:g}°"
            for *pair, degrees in zip(values, factors, told.degrees, strict=True)
        ]
        for values, factors in ((told.albedo, told.albedo_factor), (told.highlight, told.highlight_factor))
    )
    limit = f"the limit of {stop:.2%}".replace(".00%", "%")
    more = f"above {limit}, another round pays" if not found.stop else f"below {limit}, you can stop"
    highest = "" if found.highest is None else f", θ up to {found.highest:.0f}°; beyond, only the prior is used"
    facts = {
        "samples so far": f"{count}{highest}",
        "sphere PSNR": f"about {told.psnr:.1f} dB, above {told.psnr_least:.1f} dB in nine of ten cases",
        "albedo": albedo,
        "albedo of the highlight": highlight,
        "chosen": f"{len(found.angles)} directions"
        + (f" of {len(found.incidences)} incidences" if found.incidences else "")
        + f", θi {_between(found.goniometer.theta_i)}, θo {_between(found.goniometer.theta_o)} (--theta-i, --theta-o)",
        "squared error": f"expected to fall to {found.remaining:.0%} of the present one",
        "time of moves": f"{found.seconds:.0f} s in this order ({found.seconds_unordered:.0f} s without reordering)",
        "pictures": f"expected to change by {found.change:.1%}",
        "three rings more": f"expected to change the pictures by {found.change_by_rings:.1%}: {more}",
    }
    shown: list[Any] = [
        facts_table("Where to measure next", facts),
        "Albedo and highlight are means of the channels, estimated from the samples and a prior of 128 materials. The"
        " verdict of a fit does not use the prior: its limits may differ, and it may advise more directions.",
    ]
    if not found.files:
        shown += [f"theta_i {one:g}, theta_o {two:g}, phi {three:g}" for one, two, three in found.angles]
    return shown


def _between(limits: tuple[float, float]) -> str:
    low, high = limits
    return f"{low:g}–{high:g}°"


def _with_interval(value: float, factor: float) -> str:
    """A value with its 90% interval: in percent, or as a factor where that is wide."""
    return f"{value:.3g} ± {factor - 1:.0%}" if factor <= _WIDE else f"{value:.3g} within a factor of {factor:.2g}"
