"""What has changed since a model was identified: checks from a few poses, which poses to measure, and a log of checks."""
