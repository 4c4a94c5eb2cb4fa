"""The commands of virtual machines: demo, simulate, blind and benchmark."""
