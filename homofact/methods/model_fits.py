"""Fits of the models without textures (`models`), with the same samples and the same report as other fits."""

import time
from dataclasses import replace

from homofact.brdf.analytic.ggx_fit import fit_ggx
from homofact.brdf.samples import Samples
from homofact.errors import BadInput, Report, Status
from homofact.linear.threads import one_thread
from homofact.methods.common import provenance_of, refuse_bounds, transform_of
from homofact.methods.fitting import MethodFit, ProgressCallback
from homofact.methods.method import Method
from homofact.methods.models import Gaussians, Ggx, Nbrdf
from homofact.parametric.factored_fit import fit_factored
from homofact.parametric.gaussian_fit import fit_gaussians
from homofact.parametric.model_fit import ModelFit
from homofact.parametric.network import train


@one_thread
def fit_model(samples: Samples, settings: Method, progress: ProgressCallback | None = None) -> MethodFit:
    """Return the model of `settings` fitted to samples; `progress` is never called.

    Raises BadInput for clipped samples, and for a network if the samples do not have three channels.
    """
    began = time.perf_counter()
    refuse_bounds(samples, settings)
    if isinstance(settings, Ggx):
        model, report = fit_ggx(samples, settings.lobes, settings.seed)
    elif isinstance(settings, Gaussians):
        model, report = fit_gaussians(samples, settings.lobes, settings.seed)
    elif isinstance(settings, Nbrdf):
        if len(samples.channels) != 3:
            raise BadInput(
                where="nbrdf", found=f"{len(samples.channels)} channels", expected="the 3 that the network has"
            )
        model = replace(train(samples, settings.steps, settings.seed), channels=samples.channels)
        report = Report(Status.BUDGET, settings.steps, settings.steps, 0.0, 0.0, settings.seed)
    else:
        model, report = fit_factored(samples, settings.seed)
    fit = ModelFit(model, transform_of(samples, settings), provenance_of(samples, settings))
    return MethodFit(fit, replace(report, seconds=time.perf_counter() - began))
