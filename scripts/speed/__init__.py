"""These programs measure the time and memory of fits, commands and evaluations."""
