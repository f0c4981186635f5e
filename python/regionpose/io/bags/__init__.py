"""Clouds and pictures in ROS 1 and ROS 2 bags and MCAP files, named as `bag.mcap#/topic@time`."""
