"""The planner: the cheapest representation of every material of a scene that meets a tolerance."""
