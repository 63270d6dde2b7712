"""Samples, reflectances, analytic models, named materials, formats, spectra; knows nothing of fitting."""
