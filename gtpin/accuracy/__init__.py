"""Accuracy by Jacobians: sensitivity, expected error, dexterity, stiffness, workspace, and which poses to measure."""
