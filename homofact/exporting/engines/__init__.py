"""The files that an engine needs besides textures and shaders. `table.ENGINES` lists the engines by name."""
