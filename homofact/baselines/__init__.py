"""Floor 3: methods that the search is compared with."""
