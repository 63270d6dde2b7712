"""Materials edited by curves while a scene's light and views stay fixed (Ben-Artzi, Overbeck, Ramamoorthi 2006)."""
