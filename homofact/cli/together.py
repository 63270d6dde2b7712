"""`homofact sweep --svbrdf` and `--basis`: the sources fitted together, under shared projections."""

from typing import TYPE_CHECKING, Any

from rich.table import Table
from rich.text import Text

from homofact.cli.layout import add_figures, plain_table
from homofact.cli.screen import Screen

if TYPE_CHECKING:
    from homofact.api.sweeping import TogetherResult


def show_together(found: "TogetherResult", screen: Screen) -> None:
    """Print the tables and the files of a fit of all sources together."""
    if found.kind == "basis":
        screen.show(*basis_tables(found.facts["figures"]))
        screen.show(f"{found.folder}: basis.npz, basis.json")
        return
    screen.show(cluster_table(found.facts), total_line(found.facts), noise_table(found.facts))
    screen.show(
        f"{found.folder}: svbrdf.npz, texture arrays, brdf.glsl, brdf.hlsl, brdf.wgsl, brdf.c, labels.png,"
        " manifest.json"
    )


def cluster_table(record: dict[str, Any]) -> Table:
    """Return bytes and held-out log errors of each cluster, under shared projections and alone."""
    from homofact.evaluation.wording import figure

    table = plain_table("Held-out log mse and bytes (float32): shared projections, and alone")
    table.add_column("label", justify="right")
    table.add_column("source", overflow="fold")
    add_figures(table, "texels", "shared", "alone", "ratio", "bytes", "alone")
    for label, each in enumerate(record["clusters"]):
        errors = [each[side]["held_out"]["log_mse"] for side in ("shared", "alone")]
        ratio = errors[0] / errors[1] if errors[1] > 0 else float("nan")
        sizes = [str(each[side]["bytes"]) for side in ("shared", "alone")]
        row = (str(label), Text(each["source"]), str(each["texels"]), *map(figure, (*errors, ratio)), *sizes)
        table.add_row(*row)
    return table


def total_line(record: dict[str, Any]) -> str:
    """Return a line with the total bytes and the mean errors of both ways."""
    from homofact.evaluation.wording import figure

    shared, alone = record["shared"], record["alone"]
    return (
        f"Together {shared['bytes']} bytes in one program, mean log mse {figure(shared['log_mse'])};"
        f" alone {alone['bytes']} bytes in {alone['programs']} programs, {figure(alone['log_mse'])}"
    )


def noise_table(record: dict[str, Any]) -> Table:
    """Return the importance-sampling noise of homofact_sample for each label, by the viewer's angle."""
    from homofact.evaluation.wording import brief_figure

    table = plain_table(
        "Noise of importance sampling, by the viewer's angle: relative variance per sample of homofact_sample (in"
        " brackets: of cosine sampling)"
    )
    add_figures(table, "label", *(f"{each['angle']:.0f}°" for each in record["clusters"][0]["noise"]))
    for label, cluster in enumerate(record["clusters"]):
        noise = [tuple(brief_figure(each[name]) for name in ("variance", "cosine")) for each in cluster["noise"]]
        table.add_row(str(label), *(f"{own} ({cosine})" for own, cosine in noise))
    return table


def basis_tables(figures: dict[str, Any]) -> list[Table]:
    """Return two tables: errors and bytes of the basis by its directions, and those of materials' own textures."""
    from homofact.evaluation.wording import figure

    count = len(figures["materials"])
    table = plain_table(f"A basis for {count} materials: held-out log mse (median), bytes per material")
    add_figures(table, "basis", "left out", "worst", "not left out", "bytes", "own, as good", "pays from")
    for row in figures["rows"]:
        bound = row["own_is_at_most"]
        errors = (row["left_out"]["median"], row["left_out"]["worst"], row["inside"]["median"])
        sizes = (f"{row['bytes']:.0f}", f"{'≤ ' * bound}{row['own_bytes_at_equal_error']:.0f}")
        pays = "never" if row["pays_from"] is None else f"{'≥ ' * bound}{row['pays_from']}"
        table.add_row(str(row["directions"]), *map(figure, errors), *sizes, pays)
    own = plain_table("Textures of their own")
    add_figures(own, "bytes", "median", "worst")
    for row in figures["own"]:
        own.add_row(f"{row['bytes']:.0f}", figure(row["median"]), figure(row["worst"]))
    return [table, own]
