"""Recordings: rosbag2 folders, MCAP files and other bags, read, written, cut and mended."""
