"""Synthetic benchmark: templates, scenes with a known pose, exact masks, noise and error measures."""
