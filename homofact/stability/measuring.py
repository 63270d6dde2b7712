"""Stressors of coverage: too few samples, holes, grazing light, one azimuth, places where frames turn."""

import math
from dataclasses import replace

import torch

from homofact.brdf.analytic import BlinnPhong, Ward
from homofact.brdf.samples import Samples
from homofact.geometry.directions import draw_in_discs, from_cosine, from_spherical, to_spherical
from homofact.stability.fault import generator_of, joined, uniform
from homofact.stability.faults import FAULTS
from homofact.stability.problem import (
    BASE,
    CHANNELS,
    Problem,
    Scale,
    Stressor,
    drawn_from,
    faulted,
    pairs_about_half_vectors,
    samples_at,
    unstressed,
)

GRAZING = Ward((0.35, 0.15), (0.3, 0.3), alpha_x=0.3, alpha_y=0.3, channels=CHANNELS)


def _untouched_texels(strength: float, seed: int, scale: Scale) -> Problem:
    """Smoothing off, and textures of `strength` texels per side for a third of the samples."""
    problem = unstressed(seed, scale)
    fewer = problem.samples.subset(scale.samples // 3, seed)
    size = int(strength)
    # What has no smoothing has the size alone.
    return replace(problem.measuring(fewer), settings=({"smoothing": 0.0, "size": size}, {"size": size}))


def grazing(strength: float, seed: int, scale: Scale) -> Problem:
    """Return a Ward lobe, growing as 1/√(cosθi cosθo), with a third of the samples at 75° to `strength` degrees."""
    problem = drawn_from(GRAZING, seed, scale, key="grazing base")
    generator = generator_of(seed)
    count = scale.samples // 3
    low, high = (math.cos(math.radians(angle)) for angle in (75.0, strength))
    directions = []
    for _ in range(2):
        # Even in the logarithm of the cosine: as many samples in each factor of the blow-up.
        cosine = low * (high / low) ** uniform(count, generator)
        directions.append(from_cosine(cosine, uniform(count, generator) * (2 * math.pi)))
    added = samples_at(GRAZING, directions[0], directions[1])
    measured = joined(problem.samples.subset(scale.samples - count, seed), added)
    return replace(problem.measuring(measured), reference=problem)


def _half_vector_at_normal(strength: float, seed: int, scale: Scale) -> Problem:
    """Every half vector within `strength` degrees of the normal, measured and clean."""
    generator = generator_of(seed)
    limit = math.radians(strength)

    def draw(count: int) -> Samples:
        wi, wo = pairs_about_half_vectors(count, generator, lambda u: limit * u.sqrt())
        return samples_at(BASE, wi, wo)

    return Problem(draw(scale.samples), draw(scale.clean), key="stressed")


def _half_vector_at_tangent(strength: float, seed: int, scale: Scale) -> Problem:
    """Both directions, and so the half vector, within `strength` degrees of the tangent, measured and clean."""
    generator = generator_of(seed)
    reach = math.radians(strength)

    def draw(count: int) -> Samples:
        pair = [
            from_spherical(math.pi / 2 - reach * uniform(count, generator), reach * (2 * uniform(count, generator) - 1))
            for _ in range(2)
        ]
        for directions in pair:
            directions[:, 2].clamp_min_(0)
        return samples_at(BASE, pair[0], pair[1])

    return Problem(draw(scale.samples), draw(scale.clean), key="stressed")


def _one_azimuth(strength: float, seed: int, scale: Scale) -> Problem:
    """All light from a sector of `strength` degrees of azimuth, and no azimuth copies made."""
    problem = unstressed(seed, scale)
    angle = (uniform(scale.samples, generator_of(seed)) - 0.5) * math.radians(strength)
    measured = problem.samples.turned(angle - to_spherical(problem.samples.wi)[1])
    return problem.measuring(measured)


def anisotropy(strength: float, seed: int, scale: Scale) -> Problem:
    """Return a brushed metal with the ratio of slopes `strength`, whose samples are declared isotropic."""

    def of(ratio: float, key: str) -> Problem:
        root = math.sqrt(ratio)
        model = Ward((0.35, 0.15), (0.3, 0.3), alpha_x=0.3 * root, alpha_y=0.3 / root, channels=CHANNELS)
        problem = drawn_from(model, seed, scale, key)
        return replace(problem, samples=replace(problem.samples, isotropic=True))

    return replace(of(strength, "stressed"), reference=of(1.0, "isotropic ward"))


def _dynamic_range(strength: float, seed: int, scale: Scale) -> Problem:
    """A highlight `strength` times as bright as the diffuse ground, half of the samples about it."""
    generator = generator_of(seed)

    def of(ratio: float, key: str) -> Problem:
        # ks (n + 2)(n + 4)/(8π(…n)) is about ks n/8π, against kd/π.
        model = BlinnPhong((0.4, 0.2), (0.4, 0.2), exponent=8 * ratio, channels=CHANNELS)

        def draw(count: int) -> Samples:
            half = count // 2
            about = pairs_about_half_vectors(half, generator, lambda u: 10 ** (-4 * u) * (math.pi / 2))
            wide = draw_in_discs(count - half, generator, 0.9)
            return samples_at(model, torch.cat((about[0], wide[0])), torch.cat((about[1], wide[1])))

        return Problem(draw(scale.samples), draw(scale.clean), key=key)

    return replace(of(strength, "stressed"), reference=of(10.0, "range base"))


STRESSORS = (
    Stressor(
        "few-samples", "fewer samples than texels",
        "The number of samples falls from 1500 to 20. In one step it is 205, as for a material of the CUReT database.",
        "A texture has size² texels. Two textures have more texels than a sparse measurement has samples, so"
        " smoothing determines most texels. Smoothing continues linear ramps between the samples. If no sample lies"
        " in the highlight, the fit has none. Fixed projections of absolute directions suffer most, because their"
        " textures need samples at all azimuths. Projections that use only angles spread the same samples over fewer"
        " texels.",
        "Use smaller textures (`size`), fewer textures, projections that use only angles (as `search` does for"
        " isotropic data), or more samples. Believe the held-out error only if at least a few dozen samples are held"
        " out.",
        "samples", (1500, 600, 205, 60, 20), faulted(FAULTS["few"]),
    ),
    Stressor(
        "hole", "a hole in the hemisphere",
        "All samples whose view direction is in a ring around 45° from the normal are missing.",
        "Smoothing fills the texels of the missing directions from the rim of the hole. This works for a smooth"
        " material. A highlight inside the hole is lost.",
        "Measure these directions, or use projections of the half and difference angles. Pairs of directions outside"
        " the ring then fall into the same texels, so no texel stays empty.",
        "degrees, half width", (2, 10, 25, 40), faulted(FAULTS["hole"]),
    ),
    Stressor(
        "no-highlight", "the highlight was not measured",
        "The samples near the mirror direction are missing: no half vector is near the normal.",
        "Nothing in the data shows how bright the highlight is. Smoothing extends the flank of the highlight"
        " linearly towards the mirror direction, so the height of the peak is arbitrary. The held-out error cannot"
        " show this, because the held-out samples lack the highlight as well. Only the share of texels without"
        " samples reveals it.",
        "Measure near the mirror direction. Otherwise use the fit for the diffuse part only.",
        "degrees", (2, 10, 25, 45), faulted(FAULTS["no-highlight"]),
    ),
    Stressor(
        "untouched-texels", "texels without samples, smoothing off",
        "Textures grow while the number of samples stays the same, and smoothing is 0.",
        "Without smoothing, the data do not determine a texel that no sample reads, or that shares its only sample"
        " with its neighbours. Only a tiny ridge term keeps the normal matrix regular. The minimum-norm solution"
        " sets such texels near zero in log space. Zero is the mean brightness, whatever the values of the"
        " surrounding texels.",
        "Set the smoothing λ above 0, for example to 1e-3, or use textures so small that every texel has samples.",
        "texels per side", (8, 16, 24, 32), _untouched_texels,
    ),
    Stressor(
        "grazing", "grazing angles",
        "A third of the samples moves towards the horizon, where the BRDF grows as 1/cosθ.",
        "Microfacet models, and measurements divided by the cosine, grow without bound at the horizon. These values"
        " raise the mean A, and with it εA. The values in the last ring of texels also vary so much that smoothing"
        " spreads them into the neighbouring texels. Away from the horizon, the log transform limits the damage: the"
        " clean test samples end at 87°, and their error hardly changes. The damage is at the horizon and in the"
        " energy. The albedo and the held-out error in the verdict show it.",
        "Leave out samples beyond about 85°, or give them small weights. If you keep them, lower `epsilon`, because"
        " they raise εA. Do not lower it if the data contain zeros ([the choice of ε](#the-choice-of-ε)).",
        "degrees", (80, 85, 89, 89.9, 89.999), grazing,
    ),
    Stressor(
        "h-at-normal", "half vectors at the normal",
        "All half vectors move towards the normal, where φh is undefined.",
        "At h = n, the half/difference frame has no azimuth. The stabilised frame (Cole's thesis, eq. 1.4) uses the"
        " tangent as its axis there, so the coordinates stay continuous. However, all samples fall into one texel of"
        " a texture over h, and its other texels have no data.",
        "No action is needed if you use the fit only near the measured half vectors. Elsewhere, smoothing alone"
        " determines the texels.",
        "degrees", (30, 3, 0.1, 1e-4, 0), _half_vector_at_normal,
    ),
    Stressor(
        "h-at-tangent", "half vectors at the tangent",
        "Both directions and their half vector move towards the tangent on the horizon.",
        "The frame uses the part of the tangent t that is perpendicular to h. At h = t this part is zero, so"
        " homofact uses its limit. Near h = t the difference vector d turns quickly when h changes, so samples with"
        " equal values scatter over a texture that is indexed by d.",
        "No action is needed, because samples on the horizon contribute no light (cosθ = 0).",
        "degrees", (45, 10, 1, 0.01, 1e-7), _half_vector_at_tangent,
    ),
    Stressor(
        "one-azimuth", "one azimuth only",
        "All light comes from a narrow sector of azimuth, and the samples are not copied to other azimuths.",
        "A texture indexed by absolute directions (ωi, h) has samples only in that sector, and smoothing fills the"
        " rest. The fit is accurate at the measured azimuths and meaningless when the object rotates. Coordinates"
        " that do not depend on azimuth are unaffected.",
        "Copy the samples to other azimuths, or use a method whose textures do not depend on azimuth (`search`). Every"
        " command makes such copies of isotropic measurements (`copies=8`). In Python, call"
        " `Samples.azimuth_copies`.",
        "degrees", (360, 180, 60, 10, 0), _one_azimuth,
    ),
    Stressor(
        "anisotropy", "anisotropic data in an isotropic fit",
        "A brushed metal is declared isotropic.",
        "The data then have many values at the same (θh, θd, φd), and the fit returns their mean in log space. More"
        " samples do not help. Training and held-out error are equally high.",
        "Declare the material anisotropic (`isotropic=False`), so that homofact tries coordinates that depend on"
        " azimuth.",
        "ratio of slopes", (1.1, 1.5, 3, 10), anisotropy,
    ),
    Stressor(
        "dynamic-range", "dynamic range (near mirrors)",
        "The highlight becomes brighter and narrower, up to 1e7 times the diffuse part.",
        "A mirror-like lobe is narrower than one texel in θh, so the texture cannot represent it, however many"
        " samples there are. Bilinear interpolation in log space widens the lobe: if one texel spans 10°, the peak"
        " falls off exponentially over 10°, and its flanks are orders of magnitude too bright.",
        "Stretch θh near the highlight (`search` tries this), use larger textures, or subtract the mirror component"
        " from the data and render it separately.",
        "peak over diffuse value", (10, 100, 1e4, 1e6, 1e7), _dynamic_range,
    ),
)  # fmt: skip
