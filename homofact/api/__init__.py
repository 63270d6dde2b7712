"""The functions of `homofact`, one file a subject: what a program calls, and what the commands call too."""
