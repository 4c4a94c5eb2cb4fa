"""Models for physics engines: MJCF and SDF with drives, play, springs and guideways; and robots from MJCF."""
