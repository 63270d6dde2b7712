"""Error against bytes on the 100 MERL materials, beside other published methods."""
