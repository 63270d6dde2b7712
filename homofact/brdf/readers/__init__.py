"""Readers of BRDF files: one file a format, chosen by what a file holds, never by its name."""

import os
from types import ModuleType

from homofact.brdf.channels import check_channels
from homofact.brdf.readers import cornell, npz
from homofact.brdf.readers.files import read_bytes
from homofact.brdf.samples import Samples
from homofact.errors import BadInput

# Every reader is a module with NAME, DESCRIPTION, sniff(head) and read(path, channels).
READERS: tuple[ModuleType, ...] = (npz, cornell)
_HEAD = 65_536


def read_samples(path: str | os.PathLike[str], channels: str = "rgb") -> Samples:
    """The samples of a file of any known format, as "rgb", "spectral" or "luminance".

    Raises BadInput for a missing, unreadable or empty file, a folder, and content that no reader knows
    (listing the formats), besides what the format's reader raises.
    """
    check_channels(channels)
    head = read_bytes(path)[:_HEAD]
    for reader in READERS:
        if reader.sniff(head):
            return reader.read(path, channels)
    known = "; ".join(f"{reader.NAME}: {reader.DESCRIPTION}" for reader in READERS)
    raise BadInput(f"{path}: content of no known format (begins with {head[:16]!r}), expected one of: {known}")
