"""Artefacts: visible errors in a picture of a fit that a picture of its source does not have."""
