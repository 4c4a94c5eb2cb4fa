"""The machine and its gap in 3-D: in the browser, or as a still image."""
