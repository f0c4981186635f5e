"""From pairs of regions to poses: of one image, of many, of a rig, and which regions are pairs."""
