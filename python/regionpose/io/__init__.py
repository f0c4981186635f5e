"""Files: clouds, calibrations, masks, bags, exports, and how they are read and written whole."""
