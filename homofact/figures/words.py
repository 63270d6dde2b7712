"""Show external text, such as file names, literally in a figure: without markup or undrawable characters."""

from homofact.files.words import harmless


def in_figure(text: str) -> str:
    r"""Return a text for Matplotlib to show literally: `harmless`, with its line breaks, and without mathematics.

    A file name that is not UTF-8 contains lone surrogates, which no font can draw. Matplotlib parses text between two
    `$` as a formula, and fails if it is not a valid one.
    """
    return harmless(text, keep="\n").replace("$", r"\$")
