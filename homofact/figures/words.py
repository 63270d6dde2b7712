"""Words from elsewhere in a figure: shown as they stand, none of them markup or a character that cannot be drawn."""

from homofact.files.words import harmless


def in_figure(text: str) -> str:
    r"""Return a text for Matplotlib that shows it: `harmless`, line ends kept, and no part of it taken for mathematics.

    A name of a file that is not UTF-8 holds lone surrogates, which no font draws; between two `$` Matplotlib would
    read a formula, and refuse what is none.
    """
    return harmless(text, keep="\n").replace("$", r"\$")
