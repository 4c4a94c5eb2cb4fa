"""A history of checks over time: its file of lines and its page."""
