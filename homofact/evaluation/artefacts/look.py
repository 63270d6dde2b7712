"""Find artefacts: needles, rings, rims, holes and spots in pictures of a fit that those of its source lack.

    look = look_for_artefacts(fit, source)
    look.artefacts        # the worst first; empty where nothing was found

Each picture of `views` is shown at two exposures, which are chosen from the source: one for its highlight and one for
its median. For the close-up, one is for the peak and one for the highlight. `structure` compares the pictures of fit
and source, and `artefact` classifies the differences. The pictures of a source are cached for its next fit as long as
the source object exists.

If the source consists only of samples, its pictures show several interpolations of them (`brdf.neighbours`). Pixels
whose light comes from pairs of directions far from any sample are left out.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import torch
from scipy import ndimage
from torch import Tensor

from homofact.brdf.channels import display_of
from homofact.brdf.kept import Kept
from homofact.brdf.neighbours import interpolated
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.scattered import made_of_samples
from homofact.brdf.source import Source, measured_epsilon
from homofact.evaluation.artefacts.artefact import Artefact, artefact_of
from homofact.evaluation.artefacts.structure import LUMA, SourceRange
from homofact.evaluation.artefacts.views import View, views
from homofact.rendering.sphere import SphereImage
from homofact.rendering.surface import shader
from homofact.rendering.tonemap import TARGET, choose_exposure, choose_middle, displayed

# Of each view: the encoded excess from which on a pixel counts, and the sum of it over a piece, in parts of all pixels
# of the picture, from which on the piece does. A close-up is smooth, and a needle in it is thin.
LEAST = {"lamp": (0.01, 8e-5), "highlight": (0.004, 4.5e-5), "sky": (0.01, 8e-5)}
# By how much the pictures differ in a piece, in parts of white.
LEAST_SIZE = 0.04
# A piece beside a stronger one of the other sign is the shadow that the bands throw.
_SHADOW = 0.7
MOST_LEFT_OUT = 0.1  # of a pixel's light
FEWEST = 100  # samples that an interpolation needs


@dataclass(frozen=True)
class Look:
    """The artefacts of a fit.

    Attributes
    ----------
    artefacts : the worst artefact of each kind, sorted from worst to mildest.
    left_out : the share of the pictures' pixels that are ignored because they show directions far from all samples of
        the source.
    """

    artefacts: tuple[Artefact, ...]
    left_out: float

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary."""
        return {"artefacts": [each.record() for each in self.artefacts], "left_out": self.left_out}


def look_for_artefacts(fit: Reflectance, source: Source | Samples) -> Look | None:
    """Return the artefacts in pictures of a fit, compared with pictures of its source or of its samples.

    Returns None if the channels cannot be shown as a colour picture or if there are fewer than `FEWEST` samples. Raises
    BadInput if the fit's values are not finite.
    """
    of_source = _KEPT.of(source)
    return None if of_source is None else of_source.look(of_source.pictures(fit))


@dataclass(frozen=True)
class Shown:
    """A view at one exposure, with the picture of the source and its range of values."""

    view: View
    exposure: float
    curve: str
    picture: np.ndarray
    range: SourceRange

    def pieces(self, picture: np.ndarray) -> Iterator[tuple[float, Artefact]]:
        """Yield (mean excess over the sphere's pixels, artefact) for each piece, one artefact at each place."""
        excess = self.range.excess(picture)
        differs = np.sqrt(((picture - self.picture) ** 2) @ LUMA)
        count = self.view.inside.sum()
        least, least_sum = LEAST[self.view.name]
        found = []
        for sign in (1, -1):
            labels: Any = ndimage.label(sign * excess >= least, np.ones((3, 3)))
            for piece in (labels[0] == 1 + k for k in range(labels[1])):
                strength = float(np.abs(excess[piece]).sum()) / count
                size = float(np.percentile(differs[piece], 90))
                if strength >= least_sum and size >= LEAST_SIZE:
                    found.append((strength, sign, piece, size))
        for strength, sign, piece, size in found:
            near = ndimage.binary_dilation(piece, iterations=3)
            if any(one != sign and strength < _SHADOW * other and (near & at).any() for other, one, at, _ in found):
                continue
            yield strength, artefact_of(self.view, piece, sign > 0, size)


class SourcePictures:
    """The pictures of one source, in all views and exposures."""

    def __init__(self, source: Source | Samples) -> None:
        samples = source if isinstance(source, Samples) else source.samples
        self.to_rgb = display_of(samples.channels)
        if isinstance(source, Source) and not made_of_samples(source.reflectance):
            readings, beyond = [self.draw(source.reflectance)], None
        else:
            epsilon = measured_epsilon(samples) if isinstance(source, Samples) else source.default_epsilon
            found = interpolated(samples, epsilon, *_pairs())
            readings = [self.in_colour(values) for values in found.readings]
            beyond = found.beyond.to(torch.float64)[:, None]
        self.shown: list[Shown] = []
        left_out = []
        for view, part in _parts():
            several = [view.radiance(values[part]) for values in readings]
            known = view.inside
            if beyond is not None:
                lost = view.radiance(readings[0][part] * beyond[part]).sum(2)
                known = known & (lost <= MOST_LEFT_OUT * several[0].sum(2)).numpy()
            left_out.append(1 - known.sum() / view.inside.sum())
            image = SphereImage(several[0], torch.from_numpy(known).to(torch.float64))
            for choose, curve in _EXPOSURES[view.name]:
                exposure = choose(image)
                pictures = [_encoded(each, view, exposure, curve) for each in several]
                self.shown.append(Shown(view, exposure, curve, pictures[0], SourceRange.of(pictures, known)))
        self.left_out = float(np.mean(left_out))

    def draw(self, reflectance: Reflectance) -> Tensor:
        """Return the values (N, 1 or 3) of a reflectance at the pairs of all views.

        Raises BadInput if its values are not finite.
        """
        return shader(reflectance, self.to_rgb)(*_pairs())

    def in_colour(self, values: Tensor) -> Tensor:
        """Convert values (N, C) from the source's channels to those of a picture."""
        return values if self.to_rgb is None else self.to_rgb(values)

    def pictures(self, fit: Reflectance) -> list[np.ndarray]:
        """Return the encoded pictures (H, W, 3) of a fit, one for each of `shown`."""
        values = self.draw(fit)
        drawn = {view.name: view.radiance(values[part]) for view, part in _parts()}
        return [_encoded(drawn[each.view.name], each.view, each.exposure, each.curve) for each in self.shown]

    def look(self, pictures: Sequence[np.ndarray]) -> Look:
        """Return the artefacts in the `pictures` of a fit."""
        pairs = zip(self.shown, pictures, strict=True)
        found = [piece for shown, picture in pairs for piece in shown.pieces(picture)]
        worst: dict[Any, tuple[float, Artefact]] = {}
        for strength, artefact in found:
            if artefact.kind not in worst or worst[artefact.kind][0] < strength:
                worst[artefact.kind] = strength, artefact
        ordered = sorted(worst.values(), key=lambda each: -each[0])
        return Look(tuple(artefact for _, artefact in ordered), self.left_out)


_KEPT = Kept(lambda source: SourcePictures(source) if _can_be_shown(source) else None)


def _can_be_shown(source: Source | Samples) -> bool:
    """Whether its channels are those of a picture, and its samples enough for an interpolation."""
    samples = source if isinstance(source, Samples) else source.samples
    return len(samples) >= FEWEST and (len(samples.channels) in (1, 3) or display_of(samples.channels) is not None)


@lru_cache(maxsize=1)
def _pairs() -> tuple[Tensor, Tensor]:
    """(ωi, ωo) (N, 3) of all views, one after the other."""
    return torch.cat([view.wi for view in views()]), torch.cat([view.wo for view in views()])


def _parts() -> Iterator[tuple[View, slice]]:
    """Each view, and where its pairs stand among all."""
    start = 0
    for view in views():
        yield view, slice(start, start + len(view.wi))
        start += len(view.wi)


def _encoded(radiance: Tensor, view: View, exposure: float, curve: str) -> np.ndarray:
    """The picture (H, W, 3) as a screen shows it, in [0, 1]."""
    image = SphereImage(radiance, torch.from_numpy(view.inside).to(torch.float64))
    return displayed(image, exposure, curve=curve).numpy()


def _by_peak(image: SphereImage) -> float:
    """The exposure that takes the brightest value of all to `TARGET`; 1 if all is black."""
    peak = float((image.radiance.max(2).values * image.coverage).max())
    return TARGET / peak if peak > 0 else 1.0


_EXPOSURES: dict[str, tuple[tuple[Callable[[SphereImage], float], str], ...]] = {
    "lamp": ((choose_exposure, "srgb"), (choose_middle, "filmic")),
    "highlight": ((_by_peak, "srgb"), (choose_exposure, "srgb")),
    "sky": ((choose_exposure, "srgb"), (choose_middle, "filmic")),
}
