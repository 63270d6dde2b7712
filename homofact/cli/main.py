"""The entry point: one application with all commands, and the handling of errors.

Exit codes: 0 done; 2 bad input or usage, one line on stderr; 1 an error in homofact, with the traceback; 130
interrupted by Ctrl-C; 141 the reader of a pipe closed it.
"""

import errno
import io
import os
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from homofact.cli.flags import with_options
from homofact.cli.greeting import GREETING
from homofact.cli.interrupts import watched
from homofact.cli.verdicts import USUAL
from homofact.errors import BadInput, Interrupted, SolverFailure
from homofact.files import extras
from homofact.files.embedded import embedded
from homofact.files.words import harmless
from homofact.version import __version__

_BEGIN, _DATA, _SCENES, _MANY, _MORE = "First steps", "Data", "Scenes", "Whole databases", "More"
_RESEARCH = "Research"
# Heading, name and first sentence of each command: the list of all is shown without loading them.
COMMANDS = (
    (_BEGIN, "factorize", "Fit a BRDF and write its textures, pictures and errors to a folder."),
    (_BEGIN, "view", "Write a page that shows a result in a browser, with movable light and camera."),
    (_BEGIN, "export", "Write textures and the shaders that read them: GLSL, HLSL, WGSL, C."),
    (_BEGIN, "compare", "Fit several methods to the same samples and print their errors and costs."),
    (_BEGIN, "info", "Describe measurement files, named materials, or the folders of fits, plans or scenes."),
    (_DATA, "measure", "Choose the directions that a goniometer should measure next."),
    (
        _DATA,
        "convert",
        "Convert a measurement, a named material or a fit to the format given by the file name extension of OUT.",
    ),
    (
        _DATA,
        "render",
        "Draw a sphere of a result or a source under a light, or a relit scene from any point under any sky.",
    ),
    (_SCENES, "plan", "Find the smallest representation of each material of a scene within your tolerance."),
    (_SCENES, "relight", "Precompute objects with their shadows, so that you can change their light."),
    (_SCENES, "edit", "Precompute a scene under its light, so that you can edit its materials."),
    (_MANY, "sweep", "Fit many sources by several methods, and save every result."),
    (_MANY, "report", "Write the report of a sweep as a website that works offline."),
    (_MORE, "doctor", "Check what is installed, what works, and what is missing for more features."),
    (_MORE, "research", "Commands for research: where fits fail, and how many terms a material needs."),
)
RESEARCH = (
    (_RESEARCH, "stability", "Fit difficult data by every method, and find wrong fits whose verdict does not warn."),
    (_RESEARCH, "terms", "Predict and count the in-out terms (SVD) that a material needs."),
)
# Commands of 0.2.0 that are part of others now.
_RENAMED = {
    "fit": "homofact factorize SOURCE --out FOLDER",
    "chart": "homofact compare SOURCE --chart FOLDER",
    "materials": "homofact info without a source",
    "stability": "homofact research stability",
    "terms": "homofact research terms",
}
# Options of 0.2.0 by command, with their names now.
_RENAMED_OPTIONS = {("export", "--to"): "--out", ("plan", "--write"): "--out"}


def _plain_flags(params: list[Any]) -> list[Any]:
    """Options whose flags name no type in the help: they take no value."""
    for each in params:
        if getattr(each, "is_flag", False) and each.metavar is None:
            each.metavar = ""
    return params


class _Command(TyperCommand):
    """A command whose --help-all is its --help, unless it hides options and has a --help-all of its own."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options, of which flags name no type."""
        return _plain_flags(super().get_params(ctx))

    def get_help_option_names(self, ctx: Any) -> list[str]:
        """Return the words that ask for help, always in the same order."""
        own = {word for each in self.params for word in each.opts}
        return [word for word in ("--help", "-h", "--help-all") if word not in own]


def _unwrapped(text: str) -> str:
    """Return paragraphs of a docstring in one line each: the help is as wide as the terminal."""
    return "\n\n".join(" ".join(each.split()) for each in text.split("\n\n"))


class _Commands(Mapping[str, Any]):
    """The commands by name, each loaded when it is needed."""

    def __init__(self, rows: Sequence[tuple[str, str, str]]) -> None:
        self._panels = {name: panel for panel, name, _ in rows}
        self._loaded: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._loaded:
            panel = self._panels[name]
            if name == "research":
                self._loaded[name] = _research(panel)
            else:
                alone = typer.Typer(add_completion=False)
                function = getattr(import_module(f"homofact.cli.{name}"), name)
                alone.command(name, cls=_Command, rich_help_panel=panel)(function)
                self._loaded[name] = get_command(alone)
                self._loaded[name].help = _unwrapped(self._loaded[name].help)
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._panels)

    def __len__(self) -> int:
        return len(self._panels)


class _Group(TyperGroup):
    """The commands, of which the help of all loads none."""

    rows = COMMANDS

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands: Any = _Commands(self.rows)

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options, of which flags name no type."""
        return _plain_flags(super().get_params(ctx))

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names in the order of the help."""
        return list(self.commands)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of a name. Raises BadInput for the name of an older version."""
        if cmd_name in _RENAMED and cmd_name not in self.commands:
            raise BadInput("no command of this version", where=cmd_name, hint=f"now: {_RENAMED[cmd_name]}")
        return super().get_command(ctx, cmd_name)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The help of all commands: the first sentence of each."""
        loading = self.commands
        self.commands = {name: TyperCommand(name, help=said, rich_help_panel=panel) for panel, name, said in self.rows}
        super().format_help(ctx, formatter)
        self.commands = loading


class _ResearchGroup(_Group):
    """The commands under `homofact research`."""

    rows = RESEARCH

    def get_help_option_names(self, ctx: Any) -> list[str]:
        """Return the words that ask for help, as for a command."""
        return ["--help", "-h", "--help-all"]


def _research(panel: str) -> Any:
    """The group `homofact research`."""
    group = typer.Typer(name="research", cls=_ResearchGroup, add_completion=False)

    @group.callback(invoke_without_command=True)
    def research(context: typer.Context) -> None:
        """Commands for research: where fits fail, and how many terms a material needs."""
        if context.invoked_subcommand is None:
            typer.echo(context.get_help())

    made: Any = get_command(group)
    made.rich_help_panel = panel
    return made


app = typer.Typer(
    name="homofact", cls=_Group, pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)  # fmt: skip

# Options before a file that is read.
_READ = {"-c", "--config", "--environment", "--mesh", "--source", "--svbrdf"}
# What the machine refuses is for the user to mend, as bad input is.
_REFUSALS = {
    errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOSPC, errno.EDQUOT, errno.ENAMETOOLONG, errno.ELOOP, errno.ENOTDIR,
    errno.EIO, errno.EMFILE, errno.ENFILE,
}  # fmt: skip


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"homofact {__version__}")
        raise typer.Exit


@app.callback()
def homofact(
    _: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")] = False,
) -> None:
    """Compress measured BRDFs into a few small textures for real-time rendering."""


# What the validation behind the options calls a word that is no number.
_THEIR_WORDS = {
    "Input should be a valid integer, unable to parse string as an integer": "expected a whole number",
    "Input should be a valid number, unable to parse string as a number": "expected a number",
}


def _in_our_words(message: str) -> str:
    for theirs, ours in _THEIR_WORDS.items():
        message = message.replace(theirs, ours)
    return message


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command line (by default `sys.argv`) and return its exit code."""
    with watched() as watch:
        code = _run(argv)
    if code == 0 and watch.untold:
        # A library has swallowed it, in a callback or a destructor of its own.
        print("homofact: interrupted, but the work is done", file=sys.stderr)
        return 130
    return code


def _run(argv: Sequence[str] | None) -> int:
    arguments = list(sys.argv[1:] if argv is None else argv)
    command = get_command(app)
    for stream in (sys.stdout, sys.stderr):
        # What a stream's encoding does not hold (ε in latin-1, half a letter of a file's name) is shown by its number.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        # Not the application's own main: it would swallow interruption and broken pipes.
        if not arguments:
            sys.stdout.write(GREETING)
            return 0
        with command.make_context("homofact", _with_embedded(_whole(arguments))) as context:
            command.invoke(context)
        sys.stdout.flush()
        return 0
    except typer.Exit as ending:
        return ending.exit_code
    except (BadInput, SolverFailure) as error:
        return _refuse(str(error))
    except typer.TyperException as error:
        path = getattr(getattr(error, "ctx", None), "command_path", "homofact")
        option = getattr(error, "option_name", "")
        renamed = _RENAMED_OPTIONS.get((path.rpartition(" ")[2], option))
        if renamed is not None:
            return _refuse(f"{option}: no option of this version, now: {renamed} (see {path} --help)")
        return _refuse(f"{_in_our_words(error.format_message().rstrip('.'))} (see {path} --help)")
    except Interrupted as ending:
        print(f"homofact: interrupted, {harmless(with_options(ending.kept))}", file=sys.stderr)
        return 130
    except (KeyboardInterrupt, typer.Abort):
        print("homofact: interrupted, nothing was written", file=sys.stderr)
        return 130
    except BrokenPipeError:
        _drop_stdout()
        return 141
    except Exception as error:
        lacking = extras.lacking(error) if isinstance(error, ImportError) else None
        if lacking is not None:
            return _refuse(str(lacking))
        if isinstance(error, OSError) and error.errno in _REFUSALS:
            if error.filename is None:
                _drop_stdout()
            return _refuse(f"{error.filename or 'what is printed'}: {error.strerror}")
        traceback.print_exc()
        print(
            f"homofact: this is a fault of homofact {__version__}, not yours: please report it with the lines above",
            file=sys.stderr,
        )
        return 1


def _whole(arguments: list[str]) -> list[str]:
    """The command line with --strict, which may be followed by =P, as one word with its usual value."""
    return [f"{word}={USUAL}" if word == "--strict" else word for word in arguments]


def _with_embedded(arguments: list[str]) -> list[str]:
    """The command line with the places of files that come with homofact (`files.embedded`), and a line on each.

    What may be written to is left as it is: values of other options, and all words of `convert`.
    """
    made = list(arguments)
    for number, word in enumerate(arguments[1:], 1):
        before = arguments[number - 1]
        place = None if before.startswith("-") and before not in _READ else embedded(word)
        if place is not None and arguments[0] != "convert":
            made[number] = str(place)
            if not {"-q", "--quiet"} & set(arguments):
                print(f"homofact: {harmless(word)} is not in this folder: taken from {place}", file=sys.stderr)
    return made


def _drop_stdout() -> None:
    """The interpreter flushes stdout once more on its way out: into nothing, where it cannot be written."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _refuse(message: str) -> int:
    print(f"homofact: {harmless(with_options(' '.join(message.split())))}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
