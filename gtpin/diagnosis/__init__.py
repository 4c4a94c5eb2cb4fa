"""Where the gap between simulation and reality lies, which effect causes it, and how far it shrinks."""
