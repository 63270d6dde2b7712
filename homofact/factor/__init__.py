"""Floor 3: the log transform, projections, their search, the fit, and the factorization it gives."""
