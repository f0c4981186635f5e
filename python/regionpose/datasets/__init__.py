"""The scene that ships with the project: a courtyard seen by a camera and by a lidar, with the pose between them."""
