"""Rigid poses, and lengths and angles as text."""
