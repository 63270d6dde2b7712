"""Check before tracing whether a scene's transport fits into the available memory and disk space.

With `TransportSettings.kept`, the size of the transport is known in advance and is checked. With a tolerance it is not
known, so its upper bound does not reject a scene.
"""

import shutil
from pathlib import Path

from homofact.errors import BadInput
from homofact.linear.size import refuse_beyond_memory, room_in_memory
from homofact.relighting.build import RelightScene

_GIGABYTE = 2**30


def check_room(scene: RelightScene, blocks: Path | None) -> None:
    """Raise BadInput, which suggests a size that fits, if a scene needs more memory or disk space than available.

    `blocks` is the folder for blocks of transport, which are otherwise kept in memory.
    """
    cost, settings = scene.cost, scene.file.settings
    bounded = settings.tolerance is None and scene.file.reflected is None
    held = 2 * cost.most_bytes if blocks is None and bounded else 0
    room = room_in_memory()
    if room is not None and cost.peak_bytes + held > room:
        vertices = sum(len(placed.mesh.positions) for placed in scene.objects)
        fewer = f"meshes of {_part(vertices, room, cost.peak_bytes + held):,} vertices in all would fit"
        held_by = f"{fewer}, or clusters = 0" if scene.file.clusters else fewer
        refuse_beyond_memory(f"{scene.file.name}: transport of {vertices:,} vertices", cost.peak_bytes + held, held_by)
    if blocks is not None and bounded:
        parent = next(folder for folder in blocks.absolute().parents if folder.exists())
        free = shutil.disk_usage(parent).free
        if cost.disk_bytes > free:
            found = f"{free / _GIGABYTE:.1f} GB free, {cost.disk_bytes / _GIGABYTE:.1f} GB of blocks needed"
            fewer = _part(settings.kept, free, cost.disk_bytes)
            raise BadInput(where=parent, found=found, expected=f"transport.kept of at most {fewer}, or more disk")


def _part(count: int, there: float, needed: float) -> int:
    """Return the part of a count that fits, rounded down to two digits, at least 1."""
    fits = max(int(count * there / needed), 1)
    unit = 10 ** max(len(str(fits)) - 2, 0)
    return fits // unit * unit
