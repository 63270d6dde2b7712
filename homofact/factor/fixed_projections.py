"""The table of fixed projections, and the bounds of projections, in a module that does not import torch."""

from homofact.geometry.names import COORDINATE_NAMES

BOUNDS = ("disc", "cube")
# Under which a fit's provenance keeps the edits that its textures were given, and its samples' that of its material.
EDITS, EDITED = "edits", "edited"
# What the edited material is called in its scene, beside either.
EDITED_NAME = "edited_name"

# Fixed projections: coordinates and the axes that become the texture's columns and rows.
FIXED_AXES = {
    "wi": ("in-out", ("u_i", "v_i")),
    "wo": ("in-out", ("u_o", "v_o")),
    "h": ("half-diff", ("u_h", "v_h")),
    "d": ("half-diff", ("u_d", "v_d")),
    "theta_h-theta_d": ("isotropic-half-tilt", ("theta_h", "theta_d")),
    "theta_d-phi_d": ("isotropic-half-diff", ("theta_d", "phi_d")),
    "theta_h-phi_d": ("isotropic-half-diff", ("theta_h", "phi_d")),
    "theta_h-tilt": ("isotropic-half-tilt", ("theta_h", "tilt")),
    "theta_d-tilt": ("isotropic-half-tilt", ("theta_d", "tilt")),
    "theta_i-theta_o": ("isotropic-angles", ("theta_i", "theta_o")),
    "theta_i-delta_phi": ("isotropic-in-out", ("theta_i", "delta_phi")),
    "theta_i-theta_d": ("isotropic-angles", ("theta_i", "theta_d")),
    "theta_h-phi_h": ("half-angles", ("theta_h", "phi_h")),
    "theta_h": ("isotropic-half-tilt", ("theta_h",)),
    "theta_d": ("isotropic-half-tilt", ("theta_d",)),
    "theta_i": ("isotropic-angles", ("theta_i",)),
}
FIXED_PROJECTIONS = tuple(FIXED_AXES)
# What a texture of a searched fit may be indexed by: a fixed projection, or coordinates on which one is searched (none
# with a periodic axis: a mix of axes would jump where it closes).
KINDS = (*FIXED_PROJECTIONS, *COORDINATE_NAMES)
