"""How good the planner's choices are."""
