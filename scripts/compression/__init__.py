"""These programs compare the error at a given number of bytes with published methods, on the 100 MERL materials and
on real measurements."""
