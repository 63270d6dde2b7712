"""A lit sphere of any reflectance, lights, tone, and fits as materials of Mitsuba."""
