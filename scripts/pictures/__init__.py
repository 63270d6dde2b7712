"""Pictures of the README, the site and the tutorials."""
