"""The command line with all commands. Imports all their modules, which takes seconds."""

from __future__ import annotations

from gtpin.commands.registry import app_for

app = app_for(())
