"""The base class of methods: a frozen dataclass of settings, which names the function that fits.

Torch takes a second to load and is needed only to fit. A settings module therefore does not import the module that
fits; it names the function as `package.module:function`.
"""

from abc import ABC, abstractmethod
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar

from homofact.errors import Advice, BadInput
from homofact.settings.options import check_options

if TYPE_CHECKING:
    from homofact.brdf.samples import Samples
    from homofact.methods.fitting import MethodFit, ProgressCallback


class Method(ABC):
    """A way to fit: its settings are dataclass fields, and `name` is its name on the command line.

    A method that lacks one of the optional settings below behaves as with the default value here.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]
    name: ClassVar[str]
    implementation: ClassVar[str]
    """The function (samples, settings, progress) → `MethodFit`, as "package.module:function"."""
    on_devices: ClassVar[bool] = False
    """Whether it fits samples of another device there; the others take a copy of them on the processor."""

    size: int
    """Texels per side of a texture; 0 for a model without textures."""
    epsilon: float | str | None
    """ε of the log transform; None takes the source's, or that of noise-free data, "floor" the noise floor."""
    seed: int
    """Seed of every random choice."""

    bytes: int | None = None
    """How many bytes all textures may take; their sizes then come from the data."""
    search: str = ""
    """How projections are refined."""
    solver: str = ""
    """The linear solver."""
    copies: int = 1
    """To how many azimuths isotropic measurements are turned; 1 leaves them as they are."""
    mirrored: bool = False
    """Whether mirrored copies are added to these."""
    robust: bool = False
    """Whether gross errors among the samples are left out."""
    confidence: bool = False
    """Whether every texel's standard deviation is kept."""
    quantize: str = "none"
    """Which whole numbers texels are: "none", "png8" or "png16"."""
    spectral_tolerance: float | None = None
    """How much of CIEDE2000 a spectral basis may leave; None stores all bands."""

    def __post_init__(self) -> None:
        """Check the settings. Raises BadInput naming the setting, what was found and what is expected."""
        check_options(self)
        if self.spectral_tolerance is not None:
            # Bytes would need the rank before the fit; deviations are those of all bands.
            for name, given in (("bytes", self.bytes is not None), ("confidence", self.confidence)):
                if given:
                    raise BadInput(where="spectral_tolerance", found=f"it beside {name}", expected="one of them")

    @property
    @abstractmethod
    def most_textures(self) -> int:
        """How many textures, or terms, a fit has at most."""

    @property
    def stored_textures(self) -> int:
        """The maximum number of stored textures; a term with two different sides stores two."""
        return self.most_textures

    def fit(self, samples: "Samples", progress: "ProgressCallback | None" = None) -> "MethodFit":
        """Fit the training samples as measured; the method makes the azimuth copies that it needs.

        Only searches call `progress`. An interrupt or the guard `budget` ends a search with the best projections so
        far. Raises BadInput where the samples cannot be fitted.
        """
        if self.spectral_tolerance is not None:
            _check_spectrum(samples.channels)
        module, function = self.implementation.split(":")
        samples = samples if self.on_devices else samples.to("cpu")
        return getattr(import_module(module), function)(samples, self, progress)


def _check_spectrum(channels: tuple[str, ...]) -> None:
    """Raise BadInput for channels without a spectral basis, with advice on what to do."""
    from homofact.brdf.wavelengths import wavelengths_of
    from homofact.factor.spectral_fit import bands_of

    bands = wavelengths_of(channels)
    hint = "without it the fit stores all bands"
    if bands is None:
        hint = f"fit with {Advice('channels', 'spectral')} if the file has spectra"
    try:
        bands_of(channels)
    except BadInput as error:
        raise error.at("spectral_tolerance").with_hint(hint) from error
