"""Stressors of where was measured: too few samples, holes, grazing light, one azimuth, places where frames turn."""

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
    """A third of the samples between 75° and `strength` degrees, of a Ward lobe that grows as 1/√(cosθi cosθo)."""
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
    """A brushed metal whose slopes have the ratio `strength`, said to be isotropic."""

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
        "Fewer and fewer samples, down to the 205 of a CUReT material and below.",
        "A texture has size² texels, and two of them more unknowns than a sparse measurement has samples. The"
        " smoothing then decides most texels: ramps are drawn on between the samples, and a highlight that no sample"
        " met is not there. Fixed textures over absolute directions lose most, since they need samples at all azimuths;"
        " textures over angles alone gather the same samples in fewer texels.",
        "Smaller textures (`size`), fewer of them, fixed projections, or more samples; believe the held-out error"
        " only when a few dozen samples are held out.",
        "samples", (1500, 600, 205, 60, 20), faulted(FAULTS["few"]),
    ),
    Stressor(
        "hole", "a hole in the hemisphere",
        "No viewer in a ring about 45° from the normal.",
        "Texels that only the missing directions would read are filled by smoothing from the rim of the hole. A smooth"
        " material survives that; a highlight that passes through the hole is cut off.",
        "Measure there, or index by half and difference angles: the ring is then seen from other pairs, and no texel"
        " is left dark.",
        "degrees, half width", (2, 10, 25, 40), faulted(FAULTS["hole"]),
    ),
    Stressor(
        "no-highlight", "the highlight was not measured",
        "No sample whose half vector is near the normal: the mirror direction was left out.",
        "Nothing in the data says how bright the highlight is. Every fit continues the flank inwards by smoothing,"
        " which keeps ramps straight, and where the peak ends up is chance. No held-out sample can show it, since those"
        " lack the highlight as well: only the texels that no sample holds tell.",
        "Measure near the mirror direction; else treat the fit as one of the diffuse part.",
        "degrees", (2, 10, 25, 45), faulted(FAULTS["no-highlight"]),
    ),
    Stressor(
        "untouched-texels", "texels no sample touches, smoothing off",
        "Textures grow while the samples stay, with smoothing 0.",
        "Without smoothing nothing holds a texel that no sample reads, or that shares its only sample with its"
        " neighbours: the normal matrix is singular but for a tiny ridge, whose minimum-norm answer puts such texels"
        " near zero in log space, which is the mean brightness and has nothing to do with their surroundings.",
        "A smoothing above 0 (1e-3), or textures that the samples can fill.",
        "texels per side", (8, 16, 24, 32), _untouched_texels,
    ),
    Stressor(
        "grazing", "grazing angles",
        "A third of the samples towards the horizon, where the material grows as 1/cos.",
        "Microfacet models and measurements divided by the cosine blow up at the horizon. The values there lift the"
        " mean A, and with it εA, and the last ring of texels has to hold a range that smoothing pulls into its"
        " neighbours."
        " Away from the horizon the log transform bears it: the clean samples here end at 87°, and their error hardly"
        " moves. What suffers is the horizon itself, and the energy: the verdict's albedo and held-out error see it.",
        "Leave out what was measured beyond about 85°, or give it little weight; lower `epsilon`.",
        "degrees", (80, 85, 89, 89.9, 89.999), grazing,
    ),
    Stressor(
        "h-at-normal", "half vectors at the normal",
        "Every half vector closer and closer to the normal, where φh is undefined.",
        "At h = n the half/difference frame has no azimuth to turn by. The stabilised frame (thesis eq. 1.4) keeps"
        " the tangent as its axis there, so nothing jumps; but all samples fall into one texel of a texture over h,"
        " and the rest of it has no data.",
        "None is needed where the fit is used in the same region; outside it the texels are smoothing alone.",
        "degrees", (30, 3, 0.1, 1e-4, 0), _half_vector_at_normal,
    ),
    Stressor(
        "h-at-tangent", "half vectors at the tangent",
        "Both directions, and the half vector, closer and closer to the tangent on the horizon.",
        "The frame rejects the tangent from h, and at h = t nothing is left of it: the limit takes its place. Close to"
        " it the difference vector turns quickly with h, so equal values scatter over a texture indexed by d.",
        "None is needed: samples on the horizon carry no light. Leave them out where they disturb.",
        "degrees", (45, 10, 1, 0.01, 1e-7), _half_vector_at_tangent,
    ),
    Stressor(
        "one-azimuth", "one azimuth only",
        "All light from a narrow sector of azimuth, handed over without azimuth copies.",
        "A texture indexed by absolute directions (ωi, h) is filled only where the sector falls, and is smoothing"
        " everywhere else: perfect on the measurement, meaningless on a turned object. Coordinates that do not know"
        " the azimuth do not notice.",
        "Azimuth copies (`copies=8`, made by every command for isotropic measurements; `Samples.azimuth_copies` in"
        " Python), or a method whose textures do not know the azimuth (`search`).",
        "degrees", (360, 180, 60, 10, 0), _one_azimuth,
    ),
    Stressor(
        "anisotropy", "anisotropy given to an isotropic fit",
        "A brushed metal that is said to be isotropic.",
        "The same (θh, θd, φd) then has many values, and the fit returns their mean in log space. More samples do not"
        " help, and training and held-out error agree: both are high.",
        "Say that the material is anisotropic (`isotropic=False`), so that kinds that know the azimuth are tried.",
        "ratio of slopes", (1.1, 1.5, 3, 10), anisotropy,
    ),
    Stressor(
        "dynamic-range", "dynamic range (near mirrors)",
        "A highlight brighter and narrower, up to 1e7 over the ground.",
        "A mirror's lobe is narrower than a texel over θh, so the texture cannot hold it however many samples there"
        " are, and bilinear interpolation in log space smears it exponentially: a peak spread over one texel of 10° is"
        " orders of magnitude too bright at its flanks.",
        "A stretched θh (`search` tries it), larger textures, or the mirror part taken out and added by itself.",
        "brightest over ground", (10, 100, 1e4, 1e6, 1e7), _dynamic_range,
    ),
)  # fmt: skip
