"""What relighting, editing and planning share: objects in their places, cameras, lights, sources beside a scene's
file."""
