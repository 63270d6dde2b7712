"""Write the viewer: one self-contained HTML file that shows a fit beside its source on a lit sphere or mesh.

`viewer.viewer_html` assembles the page from `page.html`, `page.css`, the scripts in this folder, and `Layer`s, which
are shader text with its textures. `source_table` tabulates the source for its layer, `homofact.meshes` reads meshes,
and `packing` encodes arrays for the page.
"""
