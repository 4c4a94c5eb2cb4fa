"""The noise of measured poses, estimated by maximum likelihood from repeated visits or from residuals; heavy tails."""
