"""The quality of measured data: coverage, scatter, outliers, gains, clipping, extrapolation, suspicions of faults."""
