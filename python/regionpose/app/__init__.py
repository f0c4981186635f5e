"""The picking page: regions clicked in a photo and in a cloud, and the pose that follows while they are."""
