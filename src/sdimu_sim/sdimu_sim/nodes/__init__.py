"""ROS shell of the simulated IMU."""
