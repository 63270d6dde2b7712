"""Write files whole or not at all, and read them strictly; common to all formats."""
