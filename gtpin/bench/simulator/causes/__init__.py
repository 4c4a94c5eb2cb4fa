"""The errors that a virtual machine can have: each deviates a little from the textbook equation of its effect.

A function draws its random numbers first; the equation of the deviation follows.
"""
