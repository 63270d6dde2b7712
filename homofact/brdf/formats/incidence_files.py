"""Functions for formats with one table per incidence: samples from the nodes, and the grids for writing."""

import math
from typing import Any

import torch

from homofact.brdf.formats.reading import Reading
from homofact.brdf.incidences import IncidenceTable, IncidenceTables, directions
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.geometry.directions import from_spherical

# Angles of incidence in degrees, and rotations of an anisotropic sample.
INCIDENCES = (0, 2, *range(5, 90, 5), 87, 89)
ROTATIONS = tuple(range(0, 360, 30))
# Polar angles from the mirror direction in degrees, fine where a highlight is.
_FINE = [0, 0.25, 0.5, 0.75, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 18, 20, 22.5, 25, 27.5, 30]
_RADIAL = [*_FINE, *range(35, 181, 5)]
# Azimuths from the mirror direction in degrees where the normal is the pole, to half a turn.
_AROUND = [0, 0.5, 1, 1.5, 2, 3, 4, 5, 6, 8, 10, 12.5, 15, 17.5, 20, 25, 30, *range(40, 181, 10)]
# Directions evaluated at once.
_CHUNK = 2**18


def reading_of(path: object, tables: IncidenceTables, channels: str, facts: dict[str, Any]) -> Reading:
    """Return the tables as a reflectance, and their nodes above the horizon as samples weighted by solid angle.

    The caller has already counted negative values, in facts["faults"]. Raises BadInput as `Reading.of`.
    """
    wi, wo, values, weights = tables.nodes()
    faults = facts.pop("faults") | {"exact_zeros": int((values == 0).sum())}
    samples = Samples(
        wi,
        wo,
        values,
        channels=tables.channels,
        isotropic=tables.isotropic,
        weights=weights,
        provenance=facts
        | {
            "incidences_degrees": [round(math.degrees(table.theta_i), 4) for table in tables.tables[0]],
            "rotations_degrees": [round(math.degrees(row[0].turn), 4) for row in tables.tables],
            "weights": "solid angle of the nodes, mean 1",
            "faults": faults,
        },
    )
    return Reading.of(path, samples, tables, channels)


def asymmetry(tables: IncidenceTables) -> float:
    """Return the mean of |f(φ) − f(−φ)| divided by the mean of f; 0 for grids with mirror symmetry."""
    off, total = 0.0, 0.0
    for row in tables.tables:
        for table in row:
            polar = table.polar.repeat_interleave(len(table.azimuth))
            azimuth = table.azimuth.repeat(len(table.polar))
            one, other = table.at(polar, azimuth), table.at(polar, -azimuth)
            off += float((one - other).abs().sum())
            total += float(one.sum())
    return off / total if total else 0.0


def tabulated(reflectance: Reflectance, isotropic: bool, about_mirror: bool) -> IncidenceTables:
    """Tabulate a reflectance at the nodes of the written grids; nodes below the horizon are 0."""
    turns = (0,) if isotropic else ROTATIONS
    rows = [tuple(_table(reflectance, theta, turn, isotropic, about_mirror) for theta in INCIDENCES) for turn in turns]
    return IncidenceTables(tuple(rows), about_mirror, reflectance.channels)


def _table(reflectance: Reflectance, theta: float, turn: float, isotropic: bool, about_mirror: bool) -> IncidenceTable:
    polar = torch.tensor(_RADIAL if about_mirror else _polar(theta), dtype=torch.float64).deg2rad()
    half = [*range(0, 181, 5)] if about_mirror else _AROUND
    whole = half if isotropic and about_mirror else [*half, *(360 - x for x in half[-2::-1])]
    azimuth = torch.tensor(whole, dtype=torch.float64).deg2rad()
    empty = torch.zeros(len(polar), len(azimuth), len(reflectance.channels), dtype=torch.float64)
    made = IncidenceTable(math.radians(theta), math.radians(turn), polar, azimuth, empty)
    wo = directions(made, about_mirror)
    wi = from_spherical(torch.tensor(made.theta_i), torch.tensor(made.turn)).double().expand(len(wo), 3)
    above = (wo[:, 2] >= -1e-9).nonzero()[:, 0]
    values = torch.zeros(len(wo), len(reflectance.channels), dtype=torch.float64)
    for rows in above.split(_CHUNK):
        view = torch.cat((wo[rows, :2], wo[rows, 2:].clamp_min(1e-4)), 1)
        values[rows] = reflectance.evaluate(wi[rows], view / view.norm(dim=1, keepdim=True)).double()
    return IncidenceTable(made.theta_i, made.turn, polar, azimuth, values.reshape(empty.shape))


def _polar(theta: float) -> list[float]:
    """Polar angles from the normal in degrees, finest round the mirror direction."""
    every = {float(x) for x in range(0, 91, 2)} | {theta + x / 4 for x in range(-20, 21)}
    return sorted(x for x in every if 0 <= x <= 90)
