"""The ROS 2 nodes and what they share; the only room that imports rclpy and message classes."""
