"""These programs test the package as a whole: damaged files, interrupted writes, memory, installation,
bit-identical results, and deliberately inserted faults."""
