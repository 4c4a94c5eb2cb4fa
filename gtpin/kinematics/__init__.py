"""Kinematics: closed postures by Pinocchio, and the same closures for many poses at once."""
