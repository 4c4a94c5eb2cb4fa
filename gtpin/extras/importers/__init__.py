"""Readers of files from other programs, one module for each format; their results can be written as a dataset folder.

`docs/importers.md` describes each format, with its source.
"""

from gtpin.commands.entry import CommandEntry

IMPORT = CommandEntry(
    "import",
    "gtpin.extras.importers.commands:import_app",
    "Turn a file that another program wrote into a dataset folder.",
    place=130,
)
