"""These programs measure how good the choices of `homofact plan` and `homofact measure` are."""
