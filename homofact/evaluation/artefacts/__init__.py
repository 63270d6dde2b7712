"""Artefacts: structure that a picture of a fit shows and one of its source does not."""
