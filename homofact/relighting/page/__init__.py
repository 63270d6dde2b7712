"""The page of a relit object: `build.write_page` makes one HTML file that turns, relights and measures it."""
