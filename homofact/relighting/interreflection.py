"""One bounce of interreflection: light that other surfaces reflect to a vertex, as if these surfaces were matt.

A surface sends B = ρ E/π towards a vertex, where ρ is its albedo under uniform light (`mean_albedo`) and E its
irradiance by the sky, with its own shadows. For a glossy surface the total light is right, but not its direction: there
are no caustics. The vertex x receives B from all directions that meet a surface. Its material reflects the smooth part
of this light (`smooth_response`): Zernike's polynomials Z_j of the projected hemisphere up to `ORDER`, or only the
constant if the material is matt.

E is linear in the sky, and so is the light that x receives. x therefore has transport vectors for it as for direct
light,

    T_jr(x) = Σ over ω that meet a surface at y:  Z_j(ω) cosθ dω u_r(y) (1/π) Σ over texels l that y sees:  cosθ_l dω_l,

one for each of R colours: ρ_c(y) = Σ_r u_r(y) v_rc over the scene's materials, where R is the rank of the matrix of
their albedos, 1 if all are grey and at most 3. The view map of such a term is v_rc h_jc(ωo). These terms are the last
among the factors, with light maps of zeros.

The directions that meet surfaces come from a cube map of at most `OUTER` texels along a face, and the skies above these
surfaces have `INNER` texels: light that is integrated over two hemispheres is smooth. The Haar coefficients of a coarse
map are the first ones of a finer map, times a power of 2. Only for this light, a sun is spread over a disc of
`SUN_RADIUS`.

A lamp is not part of the sky: surfaces near it receive more. Under each lamp E is computed at every vertex of the
scene, and T uses E/π instead of the sum over texels: one number per vertex, term and lamp (`from_lamps`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from homofact.brdf.analytic import Lambert
from homofact.linear.threads import in_parallel
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.tangents import frames
from homofact.relighting import cube
from homofact.relighting.factors import InOutFactors
from homofact.relighting.haar import transform_faces
from homofact.relighting.lamps import Lamp
from homofact.relighting.lit_points import LitPoints
from homofact.relighting.smooth_response import modes, zernike
from homofact.relighting.sunlight import Sun, summed
from homofact.relighting.tracer import Tracer

OUTER, INNER, _INNER_RAYS = 16, 8, 2
ORDER = 2
# Of the response to the constant: where that to all others is below, it is left out.
_MATT = 0.02
SUN_RADIUS, _SUN_RAYS = 0.2, 1024
# Singular values of the matrix of albedos below this part of the largest are rounding.
_SMALL = 1e-6
_BLOCK = 256


@dataclass(frozen=True)
class BounceColours:
    """ρ (O, 3) of a scene's objects as `shares` (O, R) times `colours` (R, 3)."""

    shares: np.ndarray
    colours: np.ndarray

    @classmethod
    def of(cls, albedos: Sequence[np.ndarray]) -> "BounceColours":
        """Return the fewest colours that span the objects' mean albedos (C,); none if all are black."""
        rows = np.stack([np.broadcast_to(each, (3,)) for each in albedos]).astype(np.float64)
        left, size, right = np.linalg.svd(rows, full_matrices=False)
        count = int((size > _SMALL * max(size[0], 1e-12)).sum())
        sign = np.sign(left.sum(0))[:count]
        return cls(left[:, :count] * size[:count] * sign, right[:count] * sign[:, None])

    def terms(self, factors: InOutFactors, responses: Sequence[np.ndarray], tilted: bool = False) -> InOutFactors:
        """Return the factors with the terms of interreflection appended.

        `responses` (J, M, M, C) are the responses to smooth light: one, or for a textured material two, of its tinted
        part and of its plain part. The terms have the same order. Under `tilted` normals even a matt material reflects
        more than the constant polynomial.
        """
        strength = [np.sqrt((each.astype(np.float64) ** 2).mean((1, 2, 3))) for each in responses]
        few = not tilted and all((each[1:] < _MATT * strength[0][0]).all() for each in strength)
        own = np.concatenate([each[:1] if few else each for each in responses])
        grey = len(factors.channels) == 1 and np.ptp(self.colours, axis=1).max(initial=0) < _SMALL
        colours = (self.colours[:, :1] if grey else self.colours).astype(np.float32)
        view = np.einsum("jxyc,rc->jrxyc", np.broadcast_to(own, (*own.shape[:3], colours.shape[1])), colours)
        view = view.reshape(-1, *view.shape[2:])
        direct = np.broadcast_to(factors.view, (*factors.view.shape[:3], colours.shape[1]))
        return replace(
            factors,
            light=np.concatenate((factors.light, np.zeros((len(view), *factors.light.shape[1:]), np.float32))),
            view=np.concatenate((direct, view)),
            strength=np.concatenate((factors.strength, np.zeros(len(view)))),
            channels=factors.channels if grey or len(factors.channels) == 3 else ("R", "G", "B"),
            bounced=len(view),
        )


@dataclass(frozen=True)
class Interreflection:
    """The light that all surfaces of a scene reflect, at the W vertices of the occluder.

    `seen` (W, 6·m²) float32 are cosθ dω/π of the texels that a vertex sees, of a cube map of m texels along a face;
    `shares` (W, R) float32 as in `BounceColours`, of the object that a vertex belongs to.
    """

    occluder: Occluder
    normals: np.ndarray
    triangles: np.ndarray
    seen: np.ndarray
    shares: np.ndarray

    @classmethod
    def traced(
        cls,
        meshes: Sequence[Mesh],
        colours: BounceColours,
        occluder: Occluder,
        progress: Callable[[int, int], object] | None = None,
    ) -> "Interreflection":
        """Trace meshes, given in the occluder's order; `progress` is called with (vertices done, vertices)."""
        count = sum(len(mesh.positions) for mesh in meshes)
        seen, done = np.zeros((count, cube.FACES * INNER**2), np.float32), [0]
        pieces, first = [], 0
        for mesh in meshes:
            tracer, normals = Tracer(mesh, occluder, INNER, _INNER_RAYS), mesh.normals.astype(np.float32)
            starts = range(0, len(mesh.positions), _BLOCK)
            pieces += [(tracer, normals, first, start, min(start + _BLOCK, len(normals))) for start in starts]
            first += len(mesh.positions)

        def block(piece: tuple[Tracer, np.ndarray, int, int, int]) -> None:
            tracer, normals, offset, start, end = piece
            for v in range(start, end):
                cosine = (tracer.directions @ normals[v]).clip(0)
                seen[offset + v] = tracer.visible(v) * cosine * tracer.angles * (1 / np.pi)
            done[0] += end - start
            if progress is not None:
                progress(done[0], count)

        in_parallel(block, pieces)
        shares = np.repeat(colours.shares, [len(mesh.positions) for mesh in meshes], axis=0).astype(np.float32)
        normals = np.concatenate([mesh.normals for mesh in meshes])
        return cls(occluder, normals, occluder.arrays[1], seen, shares)

    @staticmethod
    def cost(vertices: int) -> tuple[int, int]:
        """Return (bytes of memory, rays) for the light that so many vertices reflect and receive."""
        texels = cube.FACES * INNER**2
        return 4 * texels * vertices, vertices * (texels * _INNER_RAYS**2 + cube.FACES * OUTER**2) // 2

    @property
    def colours(self) -> int:
        """R."""
        return self.shares.shape[1]

    @cached_property
    def _outer(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the directions (L, 3) that are traced to surfaces, and their solid angles (L,)."""
        angles = np.tile(cube.solid_angles(OUTER).reshape(-1), cube.FACES)
        return cube.directions(OUTER).reshape(-1, 3), angles

    def received(
        self, position: np.ndarray, frame: np.ndarray, count: int, light: np.ndarray | None = None
    ) -> np.ndarray:
        """T (J·R, 6·m²) of a point in the world with a frame (3, 3), by `count` = J polynomials.

        If `light` (W, L) gives E/π at the surfaces' vertices under L lamps, return the terms (J·R, L) of this light
        instead.
        """
        w, angles = self._outer
        wi = w @ frame.T.astype(np.float64)
        above = np.flatnonzero(wi[:, 2] > 0)
        origin = position + self.occluder.offset * frame[2]
        triangle, weights = self.occluder.first(origin[None], w[above])
        met = np.flatnonzero(triangle >= 0)
        corners, shares = self.triangles[triangle[met]], weights[met]
        # The back of a surface is dark.
        facing = ((self.normals[corners] * shares[..., None]).sum(1) * w[above[met]]).sum(1) < 0
        corners, shares, own = corners[facing], shares[facing], above[met[facing]]
        order = next(n for n in range(count) if len(modes(n)) == count)
        polynomials = zernike(wi[own], order) * (wi[own, 2] * angles[own])
        used, place = np.unique(corners, return_inverse=True)
        sent = np.zeros((len(used), count))
        np.add.at(sent, place.reshape(-1), (polynomials.T[:, None] * shares[..., None]).reshape(-1, count))
        each = (sent[:, :, None] * self.shares[used][:, None]).reshape(len(used), count * self.colours)
        return each.astype(np.float32).T @ (self.seen if light is None else light)[used]

    def vectors(self, position: np.ndarray, frame: np.ndarray, terms: int, size: int) -> np.ndarray:
        """The Haar coefficients (J·R, 6·n²) float32 of `received` on a cube map of n texels along a face."""
        coarse = np.ascontiguousarray(self.received(position, frame, terms // self.colours))
        transform_faces(coarse.reshape(-1, INNER, INNER), np.empty((INNER, INNER), np.float32))
        out = np.zeros((terms, cube.FACES, size, size), np.float32)
        out[:, :, :INNER, :INNER] = coarse.reshape(terms, cube.FACES, INNER, INNER)
        return out.reshape(terms, -1) * np.float32(INNER / size)

    def from_lamps(self, mesh: Mesh, factors: InOutFactors, lamps: Sequence[Lamp]) -> np.ndarray:
        """The terms of interreflection (V, B, L) float32 of a mesh's vertices under each lamp of intensity 1."""
        positions, rows = self.occluder.arrays[0], frames(self.normals)
        points = LitPoints(positions + self.occluder.offset * self.normals, rows)
        up, white = np.broadcast_to(np.array([0.0, 0.0, 1.0]), positions.shape), Lambert((1.0, 1.0, 1.0))
        ones = [replace(lamp, intensity=np.ones(3)) for lamp in lamps]
        light = np.stack([summed(white, [one], points, up, self.occluder)[:, 0] for one in ones], 1).astype(np.float32)
        own, parts = frames(mesh.normals), 2 if factors.tinted else 1
        found = np.zeros((len(own), factors.bounced, len(lamps)), np.float32)

        def block(first: int) -> None:
            for v in range(first, min(first + _BLOCK, len(own))):
                count = factors.bounced // parts // self.colours
                found[v] = np.tile(self.received(mesh.lit_at[v], own[v], count, light), (parts, 1))

        in_parallel(block, list(range(0, len(own), _BLOCK)))
        return found


def spread_suns(suns: Sequence[Sun], size: int) -> np.ndarray:
    """Return the radiance (6, n, n, 3) of suns, each at least `SUN_RADIUS` wide, at the resolution of `INNER`."""
    total = cube.FACES * INNER**2
    found = np.zeros((total, 3))
    for sun in suns:
        cone = sun.cones(np.zeros((1, 3))).widened(SUN_RADIUS)
        at = cube.texel_of(cone.directions(_SUN_RAYS)[0], INNER)
        found += (np.bincount(at, minlength=total) / _SUN_RAYS)[:, None] * cone.flux[0]
    found /= np.tile(cube.solid_angles(INNER).reshape(-1), cube.FACES)[:, None]
    times = size // INNER
    return found.reshape(cube.FACES, INNER, INNER, 3).repeat(times, 1).repeat(times, 2)
