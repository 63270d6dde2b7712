"""Bilinear stencils, masks, smoothing and the linear systems; nothing here knows about light."""
