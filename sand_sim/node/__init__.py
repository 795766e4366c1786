"""The ROS 2 node. The only part of sand_sim that needs rclpy."""
