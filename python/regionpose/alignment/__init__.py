"""Alignment of clouds with photos by their edges: poses from nothing else or with regions, and how well both agree at a
pose.
"""
