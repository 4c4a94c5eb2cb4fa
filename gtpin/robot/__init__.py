"""What the machine is: its description, its Pinocchio model with closed loops, and its named geometry."""
