"""One relit mesh of one material, as `homofact.relight` returns it."""

from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.relighting.lit import LitObject
from homofact.relighting.lit_scene import LitScene
from homofact.relighting.lobe import SeparateLobe
from homofact.relighting.precompute import WaveletTransport
from homofact.relighting.relight import Relit


class RelitMesh(Relit):
    """`Relit` with its `mesh`, whose vertices it shades, and `notes` of what was wrong with it.

    `alone` states that no other meshes cast shadows on it.
    """

    def __init__(
        self,
        mesh: Mesh,
        transport: WaveletTransport,
        notes: tuple[str, ...] = (),
        lobe: SeparateLobe | None = None,
        alone: bool = True,
    ) -> None:
        super().__init__(transport, lobe)
        self.mesh, self.notes, self.alone = mesh, notes, alone

    def lit(self) -> LitScene:
        """Return the mesh under its present light, for pictures.

        Raises BadInput if it has no light yet, if the light is not an environment map, and for a mesh among others.
        """
        if not self.alone:
            raise BadInput(found="a mesh among others", expected="the scene of all of them: a scene file")
        if self.environment is None:
            raise BadInput(found="a mesh that no environment map lights", expected="a call of its method `relight`")
        return LitScene(
            (self.mesh,), (LitObject(self.transport, self.tuples, self.lobe, self._cells),), self.environment
        )
