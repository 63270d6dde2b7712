"""The five lines of Python: read, fit, evaluate, save, load (`api.reading`, `api.loading`).

source = homofact.read("paint.brdf")              # or "material:lafortune-blue-paint"
fitted = homofact.fit(source, textures=2)         # or homofact.fit(source, homofact.Cole(textures=5))
values = fitted.evaluate(wi, wo)                  # (N, 3) in sr⁻¹; see fitted.report and fitted.verdict
fitted.save("paint.npz")
same = homofact.load("paint.npz")
"""

from dataclasses import replace
from typing import Any

from homofact.api.progress import Progress, ProgressSteps
from homofact.api.result import Fit
from homofact.api.subjects import given_method
from homofact.brdf.samples import Samples
from homofact.brdf.source import samples_of, source_of
from homofact.evaluation.appearance import appearance
from homofact.evaluation.artefacts.look import look_for_artefacts
from homofact.evaluation.metrics import measure
from homofact.evaluation.split import Split
from homofact.evaluation.verdict.judge import judge
from homofact.methods.method import Method


def fit(source: Any, method: Method | None = None, *, progress: Progress | None = None, **settings: Any) -> Fit:
    """Factor all samples of a source into a few small textures.

    No samples are held out, so the verdict judges the fit on the samples that it was fitted to, and cannot detect
    overfitting. (It rotates isotropic samples to random azimuths before it judges.) `factorize` and
    `homofact.evaluation.compare.fit_and_measure` measure the error on held-out samples. If you pass bare `Samples` or
    arrays, ε is the value for noise-free data. For measured samples, pass `epsilon` (1e-2 if you expect zeros and
    noise), or `read` them first.

    Parameters
    ----------
    source : a source that `homofact.read` returned, or anything that it accepts.
    method : `Search` (the default), `Cole`, `McCool`, `Svd`, `Nmf`, or a model: `Ggx`, `Gaussians`, `Npf`, `Nbrdf`.
    progress : called with a `ProgressStep` on the way.
    settings : settings of `Search`, if you give no method.

    Returns
    -------
    The fit, with its report and its verdict.

    Raises
    ------
    BadInput : for an invalid source, and for settings that are invalid or that the method does not have.

    Examples
    --------
    >>> import homofact
    >>> fit = homofact.fit("material:phong-10", homofact.McCool(size=4))
    >>> fit.nbytes, fit.fetches
    (360, 3)
    """
    method = given_method(method, settings)
    bare = source if isinstance(source, Samples) else samples_of(source)
    if bare is not None:
        given, samples = None, bare
    else:
        given = source_of(source)
        method = method if method.epsilon is not None else replace(method, epsilon=given.default_epsilon)
        samples, _ = Split.of(given, 0.0, method.seed).parts(given)
    steps = ProgressSteps(progress)
    steps.stage(f"fitting {method.name}")
    made = method.fit(samples, steps)
    # What judges a fit works on the processor.
    samples = samples.to("cpu")
    turned = samples.rotated_at_random(method.seed)
    fitted = made.factorization
    steps.stage("measuring")
    errors = measure(fitted, turned, fitted.transform)
    seen = None if given is None else appearance(fitted, given)
    look = look_for_artefacts(fitted, samples if given is None else given)
    verdict = judge(fitted, made.report, method, samples, turned, (errors, errors), seen, look)
    return Fit(fitted, made.report, verdict)
