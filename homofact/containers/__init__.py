"""Texture containers: pixels into EXR, PNG, KTX2 and DDS files and back, and what each of them can hold."""
