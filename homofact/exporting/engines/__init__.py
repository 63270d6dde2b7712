"""What an engine needs beside textures and shaders: `table.ENGINES` by name."""
