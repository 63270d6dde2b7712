"""The options of the commands, grown from what the settings' dataclasses declare, and the few that are no settings.

`configured` gives a command the options of whole sections of the configuration, or of single keys, and hands it the
`config.Config` that they and the file make. Every such default is None, "not given", so that a file can fill it in;
help and the default shown are the field's own.
"""

import functools
import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperOption

from homofact.config import SEED, fit_options, load_config, section_options
from homofact.methods.table import METHODS
from homofact.sections import FIT, SOURCE
from homofact.settings.options import Declared

Result = Annotated[Path, typer.Argument(metavar="RESULT", help="A result folder, its factorization.npz, or an export.")]
MadeFrom = Annotated[
    str | None,
    typer.Option(
        metavar="SOURCE",
        help="Source of the fit, for its errors: a measurement file, or material:NAME. By default homofact uses the"
        " source recorded in the fit. It looks for a moved file in the working folder and near the result.",
        show_default=False,
    ),
]
Seeds = Annotated[
    int,
    typer.Option(
        "--seeds",
        min=1,
        help="Number of seeds, starting with --seed. All seeds use the same split. The command prints means and"
        " standard deviations.",
        rich_help_panel=FIT,
    ),
]
Strict = Annotated[
    str,
    typer.Option(
        "--strict",
        metavar="[=P]",
        help="Exit with code 2 if the verdict warns of the fit. With --strict=0.05: exit with code 2 if the fit is"
        " bad with a probability above 5%.",
        show_default=False,
    ),
]
Refuse = Annotated[
    str,
    typer.Option(
        "--refuse",
        metavar="A+B",
        help="Exit with code 2 if the verdict contains any of these findings, for example reciprocity+zeros.",
        show_default=False,
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object to stdout, and everything else to stderr.")]
Quiet = Annotated[
    bool,
    typer.Option(
        "--quiet", "-q", help="Print no progress and no notes. If the command writes files, print no tables either."
    ),
]
ConfigFile = Annotated[
    Path | None,
    typer.Option(
        "--config",
        "-c",
        metavar="FILE.toml",
        help="Read settings from this file; options on the command line override it.",
    ),
]


def _show_all(context: typer.Context, wanted: bool | None) -> None:
    if wanted:
        for each in context.command.params:
            if isinstance(each, TyperOption):
                each.hidden = False
        typer.echo(context.get_help())
        raise typer.Exit


HelpAll = Annotated[
    bool | None,
    typer.Option(
        "--help-all", is_eager=True, callback=_show_all, help="Show all options, including those for research."
    ),
]
# More options than these of a configuration, and --help shows the everyday ones.
_LONG = 20


def configured(*keys: str, but: tuple[str, ...] = ()) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a command with the options of the configuration's `keys`, without those in `but`.

    A key is dotted ("evaluate.held_out"), a section's name for all that is in it, or "seed". The command's first
    parameter is the `config.Config`; its own arguments come before the options, its own options after them.
    """
    wanted = {key: option for key, option in _every_option().items() if _covers(keys, key) and not _covers(but, key)}
    # In the order in which they are asked for.
    wanted = {key: wanted[key] for asked in keys for key in wanted if _covers((asked,), key)}

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = list(inspect.signature(command).parameters.values())[1:]
        grown = {key.replace(".", "_"): key for key in wanted}
        parameters = [each for each in own if _is_argument(each)]
        long = len(wanted) > _LONG
        parameters += [_parameter(name, wanted[key], long) for name, key in grown.items()]
        parameters.append(_with_default("config", ConfigFile))
        parameters += [each for each in own if not _is_argument(each)]
        if long:
            parameters.append(_with_default("help_all", HelpAll))

        @functools.wraps(command)
        def run(**values: Any) -> None:
            file = values.pop("config")
            values.pop("help_all", None)
            given = {key: wanted[key].given(values.pop(name)) for name, key in grown.items()}
            command(load_config(file, given), **values)

        run.__dict__["__signature__"] = inspect.Signature(
            [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in parameters]
        )
        run.__annotations__ = {}
        return run

    return decorate


class Grown:
    """One option of the command line: what declares it (a setting of several methods: one each), and its words."""

    def __init__(self, by_method: Mapping[str, Declared]) -> None:
        """`by_method` maps the methods' names to their declarations, or "" to the only one."""
        self._by_method = dict(by_method)
        self._first = next(iter(self._by_method.values()))

    @property
    def panel(self) -> str | None:
        """Its heading."""
        return FIT if "" not in self._by_method else self._first.option.panel

    def info(self, hidden: bool) -> Any:
        """Typer's own description; `hidden` from the help that is not asked for everything."""
        option, flag = self._first.option, f"--{self._first.flag}"
        if option.argument:
            return typer.Argument(metavar=option.metavar, help=self.help, show_default=False)
        words = f"{flag}/--no-{self._first.flag}" if bool in self._first.kinds else flag
        return typer.Option(
            words, metavar=option.metavar, help=self.help, show_default=False, rich_help_panel=self.panel, hidden=hidden
        )

    @property
    def everyday(self) -> bool:
        """Whether a long help shows it too: whatever is not of the source or the fit, and what they mark."""
        return self.panel not in (FIT, SOURCE) or any(each.option.everyday for each in self._by_method.values())

    @property
    def hint(self) -> Any:
        """The type that typer reads: lists and what may be a word or a number are read from text by the field."""
        if self._first.is_list and self._first.option.argument:
            return list[str] | None
        kind = self._first.kinds[0]
        return (kind if kind in (int, float, bool) and len(self._first.kinds) == 1 else str) | None

    @property
    def help(self) -> str:
        """What it is, its choices, the methods that have it, and its default."""
        option = self._first.option
        whose: dict[str, list[str]] = {}
        for method, declared in self._by_method.items():
            whose.setdefault(_told(declared), []).append(method)
        told = ". ".join(f"{words}{self._of(methods)}" for words, methods in whose.items())
        default = "" if option.argument else self._default()
        return f"{told}.{f' Default: {default}.' if default else ''}"

    def _of(self, methods: list[str]) -> str:
        """Whose it is, in brackets; nothing for what is no method's."""
        if "" in methods:
            return ""
        return " (all methods)" if set(METHODS) <= set(methods) else f" ({', '.join(methods)})"

    def given(self, value: Any) -> Any:
        """Return a value of the command line as the configuration has it; None where it was not given."""
        if isinstance(value, str):
            return self._first.from_text(value)
        return (tuple(value) or None) if isinstance(value, list) else value

    def _default(self) -> str:
        whose: dict[str, list[str]] = {}
        for method, declared in self._by_method.items():
            whose.setdefault(shown_default(declared), []).append(method)
        if len(whose) == 1:
            return next(iter(whose))
        return "; ".join(f"{words} ({', '.join(methods)})" for words, methods in whose.items())


def _told(declared: Declared) -> str:
    choices = declared.option.choices
    return f"{declared.option.help}: {', '.join(choices)}" if choices else declared.option.help


def shown_default(declared: Declared) -> str:
    """Return a default in words; nothing for one that is simply absent."""
    value = declared.default
    if value is None:
        return declared.option.none
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, tuple):
        return declared.option.separators[0].join(map(str, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def _every_option() -> dict[str, Grown]:
    """Every key of a configuration as an option."""
    found = {key: Grown({"": declared}) for key, declared in section_options().items()}
    found |= {f"fit.{name}": Grown(by_method) for name, by_method in fit_options().items()}
    return found | {"seed": Grown({"": SEED})}


def _covers(keys: tuple[str, ...], key: str) -> bool:
    return any(key == each or key.startswith(f"{each}.") for each in keys)


def _is_argument(parameter: inspect.Parameter) -> bool:
    notes = getattr(parameter.annotation, "__metadata__", ())
    return any(isinstance(note, typer.models.ArgumentInfo) for note in notes)


def _parameter(name: str, grown: Grown, long: bool) -> inspect.Parameter:
    return _with_default(name, Annotated[grown.hint, grown.info(long and not grown.everyday)])


def _with_default(name: str, annotation: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)
