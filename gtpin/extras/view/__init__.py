"""The machine in 3-D, with the differences between measurement and model: in the browser, or as a still image."""

from gtpin.commands.entry import CommandEntry

VIEW = CommandEntry(
    "view",
    "gtpin.extras.view.command:view",
    "Show the robot and its instruments in 3-D in the browser: along the poses, errors magnified, rods by their share.",
    ("gtpin view gantry_tau", "gtpin view calibrated measurements -o gap.png"),
    place=100,
)
