"""What a geometry leaves out: one effect a file, each a set of small displacements that are linear in its coefficients."""
