"""Detect wrong units, wrong conventions and faults of the instrument from the samples."""
