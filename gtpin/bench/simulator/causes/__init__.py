"""The errors that a virtual machine can have. Each deviates a little from the textbook equation of its effect."""
