"""The ROS shell: convert, call the core, publish."""
