"""Checks of the package as a whole: damaged files, killed writes, memory, installation, same bits, planted faults."""
