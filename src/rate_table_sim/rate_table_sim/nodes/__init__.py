"""ROS shell of the simulated rate table."""
