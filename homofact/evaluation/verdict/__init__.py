"""The verdict of every fit: problems of the fit, faults of its data, and missing measurements."""
