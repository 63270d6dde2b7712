"""Triangle meshes: files, what is wrong with them, tangents, shapes that are generated, rays against them."""
