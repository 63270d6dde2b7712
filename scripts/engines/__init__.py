"""Exported fits as other renderers and engines draw them."""
