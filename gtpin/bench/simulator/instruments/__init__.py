"""Instruments of the plant: trackers, cameras, ranges, touches, sockets, tilt sensors and encoders on a virtual machine."""
