"""Where the platform is: closed postures on Pinocchio, and the same closures for many poses at once."""
