"""`homofact info`: what is in a file, or what a named material is."""

import typer

from homofact.cli import options as o
from homofact.cli.screen import Screen
from homofact.cli.subject import check_source, open_subject
from homofact.cli.tables import facts_table


def info(
    context: typer.Context,
    source: o.Source = None,
    channels: o.Channels = None,
    count: o.Count = None,
    scheme: o.Scheme = None,
    seed: o.Seed = None,
    config: o.ConfigFile = None,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Say what is in a measurement's file, or what a named material is."""
    from homofact.config import load_config

    settings = load_config(config, o.given(context))
    check_source(settings)

    from homofact.brdf.source import describe

    screen = Screen(as_json, quiet)
    with screen.bar() as bar:
        bar.stage("reading")
        subject = open_subject(settings)
        facts = describe(subject)
    # A model's name and parameters read better as rows of their own.
    rows = {name: value for name, value in facts.items() if name != "material"}
    screen.show(facts_table(subject.name, rows | (facts.get("material") or {})))
    screen.answer(facts)
