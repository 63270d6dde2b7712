"""These programs draw the pictures of the README, the site and the tutorials."""
