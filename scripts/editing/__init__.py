"""These programs measure errors, sizes and times of edited scenes."""
