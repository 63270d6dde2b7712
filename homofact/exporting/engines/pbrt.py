"""A scene for pbrt-v4 with the fit as its material `measured`: RGL's tensor file, tabulated from the fit.

pbrt (`MeasuredBRDF::Create` in its bxdfs.cpp) reads only spectral files, and anisotropic materials only with all
azimuths. The export therefore converts RGB to spectra (`brdf.upsampling`) that give the same RGB under D65, the white
point of pbrt's lights and of its pictures in sRGB.
"""

import re
from dataclasses import replace

from homofact.brdf.adaptive import relative_differences, tabulated
from homofact.brdf.formats import rgl
from homofact.brdf.reflectance import Exchanged
from homofact.brdf.rgl import AdaptiveTable
from homofact.brdf.upsampling import NODES, to_spectra
from homofact.brdf.wavelengths import spectral_names, wavelengths_of
from homofact.exporting.as_source import knows_no_azimuth
from homofact.exporting.engines.base import Added, Engine, check_colour, template
from homofact.exporting.exported import Exported
from homofact.shading.languages import remark
from homofact.shading.program import name_of
from homofact.version import __version__

SCENE, MATERIAL, TABLE = "scene.pbrt", "material.pbrt", "brdf.bsdf"
_PAIRS = 5000


def _files(made: Exported) -> Added:
    spectral = wavelengths_of(made.stored.channels) is not None and len(made.stored.channels) > 1
    if not spectral:
        check_colour(made, "pbrt")
    exchanged = Exchanged(made.stored)
    table = tabulated(exchanged, knows_no_azimuth(made.stored), whole_turn=True)
    middle, most = relative_differences(exchanged, table, _PAIRS)
    called = remark(name_of(made.stored.provenance))
    off = f"{middle:.2%} in the median, {most:.2%} at the 99th percentile"
    names = {
        "NAME": called,
        "MATERIAL": re.sub("[^A-Za-z0-9]+", "-", called).strip("-") or "brdf",
        "VERSION": __version__,
    }
    comments = (f"{called}, by homofact {__version__}", f"off the fit's values by {off}")
    return Added(
        {
            SCENE: template("pbrt_scene.pbrt", **names),
            MATERIAL: template("pbrt_material.pbrt", **names, OFF=off),
            TABLE: rgl.packed(table if spectral else with_spectra(table), comments),
        },
        {} if spectral else {TABLE: Exchanged(table)},
    )


def with_spectra(table: AdaptiveTable) -> AdaptiveTable:
    """Return a table of R, G, B or of one channel as spectra; one channel gives constant spectra of two nodes."""
    grey = len(table.channels) == 1
    nodes = (NODES[0], NODES[-1]) if grey else NODES
    values = table.table.expand(*table.table.shape[:-1], 2) if grey else to_spectra(table.table)
    return replace(table, table=values, channels=spectral_names(nodes))


PBRT = Engine("pbrt", ("exr", "exr16", "png8", "png16", "ktx2", "dds", "bc6h"), _files, "tabulating the fit for pbrt")
