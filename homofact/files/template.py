"""Templates: texts with marks that are filled in one pass, so that marks inside the inserted texts are never filled.

Names of files, materials and channels are untrusted and may contain anything, including marks. If marks were filled one
after the other, a name could insert a mark whose value ends the string literal around the name.
"""

import base64
import hashlib
import re
from collections.abc import Mapping
from typing import Final

# @NAME@ in the files of engines, {{name}} in pages.
AT: Final = re.compile(r"@([A-Z_]+)@")
BRACES: Final = re.compile(r"\{\{(\w+)\}\}")


def filled(text: str, mark: re.Pattern[str], values: Mapping[str, str]) -> str:
    """Return the text with every mark replaced by the value of its name.

    Parameters
    ----------
    text
        The template.
    mark
        `AT` or `BRACES`: the pattern of a mark, with its name as the first group.
    values
        The values by name. Marks inside the values are not replaced.

    Raises
    ------
    KeyError
        For a mark without a value, which is a mistake in the template.
    """
    return mark.sub(lambda found: values[found[1]], text)


def source_digest(text: str) -> str:
    """Return the hash by which a Content-Security-Policy allows an inline style or script of this text."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
