"""Dressler, Brogårdh and Robertsson, ICRA 2010: the numbers that they print, and gtpin's beside them."""
