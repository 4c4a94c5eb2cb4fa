"""A certificate of accuracy: pose accuracy and repeatability (ISO 9283, ISO 230-2), and an uncertainty budget (GUM)."""

from gtpin.commands.entry import CommandEntry

CERTIFY = CommandEntry(
    "certify",
    "gtpin.extras.certificate.command:certify",
    "Certify accuracy and repeatability (ISO 9283, ISO 230-2), with an uncertainty budget (GUM) of the corrected machine.",
    (
        "gtpin certify measurements -o certificate",
        "gtpin certify new_poses -o certificate --model diagnosis",
    ),
    place=40,
)
