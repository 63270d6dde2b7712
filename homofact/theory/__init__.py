"""How much a scene needs: spherical harmonics, spectra of lighting and BRDFs, counts of terms."""
