"""One relit mesh of one material, as `homofact.relight` returns it."""

from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.relighting.lit import LitObject
from homofact.relighting.lit_scene import LitScene
from homofact.relighting.lobe import SeparateLobe
from homofact.relighting.precompute import WaveletTransport
from homofact.relighting.relight import Relit
from homofact.rendering.light import EnvironmentMap


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

    def lit(self, light: EnvironmentMap | None = None) -> LitScene:
        """Return the mesh under a light, for pictures, without a change of its own. Default: under its own light.

        Raises BadInput without a light that is an environment map, and for a mesh among others.
        """
        if not self.alone:
            raise BadInput(found="a mesh among others", expected="the scene of all of them: a scene file")
        shown = self.environment if light is None else light
        if shown is None:
            raise BadInput(found="a mesh that no environment map lights", expected="a call of its method `relight`")
        return LitScene((self.mesh,), (LitObject.of(self.transport, None, self.lobe, shown),), shown)
