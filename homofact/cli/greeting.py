"""The text that `homofact` prints without a command: its purpose, and the five commands that most people need."""

from homofact.version import __version__

GREETING = f"""\
homofact {__version__} compresses measured BRDFs into a few small textures, and writes
the shader that reads them.

  homofact info paint.brdf                      describe a file
  homofact factorize paint.brdf --out paint     fit textures and report errors
  homofact view paint                           write a page that shows the fit
  homofact export paint --out engine            write textures and shaders
  homofact compare paint.brdf                   compare several methods

If you have no measurement, use a named material such as
material:lafortune-blue-paint. `homofact info` lists them.

`homofact --help` lists all commands, `homofact factorize --help` the options
of one.
"""
