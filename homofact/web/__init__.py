"""The viewer: one self-contained HTML file that shows a fit beside its source on a lit sphere or mesh.

`viewer.viewer_html` puts the page together from `page.html`, `page.css` and the scripts beside them, and from
`Layer`s: shader text with the textures it reads. `source_table` makes the layer of the source itself,
`mesh` reads a mesh to show it on, `packing` puts arrays into the page.
"""
