"""What `homofact` alone says: what it is for, and the five commands that most people need."""

from homofact.version import __version__

GREETING = f"""\
homofact {__version__}: measured BRDFs as a few small textures, with the shader that
reads them.

  homofact info paint.brdf                      what is in a file
  homofact factorize paint.brdf --out paint     fit it: textures and errors
  homofact view paint                           a page with the fit on a sphere
  homofact export paint --to engine             textures with their shaders
  homofact compare paint.brdf                   several methods side by side

No measurement at hand? A named material does as well, such as
material:lafortune-blue-paint: `homofact materials` lists them.

All commands: homofact --help. Of one: homofact factorize --help.
"""
