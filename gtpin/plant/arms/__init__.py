"""Virtual machines that are open chains of turning and sliding joints."""
