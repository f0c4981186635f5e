"""Colors of photos on point clouds."""
