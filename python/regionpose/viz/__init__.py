"""Pictures of poses and clouds, and the colors of photos on points."""
