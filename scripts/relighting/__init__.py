"""These programs measure errors, sizes and times of relit scenes."""
