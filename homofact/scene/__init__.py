"""Code shared by relighting, editing and planning: placed objects, cameras, lights and paths of sources."""
