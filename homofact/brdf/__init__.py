"""Floor 2: samples, analytic models, named materials, readers, spectra; knows nothing of fitting."""
