"""The machine in 3-D, with the differences between measurement and model: in the browser, or as a still image."""
