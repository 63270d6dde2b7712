"""What leaves for engines and eyes: texture images, the manifest, the folder of a result, the export with shaders."""
