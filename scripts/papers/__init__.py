"""These programs make the numbers, tables and figures of the studies in docs/papers."""
