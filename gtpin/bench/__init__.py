"""What judges the package: virtual machines, sealed cases with their scores, and the public benchmark."""
