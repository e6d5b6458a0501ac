"""Bags of ROS 2: records as messages in MCAP files, and the poses and images of vehicles' own bags."""
