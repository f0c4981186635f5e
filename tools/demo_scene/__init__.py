"""Makes the scene that ships with the package: a courtyard, rendered and scanned."""
