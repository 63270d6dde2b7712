"""Programs that measure homofact and make its pictures, by topic; docs/scripts.md lists them."""
