"""`homofact sweep --svbrdf` and `--basis`: the sources fitted together, under shared projections."""

from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from homofact.cli.layout import add_figures, plain_table
from homofact.cli.screen import Screen
from homofact.errors import BadInput


def svbrdf_of(file: Path, out: Path, screen: Screen) -> None:
    """Fit, compare with fits of each cluster alone, and write fit, texture arrays and shaders into a new folder.

    Raises BadInput for a sweep file, sources or label map that are none, and a place that cannot be written.
    """
    from homofact.files.lock import claimed
    from homofact.sweep.svbrdf import check_place, fit_clusters, read_asked, write_clusters
    from homofact.sweep.sweep_file import read_sweep

    asked = read_sweep(file)
    check_place(out)
    with claimed(out), screen.bar() as bar:
        opened = read_asked(asked, lambda words: bar.stage(f"reading {words}"))
        fit = fit_clusters(opened, bar, bar.run)
        bar.stage("fitting lobes to draw from, and writing")
        record = write_clusters(out, fit)
    screen.show(cluster_table(record), total_line(record), noise_table(record))
    screen.show(
        f"{out}: svbrdf.npz, texture arrays, brdf.glsl, brdf.hlsl, brdf.wgsl, brdf.c, labels.png, manifest.json"
    )
    screen.answer({"folder": str(out)} | record)


def cluster_table(record: dict[str, Any]) -> Table:
    """Bytes and held-out log errors of each cluster, under shared projections and alone."""
    from homofact.evaluate.wording import figure

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
    """The sums, in one line."""
    from homofact.evaluate.wording import figure

    shared, alone = record["shared"], record["alone"]
    return (
        f"Together {shared['bytes']} bytes in one program, mean log mse {figure(shared['log_mse'])};"
        f" alone {alone['bytes']} bytes in {alone['programs']} programs, {figure(alone['log_mse'])}"
    )


def noise_table(record: dict[str, Any]) -> Table:
    """The noise of directions drawn by homofact_sample for each label, by the viewer's angle."""
    table = plain_table("Relative variance of one direction drawn by homofact_sample (by the cosine), viewer at")
    add_figures(table, "label", *(f"{each['angle']:.0f}°" for each in record["clusters"][0]["noise"]))
    for label, cluster in enumerate(record["clusters"]):
        table.add_row(str(label), *(f"{each['variance']:.2g} ({each['cosine']:.2g})" for each in cluster["noise"]))
    return table


def basis_of(file: Path, count: int, out: Path, screen: Screen) -> None:
    """Fit a common basis of `count` log textures, say when it pays, and write it into a new folder.

    Raises BadInput for a sweep file or sources that are none, a count that they do not bear, an unwritable place.
    """
    from homofact.files.lock import claimed
    from homofact.sweep.basis_folder import check_place, fit_asked, write_basis
    from homofact.sweep.sweep_file import read_sweep

    if count < 1:
        raise BadInput(f"basis: found {count}, expected 1 or more")
    asked = read_sweep(file)
    if asked.svbrdf is not None:
        raise BadInput(f"{file}: found a section [svbrdf], expected none beside --basis")
    check_place(out)
    with claimed(out), screen.bar() as bar:
        fit = fit_asked(asked, count, bar, lambda words: bar.stage(f"reading {words}"), bar.run)
        bar.stage("writing")
        record = write_basis(out, fit)
    screen.show(*basis_tables(record["figures"]))
    screen.show(f"{out}: basis.npz, basis.json")
    screen.answer({"folder": str(out)} | record)


def basis_tables(figures: dict[str, Any]) -> list[Table]:
    """Errors and bytes a material by the number of directions, and those of textures of their own."""
    from homofact.evaluate.wording import figure

    count = len(figures["materials"])
    table = plain_table(f"A basis for {count} materials: held-out log mse (median), bytes a material")
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
