"""Regions found in images and in clouds."""
