"""K-tuples of an object from whichever form its transport is held in."""

import numpy as np

from homofact.relighting.clusters import Clustered
from homofact.relighting.harmonic import Harmonic
from homofact.relighting.precompute import WaveletTransport
from homofact.relighting.relight import Relit, light_coefficients
from homofact.rendering.light import EnvironmentMap


def lit_tuples(
    transport: WaveletTransport, compact: Clustered | Harmonic | None, light: EnvironmentMap | np.ndarray
) -> np.ndarray:
    """K-tuples (V, K, 3) under a light, by the compact form where there is one. Raises BadInput for no light."""
    if isinstance(compact, Harmonic):
        return compact.tuples(light_coefficients(light, transport.settings.cube))
    relit = Relit(transport if compact is None else compact.basis)
    relit.relight(light)
    return relit.tuples if compact is None else compact.mixed(relit.tuples)
