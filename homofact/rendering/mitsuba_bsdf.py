"""A fit as a material of Mitsuba 3 (the extra `mitsuba`).

    import mitsuba
    mitsuba.set_variant("llvm_ad_rgb")
    homofact.rendering.mitsuba_bsdf.register()
    bsdf = mitsuba.load_dict({"type": "homofact", "filename": "out/blue_paint"})

`filename` is a result's folder or its factorization.npz. When radiance is transported, Mitsuba's ωo, the sampled
direction, points to the light, and its ωi to the viewer. When importance is transported, it is the other way round.
`eval` contains the cosine, as Mitsuba expects. The material has only a front side; put it into `twosided` for both
sides. An anisotropic material needs a shape with texture coordinates; u gives the tangent.

`sampling` is "lobe", where light is drawn from the density that the exported shaders have too (`shading.lobe_mixture`),
or "cosine", where it is drawn from the cosine alone. The texels, `texture_0` and so on in `mitsuba.traverse`
(logarithms of a product, factors of a sum of products), can be differentiated. When the texels change, the sampling
density is not fitted again. This adds noise, but the mean stays correct.

The channels R, G, B are taken as linear sRGB, one channel as grey, and wavelengths as a spectrum, in variants of rgb,
mono and spectral (`mitsuba_spectra`). Polarized variants are refused.
"""

import os
from functools import cache
from pathlib import Path
from typing import Any

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.wavelengths import spectrum_of, wavelengths_of
from homofact.errors import Advice, BadInput, MissingDependency
from homofact.factor.evaluation import evaluation_of
from homofact.factor.fitted import Fitted
from homofact.files import extras
from homofact.files.archive import saved_file
from homofact.methods.saved import open_saved
from homofact.shading.mixture_fit import fitted_mixture

NAME = "homofact"
VARIANT = "llvm_ad_rgb"
SAMPLINGS = ("lobe", "cosine")
_RGB = ("R", "G", "B")


def register(name: str = NAME) -> None:
    """Register materials of type `name` with Mitsuba's current variant; call it again for another variant.

    Raises MissingDependency if Mitsuba is not installed, and BadInput if no variant or an unsupported variant is set.
    Mitsuba reports a faulty file as a RuntimeError that ends with homofact's message.
    """
    material = bsdf_class()
    _mitsuba().register_bsdf(name, material)


def load_bsdf(place: str | os.PathLike[str], sampling: str = "lobe") -> Any:
    """Return the material (a `mitsuba.BSDF`) of a result's folder or saved file, to be used in a scene's dictionary.

    `sampling` is one of `SAMPLINGS`. Raises as `register` and `open_fit`: BadInput instead of Mitsuba's RuntimeError.
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
    """Return the module with `variant` set. Raises MissingDependency where it, or LLVM for it, is not installed."""
    mi = _mitsuba()
    dr = extras.library("drjit", "mitsuba")
    if variant.startswith("llvm") and not dr.has_backend(dr.JitBackend.LLVM):
        raise MissingDependency("no LLVM for Mitsuba, expected Debian's libllvm19 (DRJIT_LIBLLVM_PATH names another)")
    mi.set_variant(variant)
    return mi


def open_fit(place: str | os.PathLike[str]) -> Fitted:
    """Return the fit of a result's folder or of a saved file; needs no Mitsuba.

    Raises BadInput if there is no fit, and unless the channels are R, G, B, a single channel, or visible wavelengths.
    """
    target = saved_file(place)
    fit = open_saved(target)
    if not fit.terms:
        raise BadInput(where=target, found="no textures", expected="at least one")
    if len(fit.channels) == 1 or fit.channels == _RGB:
        return fit
    if wavelengths_of(fit.channels) is None:
        names = ", ".join(fit.channels[:3]) + (", …" if len(fit.channels) > 3 else "")
        raise BadInput(
            where=target,
            found=f"the channels {names} ({len(fit.channels)} of them)",
            expected="R, G, B, one alone, or wavelengths",
            hint=f"fit with {Advice('channels', 'rgb')}",
        )
    try:
        spectrum_of(fit.channels)
    except BadInput as error:
        raise error.at(target).with_hint("fit one of its bands to render it in grey") from error
    return fit


def _mitsuba() -> Any:
    return extras.library("mitsuba", "mitsuba")


def bsdf_class() -> Any:
    """Return the subclass of `mitsuba.BSDF` for Mitsuba's variant of the moment. Raises as `register`."""
    mi = _mitsuba()
    variant = mi.variant()
    if variant is None:
        raise BadInput(
            "no variant is set", where="mitsuba", expected="mitsuba.set_variant('llvm_ad_rgb') or another first"
        )
    if mi.is_polarized:
        raise BadInput(where="mitsuba", found=f"the variant {variant}", expected="one without polarization")
    return _class_of(variant)


class _CosineDrawing:
    """Light drawn by the cosine; `mi` and `dr` are Mitsuba's modules, whose arrays all arguments are."""

    def __init__(self, mi: Any, dr: Any) -> None:
        self._mi, self._dr = mi, dr

    def direction(self, wi: Any, sample1: Any, sample2: Any, active: Any) -> Any:
        """Return a direction, of one number and two that are uniform in [0, 1)."""
        return self._mi.warp.square_to_cosine_hemisphere(sample2)

    def density(self, wi: Any, wo: Any, active: Any) -> Any:
        """Return the density of `direction`, in sr⁻¹."""
        return self._dr.select(active, wo.z / self._dr.pi, 0)


class _LobeDrawing(_CosineDrawing):
    """Light drawn by the mixture of a cosine and the material's lobe."""

    def __init__(self, mi: Any, dr: Any, reflectance: Reflectance) -> None:
        super().__init__(mi, dr)
        from homofact.shading.drjit import DrJitMixture

        self._mixture = DrJitMixture(fitted_mixture(reflectance), mi)

    def direction(self, wi: Any, sample1: Any, sample2: Any, active: Any) -> Any:
        """As of the cosine alone."""
        return self._mixture.direction(wi, [sample2.x, sample2.y, sample1])

    def density(self, wi: Any, wo: Any, active: Any) -> Any:
        """As of the cosine alone."""
        up = self._mi.Vector3f(0, 0, 1)
        towards, seen = (self._dr.select(active, each, up) for each in (wo, wi))
        return self._dr.select(active, self._mixture.density(towards, seen), 0)


@cache
def _class_of(variant: str) -> Any:
    """The class of a variant, which is the one that is set."""
    mi, dr = _mitsuba(), extras.library("drjit", "mitsuba")
    from homofact.rendering.mitsuba_spectra import spectra_of
    from homofact.shading.drjit import DrJitBands, DrJitFit

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
            grey_or_rgb = len(fitted.channels) == 1 or fitted.channels == _RGB
            self.values = (DrJitFit if grey_or_rgb else DrJitBands)(fitted, mi)
            self.spectra = spectra_of(mi, fitted.channels)
            sampling = str(properties["sampling"]) if "sampling" in properties else SAMPLINGS[0]
            if sampling not in SAMPLINGS:
                raise BadInput(
                    where="homofact material: sampling", found=repr(sampling), expected=f"one of {', '.join(SAMPLINGS)}"
                )
            self._draw_from(sampling, fitted, evaluation_of(fitted).isotropic)

        def _draw_from(self, sampling: str, reflectance: Reflectance, isotropic: bool) -> None:
            """How light is drawn, and what kind of material it is."""
            lobe = sampling == "lobe"
            self.drawing = _LobeDrawing(mi, dr, reflectance) if lobe else _CosineDrawing(mi, dr)
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            if not isotropic:
                flags |= mi.BSDFFlags.Anisotropic
            self.m_components = [flags]
            self.m_flags = flags

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Return f cosθ of the light."""
            return self._value(ctx, si, wo, self._active(ctx, si, wo, active))

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Density of `sample`, in sr⁻¹."""
            return self.drawing.density(si.wi, wo, self._active(ctx, si, wo, active))

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Return both at once."""
            active = self._active(ctx, si, wo, active)
            return self._value(ctx, si, wo, active), self.drawing.density(si.wi, wo, active)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            """Return a direction, and f cosθ over its density."""
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
            return self.spectra(self.values.evaluate(light, viewer, active), si) * dr.maximum(wo.z, 0)

    return FittedBSDF


def _resolved(mi: Any, filename: str) -> str:
    """The path, sought beside the scene file as Mitsuba does with its own."""
    if Path(filename).exists():
        return filename
    resolver = mi.file_resolver() if hasattr(mi, "file_resolver") else mi.Thread.thread().file_resolver()
    return str(resolver.resolve(filename))
