"""The scene of an editing session: objects with editable materials, light and fixed views; and what was precomputed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from homofact.editing.lights import TriangleLights
from homofact.editing.lowrank import CurveTransport
from homofact.editing.material import Editable
from homofact.editing.sender_albedo import SenderAlbedo
from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.scene.cameras import Camera
from homofact.scene.lighting import Lighting
from homofact.scene.visibility import VisiblePixels

MOST_PIXELS = 2048
Pattern = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class EditObject:
    """One object: its mesh and material; `patterns` multiply terms by name.

    A pattern maps world points (P, 3) and texture coordinates (P, 2) to factors (P, C).
    """

    mesh: Mesh
    material: Editable
    patterns: Mapping[str, Pattern] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Reject a pattern for an unknown term."""
        for name in self.patterns:
            self.material.term(name)


class Sender(NamedTuple):
    """Terms of an object with a common albedo as senders of light: one term with a pattern, or all others."""

    object: int
    terms: tuple[str, ...]


@dataclass(frozen=True)
class EditScene:
    """A scene to edit: objects, light, the cameras of its fixed views, and `notes` with one remark per line.

    With `bounces` = 1, surfaces also receive the light that others reflect (`interreflection`).

    Raises BadInput for no objects or views, for different channels, for repeated names, and for views that are too
    large.
    """

    objects: tuple[EditObject, ...]
    lighting: Lighting
    cameras: tuple[Camera, ...]
    notes: tuple[str, ...] = ()
    bounces: int = 0

    def __post_init__(self) -> None:
        """Reject a scene with nothing to show, and repeated names."""
        for what, found in (("objects", self.objects), ("views", self.cameras)):
            if not found:
                raise BadInput(where=what, found="none", expected="at least one")
        channels = {material.channels for material in self.materials}
        if len(channels) > 1:
            raise BadInput(where="materials", found=f"the channels {sorted(channels)}", expected="the same in all")
        for what, names in (
            ("materials", [material.name for material in self.materials]),
            ("views", self.view_names),
        ):
            if len(set(names)) < len(names):
                raise BadInput(where=what, found=", ".join(names), expected="different names")
        for number, camera in enumerate(self.cameras):
            if max(camera.pixels) > MOST_PIXELS:
                most = f"at most {MOST_PIXELS} along a side"
                raise BadInput(where=f"camera[{number}].pixels", found=list(camera.pixels), expected=most)

    @property
    def view_names(self) -> tuple[str, ...]:
        """The cameras' names, "view 1" and so on where they have none."""
        return tuple(camera.name or f"view {number}" for number, camera in enumerate(self.cameras, 1))

    @property
    def materials(self) -> tuple[Editable, ...]:
        """The objects' materials, in their order."""
        return tuple(edited.material for edited in self.objects)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the C channels of all materials."""
        return self.objects[0].material.channels

    @property
    def senders(self) -> tuple[Sender, ...]:
        """Return the senders of light to other surfaces; none without bounces."""
        found = []
        for number, edited in enumerate(self.objects if self.bounces else ()):
            plain = tuple(term.name for term in edited.material.terms if term.name not in edited.patterns)
            found += [Sender(number, names) for names in (plain, *((name,) for name in edited.patterns)) if names]
        return tuple(found)


@dataclass(frozen=True)
class PreparedTerm:
    """One term of one object in one view: `rows` (P,) of the view's pixels, its transport, and the fixed factor (P, C).

    `theta_o` (P,), in radians, is the argument of curves over θo. For light from other surfaces, `senders` (P,) is the
    index of each row's sender, and a pixel has one row for each sender that it sees. For direct light `senders` is
    None.
    """

    view: int
    object: int
    term: str
    rows: np.ndarray
    transport: CurveTransport
    theta_o: Tensor
    factor: Tensor | None
    senders: np.ndarray | None = None

    @classmethod
    def of(
        cls, scene: "EditScene", seen: VisiblePixels, view: int, number: int, term: str, rows: np.ndarray,
        transport: CurveTransport, senders: np.ndarray | None = None,
    ) -> "PreparedTerm":  # fmt: skip
        """Make the part from the rows of a view's pixels that show object `number`."""
        own, pattern = seen.some(rows), scene.objects[number].patterns.get(term)
        theta_o = torch.from_numpy(np.arctan2(np.hypot(own.wo[:, 0], own.wo[:, 1]), own.wo[:, 2]))
        factor = None if pattern is None else torch.from_numpy(pattern(own.points, own.uv))
        return cls(view, number, term, rows, transport, theta_o, factor, senders)


@dataclass(frozen=True)
class PreparedScene:
    """All parts of a scene, and what its views see."""

    scene: EditScene
    lights: TriangleLights
    pixels: tuple[VisiblePixels, ...]
    parts: tuple[PreparedTerm, ...]

    @cached_property
    def albedos(self) -> tuple[SenderAlbedo, ...]:
        """The albedo of each sender, by curves."""
        return tuple(SenderAlbedo(self.scene.materials[each.object], each.terms) for each in self.scene.senders)

    @property
    def nbytes(self) -> int:
        """Bytes of all transports."""
        return sum(part.transport.nbytes for part in self.parts)
