"""Instruments of the plant: what ranges, touches, sockets, tilts, encoders and cameras read of a virtual machine."""
