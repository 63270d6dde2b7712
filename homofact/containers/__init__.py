"""Texture containers: write and read EXR, PNG, KTX2 and DDS files, and list what each of them supports."""
