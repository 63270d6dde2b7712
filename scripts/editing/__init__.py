"""Errors, sizes and seconds of edited scenes."""
