"""The errors that a virtual machine can have, each departing from its textbook form."""
