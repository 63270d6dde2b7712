"""The methods, one file each, with the modules for their searches and their validation."""
