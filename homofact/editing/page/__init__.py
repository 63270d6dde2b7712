"""The page of a prepared scene: `build.write_edit_page` makes one HTML file in which its materials are edited."""
