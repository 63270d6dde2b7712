"""These programs make the project's data and check its readers and writers. The modules read data that only scripts
use."""
