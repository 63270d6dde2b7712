"""Errors, sizes and seconds of relit scenes."""
