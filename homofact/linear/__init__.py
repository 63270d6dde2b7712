"""Bilinear stencils, masks, smoothing and linear systems, independent of BRDFs."""
