"""The command line, with one file per command. Heavy imports wait until a command runs."""
