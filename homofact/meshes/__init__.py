"""Read, check, repair and generate triangle meshes, compute their tangents, and trace rays against them."""
