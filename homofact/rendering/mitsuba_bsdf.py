"""A fit as a material of Mitsuba 3 (the extra `mitsuba`).

    import mitsuba
    mitsuba.set_variant("llvm_ad_rgb")
    homofact.rendering.mitsuba_bsdf.register()
    bsdf = mitsuba.load_dict({"type": "homofact", "filename": "out/blue_paint"})

`filename` is a result's folder or its factorization.npz. Mitsuba's ωo, the direction that is asked for, is the light
and its ωi the viewer where radiance is transported; where importance is, the other way round. `eval` contains the
cosine, as Mitsuba expects. The material has a front only: put it into `twosided` for both. An anisotropic one needs a
shape with texture coordinates, whose first gives the tangent.

`sampling` is "lobe", where light is drawn from `lobe_sampling`'s mixture of cosine and lobe, or "cosine", where it is
drawn from the cosine alone. The texels, `texture_0` and so on in `mitsuba.traverse` (logarithms of
a product, factors of a sum of products), can be differentiated; the mixture is not drawn up anew when they change,
which costs noise and no correctness.

The channels R, G, B are taken as linear sRGB, and one channel as grey. Variants are rgb and mono, where R, G, B become
their luminance; spectral and polarized variants are refused, as are fits of a spectrum.
"""

import os
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from homofact.brdf.reflectance import Reflectance
from homofact.errors import Advice, BadInput, MissingDependency
from homofact.factor.evaluation import evaluation_of
from homofact.factor.fitted import Fitted
from homofact.files import extras
from homofact.files.archive import saved_file
from homofact.methods.saved import open_saved
from homofact.rendering.lobe_sampling import SCALE, SIGMA, lobe_sampling

NAME = "homofact"
VARIANT = "llvm_ad_rgb"
SAMPLINGS = ("lobe", "cosine")
_RGB = ("R", "G", "B")
_LUMINANCE = (0.212671, 0.71516, 0.072169)  # Mitsuba's `luminance`


def register(name: str = NAME) -> None:
    """Make materials of type `name` known to Mitsuba's variant of the moment; call it again for another variant.

    Raises MissingDependency where Mitsuba is not installed, BadInput where no variant is set or one that is refused.
    What is wrong with a file, Mitsuba reports as a RuntimeError that ends in our line.
    """
    material = bsdf_class()
    _mitsuba().register_bsdf(name, material)


def load_bsdf(place: str | os.PathLike[str], sampling: str = "lobe") -> Any:
    """The material (a `mitsuba.BSDF`) of a result's folder or saved file, to be used in a scene's dictionary.

    `sampling` is one of `SAMPLINGS`. Raises as `register` and `open_fit`, BadInput and not what Mitsuba
    makes of it.
    """
    material = bsdf_class()
    properties = _mitsuba().Properties(NAME)
    properties["filename"] = str(place)
    properties["sampling"] = sampling
    return material(properties)


def measured_bsdf(file: str | os.PathLike[str]) -> Any:
    """Mitsuba's own `measured` material of an RGL file, in the variant of the moment.

    Raises MissingDependency without Mitsuba, BadInput where Mitsuba refuses the file.
    """
    try:
        return _mitsuba().load_dict({"type": "measured", "filename": str(file)})
    except RuntimeError as error:
        # The reason follows the plugin's name, and what the file holds the reason.
        reason = " ".join(str(error).rpartition('"measured": ')[2].split())[:150]
        raise BadInput(f"Mitsuba's measured refused it: {reason}", where=file) from error


def open_mitsuba(variant: str = VARIANT) -> Any:
    """The module with `variant` set. Raises MissingDependency where it, or LLVM for it, is not installed."""
    mi = _mitsuba()
    dr = extras.library("drjit", "mitsuba")
    if variant.startswith("llvm") and not dr.has_backend(dr.JitBackend.LLVM):
        raise MissingDependency("no LLVM for Mitsuba, expected Debian's libllvm19 (DRJIT_LIBLLVM_PATH names another)")
    mi.set_variant(variant)
    return mi


def open_fit(place: str | os.PathLike[str]) -> Fitted:
    """The fit of a result's folder or of a saved file; needs no Mitsuba.

    Raises BadInput where there is none, and for channels that are neither R, G, B nor one alone.
    """
    target = saved_file(place)
    fit = open_saved(target)
    if not fit.terms:
        raise BadInput(where=target, found="no textures", expected="at least one")
    if len(fit.channels) != 1 and fit.channels != _RGB:
        names = ", ".join(fit.channels[:3]) + (", …" if len(fit.channels) > 3 else "")
        raise BadInput(
            where=target,
            found=f"the channels {names} ({len(fit.channels)} of them)",
            expected="R, G, B or one alone",
            hint=f"fit with {Advice('channels', 'rgb')}",
        )
    return fit


def _mitsuba() -> Any:
    return extras.library("mitsuba", "mitsuba")


def bsdf_class() -> Any:
    """The subclass of `mitsuba.BSDF` for Mitsuba's variant of the moment. Raises as `register`."""
    mi = _mitsuba()
    variant = mi.variant()
    if variant is None:
        raise BadInput(
            "no variant is set", where="mitsuba", expected="mitsuba.set_variant('llvm_ad_rgb') or another first"
        )
    if mi.is_polarized or not (mi.is_rgb or mi.is_monochromatic):
        raise BadInput(
            where="mitsuba", found=f"the variant {variant}", expected="an rgb or mono one without polarization"
        )
    return _class_of(variant)


class _CosineDrawing:
    """Light drawn by the cosine; `mi` and `dr` are Mitsuba's modules, whose arrays all arguments are."""

    def __init__(self, mi: Any, dr: Any) -> None:
        self._mi, self._dr = mi, dr

    def direction(self, wi: Any, sample1: Any, sample2: Any, active: Any) -> Any:
        """A direction, of one number and two that are uniform in [0, 1)."""
        return self._mi.warp.square_to_cosine_hemisphere(sample2)

    def density(self, wi: Any, wo: Any, active: Any) -> Any:
        """The density of `direction`, in sr⁻¹."""
        return self._dr.select(active, wo.z / self._dr.pi, 0)


class _LobeDrawing(_CosineDrawing):
    """Light drawn by the mixture of cosine and lobe (`lobe_sampling`)."""

    def __init__(self, mi: Any, dr: Any, reflectance: Reflectance, isotropic: bool) -> None:
        super().__init__(mi, dr)
        mixture = lobe_sampling(reflectance, isotropic)
        self._lobe = mi.MarginalContinuous2D0(mixture.table.numpy().astype(np.float32))
        share = mixture.cosine.numpy().astype(np.float32)[:, None]
        self._share = mi.Texture1f(mi.TensorXf(share), False, False, dr.FilterMode.Linear, dr.WrapMode.Clamp)

    def direction(self, wi: Any, sample1: Any, sample2: Any, active: Any) -> Any:
        """As of the cosine alone."""
        wo = super().direction(wi, sample1, sample2, active)
        share = self._share.eval(wi.z, active)[0]
        place, _ = self._lobe.sample(sample2)
        return self._dr.select(sample1 < share, wo, self._mi.reflect(wi, self._half(place)))

    def density(self, wi: Any, wo: Any, active: Any) -> Any:
        """As of the cosine alone."""
        dr = self._dr
        h = dr.normalize(wi + dr.select(active, wo, wi))
        squared = h.x * h.x + h.y * h.y
        s = squared / (2 * (1 + dr.maximum(h.z, 0)))
        turn = dr.atan2(h.y, h.x) * (0.5 / dr.pi)
        place = self._mi.Point2f(dr.select(turn < 0, turn + 1, turn), dr.asinh(s / SIGMA) / SCALE)
        slope = SCALE * dr.sqrt(SIGMA * SIGMA + s * s)
        lobe = self._lobe.eval(place) / (4 * dr.pi * slope) / (4 * dr.maximum(dr.dot(h, wo), 1e-12))
        share = self._share.eval(wi.z, active)[0]
        return dr.select(active, share * wo.z / dr.pi + (1 - share) * lobe, 0)

    def _half(self, place: Any) -> Any:
        """The half vector at a point of the table."""
        dr = self._dr
        s = dr.minimum(SIGMA * dr.sinh(SCALE * place.y), 0.5)
        sine, cosine = dr.sincos(2 * dr.pi * place.x)
        radius = 2 * dr.sqrt(s * (1 - s))
        return self._mi.Vector3f(radius * cosine, radius * sine, 1 - 2 * s)


@cache
def _class_of(variant: str) -> Any:
    """The class of a variant, which is the one that is set."""
    mi, dr = _mitsuba(), extras.library("drjit", "mitsuba")
    from homofact.shading.drjit import DrJitFit

    class FittedBSDF(mi.BSDF):
        """`mitsuba.BSDF` of a fit; arguments and results are Mitsuba's."""

        def __init__(self, properties: Any) -> None:
            mi.BSDF.__init__(self, properties)
            if "filename" not in properties:
                raise BadInput(
                    "no filename", where="homofact material", expected="a result's folder or factorization.npz"
                )
            self.path = _resolved(mi, str(properties["filename"]))
            fitted = open_fit(self.path)
            self.size = ", ".join(f"{rows} x {columns}" for rows, columns in (t.size for t in fitted.textures))
            self.fetches = fitted.fetches
            self.values = DrJitFit(fitted, mi)
            sampling = str(properties["sampling"]) if "sampling" in properties else SAMPLINGS[0]
            if sampling not in SAMPLINGS:
                raise BadInput(
                    where="homofact material: sampling", found=repr(sampling), expected=f"one of {', '.join(SAMPLINGS)}"
                )
            self._draw_from(sampling, fitted, evaluation_of(fitted).isotropic)

        def _draw_from(self, sampling: str, reflectance: Reflectance, isotropic: bool) -> None:
            """How light is drawn, and what kind of material it is."""
            lobe = sampling == "lobe"
            self.drawing = _LobeDrawing(mi, dr, reflectance, isotropic) if lobe else _CosineDrawing(mi, dr)
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            if not isotropic:
                flags |= mi.BSDFFlags.Anisotropic
            self.m_components = [flags]
            self.m_flags = flags

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """f cosθ of the light."""
            return self._value(ctx, si, wo, self._active(ctx, si, wo, active))

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Density of `sample`, in sr⁻¹."""
            return self.drawing.density(si.wi, wo, self._active(ctx, si, wo, active))

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Both at once."""
            active = self._active(ctx, si, wo, active)
            return self._value(ctx, si, wo, active), self.drawing.density(si.wi, wo, active)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            """A direction, and f cosθ over its density."""
            wo = self.drawing.direction(si.wi, sample1, sample2, active)
            active = self._active(ctx, si, wo, active)
            density = self.drawing.density(si.wi, wo, active)
            active &= density > 0
            sample = dr.zeros(mi.BSDFSample3f)
            sample.wo = wo
            sample.pdf = dr.select(active, density, 0)
            sample.eta = 1
            sample.sampled_type = +mi.BSDFFlags.GlossyReflection
            sample.sampled_component = 0
            value = self._value(ctx, si, wo, active)
            return sample, dr.select(active, value / dr.maximum(density, 1e-30), 0)

        def traverse(self, callback: Any) -> None:
            """The textures' texels."""
            for j, texture in enumerate(self.values.textures):
                callback.put(f"texture_{j}", texture.tensor(), mi.ParamFlags.Differentiable)

        def parameters_changed(self, keys: Any = ()) -> None:
            """Take changed texels over."""
            for texture in self.values.textures:
                texture.update_inplace()

        def to_string(self) -> str:
            """File, textures and fetches."""
            return f"homofact[filename = {self.path}, textures = {self.size}, fetches = {self.fetches}]"

        def _active(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
            enabled = ctx.is_enabled(mi.BSDFFlags.GlossyReflection, 0)
            return mi.Mask(active) & enabled & (si.wi.z > 0) & (wo.z > 0)

        def _value(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
            light, viewer = (wo, si.wi) if ctx.mode == mi.TransportMode.Radiance else (si.wi, wo)
            return _spectrum(mi, self.values.evaluate(light, viewer, active)) * dr.maximum(wo.z, 0)

    return FittedBSDF


def _spectrum(mi: Any, values: list[Any]) -> Any:
    """Mitsuba's spectrum of one channel or of R, G, B, of which a mono variant takes the luminance."""
    if mi.is_monochromatic and len(values) == 3:
        values = [sum(weight * value for weight, value in zip(_LUMINANCE, values, strict=True))]
    # One channel is grey in all of Mitsuba's.
    return mi.Spectrum(*values)


def _resolved(mi: Any, filename: str) -> str:
    """The path, sought beside the scene file as Mitsuba does with its own."""
    if Path(filename).exists():
        return filename
    resolver = mi.file_resolver() if hasattr(mi, "file_resolver") else mi.Thread.thread().file_resolver()
    return str(resolver.resolve(filename))
