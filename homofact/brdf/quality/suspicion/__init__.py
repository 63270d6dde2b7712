"""Suspected units, conventions and faults of the instrument, found in the samples alone."""
