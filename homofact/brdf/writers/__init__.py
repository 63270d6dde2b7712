"""Writers of BRDF files for other programs, one file a format, each the mirror of the reader of that name."""
