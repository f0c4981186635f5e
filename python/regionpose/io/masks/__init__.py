"""Masks in the files of labeling tools and segmenters."""
