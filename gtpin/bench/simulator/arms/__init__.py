"""Virtual machines that are open chains of revolute and prismatic joints."""
