"""The options of the commands: most are generated from the settings' dataclasses.

`configured` adds options to a command, for whole sections or single keys of the configuration. It combines the options
with the configuration file into a `config.Config`, and passes this to the command. The default of every such option is
None, "not given", so that a file can set the value. The help text and the printed default come from the dataclass
field.
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
    """Return a decorator that adds the options of the configuration's `keys`, without those in `but`.

    A key is a dotted setting ("evaluate.held_out"), the name of a section for all its settings, or "seed". The
    command's first parameter is the `config.Config`; its own arguments come before the options, its own options after
    them.
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
    """One option of the command line, made from one declaration, or from one per method that has the setting."""

    def __init__(self, by_method: Mapping[str, Declared]) -> None:
        """`by_method` maps the methods' names to their declarations, or "" to the only one."""
        self._by_method = dict(by_method)
        self._first = next(iter(self._by_method.values()))

    @property
    def panel(self) -> str | None:
        """The heading of its group in the help."""
        return FIT if "" not in self._by_method else self._first.option.panel

    def info(self, hidden: bool) -> Any:
        """Return Typer's description of the option; a `hidden` option is shown only by --help-all."""
        option, flag = self._first.option, f"--{self._first.flag}"
        if option.argument:
            return typer.Argument(metavar=option.metavar, help=self.help, show_default=False)
        words = f"{flag}/--no-{self._first.flag}" if bool in self._first.kinds else flag
        return typer.Option(
            words, metavar=option.metavar, help=self.help, show_default=False, rich_help_panel=self.panel, hidden=hidden
        )

    @property
    def everyday(self) -> bool:
        """Whether a long --help shows it: all options outside the groups of source and fit, and `everyday` ones."""
        return self.panel not in (FIT, SOURCE) or any(each.option.everyday for each in self._by_method.values())

    @property
    def hint(self) -> Any:
        """The type that Typer parses; lists and mixed types are mostly str, which the setting itself parses."""
        if self._first.is_list and self._first.option.argument:
            return list[str] | None
        kind = self._first.kinds[0]
        return (kind if kind in (int, float, bool) and len(self._first.kinds) == 1 else str) | None

    @property
    def help(self) -> str:
        """The help text: its description, its choices, the methods that have it, and its default."""
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
        """Convert a command-line value to the form of the configuration; None if it was not given."""
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
    """Return a default in words; for the default None, the words that the option declares."""
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
