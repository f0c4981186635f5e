"""Checks of arguments: classes, array shapes, packages that not every installation has."""
