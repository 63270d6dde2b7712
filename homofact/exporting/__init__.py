"""Write results and exports: texture images, manifests, result folders, and exports with shaders."""
