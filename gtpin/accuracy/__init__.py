"""Accuracy by Jacobians: sensitivity, expected error, dexterity, workspace, and which poses to measure."""
